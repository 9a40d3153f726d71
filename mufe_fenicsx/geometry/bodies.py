"""Grains given as surfaces: read, check, repair their orientation, mesh anew."""

from pathlib import Path

import numpy as np
import pyvista

from ..errors import InputError
from .foreign import read_foreign
from .image_files import natural_order
from .measure import compact, surface_defect, surface_volume
from .pieces import piece_of_cell
from .remesh import closed, collapse_short_edges, flip_long_edges, oriented, remesh
from .self_crossing import crossing_triangles

#: Edges around a hole that is closed.
LARGEST_HOLE = 12

FORMATS = (".stl", ".ply", ".obj", ".off", ".vtk", ".vtu", ".msh")


def read_bodies(path, scale=1.0, notices=None):
    """Read surfaces of grains.

    Args:
        path: An .npz with ``vertices``, ``faces`` and ``grain_of_face``, or a
            folder of files (see `FORMATS`), one body a file; these get the
            labels 1 … n in the natural order of their names. Or one such file with many
            bodies, which are labelled in the order of their first triangles.
        scale: Metres a unit of length of the files.
        notices: A list to which one line is added for each surface that was repaired.

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
        files = sorted(
            (f for f in path.iterdir() if f.suffix.lower() in FORMATS), key=natural_order
        )
        if not files:
            raise InputError(
                f"folder {path} holds no {', '.join(FORMATS)}, expected one body a file"
            )
        surfaces = [(i, file.name, *_read_file(file)) for i, file in enumerate(files, start=1)]
    elif path.suffix.lower() == ".npz" and path.is_file():
        surfaces = _read_npz(path)
    elif path.suffix.lower() in FORMATS and path.is_file():
        surfaces = [
            (i, f"body {i}", *body) for i, body in enumerate(_bodies(*_read_file(path)), start=1)
        ]
    else:
        raise InputError(
            f"no surfaces {path}, expected an .npz, a {', '.join(FORMATS)}, or a folder of these"
        )
    if len(surfaces) == 0:
        raise InputError(f"{path} holds no grain, expected at least one")
    return [
        (
            label,
            *sound_surface(
                points * scale, triangles, f"{path.name}: grain {label} ({name})", notices
            ),
        )
        for label, name, points, triangles in surfaces
    ]


def has_bodies(path):
    """True if a file or folder looks like surfaces rather than labels."""
    path = Path(path)
    if path.is_dir():
        return any(f.suffix.lower() in FORMATS for f in path.iterdir())
    if path.suffix.lower() in FORMATS and path.is_file():
        return True
    if path.suffix.lower() != ".npz" or not path.is_file():
        return False
    try:
        with np.load(path, allow_pickle=False) as data:
            return {"vertices", "faces", "grain_of_face"} <= set(data.files)
    except (OSError, ValueError, EOFError):
        return False


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
    points, triangles = _welded(points, triangles)
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
    x, faces = remesh(scaled, triangles, sizes)
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


def _welded(points, triangles):
    """Points without doubles: STL repeats each one for each of its triangles."""
    span = np.ptp(points, axis=0).max()
    _, first, number = np.unique(
        np.round(points / span * 1e7), axis=0, return_index=True, return_inverse=True
    )
    return points[first], number.ravel()[np.asarray(triangles, dtype=np.int64)]


def _bodies(points, triangles):
    """The connected pieces of a surface, as pairs (points, triangles)."""
    points, triangles = _welded(np.asarray(points, dtype=float), triangles)
    piece = piece_of_cell(triangles)
    _, first = np.unique(piece, return_index=True)
    return [(points, triangles[piece == piece[k]]) for k in np.sort(first)]


def _read_file(file):
    mesh = read_foreign(file, "surface", "a surface of triangles")
    triangles = mesh.cells_dict.get("triangle", np.zeros((0, 3)))
    if len(triangles) == 0:
        raise InputError(f"surface {file} holds no triangle, expected a closed surface")
    return mesh.points, triangles


def _read_npz(path):
    try:
        with np.load(path, allow_pickle=False) as data:
            arrays = [data[key] for key in ("vertices", "faces", "grain_of_face")]
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise InputError(
            f"surfaces {path} cannot be read: {' '.join(str(error).split())}, expected arrays "
            "vertices, faces and grain_of_face"
        ) from error
    vertices, faces, grain_of_face = arrays
    if (
        vertices.ndim != 2
        or vertices.shape[1] != 3
        or faces.ndim != 2
        or faces.shape[1] != 3
        or len(grain_of_face) != len(faces)
        or len(faces) == 0
        or faces.min() < 0
        or faces.max() >= len(vertices)
        or grain_of_face.min() < 1
    ):
        raise InputError(
            f"surfaces {path}: vertices {vertices.shape}, faces {faces.shape}, grain_of_face "
            f"{grain_of_face.shape}, expected (n, 3), (m, 3) within 0 to n-1, (m,) from 1"
        )
    return [
        (int(label), path.name, vertices, faces[grain_of_face == label])
        for label in np.unique(grain_of_face)
    ]
