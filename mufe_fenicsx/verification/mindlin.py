"""Two elastic balls pressed together and sheared to and fro, with partial slip."""

import math
import time
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..materials.elastic import Elastic
from ..run.from_bodies import drive
from ..theory import hertz
from ..theory import mindlin as theory
from .case import case, compare
from .finite_body import shear_compliance
from .half_balls import ALONG, UP, HalfBalls, displacement, low_load

E, RHO, RADIUS = 100e9, 2650.0, 1e-3
#: Height of the caps over their radius: where their base makes up for their narrow pole.
HEIGHT = 0.3

#: Static increments of half a cycle: as finely recorded as the time steps.
INCREMENTS = 50
#: After the cycles at constant approach, both change: shear and approach, in parts of the first.
VARYING = ((0.3, 1.25), (-0.5, 0.9), (-0.2, 0.9), (0.6, 1.1))


@case("mindlin", num_bodies=2)
def mindlin(
    comm,
    elements_per_radius=5.0,
    a_over_R=0.015,
    nu=0.3,
    friction=0.3,
    ratio=0.8,
    growth=0.3,
    periods=24.0,
    integrator: Literal["explicit", "static"] = "explicit",
):
    """Elastic ball on elastic ball, sheared to and fro: curve, energy per cycle, stick radius.

    Like bodies, so the theory's neglect of normal traction by shear is exact; its neglect
    of slip across the force is not, for nu > 0. Two caps on rigid platens: at constant
    approach the upper one is sheared to ``ratio`` of sliding, to its opposite and
    again; then shear and approach change together. Finite size is separate: what a cap
    yields beyond the half-space, from a static solution, is taken off the displacement.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        a_over_R: Contact radius over that of the balls. Strain in the contact is of its order.
        nu: Poisson's ratio.
        friction: Coefficient of friction.
        ratio: Largest tangential force over μP.
        growth: Growth of the element size with the distance from the contact.
        periods: Duration of half a cycle over the period of a cap on its base.
        integrator: Time steps, or ``INCREMENTS`` static ones in half a cycle.
    """
    s = shear_balls(
        comm, elements_per_radius, a_over_R, nu, friction, ratio, growth, periods, integrator
    )
    _, first, back, again = s.turns[:4]
    N, Q = s.normal, s.force
    error = np.abs(Q - s.theory) / (2 * ratio * friction * N[first])
    reached = 0.25 * (Q[first] - 2 * Q[back] + Q[again])
    force = N[first : again + 1].mean()
    a = s.contact_radius(force)
    cycle = theory.energy_per_cycle(reached, force, friction, a, s.compliance)
    rubbed, done = s.rubbed[again] - s.rubbed[first], s.work[again] - s.work[first]
    coarse = max(5.0 / elements_per_radius, 1.0)
    results = {
        "curve at constant approach, error over full range": compare(
            error[: again + 1].max(), 0.0, 0.04, scale=1.0
        ),
        "curve with varying normal force, error over full range": compare(
            error[again:].max(), 0.0, 0.04, scale=1.0
        ),
        "friction per cycle [J]": compare(rubbed, cycle, 0.05 * coarse),
        # The same to the residual of the energy balance: a closed cycle gains nothing.
        "work per cycle over friction": compare(done / rubbed, 1.0, 0.03),
        # It ends between two rings of nodes.
        "stick radius over a": compare(
            s.stuck / a, theory.stick_radius(Q[first], N[first], friction, 1.0),
            0.5 / elements_per_radius, scale=1.0,
        ),
        "normal force, change over the cycle": compare(
            np.ptp(N[first : again + 1]) / force, 0.0, 0.01, scale=1.0
        ),
        "finite size: compliance of the caps over half-spaces": compare(
            1 + s.beyond * theory.stick_stiffness(a, s.compliance), 1.0, 0.03
        ),
    }  # fmt: skip
    return results, [s.simulation]


@dataclass(frozen=True)
class Sheared:
    """The course of two balls sheared to and fro; arrays of shape (num_records,)."""

    normal: np.ndarray  #: normal force [N]
    force: np.ndarray  #: tangential force [N]
    shift: np.ndarray  #: of the half-spaces, what caps yield beyond these taken off [m]
    theory: np.ndarray  #: tangential force at that shift and normal force [N]
    rubbed: np.ndarray  #: friction work so far [J]
    work: np.ndarray  #: of the platens less what damping took, so far [J]
    turns: list  #: record at each turn of the path
    stuck: float  #: stick radius at the first turn [m]
    beyond: float  #: compliance of both caps beyond half-spaces [m/N]
    compliance: float  #: tangential one of the theory, of both bodies [1/Pa]
    modulus: float  #: effective one [Pa]
    processor_s: float  #: of the steps alone
    simulation: object

    def contact_radius(self, force):
        """By Hertz at a normal force [m]."""
        return (0.75 * force * 0.5 * RADIUS / self.modulus) ** (1 / 3)


def shear_balls(
    comm, elements_per_radius, a_over_R, nu, friction, ratio, growth, periods,
    integrator="explicit", varying=VARYING, **options,
):  # fmt: skip
    """Press and shear, as the case does, whose parameters these are. Collective.

    Args:
        comm, elements_per_radius, a_over_R, nu, friction, ratio, growth, periods, integrator: Its.
        varying: Path after the cycles, as ``VARYING``.
        options: Of :meth:`~.half_balls.HalfBalls.simulation`.

    Returns:
        :class:`Sheared`.
    """
    material = Elastic(E, nu, RHO)
    a, radius = a_over_R * RADIUS, 0.5 * RADIUS
    balls = HalfBalls(RADIUS, HEIGHT * RADIUS, a, a / elements_per_radius, growth)
    omega = balls.frequency(material)
    half_cycle = periods * 2 * math.pi / omega
    options = {"damping": 0.3 * omega, "time_step_factor": 0.8} | options
    if integrator == "static":
        options = {"increment": half_cycle / INCREMENTS} | options
    s = balls.simulation(comm, material, friction, **options)
    modulus = hertz.effective_modulus((E, nu), (E, nu))
    S = theory.tangential_compliance((E, nu), (E, nu))
    beyond = shear_compliance(balls, material) if comm.rank == 0 else None
    beyond = 2 * comm.bcast(beyond)

    every = max(int(half_cycle / s.dt / 100), 1)
    rows = []

    def record():
        if s.state.num_steps % every == 0:
            along, _, up = low_load(s)
            lost = comm.allreduce(np.array([s.contact.dissipation.total, s.walls.work - s.damped]))
            rows.append((-up, along, displacement(s, "top")[0], *lost))

    approach = a**2 / radius
    began = time.process_time()
    drive(s, {"top": -approach * UP}, 0.3 * half_cycle)
    drive(s, {"top": 0 * UP}, 0.3 * half_cycle)
    force = -low_load(s)[2]
    a = (0.75 * force * radius / modulus) ** (1 / 3)
    largest = theory.displacement(ratio * friction * force, force, friction, a, S)
    largest += beyond * ratio * friction * force

    # The caps lag behind their platens by damping x speed / omega².
    s.damping = 0.15 * omega
    turns = [0]
    x, z = 0.0, 1.0
    path = [(1.0, 1.0, 0.6), (-1.0, 1.0, 1.0), (1.0, 1.0, 1.0)]
    for x_next, z_next, part in path + [(*point, 0.6) for point in varying]:
        move = (x_next - x) * largest * ALONG - (z_next - z) * approach * UP
        drive(s, {"top": move}, part * half_cycle, at_step=record)
        x, z = x_next, z_next
        turns.append(len(rows) - 1)
        if len(turns) == 2:
            stuck = _stick_radius(s, friction)

    processor_s = time.process_time() - began
    normal, tangential, shift, rubbed, work = np.array(rows).T
    shift = shift - beyond * tangential
    return Sheared(
        normal=normal,
        force=tangential,
        shift=shift,
        theory=_theory(normal, shift, radius, modulus, S, friction),
        rubbed=rubbed,
        work=work,
        turns=turns,
        stuck=stuck,
        beyond=beyond,
        compliance=S,
        modulus=modulus,
        processor_s=processor_s,
        simulation=s,
    )


def _theory(N, shear, radius, modulus, S, friction):
    """Tangential force along the recorded path, by the theory for any path."""
    fine = np.linspace(0, N.size - 1, 4 * (N.size - 1) + 1)
    approach = (0.75 * N / modulus / math.sqrt(radius)) ** (2 / 3)
    paths = (np.interp(fine, np.arange(N.size), values) for values in (approach, shear))
    return theory.history(*paths, radius, modulus, S, friction, 500)[1][::4]


def _stick_radius(s, friction):
    """Radius of the nodes that hold more than they need, by their area on both sides [m]."""
    p = s.contact.pairs
    on = np.flatnonzero(p.closed)
    shear = np.linalg.norm(p.shear[on], axis=1)
    stuck = on[shear < 0.98 * friction * p.normal_force[on]]
    area = s.comm.allreduce(s.contact.points.area[p.node[stuck]].sum())
    return math.sqrt(0.5 * area / math.pi)
