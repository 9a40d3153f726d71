"""An elastic block on a plane that is drawn away below it."""

import math

import numpy as np

from ..geometry.shapes import box
from ..materials.elastic import Elastic
from ..theory.coulomb import friction_work
from .build import build, drive, settle
from .case import case, compare

# Without lateral strain pressing alone makes no node slip.
E, NU, RHO = 100e9, 0.0, 2650.0
LENGTH, HEIGHT = 1e-3, 0.5e-3


@case("sliding-block", num_bodies=1)
def sliding_block(comm, friction=0.3, strain=1e-4, slip=1e-5, divisions=4):
    """A block pressed on a plane sticks below mu N, and friction work is mu N s where it slides.

    A platen presses the block on the plane and holds it, by twice the friction; the
    plane is drawn along x.

    Args:
        comm: MPI communicator.
        friction: Coefficient of friction between block and plane.
        strain: Compression of the block.
        slip: Distance to slide [m].
        divisions: Bricks along the length.
    """
    material = Elastic(E, NU, RHO)
    body = box((LENGTH, LENGTH, HEIGHT), (divisions, divisions, max(divisions // 2, 1)))
    s = build(
        comm, [body], material, (0, 0, 0), (0, 0, HEIGHT), axes="z",
        wall_friction={"z_min": friction, "z_max": 2 * friction},
        damping=math.pi * material.wave_speed / LENGTH,
    )  # fmt: skip
    names = s.walls.names
    plane, platen = names.index("z_min"), names.index("z_max")
    beat = 8 * LENGTH / material.wave_speed

    drive(s, {"z_max": (0, 0, -strain * HEIGHT)}, beat)
    settle(s, 1e-12)

    def state():
        """Drag and normal force of the plane, drag of the platen [N], work of friction [J]."""
        drag, hold = s.comm.allreduce(-s.walls.force[[plane, platen], 0])
        work = s.comm.allreduce(s.contact.dissipated)
        return np.array([drag, s.wall_forces()[plane], hold, work])

    # Well below the limit: the plane moves by a few parts of the elastic displacement at it.
    step = 0.4 * friction * strain * HEIGHT
    rest = state()
    stuck = []
    for move in (step, step, -2 * step):
        drive(s, {"z_min": (move, 0, 0)}, beat)
        settle(s, 1e-12)
        stuck.append(state() - rest)

    before, u_before = state(), _foot(s)
    forces, places = [before[1]], [s.walls.point[plane, 0]]

    def record():
        forces.append(s.wall_forces()[plane])
        places.append(s.walls.point[plane, 0])

    # The stress of its inertia, rho c v, stays some percent of the pressure.
    speed = 0.02 * strain * material.wave_speed
    drive(s, {"z_min": (slip, 0, 0)}, max(slip / speed, beat), at_step=record)
    end = state()
    forces = np.array(forces)
    mean_force = np.trapezoid(forces, places) / slip
    slid = slip - (_foot(s) - u_before)
    energy = s.energies()

    results = {
        "stuck: drag over mu N": compare(stuck[1][0] / (friction * rest[1]), 0.0, 1.0, scale=1.0),
        # Linear elasticity with strains of 1e-4 and less, until some node slips.
        "stuck: drag at twice the displacement": compare(stuck[1][0] / stuck[0][0], 2.0, 1e-3),
        "stuck: drag after the way back, over mu N": compare(
            stuck[2][0] / (friction * rest[1]), 0.0, 1e-3, scale=1.0
        ),
        "stuck: friction work over mu N times the displacement": compare(
            stuck[2][3] / (friction * rest[1] * 4 * step), 0.0, 1e-3, scale=1.0
        ),
        # The platen holds what the plane drags: at rest to 1e-12 in energies.
        "stuck: platen against plane": compare(-stuck[1][2], stuck[1][0], 1e-4),
        # Not at rest while sliding, and nodes that spread sideways rub a little across.
        "sliding: drag over normal force": compare(end[0] / end[1], friction, 0.01),
        # The way includes that of building up the drag, elastic displacement over slip.
        "friction work [J]": compare(
            end[3] - before[3], friction_work(friction, mean_force, slid), 0.01
        ),
        "energy residual over work": compare(
            energy["residual"] / energy["work"], 0.0, 1e-3, scale=1.0
        ),
    }
    return results, [s]


def _foot(s):
    """Mean displacement along x of the block's face on the plane [m]."""
    bottom = s.mesh.x[:, 2] < 1e-9
    return s.comm.allreduce(s.state.u[bottom, 0].sum()) / s.comm.allreduce(bottom.sum())
