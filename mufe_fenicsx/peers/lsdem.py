"""Text files of the level-set discrete element codes of Kawamoto and successors.

Lengths are in units of the grid's spacing, density is 1; the code multiplies by its own. For grain
i of n in the order of `grains.csv`, ``morph_<i>.dat`` has the lines

1. mass, that is the volume;
2. principal moments of inertia;
3. place of the centroid, counted from the first node of the grid;
4. number of nodes on the surface;
5. their positions about the centroid along the principal axes, x y z x y z …;
6. radius of the ball about the centroid that holds them;
7. numbers of nodes of the grid along the three axes;
8. the signed distances, the first axis fastest, negative inside.

``positions.dat`` has the centroids and ``rotations.dat`` the rotations from principal axes
to the sample, a grain a line. The quaternion there is (y, -x, -z, w) of the usual one: that
gives the rotation matrix of these codes. Numbers are parted by one space: two would be read as a
number between them. This is what ``readPositionFile``, ``readQuaternionFile`` and
``generateGrainFromFile`` of https://github.com/tanpeng1995/LS-DEM_Parallel_Benchmark (Tan & Sitar
2024, Comput. Geotech. 172, 106408) read. The format is that of Kawamoto, Andò, Viggiani & Andrade
(2016), J. Mech. Phys. Solids 91, 1-13.
"""

import numpy as np


def morphology(body, grid):
    """Text of ``morph_<i>.dat``.

    Args:
        body: :class:`~mufe_fenicsx.peers.body.Body`.
        grid: Its :class:`~mufe_fenicsx.peers.level_sets.LevelSet`.
    """
    h = grid.spacing
    points = body.points / h
    lines = (
        [body.volume / h**3],
        body.moments / h**5,
        -grid.origin / h,
        [len(points)],
        points.ravel(),
        [np.linalg.norm(points, axis=1).max()],
        grid.distance.shape,
        (grid.distance / h).ravel(order="F"),
    )
    return "".join(" ".join(f"{value:.9g}" for value in line) + "\n" for line in lines)


def place(body, spacing):
    """Lines of ``positions.dat`` and ``rotations.dat`` for a body."""
    x, y, z, w = body.quaternion
    position = " ".join(f"{value:.12g}" for value in body.centroid / spacing)
    return position + "\n", " ".join(f"{value:.12g}" for value in (y, -x, -z, w)) + "\n"
