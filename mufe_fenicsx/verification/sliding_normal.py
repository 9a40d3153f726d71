"""Bodies drawn over each other at a fixed height: the normal force is that of pressing anew."""

import math

import numpy as np

from ..geometry.bodies.shapes import box
from ..materials.elastic import Elastic
from ..run.from_bodies import distribute
from .case import case, compare
from .slow_press import Increments, TimeSteps

# Without lateral strain nothing but the place of the bodies sets the normal force.
E, NU, RHO = 100e9, 0.0, 2650.0
#: Edge of the sliders' bricks [m].
H = 1e-3
#: Bricks of a slider along its sides and its height.
WIDE, HIGH = 4, 2
#: Angles between bottom and side faces [degrees]; 20 is the least of a sharp edge.
ANGLES = (90.0, 60.0, 45.0, 30.0, 22.0, 15.0)
#: Gap before bodies are pressed together [edges].
GAP = 0.01
#: The program's integrators by name.
INTEGRATORS = {"explicit": TimeSteps, "static": Increments}
DOWN, UP = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])


@case("sliding-normal", num_bodies=2 * len(ANGLES))
def sliding_normal(comm, ratio=0.5, friction=0.0, degrees=23.0, way=2.2, strain=0.004, moves=3):
    """Sliders whose edges pass over the facets of their bases carry what they carry pressed anew.

    Sliders with side faces of several angles to the bottom, side by side, each over a base of
    finer or coarser facets. They are pressed, drawn at a fixed height, lifted, and pressed again
    where they are: by time steps, and by static increments on the same path.

    Args:
        comm: MPI communicator.
        ratio: Edge of the bases' bricks over that of the sliders'.
        friction: Coefficient of friction.
        degrees: Direction of the way, from an edge of the bases.
        way: To draw the sliders [edges].
        strain: Compression of the sliders over their height.
        moves: Parts in which they are drawn.
    """
    bodies = [sliders(comm, ratio, friction, degrees, way, strain, name) for name in INTEGRATORS]
    drawn = {}
    results, simulations = {}, []
    for name, of in zip(INTEGRATORS, bodies, strict=True):
        found = of.draw_and_press_again(moves)
        drawn[name] = found.drawn
        for angle, slid, anew in zip(ANGLES, found.drawn, found.anew, strict=True):
            # Of what the elastic bodies and the search for equilibrium leave.
            results[f"{name}, {angle:g} degrees: normal force drawn [N]"] = compare(
                slid, anew, 0.01
            )
        if not friction:
            results[f"{name}: friction work over the stored energy"] = compare(
                found.friction / found.stored, 0.0, 1e-12, scale=1.0
            )
        simulations.append(of.simulation)
    for angle, by_steps, by_increments in zip(ANGLES, *drawn.values(), strict=True):
        results[f"{angle:g} degrees: time steps against increments [N]"] = compare(
            by_steps, by_increments, 0.01
        )
    return results, simulations


@case("sliding-graded", num_bodies=4)
def sliding_graded(comm, grading=4.0, friction=0.0, way=8.0, depth=0.05, moves=8):
    """A bulged slider drawn over facets that grow, and over ones that shrink.

    Each point of either side carries the share of the contact that the two facets there give it.

    Args:
        comm: MPI communicator.
        grading: Largest edge of the base over the smallest, along the way; their root is that
            of the slider.
        friction: Coefficient of friction.
        way: To draw the slider [edges].
        depth: By which the bulge is pressed in [edges].
        moves: Parts in which it is drawn.
    """
    results, simulations, drawn = {}, [], []
    for name in INTEGRATORS:
        found = graded(comm, grading, friction, way, depth, name).draw_and_press_again(moves)
        for facets, slid, anew in zip(
            ("growing", "shrinking"), found.drawn, found.anew, strict=True
        ):
            results[f"{name}, {facets} facets: normal force drawn [N]"] = compare(slid, anew, 0.02)
        drawn.append(found.drawn)
        simulations.append(found.simulation)
    for facets, by_steps, by_increments in zip(("growing", "shrinking"), *drawn, strict=True):
        results[f"{facets} facets: time steps against increments [N]"] = compare(
            by_steps, by_increments, 0.01
        )
    return results, simulations


@case("sliding-ridges", num_bodies=4)
def sliding_ridges(comm, friction=0.0, depth=0.03, positions=39):
    """Crossed ridges drawn over each other's nodes carry what they carry pressed anew.

    One pair is drawn along the edge of the lower one, the other along both. A force at a node of a
    mesh finds it softer than one between two nodes; the crossing's own spring makes up for that.

    Args:
        comm: MPI communicator.
        friction: Coefficient of friction.
        depth: By which they are pressed together [edges].
        positions: Places on the way of one edge where the force is looked at.
    """
    results, simulations = {}, []
    for name in INTEGRATORS:
        found = ridges(comm, friction, depth, name)
        found.draw_and_press_again(positions)
        forces = found.on_the_way
        ripple = 0.5 * np.ptp(forces, axis=0) / forces.mean(axis=0)
        for k, along in enumerate(("along one", "along both")):
            results[f"{name}, {along}: ripple of the normal force over its mean"] = compare(
                ripple[k], 0.0, 0.02, scale=1.0
            )
            results[f"{name}, {along}: normal force drawn [N]"] = compare(
                found.drawn[k], found.anew[k], 0.01
            )
        simulations.append(found.simulation)
    return results, simulations


class Drawn:
    """Bodies drawn over others that are held. Collective.

    Args:
        comm: MPI communicator.
        pairs: Of each slider and its base, (points, cells) each; the base is held where z is
            least, the slider where it is largest.
        way: To be drawn [m], shape (3,), or (num_sliders, 3).
        depth: By which they are pressed, with the gap [m].
        integrator: A name out of ``INTEGRATORS``.
        options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
    """

    def __init__(self, comm, pairs, way, depth, integrator, **options):
        mesh = distribute(comm, [body for pair in pairs for body in pair])
        self.comm, self.depth, self.number = comm, depth, len(pairs)
        self.way = np.broadcast_to(way, (self.number, 3))
        grain = mesh.grains[mesh.grain_of_node]
        z = mesh.x[:, 2]
        low, high = (
            np.array([side(points[:, 2]) for pair in pairs for points, _ in pair])
            for side in (np.min, np.max)
        )
        size = 1e-6 * (high - low).max()
        top = (grain % 2 == 0) & (z > high[grain] - size)
        foot = (grain % 2 == 1) & (z < low[grain] + size)
        self.tops = np.flatnonzero(top)
        self._slider = grain[self.tops] // 2
        held = np.flatnonzero(top | foot)
        height = (high - low).max()
        self._driver = INTEGRATORS[integrator](
            mesh, [Elastic(E, NU, RHO)] * mesh.num_grains, (),
            [(held, axis) for axis in np.eye(3)], height, **options,
        )  # fmt: skip
        self.simulation = self._driver.simulation
        self._friction = options.get("friction", 0.0)

    def move(self, way):
        """Move the sliders by ``way`` [m], shape (num_sliders, 3) or (3,), and wait for rest."""
        self._driver.move(self.tops, np.broadcast_to(way, (self.number, 3))[self._slider])

    def normal_forces(self):
        """Of each slider on what holds it [N], shape (num_sliders,)."""
        f = self.simulation.specimen.f[self.tops, 2]
        return self.comm.allreduce(np.bincount(self._slider, f, self.number))

    def draw_and_press_again(self, moves):
        """Press, draw in so many parts, lift and press again; keeps what was found as attributes.

        With friction they are pressed again before the last part, and drawn there: a body that
        sticks carries another normal force than one that slides.

        ``drawn`` and ``anew``: normal forces [N], shape (num_sliders,); ``on_the_way``: those after
        each part, shape (moves, num_sliders); ``friction`` and ``stored``: work of friction, and
        the energy stored when drawn [J]; ``shares``: sums of both sides' areas over the contact's.
        """
        press = self.depth * DOWN
        self.move(press)
        rows = []
        for _ in range(moves):
            self.move(self.way / moves)
            rows.append(self.normal_forces())
        self.on_the_way = np.array(rows)
        self.drawn = rows[-1]
        energies = self.simulation.energies()
        self.friction, self.stored = energies["friction"], energies["elastic"]
        self.switched = energies["switching"]
        # Where there is friction it has to slide again, over the last part of the way.
        last = [self.way / moves] if self._friction else []
        self.move(-press)
        for way in last:
            self.move(-way)
        self.move(press)
        for way in last:
            self.move(way)
        self.anew = self.normal_forces()
        return self


def sliders(comm, ratio, friction, degrees, way, strain, integrator):
    """:class:`Drawn` sliders of all ``ANGLES``, arguments as of :func:`sliding_normal`."""
    direction = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0])
    way = way * H * direction
    h, height = ratio * H, HIGH * H
    divisions = [math.ceil((WIDE * H + abs(d) + 2 * H) / h) for d in way[:2]]
    lengths = np.array([divisions[0] * h, divisions[1] * h, height])
    layers = max(1, round(height / h))
    base = box(lengths, (*divisions, layers), (-0.5 * lengths[0], -0.5 * lengths[1], -height))
    pairs = []
    for k, angle in enumerate(ANGLES):
        # Far enough from each other for the widest of them.
        place = np.array([0.0, 1.2 * k * (lengths[1] + 2 * height / math.tan(math.radians(15))), 0])
        points, cells = frustum(angle)
        points = points - 0.5 * way + [0.013 * H, 0.021 * H, GAP * H]
        pairs.append(((points + place, cells), (base[0] + place, base[1])))
    return Drawn(comm, pairs, way, GAP * H + strain * height, integrator, friction=friction)


def frustum(angle):
    """A slider with its bottom on z = 0, side faces at an angle [degrees] to it: points, cells."""
    side, height = WIDE * H, HIGH * H
    points, cells = box((side, side, height), (WIDE, WIDE, HIGH), (-0.5 * side, -0.5 * side, 0.0))
    points[:, :2] *= 1.0 + points[:, 2:] / math.tan(math.radians(angle)) / (0.5 * side)
    return points, cells


def graded(comm, grading, friction, way, depth, integrator):
    """:class:`Drawn` bulged sliders, arguments as of :func:`sliding_graded`."""
    radius, span = 40 * H, (way + 10) * H
    small = H / math.sqrt(grading)
    edges = [small]
    while sum(edges) < span:
        edges.append(min(small * grading ** (sum(edges) / span), grading * small))
    places = np.concatenate([[0.0], np.cumsum(edges)]) - 0.5 * sum(edges)
    wide = 8
    base, cells = box(
        (len(edges), wide * H, HIGH * H), (len(edges), wide, HIGH), (0, -0.5 * wide * H, -HIGH * H)
    )
    slider, of_slider = box(
        (wide * H, wide * H, HIGH * H), (wide, wide, HIGH), (-0.5 * wide * H, -0.5 * wide * H, 0.0)
    )
    slider[:, 2] += (
        (slider[:, :2] ** 2).sum(axis=1) / (2 * radius) * (1 - slider[:, 2] / (HIGH * H))
    )
    slider += [0.013 * H - 0.5 * way * H, 0.021 * H, GAP * H]
    pairs = []
    for k, sign in enumerate((1.0, -1.0)):
        place = np.array([0.0, 1.5 * wide * k * H, 0.0])
        points = base.copy()
        points[:, 0] = np.interp(base[:, 0], np.arange(len(edges) + 1), places)
        points[:, :2] *= sign  # half a turn
        pairs.append(((slider + place, of_slider), (points + place, cells)))
    way = way * H * np.array([1.0, 0.0, 0.0])
    return Drawn(comm, pairs, way, (GAP + depth) * H, integrator, friction=friction)


def ridge(n):
    """Half a cube of n bricks along its edges; its right-angled edge lies on the x axis, up."""
    points, cells = box((1.0, 1.0, 1.0), (n, n, n))
    centre = points[cells].mean(axis=1)
    nodes, cells = np.unique(cells[centre[:, 2] > centre[:, 1]], return_inverse=True)
    half = np.sqrt(0.5)
    turn = np.array([[1, 0, 0], [0, half, half], [0, -half, half]])
    return (points[nodes] - [0.5, 0, 1]) @ turn.T, cells.reshape(-1, 4)


def ridges(comm, friction, depth, integrator, n=8):
    """:class:`Drawn` ridges across each other, arguments as of :func:`sliding_ridges`."""
    points, cells = ridge(n)
    points = n * H * points
    over = points @ np.array([[0, 1.0, 0], [1, 0, 0], [0, 0, -1]])
    pairs = []
    for k in range(2):
        place = np.array([0.0, 3.0 * n * H * k, 0.0])
        start = np.array([-0.5, -0.5 * k, 0.0]) * H + [0.013 * H, 0.021 * H, GAP * H]
        pairs.append(((over + start + place, cells), (points + place, cells)))
    ways = H * np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    return Drawn(comm, pairs, ways, (GAP + depth) * H, integrator, friction=friction)
