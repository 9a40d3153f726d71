"""Four balls that start with random speeds in a box that shrinks: all kinds of energy take part."""

import numpy as np

from ..container import BOX
from ..geometry.bodies.shapes import sphere
from ..run.from_bodies import build, drive

RADIUS = 1e-3
#: Distance of the balls over their diameter, and their first velocities and spins over the speed.
APART = 1.005
THROW = np.array([[-1, 0.3, -0.2], [0.8, 0.9, -0.1], [0.5, -1, 0.7], [-0.3, 0.1, 1.0]])
SPIN = np.array([[1, 0.2, 0], [0, -0.5, 1], [0.3, 0.3, 0.3], [0, 1, 0]]) / RADIUS


def press_four_balls(
    comm, materials, element_size, speed, strain, friction, time_step_factor, spin=0.0
):
    """Balls at the corners of a tetrahedron collide and are compressed. Collective.

    Args:
        comm: MPI communicator.
        materials: One, or one for each ball.
        element_size: Edge of the elements over the radius.
        speed: Speed of the first collision and of the platen [m/s].
        strain: Compression of the box.
        friction: Coefficient of friction, everywhere.
        time_step_factor: Time step over the limit of stability.
        spin: Part of the first spins.

    Returns:
        The simulation, and the largest residual of the energies over what was put in.
    """
    points, cells = sphere(RADIUS, element_size * RADIUS)
    corners = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]) / np.sqrt(2)
    centres = APART * corners * RADIUS
    half = (APART / np.sqrt(2) + 1) * RADIUS

    def velocity(x, grain):
        return speed * (THROW[grain] + np.cross(spin * SPIN[grain], x - centres[grain]))

    s = build(
        comm, [(points + c, cells) for c in centres], materials, np.full(3, -half),
        np.full(3, half), wall_friction=dict.fromkeys(BOX.walls, friction), friction=friction,
        velocity=velocity, time_step_factor=time_step_factor,
    )  # fmt: skip
    worst = 0.0

    def watch():
        nonlocal worst
        if s.state.num_steps % 20 == 0:
            e = s.energies()
            worst = max(worst, abs(e["residual"]) / (s.initial_kinetic + abs(e["work"])))

    drive(s, {"z_max": (0, 0, -2 * half * strain)}, 2 * half * strain / speed, at_step=watch)
    return s, worst
