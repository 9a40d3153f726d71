"""A facet that opens, shears, comes back, closes and rubs, moved by hand."""

from itertools import pairwise

import numpy as np

from ..kernels.cracks.cracks import POINT, CrackForces
from ..theory.cohesion import linear_softening
from .case import case, compare

STRENGTH, ENERGY, STIFFNESS, FRICTION, SIDE = 100e6, 10.0, 1e15, 0.4, 1e-4
LIMIT = 2.0 * ENERGY / STRENGTH  # δc [m]
FIRST = STRENGTH / STIFFNESS  # δ₀ [m]
PRESSURE = 1.5  #: over σ
WAYS = {"tension": [1.0, 0.0, 0.0], "shear": [0.0, 0.6, 0.8], "both": [1.0, 0.5, -0.5]}


@case("cohesive-facet", num_bodies=1)
def cohesive_facet(comm, steps=2000, shear_ratio=2.0, turn=0.7):
    """The law of a facet: in tension, shear and both; unloaded half way, closed, pressed, rubbed.

    Its nodes are moved by hand, by 1.2 times the opening at failure in all. It opens under a
    traction of effect σ, in the direction in which it is moved then.

    Args:
        comm: MPI communicator.
        steps: To the largest opening.
        shear_ratio: β.
        turn: Of the facet about a skew axis [rad].
    """
    results = {}
    for name, way in WAYS.items():
        facet = Facet(way, shear_ratio, turn)
        opening = np.linspace(0.0, 1.2 * LIMIT, steps + 1)
        found = facet.go(opening)
        expected = linear_softening(opening, STRENGTH, ENERGY)[:, None] * facet.pull
        results |= _lines(name, facet, opening, found, expected)
        area = np.trapezoid(found @ facet.way, opening)
        results[f"{name}: area over G"] = compare(area / ENERGY, 1.0, 1e-3)
        facet, back = Facet(way, shear_ratio, turn), LIMIT * np.linspace(0.5, -0.1, steps + 1)
        opening = np.concatenate([opening[opening <= 0.5 * LIMIT], back])
        expected = _unloaded(back, 0.5 * LIMIT)[:, None] * facet.pull
        pressed = back < -FIRST
        expected[pressed, 0] = STIFFNESS * (FIRST + back[pressed]) * facet.way[0]
        found = facet.go(opening)
        results |= _lines(
            f"{name}, back", facet, opening, found, expected, rows=slice(-back.size, None)
        )
    results |= _pressed(steps, shear_ratio, turn)
    return results | _rubbed(steps, shear_ratio, turn), []


def _unloaded(opening, furthest):
    """Effect of the traction on the line from the largest opening to the zero of the spring."""
    most = linear_softening(furthest, STRENGTH, ENERGY)
    return most * (opening + FIRST) / (furthest + FIRST)


def _lines(name, facet, opening, found, expected, rows=slice(None)):
    """Largest error of the tractions, and energies against the work."""
    work = np.trapezoid(found @ facet.way, opening)
    total = facet.energies().sum()  # nothing rubs in these
    wrong = np.abs(found[rows] - expected).max() / STRENGTH
    return {
        f"{name}: traction": compare(wrong, 0.0, 1e-6, scale=1.0),
        # The trapezium of a step that has a kink of the law in it is off by its square.
        f"{name}: energy over work": compare((total - work) / ENERGY, 0.0, 1e-5, 1.0),
    }


def _pressed(steps, shear_ratio, turn):
    """A facet shears under a constant pressure p: it breaks at βσ + μp, and half way goes back."""
    way, pressure = np.array(WAYS["shear"]), PRESSURE * STRENGTH
    rubs = FRICTION * pressure
    first = (shear_ratio * STRENGTH + rubs) * way - [pressure, 0.0, 0.0]
    results = {}
    for name, ends in (("", [0.0, 1.2]), (", back", [0.0, 0.5, -0.5])):
        facet, ends = Facet(way, shear_ratio, turn, first), np.array(ends) * LIMIT
        ways = [np.linspace(*some, steps + 1) for some in pairwise(ends)]
        opening, last = np.concatenate(ways), ways[-1]
        found = facet.go(opening)
        expected = linear_softening(last, STRENGTH, ENERGY) * shear_ratio + rubs
        if name:  # friction turns along with its spring, to the same the other way
            expected = _unloaded(last, ends[1]) * shear_ratio
            expected += np.maximum(rubs + STIFFNESS * (last - ends[1]) / shear_ratio, -rubs)
        shear = found @ way
        wrong = np.abs(shear[-last.size :] - expected).max(), np.abs(found[:, 0] + pressure).max()
        work = np.trapezoid(shear, opening / shear_ratio)
        total = facet.energies().sum()
        results |= {
            f"pressed{name}: traction": compare(max(wrong) / STRENGTH, 0.0, 1e-6, scale=1.0),
            # As above; where friction turns its work is that of a whole step.
            f"pressed{name}: energy over work": compare((total - work) / ENERGY, 0.0, 1e-4, 1.0),
        }
        if not name:
            above = np.trapezoid(shear - rubs, opening / shear_ratio) / ENERGY
            results["pressed: peak over βσ + μp"] = compare(
                shear.max() / (shear_ratio * STRENGTH + rubs), 1.0, 1e-6
            )
            results["pressed: area above μp over G"] = compare(above, 1.0, 1e-6)
    return results


def _rubbed(steps, shear_ratio, turn):
    """A facet that has failed slides to and fro under pressure."""
    facet = Facet(WAYS["tension"], shear_ratio, turn)
    facet.go(np.linspace(0.0, 1.2 * LIMIT, 3))
    depth, way = 0.2 * LIMIT, 20.0 * FIRST * np.sin(np.linspace(0.0, 2.0 * np.pi, steps + 1))
    places = np.column_stack([np.full_like(way, -FIRST - depth), way, 0.0 * way])
    found = np.array([facet.traction(place) for place in places])
    most = FRICTION * STIFFNESS * depth
    work = facet.energies()[2]
    # It slips but for the turns, at each of which the spring is stretched to the other side.
    slips = 80.0 * FIRST - 5.0 * FRICTION * depth
    return {
        "rubbed: friction": compare(np.abs(found[:, 1]).max() / most, 1.0, 1e-6),
        "rubbed: pressure": compare(found[-1, 0] / (-STIFFNESS * depth), 1.0, 1e-6),
        "rubbed: work": compare(work / (most * slips), 1.0, 1e-4),
    }


class Facet:
    """One facet, which opens under a traction, else one of effect σ, along a way; in its frame."""

    def __init__(self, way, shear_ratio, turn, first=None):
        axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
        K = np.cross(np.eye(3), -axis)
        self._turn = np.eye(3) + np.sin(turn) * K + (1.0 - np.cos(turn)) * K @ K
        effect = np.array([1.0, shear_ratio, shear_ratio])
        self.way = way / np.linalg.norm(way * effect)  #: an opening of effect 1
        self.pull = self.way * effect**2  #: a traction of effect 1
        self._corners = SIDE * np.array([[0.0, 0, 0], [0, 1, 0], [0, 0, 1]])  # its normal is x
        self._x = np.concatenate([self._corners, self._corners]) @ self._turn.T
        self._area, self._points = np.array([0.5 * SIDE**2]), np.zeros((1, 3), POINT)
        self._points["strength"], self._points["ultimate"] = STRENGTH, LIMIT
        self._points["stiffness"] = STIFFNESS
        self._forces = CrackForces(
            np.arange(6, dtype=np.int32)[None], self._area, np.array([FRICTION]), self._points,
            shear_ratio,
        )  # fmt: skip
        first = self._turn @ (self.pull * STRENGTH if first is None else first)
        self._forces.begin(np.arange(3), np.tile(first, (3, 1)), self._x)

    def traction(self, opening):
        """That on the first side [Pa], in the frame of the start."""
        self._x[3:] = (self._corners + opening) @ self._turn.T
        f = np.zeros((6, 3))
        self._forces.add(f, self._x, np.zeros((6, 3)), 1.0)
        return f[:3].sum(axis=0) @ self._turn / self._area[0]

    def go(self, openings):
        """Tractions along the way [Pa], shape (num_openings, 3)."""
        return np.array([self.traction(opening * self.way) for opening in openings])

    def energies(self):
        """As of kernels.cracks, over the area [J/m²]."""
        return self._forces.energies(self._x) / self._area[0]
