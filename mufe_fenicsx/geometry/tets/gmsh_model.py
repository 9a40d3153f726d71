"""One quiet gmsh session at a time, and its tetrahedra as arrays."""

from contextlib import contextmanager

import gmsh
import numpy as np

from ...errors import raise_on_broken_pipes
from ..measure import compact, positively_oriented


@contextmanager
def gmsh_model(options=None):
    """A fresh model in a quiet gmsh; gmsh is left as it was found.

    Args:
        options: Numbers to set, by the option's name, such as ``{"Mesh.Algorithm3D": 10}``.
    """
    started = not gmsh.isInitialized()
    if started:
        # interruptible=False leaves Ctrl-C to Python.
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        raise_on_broken_pipes()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("General.NumThreads", 1)
    gmsh.option.setNumber("Mesh.RandomSeed", 1)
    gmsh.model.add("grain")
    try:
        for name, value in (options or {}).items():
            gmsh.option.setNumber(name, value)
        yield gmsh
    finally:
        gmsh.model.remove()
        if started:
            gmsh.finalize()
        elif options:
            gmsh.option.restoreDefaults()


def tetrahedra():
    """Nodes [m] and positively oriented tetrahedra of the current model."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, node_tags = gmsh.model.mesh.getElementsByType(4)
    if len(node_tags) == 0:
        raise RuntimeError("gmsh made no tetrahedra")
    order = np.argsort(tags)  # given nodes first, in the order in which they were numbered
    points = coordinates.reshape(-1, 3)[order]
    position = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    position[tags[order].astype(np.int64)] = np.arange(len(tags))
    cells = position[node_tags.astype(np.int64)].reshape(-1, 4)
    points, cells = compact(points, cells)
    return points, positively_oriented(points, cells)
