"""Input deck of CalculiX: bodies of linear tetrahedra between rigid planes.

Keywords are those of CalculiX 2.20 (G. Dhondt, CalculiX CrunchiX user's manual), which took
them from Abaqus. Rigid planes are single bricks all of whose nodes are prescribed. Contact is
the face-to-face penalty method with a linear pressure-overclosure law, finite sliding.
"""

from dataclasses import dataclass, field

import numpy as np

#: Units of decks by name: length [m], stress [Pa], mass [kg], and how they are called.
UNITS = {
    "m": (1.0, 1.0, 1.0, "m, N, kg, s, Pa"),
    "mm": (1e-3, 1e6, 1e3, "mm, N, t, s, MPa"),
    "um": (1e-6, 1e6, 1.0, "um, uN, kg, s, MPa"),
}
#: Corners of the faces S1 to S4 of C3D4.
FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))


@dataclass(frozen=True)
class Material:
    """Isotropic elasticity, with a table of yield stresses where it is plastic."""

    E: float  #: [Pa]
    nu: float
    rho: float  #: [kg/m³]
    plastic: tuple = ()  #: points (plastic strain, yield stress [Pa])


@dataclass(frozen=True)
class Grain:
    """One body; nodes are numbered from 0 within it."""

    name: str
    points: np.ndarray  #: [m], shape (n, 3)
    cells: np.ndarray  #: shape (m, 4)
    material: Material
    spring: float = 0.0  #: of weak springs that hold it [N/m], in all; none if 0


@dataclass(frozen=True)
class Plane:
    """A rigid plane."""

    name: str
    corners: np.ndarray  #: of the part that is drawn, in turn about the inward normal [m], (4, 3)
    normal: np.ndarray  #: into the sample, shape (3,)
    #: (time [s], way along the normal [m]) of points of its motion; at rest if empty.
    motion: tuple = ()


@dataclass(frozen=True)
class Pair:
    """Contact of a surface with another one."""

    slave: str  #: name of a grain
    master: str  #: name of a grain or a plane
    stiffness: float  #: pressure over overclosure [Pa/m]
    friction: float = 0.0
    stick: float = 0.0  #: shear traction over slip while it sticks [Pa/m]


@dataclass(frozen=True)
class Step:
    """One step."""

    time: float  #: [s]
    first: float  #: increment [s]
    smallest: float
    largest: float
    alpha: float | None = None  #: of the α-method (Hilber, Hughes & Taylor); None: without inertia


@dataclass(frozen=True)
class Deck:
    """All that a deck says."""

    title: str
    grains: list
    planes: list
    pairs: list
    step: Step
    units: str = "um"  #: one of `UNITS`
    notes: list = field(default_factory=list)  #: lines of comment


def write_deck(file, deck):
    """Write a deck to an open text file."""
    length, stress, mass, called = UNITS[deck.units]
    write = file.write
    write(f"*HEADING\n{_plain(deck.title)}\n** units: {called}\n")
    for note in deck.notes:
        write(f"** {_plain(note)}\n")
    node = cell = 1
    surfaces = []
    for grain in deck.grains:
        _nodes(file, node, grain.points / length)
        write(f"*ELEMENT, TYPE=C3D4, ELSET={grain.name}\n")
        rows = np.column_stack([np.arange(cell, cell + len(grain.cells)), grain.cells + node])
        file.writelines(", ".join(map(str, row)) + "\n" for row in rows.tolist())
        surfaces.append((grain.name, _outer_faces(grain.cells, cell)))
        node, cell = node + len(grain.points), cell + len(grain.cells)
    for plane in deck.planes:
        depth = 0.1 * np.linalg.norm(plane.corners[1] - plane.corners[0])
        # The face S1 looks against the normal that its nodes 1 to 4 turn about.
        front = plane.corners[::-1]
        _nodes(file, node, np.concatenate([front, front - depth * plane.normal]) / length)
        write(f"*ELEMENT, TYPE=C3D8, ELSET={plane.name}\n{cell}, ")
        write(", ".join(str(node + k) for k in range(8)) + "\n")
        write(f"*NSET, NSET={plane.name}, GENERATE\n{node}, {node + 7}\n")
        surfaces.append((plane.name, [(cell, 1)]))
        node, cell = node + 8, cell + 1
    for name, faces in surfaces:
        write(f"*SURFACE, NAME=S_{name}, TYPE=ELEMENT\n")
        file.writelines(f"{element}, S{face}\n" for element, face in faces)
    _materials(write, deck, stress, mass / length**3)
    _springs(write, deck, cell, stress * length)
    for k, pair in enumerate(deck.pairs, start=1):
        write(f"*SURFACE INTERACTION, NAME=I{k}\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n")
        write(f"{_number(pair.stiffness * length / stress)}\n")
        if pair.friction:
            slope = _number(pair.stick * length / stress)
            write(f"*FRICTION\n{_number(pair.friction)}, {slope}\n")
        write(f"*CONTACT PAIR, INTERACTION=I{k}, TYPE=SURFACE TO SURFACE\n")
        write(f"S_{pair.slave}, S_{pair.master}\n")
    for plane in deck.planes:
        if plane.motion:
            write(f"*AMPLITUDE, NAME=A_{plane.name}\n")
            file.writelines(f"{_number(t)}, {_number(s / length)}\n" for t, s in plane.motion)
    _step(write, deck)


def _step(write, deck):
    step = deck.step
    write("*STEP, NLGEOM, INC=1000000\n")
    write("*STATIC\n" if step.alpha is None else f"*DYNAMIC, ALPHA={step.alpha:.6g}\n")
    times = (step.first, step.time, step.smallest, step.largest)
    write(", ".join(map(_number, times)) + "\n*BOUNDARY\n")
    for plane in deck.planes:
        axis = int(np.argmax(np.abs(plane.normal)))
        for i in range(3):
            if not (plane.motion and i == axis):
                write(f"{plane.name}, {i + 1}, {i + 1}\n")
    for plane in deck.planes:
        if plane.motion:
            axis = int(np.argmax(np.abs(plane.normal)))
            write(f"*BOUNDARY, AMPLITUDE=A_{plane.name}\n")
            write(f"{plane.name}, {axis + 1}, {axis + 1}, {np.sign(plane.normal[axis]):g}\n")
    for plane in deck.planes:
        write(f"*NODE PRINT, NSET={plane.name}, TOTALS=ONLY\nRF\n")
    # One FREQUENCY holds for files and prints alike: forces of every increment ask for all.
    write("*NODE FILE\nU\n*EL FILE\n")
    write("S, PEEQ\n" if any(g.material.plastic for g in deck.grains) else "S\n")
    write("*CONTACT FILE\nCDIS, CSTR\n*END STEP\n")


def _materials(write, deck, stress, density):
    models = {}
    for grain in deck.grains:
        models.setdefault(grain.material, []).append(grain.name)
    stiffest = max(models, key=lambda material: material.E)
    for k, (material, names) in enumerate(models.items(), start=1):
        name = f"M{k}"
        write(f"*MATERIAL, NAME={name}\n*ELASTIC\n")
        write(f"{_number(material.E / stress)}, {_number(material.nu)}\n")
        write(f"*DENSITY\n{_number(material.rho / density)}\n")
        if material.plastic:
            write("*PLASTIC\n")
            for strain, value in material.plastic:
                write(f"{_number(value / stress)}, {_number(strain)}\n")
        members = names + [p.name for p in deck.planes if material is stiffest]
        for member in members:
            write(f"*SOLID SECTION, ELSET={member}, MATERIAL={name}\n")


def _springs(write, deck, cell, stiffness):
    """Weak springs to the ground at the outermost nodes of grains that are to be held."""
    first = 1
    for grain in deck.grains:
        if grain.spring:
            ends = [f(grain.points[:, i]) for i in range(3) for f in (np.argmin, np.argmax)]
            ends = np.unique(ends) + first
            for i in range(3):
                name = f"{grain.name}_{'XYZ'[i]}"
                write(f"*ELEMENT, TYPE=SPRING1, ELSET={name}\n")
                for end in ends.tolist():
                    write(f"{cell}, {end}\n")
                    cell += 1
                each = _number(grain.spring / len(ends) / stiffness)
                write(f"*SPRING, ELSET={name}\n{i + 1}\n{each}\n")
        first += len(grain.points)


def _nodes(file, first, points):
    # CalculiX reads twenty characters of a number.
    file.write("*NODE\n")
    file.writelines(
        f"{k}, {x:.12e}, {y:.12e}, {z:.12e}\n"
        for k, (x, y, z) in enumerate(points.tolist(), start=first)
    )


def _outer_faces(cells, first):
    """(element, face) of the faces that one tetrahedron alone has."""
    faces = np.sort(cells[:, FACES], axis=2).reshape(-1, 3)
    _, index, count = np.unique(faces, axis=0, return_index=True, return_counts=True)
    outer = np.sort(index[count == 1])
    return list(zip((first + outer // 4).tolist(), (1 + outer % 4).tolist(), strict=True))


def _number(value):
    """A number in at most 20 characters, as CalculiX reads them."""
    return f"{value:.12g}"


def _plain(text):
    return " ".join(text.encode("ascii", "replace").decode().split()) or "grains"
