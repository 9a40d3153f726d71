"""The energy balance of grains that collide, yield, slide and are compressed."""

import numpy as np

from ..geometry.bodies.shapes import sphere
from ..materials.elastic import Elastic
from ..materials.sand import SAND
from ..run.from_bodies import build, sum_over_nodes
from .case import at_least, case, compare
from .shrinking_box import RADIUS, press_four_balls


@case("energy", num_bodies=4)
def energy(comm, element_size=0.4, speed=1.0, strain=0.02, friction=0.23, time_step_factor=0.6):
    """Four elasto-plastic balls collide and are compressed: all energies add up to the work.

    And two balls that collide in free space keep their momentum.

    Args:
        comm: MPI communicator.
        element_size: Edge of the elements over the radius.
        speed: Speed of the first collision and of the platen [m/s].
        strain: Compression of the box.
        friction: Coefficient of friction, everywhere.
        time_step_factor: Time step over the limit of stability. That limit is one of
            vibration about a closed contact; single nodes that meet at speed keep their
            energy only below about 0.7 of it.
    """
    points, cells = sphere(RADIUS, element_size * RADIUS)
    squeezed = _compress(comm, element_size, speed, strain, friction, time_step_factor)
    collided = _collide(comm, points, cells, speed, friction, time_step_factor)
    return squeezed[0] | collided[0], [squeezed[1], collided[1]]


def _compress(comm, *setting):
    """Balls in a box that shrinks."""
    s, worst = press_four_balls(comm, SAND, *setting)
    e = s.energies()
    elastic, plastic = s.solid.elastic_energy(s.state), s.solid.plastic_energy(s.state)
    plastic += s.contact.dissipation.dents.of_grains(s.mesh)
    least = min(comm.allgather(min(elastic.min(), plastic.min(), s.contact.dissipation.total)))
    stored = comm.allreduce(np.array([elastic.sum(), plastic.sum()]))
    results = {
        # The target of the method: 0.1 % of what was put in, at all times.
        "largest residual over work": compare(worst, 0.0, 1e-3, scale=1.0),
        # Sums over the same numbers in another order.
        "elastic energy of the grains over that of all": compare(
            stored[0] / e["elastic"], 1, 1e-12
        ),
        "plastic energy of the grains over that of all": compare(
            stored[1] / e["plastic"], 1, 1e-12
        ),
        # Each term of every grain is a sum of squares or a dissipation.
        "least energy of a grain, if negative": compare(min(least, 0.0), 0.0, 0.0, scale=1.0),
    }
    # A test of plasticity and friction has to have some.
    total = s.initial_kinetic + e["work"]
    for name in ("plastic", "friction"):
        results[f"{name} part of the work, at least"] = at_least(e[name] / total, 0.005)
    return results, s


def _collide(comm, points, cells, speed, friction, time_step_factor):
    """Two spinning balls, off centre, in free space; the other ranks have a far ball each."""
    centres = np.array([[-1.002, 0, 0], [1.002, 0.3, 0.1], [0, 0, 9], [0, 9, 0]]) * RADIUS
    throw = np.array([[1, 0, 0.2], [-1, 0.1, 0], [0, 0, 0], [0, 0, 0]]) * speed
    spin = np.array([[0, 0, 1], [0.5, 1, 0], [0, 0, 0], [0, 0, 0]]) * 0.5 * speed / RADIUS

    def velocity(x, grain):
        return throw[grain] + np.cross(spin[grain], x - centres[grain])

    s = build(
        comm, [(points + c, cells) for c in centres], Elastic(SAND.E, SAND.nu, SAND.rho),
        np.zeros(3), np.zeros(3),
        axes="", friction=friction, velocity=velocity, time_step_factor=time_step_factor,
    )  # fmt: skip
    mass = s.solid.mass[:, None]

    def momenta():
        return (
            sum_over_nodes(s, mass * s.state.v),
            sum_over_nodes(s, mass * np.cross(s.state.x, s.state.v)),
        )

    scale = s.solid.mass.sum()
    scale = comm.allreduce(scale) * speed
    p0, L0 = momenta()
    touched = 0
    gap = 0.5 * RADIUS
    while s.state.t < gap / speed:
        s.step()
        if s.state.num_steps % 50 == 0:
            s.energies()
            touched = max(touched, s.num_contacts)
    p1, L1 = momenta()
    results = {
        "contacts of the collision, at least": at_least(touched, 1),
        # Every force has its opposite: round-off of some thousand steps.
        "momentum of the collision": compare(np.linalg.norm(p1 - p0) / scale, 0, 1e-12, 1.0),
        "angular momentum of the collision": compare(
            np.linalg.norm(L1 - L0) / (scale * RADIUS), 0, 1e-12, 1.0
        ),
        "energy of the collision": compare(
            s.energies()["residual"] / s.initial_kinetic, 0.0, 1e-3, scale=1.0
        ),
    }
    return results, s
