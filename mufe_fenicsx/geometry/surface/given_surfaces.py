"""Grains given as surfaces: read, check, repair their orientation, mesh anew."""

from collections import Counter
from pathlib import Path

import numpy as np
import pyvista

from ...errors import InputError
from ...kernels.geometry.topology import cut_at_pinches, surface_pinch
from ..image.array_file import array_names, read_arrays
from ..image.image_files import files_in
from ..measure import compact, surface_defect, surface_volume
from ..tets.foreign import SOLID, counted, read_foreign
from .remesh import closed, collapse_short_edges, flip_long_edges, oriented, remesh, with_cavities
from .self_crossing import crossing_triangles
from .shells import shells

#: Edges around a hole that is closed.
LARGEST_HOLE = 12

FORMATS = (".stl", ".ply", ".obj", ".off", ".vtk", ".vtu", ".msh")


def read_bodies(path, scale=1.0, notices=None, least_cavity=0.0, origins=None):
    """Read surfaces of grains.

    A surface inside that of a body is a cavity of it. A body inside a cavity is one of its own.
    Where parts of a surface only touch at nodes they are cut there.

    Args:
        path: An .npz with ``vertices``, ``faces`` and ``grain_of_face``, one body a grain; or
            a file of surfaces (see `FORMATS`), or a folder of these. Bodies get the labels 1 … n,
            in the natural order of the files' names and of the first triangles in each.
        scale: Metres a unit of length of the files.
        notices: A list to which one line is added for each surface that was repaired, cut or
            filled, and each file of a folder that holds several bodies.
        least_cavity: Smaller cavities are filled [m³].
        origins: A list to which (label, name of its file, number of the body in it, from 1) of
            each grain is added.

    Returns:
        A list of (label, points [m], triangles seen from outside).

    Raises:
        InputError: nothing to read, or a surface that bounds no body or crosses itself.
    """
    notices = [] if notices is None else notices
    path = Path(path)
    if not scale > 0:
        raise InputError(f"scale = {scale}, expected > 0 metres a unit of length")
    if path.is_dir():
        files = files_in(path, FORMATS)
        if not files:
            raise InputError(f"folder {path} holds no {', '.join(FORMATS)}, expected surfaces")
        surfaces = []
        for file in files:
            bodies = _bodies(*read_triangles(file, notices), file.name, notices)
            first = len(surfaces) + 1
            surfaces += [(first + i, file.name, *body) for i, body in enumerate(bodies)]
            if len(bodies) > 1:
                notices.append(
                    f"{file.name}: {len(bodies)} bodies, grains {first} to {len(surfaces)}"
                )
    elif path.suffix.lower() == ".npz" and path.is_file():
        surfaces = []
        for label, name, points, triangles in _read_npz(path):
            bodies = _bodies(points, triangles, f"{name}: grain {label}", notices)
            if len(bodies) > 1:
                raise InputError(
                    f"{path}: grain {label} has {len(bodies)} bodies, expected one body a grain"
                )
            surfaces += [(label, name, *body) for body in bodies]
    elif path.suffix.lower() in FORMATS and path.is_file():
        bodies = _bodies(*read_triangles(path, notices), path.name, notices)
        surfaces = [(i, f"body {i}", *body) for i, body in enumerate(bodies, start=1)]
    else:
        raise InputError(
            f"no surfaces {path}, expected an .npz, a {', '.join(FORMATS)}, or a folder of these"
        )
    if len(surfaces) == 0:
        raise InputError(f"{path} holds no grain, expected at least one")
    result, of_file = [], Counter()
    for label, name, points, triangles in surfaces:
        file = name if path.is_dir() else path.name
        of_file[file] += 1
        if origins is not None:
            origins.append((label, file, of_file[file]))
        name = f"{path.name}: grain {label} ({name})"
        points, triangles = sound_surface(points * scale, triangles, name, notices)
        result.append(
            (label, *_without_small_cavities(points, triangles, least_cavity, name, notices))
        )
    return result


def has_bodies(path):
    """True if a file or folder looks like surfaces rather than labels."""
    path = Path(path)
    if path.is_dir():
        return bool(files_in(path, FORMATS))
    if path.suffix.lower() in FORMATS and path.is_file():
        return True
    return {"vertices", "faces", "grain_of_face"} <= array_names(path)


def sound_surface(points, triangles, name, notices):
    """Points without doubles and triangles seen from outside, repaired where that is safe.

    Triangles are turned, and holes of up to `LARGEST_HOLE` edges closed; a line in ``notices``
    says so.

    Raises:
        InputError: the surface is open, not manifold, or crosses itself.
    """
    points = np.asarray(points, dtype=float)
    if not np.isfinite(points).all() or len(triangles) < 4:
        raise InputError(
            f"{name}: {len(triangles)} triangles, points finite: {np.isfinite(points).all()}, "
            "expected a closed surface"
        )
    points, triangles = welded(points, triangles)
    a, b, c = triangles.T
    points, triangles = compact(points, triangles[(a != b) & (b != c) & (c != a)])
    defect = surface_defect(points, triangles)
    if defect:
        filled = closed(triangles, LARGEST_HOLE)
        repaired = oriented(points, filled)
        new, defect = len(filled) - len(triangles), surface_defect(points, repaired)
        if not defect:
            turned = np.count_nonzero((repaired[: len(triangles)] != triangles).any(axis=1))
            done = [f"{turned} triangles turned"] if turned else []
            done += [f"holes closed by {new} triangles"] if new else []
            notices.append(f"{name}: {', '.join(done)}")
        triangles = repaired
    if defect:
        holes = _num_open_edges(triangles)
        raise InputError(
            f"{name}: surface has {defect}{f' ({holes})' if holes else ''}, expected a closed "
            f"surface, or holes of at most {LARGEST_HOLE} edges"
        )
    seen = oriented(points, triangles)  # a cavity may be turned as if it were a body
    if (seen != triangles).any():
        notices.append(
            f"{name}: {np.count_nonzero((seen != triangles).any(axis=1))} triangles turned"
        )
        triangles = seen
    crossing = crossing_triangles(points, triangles)
    if len(crossing):
        at = points[triangles[crossing[0, 0]]].mean(axis=0)
        raise InputError(
            f"{name}: surface crosses itself at {len(crossing)} pairs of triangles, first near "
            f"({at[0]:.6g}, {at[1]:.6g}, {at[2]:.6g}) m, expected one that does not"
        )
    return points, triangles


def _num_open_edges(triangles):
    """Edges with one triangle only."""
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2)
    _, count = np.unique(edges.reshape(-1, 2), axis=0, return_counts=True)
    return int((count == 1).sum())


def body_surface(points, triangles, sizes):
    """A sound surface with triangles of the wanted size, its vertices on the one given.

    Args:
        points, triangles: The surface.
        sizes: `Sizes`.

    Raises:
        SurfaceError: the body is too small for its size, or no closed surface came out.
    """
    h = sizes.size
    scaled, sizes = points / h, sizes.scaled(1 / h)
    original = pyvista.PolyData.from_regular_faces(scaled, triangles)
    tags = np.zeros(len(triangles), dtype=np.int64)
    x, faces, _ = with_cavities(scaled, triangles, tags, sizes, _outer)
    for _ in range(2):
        x, faces = collapse_short_edges(x, faces, 0.55, sizes)
        faces = flip_long_edges(x, faces)
        _, x = original.find_closest_cell(x, return_closest_point=True)
    # Facets cut off what is round: give the volume back, about the body's middle.
    middle = x.mean(axis=0)
    lost = surface_volume(scaled, triangles) / surface_volume(x, faces)
    if abs(lost - 1) < 0.1:
        x = middle + (x - middle) * np.cbrt(lost)
    return x * h, faces


def _outer(points, triangles, tags, sizes):
    x, faces = remesh(points, triangles, sizes)
    return x, faces, np.zeros(len(faces), dtype=np.int64)


def welded(points, triangles):
    """Points without doubles: STL repeats each one for each of its triangles."""
    span = np.ptp(points, axis=0).max()
    _, first, number = np.unique(
        np.round(points / span * 1e7), axis=0, return_index=True, return_inverse=True
    )
    return points[first], number.ravel()[np.asarray(triangles, dtype=np.int64)]


def _bodies(points, triangles, name, notices):
    """The bodies of a surface with their cavities, as pairs (points, triangles)."""
    points, triangles = np.asarray(points, dtype=float), np.asarray(triangles, dtype=np.int64)
    if not np.isfinite(points).all():
        raise InputError(f"{name}: a point is not finite, expected a closed surface")
    points, triangles = welded(points, triangles)
    a, b, c = triangles.T
    points, triangles = compact(points, triangles[(a != b) & (b != c) & (c != a)])
    if len(triangles) == 0:
        raise InputError(f"{name}: no triangle with an area, expected a closed surface")
    again = len(triangles) - len(np.unique(np.sort(triangles, axis=1), axis=0))
    if again:
        raise InputError(f"{name}: {again} triangles are there twice, expected each once")
    points, triangles, cut = cut_at_pinches(points, triangles)
    if cut and not surface_pinch(triangles):
        notices.append(f"{name}: cut at {cut} nodes where parts only touched")
    part, depth, around = shells(points, triangles)
    body = np.where(depth % 2, around, np.arange(len(depth)))[part]
    _, first = np.unique(body, return_index=True)
    return [compact(points, triangles[body == body[k]]) for k in np.sort(first)]


def _without_small_cavities(points, triangles, least, name, notices):
    """A body without cavities of less than a volume [m³]."""
    part, depth, _ = shells(points, triangles)
    volumes = [abs(surface_volume(points, triangles[part == p])) for p in range(len(depth))]
    small = [p for p in range(len(depth)) if depth[p] == 1 and volumes[p] < least]
    if small:
        lost = sum(volumes[p] for p in small) / surface_volume(points, triangles)
        notices.append(f"{name}: {len(small)} cavities filled, {lost:.2g} of its volume")
        points, triangles = compact(points, triangles[~np.isin(part, small)])
    return points, triangles


def read_triangles(file, notices):
    """Points and triangles of one file as they are, quadrangles cut; ``notices`` as above.

    Raises:
        InputError: It cannot be read, or holds no triangles.
    """
    mesh = read_foreign(file, "surface", "a surface of triangles")
    faces, others = [np.zeros((0, 3), dtype=np.int64)], {}
    for block in mesh.cells:
        cells = np.asarray(block.data)
        if block.type == "triangle":
            faces.append(cells)
        elif block.type == "quad":
            faces += [cells[:, :3], cells[:, [0, 2, 3]]]
            notices.append(f"{file.name}: {len(cells)} quadrangles cut into triangles")
        elif len(cells):
            others[block.type] = others.get(block.type, 0) + len(cells)
    triangles = np.concatenate(faces).astype(np.int64)
    solid = [kind for kind in others if SOLID.match(kind)]
    if solid:
        raise InputError(
            f"surface {file} holds {counted(others)}, expected a closed surface; `mufe import` "
            "takes tetrahedra"
        )
    bad = {kind: n for kind, n in others.items() if kind not in ("vertex", "line")}
    if bad:
        raise InputError(f"surface {file} holds {counted(bad)}, expected triangles")
    if len(triangles) == 0:
        raise InputError(f"surface {file} holds no triangle, expected a closed surface")
    points = np.asarray(mesh.points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"surface {file}: points of shape {points.shape}, expected (n, 3)")
    if triangles.min() < 0 or triangles.max() >= len(points):
        raise InputError(
            f"surface {file}: a triangle has point {triangles.max()}, counted from 0, expected up "
            f"to {len(points) - 1}"
        )
    return points, triangles


def _read_npz(path):
    arrays = read_arrays(path, ("vertices", "faces", "grain_of_face"), "surfaces")
    vertices, faces, grain_of_face = arrays
    if (
        any(array.dtype.kind not in "iuf" for array in arrays)
        or faces.dtype.kind == "f"
        or vertices.ndim != 2
        or vertices.shape[1] != 3
        or faces.ndim != 2
        or faces.shape[1] != 3
        or grain_of_face.shape != faces.shape[:1]
        or len(faces) == 0
        or faces.min() < 0
        or faces.max() >= len(vertices)
        or not np.isfinite(grain_of_face).all()
        or (grain_of_face != np.floor(grain_of_face)).any()
        or grain_of_face.min() < 1
    ):
        raise InputError(
            f"surfaces {path}: vertices {vertices.shape}, faces {faces.shape}, grain_of_face "
            f"{grain_of_face.shape}, expected (n, 3), (m, 3) within 0 to n-1, (m,) whole from 1"
        )
    return [
        (int(label), path.name, vertices, faces[grain_of_face == label])
        for label in np.unique(grain_of_face)
    ]
