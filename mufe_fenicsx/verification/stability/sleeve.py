"""A sleeve with nothing inside: the outer pressure at which it buckles, and its time step."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.walls import Wall
from ...geometry.bodies.shapes import box
from ...geometry.bodies.sleeve import sleeve
from ...loading.oedometer import smooth_step
from ...loading.pressure import Pressure
from ...materials.elastic import Elastic
from ...materials.neo_hookean import NeoHookean
from ...run.from_bodies import build
from ...theory.membranes import ring_buckling_pressure
from ..case import at_least, case, compare
from .limits import (
    NEVER,
    NOISE,
    NU,
    RHO,
    SIZE,
    E,
    Snapshot,
    bisect,
    free_block,
    growth,
    highest_frequency,
)

LATEX, RADIUS = NeoHookean(), 5e-3
UP = np.array([0.0, 0.0, 1.0])
#: Layers, and length of edges over the thickness: those of a scene first; of the last two the
#: second halves all edges of the first.
MESHES = ((1, 2.0), (1, 1.0), (2, 1.0), (4, 0.5))
#: Of the sleeve whose time step is looked at [m]: a scene's own thickness.
THICKNESS = 0.3e-3


def ring(comm, pressure, layers, h_over_t, t_over_R=0.1):
    """Square of the frequency of oval swings of a slice of a long sleeve [1/s²]. Collective.

    The slice, one edge high between mirrors, takes its pressure with damping. Then it gets the
    velocities of the oval, φ = (cos 2θ, -sin 2θ/2), whose part q of the motion follows
    q̈ = -ω² q: so that ω² = (q̇(0) - q̇(T))/∫ q dt, below zero where it grows.

    Args:
        comm: MPI communicator of one rank.
        pressure: Around it over that of buckling.
        layers, h_over_t: As of :data:`MESHES`.
        t_over_R: Thickness over mean radius.

    Returns:
        ω², the simulation.
    """
    t = t_over_R * RADIUS
    body = sleeve(RADIUS - 0.5 * t, t, h_over_t * t, h_over_t * t, layers)
    walls = [
        Wall("bottom", np.zeros(3), UP, mirror=True),
        Wall("top", h_over_t * t * UP, -UP, mirror=True),
    ]
    fast = math.sqrt(LATEX.E / LATEX.rho) / RADIUS
    s = build(comm, [body], LATEX, [0] * 3, [0] * 3, "", walls=walls, damping=2.0 * fast)
    term = Pressure(s.mesh, 0.0, where=_faces_out)
    s.add_term(term)
    p = pressure * ring_buckling_pressure(RADIUS, t, LATEX.E, LATEX.nu)
    duration = 8.0 / fast
    while s.state.t < 1.5 * duration:
        term.set_pressure(p * smooth_step(min(s.state.t / duration, 1.0)), s.state)
        s.step()
    s.damping = 0.0
    angle = np.arctan2(s.mesh.x[:, 1], s.mesh.x[:, 0])
    radial, around = np.cos(2 * angle), -0.5 * np.sin(2 * angle)
    c, n = np.cos(angle), np.sin(angle)
    oval = np.column_stack([radial * c - around * n, radial * n + around * c, 0 * angle])
    weight = s.solid.mass[:, None] * oval
    weight /= np.vdot(weight, oval)
    s.state.v[:] = NOISE * oval
    start, begun, total, before = s.state.x.copy(), s.state.t, 0.0, 0.0
    # A quarter of the period of a thin ring, ω² = 36/5 E t²/(12 (1 - ν²) ρ R⁴) (Timoshenko,
    # Vibration Problems in Engineering); on any mesh less than a whole one, whose sum is none.
    omega = math.sqrt(0.6 / (1 - LATEX.nu**2)) * fast * t_over_R
    while s.state.t - begun < 0.5 * math.pi / omega:
        s.step()
        q = float(np.vdot(weight, s.state.x - start))
        total += 0.5 * s.dt * (before + q)
        before = q
    return (NOISE - float(np.vdot(weight, s.state.v))) / total, s


def _faces_out(centre, normal):
    return np.einsum("ni,ni->n", centre[:, :2], normal[:, :2]) > 0.5 * RADIUS


def buckling(comm, layers, h_over_t, pressures=(0.0, 0.7)):
    """The pressure at which oval swings of a slice have no frequency left, over a thin ring's.

    Squares of frequencies fall linearly with the pressure: their line ends there. Collective.

    Returns:
        ``layers``, ``h_over_t``, ``squares`` over the first of them, ``limit``; the simulations.
    """
    squares, simulations = zip(
        *(ring(comm, p, layers, h_over_t) for p in pressures), strict=True
    )  # fmt: skip
    slope, first = np.polyfit(pressures, squares, 1)
    row = SimpleNamespace(layers=layers, h_over_t=h_over_t, squares=np.array(squares) / squares[0],
                          limit=float(-first / slope))  # fmt: skip
    return row, list(simulations)


def extrapolated(coarse, fine):
    """A limit on ever finer meshes, of two rows whose edges are one twice those of the other."""
    return (4.0 * fine.limit - coarse.limit) / 3.0


def light_sleeve(comm, rho=LATEX.rho, **options):
    """A sleeve around a cube of quartz that it does not touch."""
    bodies = [
        box((SIZE,) * 3, (2,) * 3),
        sleeve(RADIUS, THICKNESS, 6.0 * THICKNESS, 2.0 * THICKNESS),
    ]
    materials = [Elastic(E, NU, RHO), NeoHookean(rho=rho)]
    return build(
        comm, bodies, materials, [0] * 3, [0] * 3, "", sleeves=["side"], refresh=NEVER, **options
    )


def density_theory(comm):
    """The density [kg/m³] at which the sleeve allows the step of the cube: both 2/ω, by √ρ."""
    block = highest_frequency(free_block(comm, "averaged"))
    alone = build(
        comm, [sleeve(RADIUS, THICKNESS, 6.0 * THICKNESS, 2.0 * THICKNESS)], LATEX, [0] * 3,
        [0] * 3, "", refresh=NEVER,
    )  # fmt: skip
    return LATEX.rho * (highest_frequency(alone) / block) ** 2


def density_limit(comm, trials=10):
    """The density below which noise in the sleeve grows at the cube's own step [kg/m³].

    The step is a thousandth below the limit of the cube, so that it is the sleeve that grows.
    """
    dt = 0.999 * 2.0 / highest_frequency(free_block(comm, "averaged"))
    theory = density_theory(comm)

    def holds(rho):
        s = light_sleeve(comm, rho)
        return not growth(s, Snapshot(s), dt)[1]

    return 1.0 / bisect(
        lambda inverse: not holds(1.0 / inverse), 0.5 / theory, 2.0 / theory, trials
    )


def steps_over_density(comm, densities):
    """The program's limit of the time step [s] at densities [kg/m³] of the sleeve."""
    simulations = (light_sleeve(comm, rho) for rho in densities)
    return np.array([s.dt / s.time_step_factor for s in simulations])


@case("stability-sleeve", num_bodies=1)
def sleeve_limits(comm, trials=8):
    """A long sleeve becomes oval at the pressure of a thin ring; how light it may be.

    Args:
        comm: MPI communicator.
        trials: Bisections.
    """
    rows, simulations = {}, []
    for mesh in (MESHES[0], *MESHES[2:]):
        rows[mesh], more = buckling(comm, *mesh)
        simulations += more
    theory = density_theory(comm)
    return {
        # (t/R)² = 1 % for the thick wall, 1 % for what is left of the mesh's error.
        "buckling pressure, ever finer meshes": compare(
            extrapolated(*(rows[mesh] for mesh in MESHES[2:])), 1.0, 0.02
        ),
        "buckling pressure, the mesh of a scene": compare(rows[MESHES[0]].limit, 1.0, math.inf),
        "density at which a sleeve sets the step [kg/m³]": compare(
            density_limit(comm, trials), theory, 4 ** (0.5 / 2**trials) - 1 + 0.01
        ),
        "step at ten times that density over that of latex": at_least(
            float(np.divide(*steps_over_density(comm, (10.0 * theory, LATEX.rho)))), 0.99
        ),
    }, simulations
