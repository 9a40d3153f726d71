"""Rigid star-shaped grains packed by isotropic compression between six walls.

The walls come nearer to each other and carry the centres along, as a servo that drives the
depth of contacts to its target; contact without friction and a damped rigid motion let the
grains rearrange. Only the end matters, not the way: masses are chosen so that all grains
answer at the same rate, and the time step is one.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import SolverError
from ..kernels.bulk import rigid as motion
from ..kernels.packing import radial
from .rigid_packing.bodies import random_turns
from .rigid_packing.contacts import near_pairs
from .triangulated import icosphere, vertex_areas

#: Damping a step, of the motion relative to the walls.
DAMPING = 0.05
#: Part of a grain's surface that is in contact at most, which sets its mass.
CONTACT_SHARE = 0.02
#: Strain of each direction a step: while loose, then while grains touch.
LOOSE_STRAIN, DENSE_STRAIN = 1e-3, 2e-4
#: Velocities at the start, over the diameter: a grain goes some lattice spacings while loose.
AGITATION = 0.005
#: The compression goes on until contacts are so many times deeper than wanted at the end.
OVERSHOOT = 4.0
#: Strain a step of the servo, over the lack of depth over the diameter.
GAIN = 0.05
#: Contacts per grain, half of the coordination number, over which depths are averaged.
CONTACTS = 4
#: Steps in a row near the wanted depth that end the packing.
CALM = 50
LOOSE, DENSE, SERVO = range(3)
COARSE, FINE = 2, 3  #: subdivisions of the icosahedron: 162 and 642 surface points


@dataclass
class Packing:
    """Grains in place."""

    grains: object  #: `shapes.RadialGrains`
    centre: np.ndarray  #: [m], (n, 3)
    axes: np.ndarray  #: columns are the grains' axes, (n, 3, 3)
    low: np.ndarray  #: corner of the box [m], (3,)
    high: np.ndarray  #: [m], (3,)
    num_steps: int = 0
    mean_depth: float = 0.0  #: mean over touching pairs of their largest overlap [m]
    largest_depth: float = 0.0  #: [m]
    num_contacts: int = 0

    @property
    def solid_fraction(self):
        """Volume of grains over that of the box, walls included."""
        return float(self.grains.volume.sum() / np.prod(self.high - self.low))

    @property
    def arrays(self):
        """What the kernels need of the bodies."""
        g = self.grains
        return self.centre, self.axes, g.inverse, g.offset, g.table, g.reach, g.bound

    def pairs(self, skin):
        """Grains whose spheres around them are nearer than ``skin`` [m], (num_pairs, 2)."""
        return near_pairs(self.centre, self.grains.reach, skin)


def pack(grains, rng, proportions, target_depth, *, max_steps=20000, progress=None):
    """Pack grains in a box of the given proportions until contacts are ``target_depth`` deep.

    Args:
        grains: `RadialGrains`.
        rng: NumPy generator, for places and orientations at the start.
        proportions: Edges of the box, to a factor, (3,).
        target_depth: Mean of the largest depth of each touching pair [m].
        max_steps: After so many the compression has failed.
        progress: Called with the number of steps and the packing.

    Returns:
        `Packing`.

    Raises:
        SolverError: no state at rest with the target depth was found.
    """
    packing, turn = _loose(grains, rng, np.asarray(proportions, dtype=float))
    diameter = float(np.cbrt((grains.diameter**3).mean()))
    mover = _Mover(packing, turn, COARSE)
    mover.velocity[:] = AGITATION * diameter * rng.standard_normal(mover.velocity.shape)
    # A gas that forgets its lattice; compression until grains bear; then fine surfaces, held
    # at a depth by the servo.
    stage, calm = LOOSE, 0
    while True:
        if packing.num_steps >= max_steps:
            raise SolverError(
                f"packing: contacts are {packing.mean_depth:.3g} m deep after {max_steps} steps, "
                f"expected {target_depth:.3g} m at rest"
            )
        # Depths over a nominal number of contacts: few contacts are no bearing structure.
        depth = packing.mean_depth * packing.num_contacts / (CONTACTS * grains.num_grains)
        if stage == LOOSE:
            strain = LOOSE_STRAIN
            if packing.num_contacts > 0.5 * grains.num_grains:
                stage = DENSE
        elif stage == DENSE:
            strain = DENSE_STRAIN
            if depth > OVERSHOOT * target_depth:
                stage = SERVO
                mover.refine(FINE)
                mover.velocity[:] = mover.momentum[:] = 0.0
        else:
            lack = (target_depth - packing.mean_depth) / diameter
            strain = float(np.clip(GAIN * lack, -DENSE_STRAIN, DENSE_STRAIN))
            near = abs(lack) * diameter < 0.1 * target_depth
            calm = calm + 1 if near else 0
            if calm >= CALM:
                break
        mover.step(strain, 0.0 if stage == LOOSE else DAMPING)
        if progress:
            progress(packing.num_steps, packing)
    return packing


class _Mover:
    """Steps of a packing; holds what moves."""

    def __init__(self, packing, turn, level):
        self.packing, self.turn = packing, turn
        n = packing.grains.num_grains
        self.velocity, self.momentum, self.spin, self.force, self.torque = np.zeros((5, n, 3))
        self.load = np.zeros(6)
        self.refine(level)
        area = self.weight.sum(axis=1)
        # omega² = (area in contact)(1 + r²/j)/m is at most 1, with r²/j about 3.
        self.mass = 4 * CONTACT_SHARE * area
        square = packing.grains.semi_axes**2 / 5
        self.inertia = self.mass[:, None] * (square.sum(axis=1, keepdims=True) - square)
        self.told = np.zeros((self.mass.size, 6), dtype=bool)  # no motion is
        self._list_pairs()

    def refine(self, level):
        """Take more surface points."""
        self.level = level
        directions, triangles = icosphere(level)
        self.place = self.packing.grains.surface(directions)
        self.weight = vertex_areas(self.place, triangles)
        self.x = np.empty_like(self.place)

    def _list_pairs(self):
        packing = self.packing
        self.skin = 0.1 * packing.grains.reach.mean()
        self._pairs, self._at = packing.pairs(self.skin), packing.centre.copy()

    def step(self, strain, damping):
        """One step, in which each edge of the box shortens by ``strain``."""
        p = self.packing
        middle = (p.low + p.high) / 2
        for points in (p.low, p.high, p.centre):
            points += (middle - points) * strain
        motion.kick_and_drift(
            p.centre, self.velocity, self.momentum, self.turn, p.axes, self.force, self.torque,
            self.mass, self.inertia, self.told, p.grains.reach, 1.0, damping,
        )  # fmt: skip
        if np.abs(p.centre - self._at).max() > self.skin / 4:
            self._list_pairs()
        radial.surface_points(self.x, self.place, p.centre, p.axes)
        self.force[:] = self.torque[:] = 0.0
        touching, depths, p.largest_depth = radial.add_contact_forces(
            self.force, self.torque, self.x, self.weight, self._pairs, *p.arrays
        )
        radial.add_wall_forces(
            self.force, self.torque, self.load, self.x, self.weight, p.low, p.high, p.centre,
            p.grains.reach,
        )  # fmt: skip
        motion.kick(
            self.velocity, self.momentum, self.spin, self.force, self.torque, p.axes, self.mass,
            self.inertia, self.told, 1.0, damping,
        )  # fmt: skip
        p.num_contacts, p.mean_depth = touching, depths / max(touching, 1)
        p.num_steps += 1


def _loose(grains, rng, proportions):
    """Grains turned at random on a lattice in which none reaches its neighbour."""
    n = grains.num_grains
    spacing = 2 * grains.reach.max()
    unit = np.cbrt(n / np.prod(proportions))
    counts = np.maximum(np.round(unit * proportions), 1).astype(int)
    while np.prod(counts) < n:
        counts[np.argmin(counts / proportions)] += 1
    # The box keeps its proportions, whatever the numbers are.
    edges = proportions * (counts / proportions).max() * spacing
    sites = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    sites = sites[rng.permutation(len(sites))[:n]]
    centre = (sites + 0.5) / counts * edges
    turn = random_turns(rng, n)
    axes = np.empty((n, 3, 3))
    motion.set_axes(axes, turn)
    return Packing(grains, centre, axes, np.zeros(3), edges), turn
