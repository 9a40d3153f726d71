"""A sample that is the same body on every mesh: grains from formulas, packed once, in a box.

Grains are rigid while they are packed (`python demos/known_sample.py --pack`); formulas and places
are stored, since what a packing comes to hangs on the processor. For a test grains and box are
drawn apart until no two meshes touch.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..synthetic.formula_grains import (
    Harmonics,
    Superquadric,
    distances,
    level,
    mesh_formula,
    surface_points,
)
from ..synthetic.rigid_packing.pipeline import packed
from ..synthetic.rigid_packing.settings import PackSettings
from ..synthetic.rigid_packing.shapes import in_own_frame
from ..synthetic.rigid_packing.sources import Draw, Supply
from ..synthetic.triangulated import icosphere

STORED = Path(__file__).parent / "reference" / "known_samples.json"
#: Mean diameter of grains [m].
DIAMETER = 1e-3
#: Subdivisions of the icosahedra that shapes are packed by, and by which gaps are looked for.
LEVEL = 4
#: Level function up to which gaps are looked for: a twentieth of the diameter.
NEAR = 1.1
#: Of the harmonic grains: largest degree; root mean square of degree n over the radius, which is
#: ROUGHNESS n^-FALLOFF for each of its functions.
DEGREE, ROUGHNESS, FALLOFF = 6, 0.1, 1.5
#: Friction while packing: grains without friction lock, those with much leave room.
PACKED = {"interlocked": 0.0, "with-room": 1.0}
State = Literal[*PACKED]


@dataclass(frozen=True)
class KnownSample:
    """Grains and where they are, in a box as packed: pressed into each other a little."""

    shapes: list  #: as of `synthetic.formula_grains`
    centre: np.ndarray  #: of the formulas' origins [m], shape (num_grains, 3)
    turn: np.ndarray  #: rotation vectors of the formulas' axes [rad], shape (num_grains, 3)
    edges: np.ndarray  #: of the box, whose low corner is the origin [m], shape (3,)

    @property
    def num_grains(self):
        """How many grains."""
        return len(self.shapes)

    @property
    def axes(self):
        """Columns are the formulas' axes, shape (num_grains, 3, 3)."""
        return Rotation.from_rotvec(self.turn).as_matrix()

    def places(self, apart=0.0):
        """Origins of the formulas [m], drawn apart about the middle by a strain."""
        return self.centre + apart * (self.centre - 0.5 * self.edges)

    def bodies(self, size, apart=0.0, *, bulge=True, mesh=1, inner=1.0):
        """Meshes in place: list of (points [m], cells).

        Args:
            size: Length of edges [m].
            apart: As of :meth:`places`.
            bulge, inner: As of `formula_grains.mesh_formula`.
            mesh: Seed of the points that meshes start from: another mesh of the same grains.
        """
        starts = Rotation.random(self.num_grains, rng=np.random.default_rng(mesh)).as_matrix()
        found = []
        for shape, start, axes, place in zip(
            self.shapes, starts, self.axes, self.places(apart), strict=True
        ):
            x, cells = mesh_formula(shape, size, bulge=bulge, turn=start, inner=inner)
            found.append((x @ axes.T + place, cells))
        return found

    def gaps(self, apart=0.0):
        """Smallest distance of each grain from others and from the walls [m], shape (num_grains,).

        To first order in the distance, at the vertices of a fine triangulation within `NEAR`.
        """
        directions, _ = icosphere(LEVEL)
        local = [surface_points(shape, directions) for shape in self.shapes]
        reach = [np.linalg.norm(x, axis=1).max() for x in local]
        axes, places = self.axes, self.places(apart)
        beyond = 0.5 * apart * self.edges
        gap = np.empty(self.num_grains)
        for i, own in enumerate(local):
            x = own @ axes[i].T + places[i]
            gap[i] = min((x + beyond).min(), (self.edges + beyond - x).min())
            for j, shape in enumerate(self.shapes):
                way = (x - places[j]) @ axes[j]
                way = way[np.linalg.norm(way, axis=1) < NEAR * reach[j]]
                if i == j or not len(way):
                    continue
                way = way[level(shape, way) < NEAR]
                gap[i] = min(gap[i], distances(shape, way).min(initial=np.inf))
        return gap

    def to_dict(self):
        """Fit for JSON; lengths rounded to 1e-9 of the mean diameter, angles to 1e-9."""
        grains = []
        for shape, centre, turn in zip(self.shapes, self.centre, self.turn, strict=True):
            formula = (
                {"semi_axes": _rounded(shape.semi_axes), "exponent": round(shape.exponent, 9)}
                if isinstance(shape, Superquadric)
                else {"coefficients": _rounded(shape.coefficients)}
            )
            turn = [round(x, 9) for x in turn.tolist()]
            grains.append(formula | {"centre": _rounded(centre), "turn": turn})
        return {"edges": _rounded(self.edges), "grains": grains}

    @classmethod
    def from_dict(cls, kept):
        """What :meth:`to_dict` gave."""
        shapes = [
            Harmonics(DIAMETER * np.array(grain["coefficients"]))
            if "coefficients" in grain
            else Superquadric(tuple(DIAMETER * x for x in grain["semi_axes"]), grain["exponent"])
            for grain in kept["grains"]
        ]
        centre = DIAMETER * np.array([grain["centre"] for grain in kept["grains"]])
        turn = np.array([grain["turn"] for grain in kept["grains"]])
        return cls(shapes, centre, turn, DIAMETER * np.array(kept["edges"]))


def known_sample(number=20, state="interlocked", seed=1):
    """A stored :class:`KnownSample`.

    Raises:
        InputError: It is not there.
    """
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    name = name_of(number, state, seed)
    if name not in stored:
        raise InputError(f"sample = {name}, expected one of {', '.join(stored)}")
    return KnownSample.from_dict(stored[name])


def name_of(number, state, seed):
    """What a sample is called where it is stored."""
    return f"{number} {state} {seed}"


def random_shapes(rng, number):
    """Superquadrics and harmonic grains in turn, of diameters about `DIAMETER`."""
    shapes = []
    for k in range(number):
        size = 0.5 * DIAMETER * rng.uniform(0.85, 1.15)
        if k % 2:
            c = np.zeros((DEGREE + 1) ** 2)
            c[0] = np.sqrt(4 * np.pi)
            for n in range(2, DEGREE + 1):
                spread = ROUGHNESS * n**-FALLOFF * np.sqrt(4 * np.pi)
                c[n * n : (n + 1) ** 2] = spread * rng.standard_normal(2 * n + 1)
            shapes.append(Harmonics(size * c))
        else:
            axes = size * rng.uniform(0.8, 1.2, 3)
            shapes.append(Superquadric(tuple(axes.tolist()), float(rng.uniform(2.0, 4.0))))
    return shapes


def pack_sample(number, state, seed, progress=None):
    """:class:`KnownSample` of random grains, packed with the friction of a `State`.

    Args:
        number: Grains.
        state: Of `PACKED`.
        seed: Of the random numbers.
        progress: As of `rigid_packing.pipeline.pack`.
    """
    rng = np.random.default_rng(seed)
    shapes = random_shapes(rng, number)
    directions, triangles = icosphere(LEVEL)
    own = [in_own_frame(surface_points(s, directions), triangles) for s in shapes]
    supply = Supply(
        "grains from formulas",
        [(points, triangles, moments) for points, moments, *_ in own],
        np.array([diameter for *_, diameter in own]),
    )
    draw = Draw(supply, np.arange(number), supply.size)
    settings = PackSettings(count=number, friction=PACKED[state], seed=seed)
    assembly = packed(draw, settings, rng, progress)
    bodies, container = assembly.bodies, assembly.container
    # Of a grain the packing knows its principal axes about its centroid.
    axes = np.array([b @ rows for b, (_, _, _, rows, _) in zip(bodies.axes, own, strict=True)])
    centroid = np.array([c for _, _, c, _, _ in own])
    place = (bodies.centre - container.low) * draw.unit
    return KnownSample(
        shapes,
        place - np.einsum("gij,gj->gi", axes, centroid),
        Rotation.from_matrix(axes).as_rotvec(),
        (container.high - container.low) * draw.unit,
    )


def _rounded(lengths):
    return [round(float(x) / DIAMETER, 9) for x in lengths]
