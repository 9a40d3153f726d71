"""Tetrahedra in files of other programs: read whole, or refused."""

import contextlib
import io
import re
import signal
import threading
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import meshio
import numpy as np

from ...errors import InputError
from ...machine.memory import check_room
from ..image.stored_image import check_regular
from .abaqus import read_abaqus
from .gmsh_model import gmsh_model

NASTRAN = (".bdf", ".nas", ".fem")
#: Lines that begin with the number of a node, by the ending of the file: the words between which
#: they stand, if any, and the line itself. meshio lets a number that is there twice overwrite the
#: first.
NUMBERED = {
    NASTRAN: ("", "", r"GRID\*?[\s,]\s*(\d+)"),
    (".f3grid",): ("", "", r"G\s+(\d+)\s"),
    (".mdpa",): ("Begin Nodes", "End Nodes", r"(\d+)\s"),
    (".post", ".dato"): ("$COOR", "$", r"(\d+)\s"),
}
#: Time of computing that meshio may take [s], and that for each byte: several of its readers look
#: for the end of a file that was cut for ever.
PATIENCE, SECONDS_PER_BYTE = 3.0, 1e-5
#: Memory that a file takes as it is read, over its size.
ROOM = 4
#: Kinds of cells in three dimensions.
SOLID = re.compile(r"tetra|hexa|wedge|pyramid|polyhedron|VTK_.*TETRA|VTK_.*HEXA")


@dataclass
class ForeignMesh:
    """What a file holds of tetrahedra."""

    points: np.ndarray  #: as in the file, shape (n, 3)
    cells: np.ndarray  #: shape (m, 4)
    data: dict = field(default_factory=dict)  #: one number a cell, by name
    sets: dict = field(default_factory=dict)  #: indices of cells, by name
    others: dict = field(default_factory=dict)  #: how many cells of other kinds


def read_tetrahedra(path):
    """Read the tetrahedra of a file.

    Args:
        path: In a format of meshio, or an input file of Abaqus or CalculiX.

    Raises:
        InputError: the file cannot be read, holds no tetrahedra or other solid cells beside them,
            has a number of a node twice or nodes that are not there.
    """
    path = Path(path)
    if path.suffix.lower() == ".inp":
        points, cells, others, sets, instance = read_abaqus(path)
        data = {} if instance is None else {"instance": instance}
        mesh = ForeignMesh(points, cells, data, sets, others)
    else:
        mesh = _from_meshio(path)
    wrong = {kind: n for kind, n in mesh.others.items() if SOLID.match(kind)}
    if wrong or not len(mesh.cells):
        solids = {"tetra": len(mesh.cells)} | wrong if len(mesh.cells) else mesh.others
        raise InputError(
            f"{path} holds {counted(solids) or 'no cells'}, expected linear tetrahedra (tetra) only"
        )
    if mesh.cells.min() < 0 or mesh.cells.max() >= len(mesh.points):
        raise InputError(
            f"{path}: a cell has node {mesh.cells.min()} to {mesh.cells.max()}, counted from 0, "
            f"expected 0 to {len(mesh.points) - 1}"
        )
    used = mesh.points[mesh.cells]
    if not np.isfinite(used).all():
        cell = np.flatnonzero(~np.isfinite(used).all(axis=(1, 2)))[0]
        raise InputError(f"{path}: cell {cell} has a node whose place is not finite")
    return mesh


def write_surface(path, points, triangles):
    """Write a surface of triangles in the format that the file's name asks for, STL in binary.

    Args:
        path: The file.
        points: Shape (num_points, 3), in its unit of length.
        triangles: Seen from outside, shape (num_triangles, 3).
    """
    meshio.write_points_cells(path, points, [("triangle", np.asarray(triangles))])


def check_size(path, what="surface"):
    """Raise InputError unless there is memory for what a file may hold."""
    if Path(path).is_file():
        check_room(ROOM * Path(path).stat().st_size, f"{what} {path}")


def read_foreign(path, what="mesh", expected="a format of meshio"):
    """A mesh by meshio, whose failures become one line.

    Args:
        path: Its file.
        what, expected: What the message calls it, and what it asks for.

    Raises:
        InputError: the file cannot be read.
    """
    path = Path(path)
    check_regular(path, path, what)
    check_size(path, what)
    nowhere = io.StringIO()  # meshio prints beside what it raises
    try:
        with (
            contextlib.redirect_stdout(nowhere),
            contextlib.redirect_stderr(nowhere),
            warnings.catch_warnings(action="ignore"),
            _in_time(path),
        ):
            return meshio.read(path)
    except SystemExit as error:  # meshio ends the program on a file that it cannot read
        raise InputError(
            f"{what} {path} cannot be read: it may be cut short, expected {expected}"
        ) from error
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{what} {path} cannot be read ({reason}), expected {expected}") from error


@contextlib.contextmanager
def _in_time(path):
    """Raise TimeoutError where the block goes on for ever, in the main thread."""
    if threading.current_thread() is not threading.main_thread():  # of a program of one's own
        yield
        return
    limit = PATIENCE + SECONDS_PER_BYTE * path.stat().st_size

    def ring(*_):
        raise TimeoutError(f"its end was not found in {limit:.3g} s")

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, limit)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def counted(kinds):
    """Numbers of cells by kind, in words."""
    return ", ".join(f"{n} {kind}" for kind, n in sorted(kinds.items()))


def _from_meshio(path):
    mesh = read_foreign(path)
    _check_numbers(path)
    blocks = [k for k, block in enumerate(mesh.cells) if block.type in ("tetra", "tetra4")]
    others = {}
    for block in mesh.cells:
        if block.type not in ("tetra", "tetra4"):
            others[block.type] = others.get(block.type, 0) + len(block.data)
    sizes = [len(mesh.cells[k].data) for k in blocks]
    cells = [np.asarray(mesh.cells[k].data, dtype=np.int64).reshape(-1, 4) for k in blocks]
    cells = np.concatenate([*cells, np.zeros((0, 4), dtype=np.int64)])
    data = {}
    for name, arrays in mesh.cell_data.items():
        parts = [np.asarray(arrays[k]) for k in blocks]
        if parts and all(part.size == n for part, n in zip(parts, sizes, strict=True)):
            data[name] = np.concatenate([part.ravel() for part in parts])
    first, sets = np.cumsum([0, *sizes]), {}
    for name, members in mesh.cell_sets.items():
        found = [
            first[i] + np.asarray(members[k], dtype=np.int64)
            for i, k in enumerate(blocks)
            if k < len(members) and members[k] is not None
        ]
        found = np.concatenate([*found, np.zeros(0, dtype=np.int64)])
        if len(found) and not name.startswith("gmsh:"):
            sets[name] = np.unique(found)
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{path}: points of shape {points.shape}, expected (n, 3)")
    return ForeignMesh(points, cells, data, sets, others)


def _check_numbers(path):
    """No number of a node is there twice, in formats that name nodes by numbers.

    Raises:
        InputError: one is.
    """
    kind = path.suffix.lower()
    again = None
    if kind == ".msh" and path.read_bytes()[:11].startswith(b"$MeshFormat"):
        again = _twice_in_gmsh(path)
    if kind in NASTRAN and re.search(rb"(?mi)^CORD[123][RCS]", path.read_bytes()):
        raise InputError(f"{path} has coordinate systems (CORD…), expected the basic one only")
    for endings, (begin, end, line) in NUMBERED.items():
        if kind in endings:
            again = _twice_in_lines(path, begin, end, re.compile(line, re.IGNORECASE))
    if kind == ".avs":
        again = _twice_in_table(path)
    if again is not None:
        raise InputError(f"{path}: node {again} is there twice, expected each number once")


def _twice_in_gmsh(path):
    with gmsh_model() as gmsh:
        gmsh.logger.start()
        try:
            gmsh.merge(str(path))
        except Exception as error:
            raise InputError(
                f"mesh {path} cannot be read: {' '.join(str(error).split())}"
            ) from error
        finally:
            said = gmsh.logger.get()
            gmsh.logger.stop()
    for line in said:
        found = re.search(r"duplicate node (\d+)", line)
        if found:
            return found.group(1)
    return None


def _twice_in_table(path):
    """Of an AVS-UCD file, whose first line says how many lines of nodes follow."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    numbers = [int(row[0]) for row in rows[1 : 1 + int(rows[0][0])]]
    return next((n for n, count in Counter(numbers).items() if count > 1), None)


def _twice_in_lines(path, begin, end, pattern):
    seen, inside = set(), not begin
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            text = line.strip()
            if begin and text.startswith(begin):
                inside = True
            elif inside and end and text.startswith(end):
                inside = False
            elif inside and (found := pattern.match(text + " ")):
                number = int(found.group(1))
                if number in seen:
                    return number
                seen.add(number)
    return None
