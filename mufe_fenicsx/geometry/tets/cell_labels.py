"""Which grain each cell of a foreign mesh belongs to: found where only one answer is left."""

import re

import numpy as np

from ...errors import InputError
from ..pieces import piece_of_cell

#: Names of cell data that tell grains apart, the first that is there.
TAGS = ("label", "gmsh:physical", "gmsh:geometrical", "cell_tags", "grain")
#: Sets ``GRAIN_<label>`` do so too.
SETS = "GRAIN_"
#: Answers that are no names in the file: which cells hang together, and all element sets.
PIECES, ALL_SETS = "pieces", "sets"
#: How many names a message lists.
FEW = 8


def labels_of_cells(mesh, name=None, source="mesh"):
    """Labels of the cells of a mesh, and what told them.

    Args:
        mesh: `ForeignMesh`.
        name: Cell data; the first letters of sets that end in the label; `ALL_SETS`, numbered in
            the order of the file; or `PIECES`. None: the first of `TAGS`, sets that begin with
            `SETS`, or the pieces, as long as nothing else in the file parts a grain of these.
        source: Name of the mesh in messages.

    Returns:
        labels, int64, shape (num_cells,); and a name.

    Raises:
        InputError: no such name, numbers that are no labels, or more than one answer.
    """
    if name is not None:
        return _named(mesh, name, source), name
    # In gmsh 0 stands for no physical group.
    there = [tag for tag in TAGS if tag in mesh.data]
    there = [tag for tag in there if tag != "gmsh:physical" or (mesh.data[tag] > 0).all()]
    found = next(iter(there), None)
    if found is None and any(_number_of(key, SETS) for key in mesh.sets):
        found = SETS
    found = found or PIECES
    label = _named(mesh, found, source)
    # What this program writes says so by its name; anything else may know better.
    if found in ("label", SETS):
        return label, found
    finer = _finer(mesh, label, found)
    if finer:
        raise InputError(
            f"{source}: grains told apart by {found} are {len(np.unique(label))}, and parted "
            f"by {'; '.join(finer[:FEW])}{'; …' if len(finer) > FEW else ''}: say which counts, "
            f"--labels {finer[0].split(' (')[0]} or --labels {found}"
        )
    return label, found


def unused_numbers(mesh, label):
    """Names of cell data that number the same grains as labels do, but otherwise."""
    _, grain = np.unique(label, return_inverse=True)
    return [
        name
        for name, values in mesh.data.items()
        if values.dtype.kind in "biuf"
        and np.isfinite(values).all()
        and (values == np.floor(values)).all()
        and values.any()  # zeros everywhere number nothing
        and (values != label).any()
        and not _parts(grain, values)
        and not _parts(values, grain)
    ]


def _finer(mesh, label, found):
    """Names in the file that part cells of one label, with how many grains they tell."""
    names = []
    for name, values in mesh.data.items():
        if name == found or values.dtype.kind not in "biuf":
            continue
        # Fractions are no labels, and numbers of cells, from 0 or 1 on, tell no grains.
        if not (np.isfinite(values).all() and (values == np.floor(values)).all()):
            continue
        numbers = values[0] in (0, 1) and np.array_equal(values - values[0], np.arange(len(values)))
        count = len(np.unique(values))
        if not numbers and count > 1 and _parts(label, values):
            names.append(f"{name} ({count} values)")
    sets = {key: members for key, members in mesh.sets.items() if 0 < len(members) < len(label)}
    parting = [key for key, members in sets.items() if _parts(label, _indicator(label, members))]
    if parting and found != SETS:
        shown = ", ".join(parting[:3]) + (", …" if len(parting) > 3 else "")
        names.append(f"{_prefix(parting)} ({len(parting)} element sets: {shown})")
    if found != PIECES:
        pieces = piece_of_cell(mesh.cells)
        if _parts(label, pieces):
            names.append(f"{PIECES} ({1 + pieces.max()} that hang together)")
    return names


def _indicator(label, members):
    inside = np.zeros(len(label), dtype=bool)
    inside[members] = True
    return inside


def _parts(label, values):
    """Whether some label has more than one value."""
    _, label = np.unique(label, return_inverse=True)
    _, values = np.unique(values, return_inverse=True)
    pairs = np.unique(label.astype(np.int64) * (values.max() + 1) + values)
    return len(pairs) > label.max() + 1


def _prefix(names):
    """What names of sets begin with where a number ends them all, or `ALL_SETS`."""
    found = {match.group(1) for key in names if (match := re.fullmatch(r"(.*?\D)(\d+)", key))}
    whole = all(re.fullmatch(r".*?\D\d+", key) for key in names)
    return found.pop() if whole and len(found) == 1 else ALL_SETS


def _number_of(key, prefix):
    """Number at the end of a set's name after a prefix, or None."""
    rest = key[len(prefix) :]
    return int(rest) if key.upper().startswith(prefix.upper()) and rest.isdigit() else None


def _named(mesh, name, source):
    """Labels by one name."""
    if name == PIECES:
        piece = piece_of_cell(mesh.cells)
        # Tetrahedra one by one, each on nodes of its own, are grains only where they lie apart.
        if len(piece) > 1 and piece.max() + 1 == len(piece):
            used = mesh.points[np.unique(mesh.cells)]
            same = len(used) - len(np.unique(used, axis=0))
            if same:
                raise InputError(
                    f"{source}: no two of {len(piece)} cells have a node in common, but {same} "
                    "nodes are where another is, expected cells that share their nodes: merge them"
                )
        return 1 + piece.astype(np.int64)
    if name in mesh.data:
        return _whole(mesh.data[name], name, source)
    if name == ALL_SETS:
        sets = {key: members for key, members in mesh.sets.items() if len(members)}
        parts = {key: members for key, members in sets.items() if len(members) < len(mesh.cells)}
        sets = dict(enumerate((parts or sets).values(), start=1))
    else:
        sets = {}
        for key, members in mesh.sets.items():
            number = _number_of(key, name)
            if number is not None and len(members):
                sets[number] = np.concatenate([sets.get(number, members[:0]), members])
    if not sets:
        there = [*mesh.data, *mesh.sets]
        raise InputError(
            f"{source}: --labels {name} names no cell data and no element sets, expected "
            f"{', '.join([*there[:FEW], PIECES])}"
        )
    label, count = (np.zeros(len(mesh.cells), dtype=np.int64) for _ in range(2))
    for number, members in sets.items():
        label[members] = number
        count[members] += 1
    if (count != 1).any():
        cell = np.flatnonzero(count != 1)[0]
        raise InputError(
            f"{source}: cell {cell} is in {count[cell]} of the {len(sets)} element sets of "
            f"--labels {name}, expected every cell in one"
        )
    return label


def _whole(values, name, source):
    """Numbers of cells as labels."""
    if values.dtype.kind not in "biuf":
        raise InputError(f"{source}: {name} is of type {values.dtype}, expected whole numbers")
    wrong = np.flatnonzero(~(np.isfinite(values) & (values == np.floor(values))))
    if len(wrong):
        raise InputError(
            f"{source}: {name} of cell {wrong[0]} is {values[wrong[0]]:g}, expected whole numbers"
        )
    if values.min() < 1 or values.max() > np.iinfo(np.int32).max:
        remedy = f"--labels {PIECES}" + (", or add 1" if values.min() == 0 else "")
        raise InputError(
            f"{source}: {name} from {values.min():g} to {values.max():g}, expected labels from 1 "
            f"to {np.iinfo(np.int32).max}: {remedy}"
        )
    return values.astype(np.int64)
