"""Large plastic flow: flattening without hardening, necking with it, and softening, refused."""

import math
from types import SimpleNamespace

import numpy as np

from ...bulk.solid import COLLAPSED
from ...contact.walls import Wall
from ...errors import SolverError
from ...geometry.bodies.shapes import box
from ...implicit.simulation import ImplicitSimulation
from ...kernels.bulk.element_step import element_steps
from ...materials.j2 import J2
from ...run.from_bodies import build, distribute, drive
from ...theory.stability import necking_strain
from ..case import case, compare
from .limits import NU, RHO, SIZE, E, bisect, message_of

YIELD = 5e-3 * E
#: That of the cube which is flattened by time steps: waves have to be small beside it.
HARD = 0.05 * E
#: Hardening over yield stress.
HARDENING = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)


def flatten(comm, strain=1.1, element="averaged", divisions=(2, 2, 2), passages=300.0):
    """A perfectly plastic cube under a smooth platen.

    Returns:
        Strains, stress over Y of the present area, work of dents over plastic work, energy
        residual over work, strain at which the program stopped and its words, simulation.
    """
    material = J2(E, NU, RHO, ((0.0, HARD),))
    transit = SIZE / material.wave_speed
    s = build(
        comm, [box((SIZE,) * 3, divisions)], material, np.zeros(3), np.full(3, SIZE), axes="z",
        element=element, refresh=20, damping=0.2 / transit, compliance=0.02,
    )  # fmt: skip
    rows, message, stopped = [], "", math.inf

    def record():
        if s.state.num_steps % 25:
            return
        height = float(np.ptp(s.state.x[:, 2]))  # of the cube: layers of contact give way too
        e = s.energies()
        dents = e["plastic_dents"] / max(e["plastic"], 1e-300)
        rows.append((1 - height / SIZE, s.wall_forces()[1], height, dents))

    try:
        drive(s, {"z_max": (0, 0, -strain * SIZE)}, passages * transit, at_step=record)
    except SolverError as error:
        message = str(error)
        stopped = 1 - float(np.ptp(s.state.x[:, 2])) / SIZE
    reached, force, height, dents = np.array(rows).T
    e = s.energies()
    return SimpleNamespace(
        strain=reached, stress=force * height / SIZE**3 / HARD, stopped=stopped, message=message,
        residual=e["residual"] / e["work"], dents=dents, simulation=s,
    )  # fmt: skip


def collapse_theory(divisions=(2, 2, 2)):
    """Strain at which flattening leaves the worst element ``COLLAPSED`` of its first step."""
    points, cells = box((SIZE,) * 3, divisions)
    speed = np.ones(len(cells))
    first = element_steps(points, cells, speed).min()

    def collapsed(rest):
        stretch = np.array([rest**-0.5, rest**-0.5, rest])
        return element_steps(points * stretch, cells, speed).min() < COLLAPSED * first

    return 1.0 - 1.0 / bisect(lambda inverse: collapsed(1.0 / inverse), 1.0, 1e4, 40)


def pull(comm, material, strain, divisions=(2, 2, 8), length=4.0, increments=80):
    """A bar glued at both ends and drawn out in static increments.

    Returns:
        Way over length, plastic strain of its middle, force over Y A, plastic work over Y V, words
        of the program where it finds no equilibrium, simulation.
    """
    height, up = length * SIZE, np.eye(3)[2]
    walls = [
        Wall("base", np.zeros(3), up, bonded=True),
        Wall("platen", height * up, -up, bonded=True, velocity=strain * height * up),
    ]
    mesh = distribute(comm, [box((SIZE, SIZE, height), divisions)])
    step = 1.0 / increments
    s = ImplicitSimulation(
        mesh, [material], walls, first_step=step, largest_step=step, smallest_step=0.02 * step
    )
    middle = np.abs(mesh.x[mesh.cells].mean(axis=1)[:, 2] - 0.5 * height) < 0.26 * height
    volume = s.solid.volume0
    rows, message = [], ""
    try:
        while s.state.t < 1 - 0.5 * step:
            s.step()
            plastic = float(volume[middle] @ s.state.plastic_strain[middle] / volume[middle].sum())
            force = 0.5 * float(np.abs(s.walls.force[:, 2]).sum())
            rows.append((strain * s.state.t, plastic, force, float(s.state.plastic_work.sum())))
    except SolverError as error:
        message = str(error)
    way, plastic, force, work = np.array(rows).T
    first = material.yield_stress[0][1]
    return SimpleNamespace(
        way=way, plastic=plastic, force=force / (first * SIZE**2),
        work=work / (first * SIZE**2 * height), message=message, simulation=s,
    )  # fmt: skip


def necking(comm, hardening=HARDENING):
    """One row for each H/Y: plastic strain of the middle at the largest force, and theory."""
    rows, simulations = [], []
    for ratio in hardening:
        table = ((0.0, YIELD),) if ratio == 0 else ((0.0, YIELD), (3.0, YIELD * (1 + 3 * ratio)))
        theory = necking_strain(1.0, ratio)
        course = pull(comm, J2(E, NU, RHO, table), 1.3 * math.expm1(theory) + 0.2)
        top = int(course.force.argmax())
        rows.append(
            SimpleNamespace(
                ratio=ratio, theory=theory, measured=float(course.plastic[top]), course=course
            )
        )
        simulations.append(course.simulation)
    return rows, simulations


#: A table that falls.
FALLING = ((0.0, YIELD), (0.2, 0.2 * YIELD))


@case("stability-plastic", num_bodies=1)
def plastic_flow(comm):
    """A perfectly plastic cube flattened until its elements collapse, bars drawn until they neck.

    Args:
        comm: MPI communicator.
    """
    found = flatten(comm)
    late = (found.strain > 0.1) & (found.strain < 0.9)
    results = {
        # Even flow; contact keeps its first area, so that its layer grows thick beside the cube.
        "flattening: stress over yield, mean": compare(found.stress[late].mean(), 1.0, 0.05),
        "flattening: strain at which it stops": compare(
            min(found.stopped, 1.0), collapse_theory(), 0.05
        ),
        # Its surface grows by flow: the pressure on what it has grown to is the yield stress.
        "flattening: work of dents over plastic work": compare(
            found.dents[late].max(), 0.0, 1e-3, scale=1.0
        ),
        "flattening: energy residual over work": compare(found.residual, 0.0, 0.01, scale=1.0),
        "softening is refused": compare(float(bool(message_of(J2, E, NU, RHO, FALLING))), 1.0, 0.0),
    }
    rows, simulations = necking(comm, (2.0, 3.0))
    for row in rows:
        # The glued ends hold the bar a little; the force is flat around its largest value.
        results[f"H/Y = {row.ratio:g}: strain at the largest force"] = compare(
            row.measured, row.theory, 0.05
        )
    return results, [found.simulation, *simulations]
