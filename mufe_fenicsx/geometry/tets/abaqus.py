"""Meshes of Abaqus and CalculiX input files: nodes, elements and sets of parts and instances."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..image.stored_image import check_regular

#: Kinds of solid elements by the number in their type, as C3D4 or DC3D10, and their nodes.
SOLIDS = {
    4: "tetra",
    5: "pyramid",
    6: "wedge",
    8: "hexahedron",
    10: "tetra10",
    15: "wedge15",
    20: "hexahedron20",
    27: "hexahedron27",
}
#: Keywords that make nodes or elements, or move them, and that this reader does not follow.
NOT_FOLLOWED = {
    *("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "SYMMETRICMODELGENERATION"),
    *("IMPORT", "SUBSTRUCTUREGENERATE", "PARAMETER"),
}
#: How deep files may include each other.
DEEPEST = 8


@dataclass
class Part:
    """Nodes, elements and sets that have one numbering: a part, or a file without parts."""

    name: str
    numbers: list = field(default_factory=list)  #: of nodes, an array a block
    points: list = field(default_factory=list)  #: shape (n, 3), an array a block
    tets: list = field(default_factory=list)  #: number and nodes, shape (n, 5), an array a block
    others: dict = field(default_factory=dict)  #: numbers of elements by kind
    sets: dict = field(default_factory=dict)  #: numbers of elements or names of sets, by set


@dataclass
class Instance:
    """A part somewhere in the assembly."""

    name: str
    part: Part
    move: np.ndarray  #: translation, shape (3,)
    turn: np.ndarray  #: axis from a to b, and the angle [degrees], shape (7,)


def read_abaqus(path):
    """Read the mesh of an input file, its instances moved and turned to their places.

    Returns:
        points, shape (n, 3); tetrahedra, shape (m, 4); the numbers of other elements by kind; sets
        of elements, indices of tetrahedra by name; and the instance of each tetrahedron from 1,
        shape (m,), or None in a file without instances.

    Raises:
        InputError: the file cannot be read, a number of a node or element is there twice, or the
            file has keywords that make nodes in a way that is not followed.
    """
    reader = _Reader(Path(path))
    reader.read()
    bodies = reader.instances
    if not bodies:
        used = [part for part in reader.parts.values() if part.tets or part.others]
        if len(used) + bool(reader.flat.tets or reader.flat.others) > 1:
            raise InputError(
                f"{path}: {len(used)} parts ({used[0].name}, …) without an *Instance, expected an "
                "assembly of instances, one part, or a file without parts"
            )
        # One part alone is the mesh: programs that mesh write no assembly.
        bodies = [Instance("", [*used, reader.flat][0], np.zeros(3), np.zeros(7))]
    elif reader.flat.tets:
        raise InputError(
            f"{path}: elements outside of parts beside {len(bodies)} instances, expected either"
        )
    points, cells, owner, others, sets = [], [], [], {}, {}
    num_points = num_cells = 0
    for number, body in enumerate(bodies, start=1):
        x, tets, members = _mesh_of(path, body.part)
        points.append(_placed(x, body))
        cells.append(tets + num_points)
        owner.append(np.full(len(tets), number))
        for kind, count in body.part.others.items():
            others[kind] = others.get(kind, 0) + count
        for name, indices in [*members.items(), *reader.of_assembly(body, members)]:
            sets.setdefault(name, []).append(indices + num_cells)
        num_points, num_cells = num_points + len(x), num_cells + len(tets)
    return (
        np.concatenate(points),
        np.concatenate(cells),
        others,
        {name: np.unique(np.concatenate(found)) for name, found in sets.items()},
        np.concatenate(owner) if reader.instances else None,
    )


class _Reader:
    """What an input file says, keyword after keyword."""

    def __init__(self, path):
        self.path = path
        self.flat = self.scope = Part("")
        self.parts, self.instances, self.assembly_sets = {}, [], []
        self.placing = None  # lines of the present instance

    def read(self):
        for at, words, options, data in self._blocks(self.path, 0):
            keyword = "".join(words.split()).upper()
            if keyword == "STEP":
                break
            try:
                self._read_block(keyword, options, data)
            except InputError as error:
                raise InputError(f"{at}: {error}") from None
            except ValueError as error:
                raise InputError(f"{at}: *{words}: {error}, expected numbers") from None
        self._place()

    def _read_block(self, keyword, options, data):
        if keyword in NOT_FOLLOWED and (keyword != "SYSTEM" or data):
            raise InputError(
                f"*{keyword} is not followed, expected all nodes and elements written out: write "
                "the mesh as VTU or MSH"
            )
        if keyword == "PART":
            self.scope = self.parts[_need(options, "NAME").upper()] = Part(options["NAME"])
        elif keyword in ("ENDPART", "ASSEMBLY"):
            self.scope = self.flat
        elif keyword == "INSTANCE":
            name = _need(options, "NAME")
            part = self.parts.get(_need(options, "PART").upper())
            if part is None:
                raise InputError(f"*Instance {name} of part {options['PART']}, which is not there")
            self.placing, self.scope = (name, part, data), Part(name)
        elif keyword == "ENDINSTANCE":
            self._place()
            self.scope = self.flat
        elif keyword == "NODE":
            if options.get("SYSTEM", "R").upper() != "R":
                raise InputError(
                    f"*Node system={options['SYSTEM']}, expected Cartesian coordinates"
                )
            self._nodes(data)
        elif keyword == "ELEMENT":
            self._elements(_need(options, "TYPE").upper(), options.get("ELSET"), data)
        elif keyword == "ELSET":
            self._set(_need(options, "ELSET"), options, data)

    def _nodes(self, lines):
        rows = [_floats(line) for line in lines]
        table = np.zeros((len(rows), 4))
        for row, numbers in zip(table, rows, strict=True):
            row[: min(len(numbers), 4)] = numbers[:4]
        self.scope.numbers.append(table[:, 0].astype(np.int64))
        self.scope.points.append(table[:, 1:])

    def _elements(self, kind, name, lines):
        solid = re.match(r"[A-Z]*C3D(\d+)", kind)
        size = int(solid.group(1)) if solid and int(solid.group(1)) in SOLIDS else None
        elements, open_ = [], False
        for line in lines:
            numbers = _integers(line)
            if open_:
                elements[-1] += numbers
            else:
                elements.append(numbers)
            # Without a known number of nodes, a comma at the end says that more follow.
            open_ = len(elements[-1]) <= size if size else line.rstrip().endswith(",")
        if size == 4:
            wrong = [element for element in elements if len(element) != 5]
            if wrong:
                raise InputError(
                    f"element {wrong[0][0]} of type {kind} has {len(wrong[0]) - 1} nodes, "
                    "expected 4"
                )
            self.scope.tets.append(np.array(elements, dtype=np.int64).reshape(-1, 5))
        else:
            what = SOLIDS.get(size, kind)
            self.scope.others[what] = self.scope.others.get(what, 0) + len(elements)
        if name:
            self.scope.sets.setdefault(name, []).extend(element[0] for element in elements)

    def _set(self, name, options, lines):
        members = []
        for line in lines:
            if "GENERATE" in options:
                first, last, *step = _integers(line)
                members += range(first, last + 1, *step)
            else:
                words = [word.strip() for word in line.split(",") if word.strip()]
                members += [int(word) if word.isdigit() else word for word in words]
        if "INSTANCE" in options:
            self.assembly_sets.append((name, options["INSTANCE"].upper(), members))
        else:
            self.scope.sets.setdefault(name, []).extend(members)

    def _place(self):
        """The instance that was being read joins the others."""
        if self.placing is None:
            return
        name, part, data = self.placing
        if self.scope.tets or self.scope.points:  # it has a mesh of its own
            if part.tets or part.points:
                raise InputError(f"*Instance {name} has nodes beside those of part {part.name}")
            part = self.scope
        place = [_floats(line) for line in data]
        if (
            len(place) > 2
            or (place and len(place[0]) != 3)
            or (len(place) > 1 and len(place[1]) != 7)
        ):
            raise InputError(
                f"*Instance {name} with {[len(p) for p in place]} numbers, expected 3 of a "
                "translation and 7 of a rotation"
            )
        move = np.array(place[0]) if place else np.zeros(3)
        turn = np.array(place[1]) if len(place) > 1 else np.zeros(7)
        self.instances.append(Instance(name, part, move, turn))
        self.placing = None

    def of_assembly(self, body, members):
        """Sets of the assembly, as far as they concern an instance: names and indices."""
        numbers = _element_numbers(body.part)
        for name, instance, wanted in self.assembly_sets:
            if instance == body.name.upper():
                yield name, _indices(wanted, numbers, members)

    def _blocks(self, path, depth):
        """Each keyword with the place where it stands, its options and the lines of its data."""
        check_regular(path, path, "mesh")
        try:
            lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError as error:
            raise InputError(f"mesh {path} cannot be read: {error.strerror}") from error
        current, i = None, 0
        while i < len(lines):
            line, i = lines[i].strip(), i + 1
            if line.startswith("**") or not line:
                continue
            if not line.startswith("*"):
                if current is not None:
                    current[-1].append(line)
                continue
            if current is not None:
                yield from self._with_file(current, path, depth)
            at = f"{path}: line {i}"
            while line.endswith(",") and i < len(lines):
                line, i = line + lines[i].strip(), i + 1
            words, *pairs = (part.strip() for part in line[1:].split(","))
            options = {}
            for pair in pairs:
                key, _, value = pair.partition("=")
                if key.strip():
                    options["".join(key.split()).upper()] = value.strip().strip("\"'")
            current = (at, words, options, [])
        if current is not None:
            yield from self._with_file(current, path, depth)

    def _with_file(self, block, path, depth):
        """A block, with what another file adds: all of it, or its data."""
        at, words, options, data = block
        include = "".join(words.split()).upper() == "INCLUDE"
        if "INPUT" not in options or not (include or words.upper() in ("NODE", "ELEMENT", "ELSET")):
            yield block
            return
        folder = self.path.parent.resolve()
        other = (folder / options["INPUT"]).resolve()
        if not other.is_relative_to(folder) or depth == DEEPEST:
            raise InputError(
                f"{at}: *{words} input={options['INPUT']}, expected a file beside {self.path.name} "
                f"and at most {DEEPEST} that include each other"
            )
        if include:
            yield from self._blocks(other, depth + 1)
            return
        try:
            check_regular(other, path, "mesh")
            text = other.read_text(encoding="utf-8", errors="replace")
        except OSError as error:
            raise InputError(f"{at}: {other} cannot be read: {error.strerror}") from error
        lines = [line.strip() for line in text.splitlines()]
        more = [line for line in lines if line and not line.startswith("*")]
        yield at, words, options, data + more


def _mesh_of(path, part):
    """Points, tetrahedra and indices by set of a part, its numbers replaced by places."""
    where = f"{path}: part {part.name}" if part.name else str(path)
    numbers = np.concatenate([*part.numbers, np.zeros(0, dtype=np.int64)])
    points = np.concatenate([*part.points, np.zeros((0, 3))])
    order = np.argsort(numbers, kind="stable")
    numbers, points = numbers[order], points[order]
    again = np.flatnonzero(numbers[1:] == numbers[:-1])
    moved = again[(points[again] != points[again + 1]).any(axis=1)]
    if len(moved):
        first, second = points[moved[0]], points[moved[0] + 1]
        raise InputError(
            f"{where}: node {numbers[moved[0]]} is there twice, at {_place(first)} and "
            f"{_place(second)}, expected each number once"
        )
    rows = np.concatenate([*part.tets, np.zeros((0, 5), dtype=np.int64)])
    elements, count = np.unique(rows[:, 0], return_counts=True)
    if (count > 1).any():
        raise InputError(
            f"{where}: element {elements[count > 1][0]} is there twice, expected each number once"
        )
    nodes = rows[:, 1:]
    at = np.minimum(np.searchsorted(numbers, nodes), max(len(numbers) - 1, 0))
    missing = nodes[numbers[at] != nodes] if len(numbers) else nodes.ravel()
    if len(missing):
        raise InputError(f"{where}: an element has node {missing[0]}, which is not there")
    numbers_of = _element_numbers(part)
    done = {}
    for name, wanted in part.sets.items():
        done[name] = _indices(wanted, numbers_of, done)
    return points, at, done


def _element_numbers(part):
    return np.concatenate([*part.tets, np.zeros((0, 5), dtype=np.int64)])[:, 0]


def _indices(wanted, numbers, sets):
    """Places of wanted elements among numbers; names stand for sets that are known already."""
    by_name = {name.upper(): members for name, members in sets.items()}
    names = [word for word in wanted if isinstance(word, str)]
    unknown = [word for word in names if word.upper() not in by_name]
    if unknown:
        raise InputError(f"*Elset names the set {unknown[0]}, expected one that stands before it")
    given = np.array([word for word in wanted if not isinstance(word, str)], dtype=np.int64)
    own = np.flatnonzero(np.isin(numbers, given))
    return np.unique(np.concatenate([own, *(by_name[n.upper()] for n in names)])).astype(np.int64)


def _placed(x, body):
    """Points moved, then turned about the axis from a to b (Rodrigues)."""
    x = x + body.move
    a, b, angle = body.turn[:3], body.turn[3:6], np.radians(body.turn[6])
    if angle == 0:
        return x
    length = np.linalg.norm(b - a)
    if not length > 0:
        raise InputError(f"*Instance {body.name}: rotation about an axis of length {length}")
    axis, y = (b - a) / length, x - a
    along = (y @ axis)[:, None] * axis
    return a + along + np.cos(angle) * (y - along) + np.sin(angle) * np.cross(axis, y)


def _need(options, name):
    if not options.get(name):
        raise InputError(f"{name.lower()}= is missing")
    return options[name]


def _floats(line):
    return [
        float(word.replace("D", "E").replace("d", "e")) if word.strip() else 0.0
        for word in line.rstrip().rstrip(",").split(",")
    ]


def _integers(line):
    return [int(word) for word in line.split(",") if word.strip()]


def _place(x):
    return "(" + ", ".join(f"{value:g}" for value in x) + ")"
