"""An elastic block on a plane that is drawn away below it, and on another block."""

import math

import numpy as np

from ..geometry.bodies.shapes import box
from ..materials.elastic import Elastic
from ..run.from_bodies import build, drive, settle
from ..theory.coulomb import friction_work
from .case import case, compare

# Without lateral strain pressing alone makes no node slip.
E, NU, RHO = 100e9, 0.0, 2650.0
LENGTH, HEIGHT = 1e-3, 0.5e-3
#: The way that blocks are drawn, along no edge of their meshes.
WAY = np.array([math.cos(0.4), math.sin(0.4), 0.0])


@case("sliding-block", num_bodies=1)
def sliding_block(comm, friction=0.3, strain=1e-4, slip=1e-5, divisions=4):
    """A block pressed on a plane sticks up to mu N, and friction work is mu N s where it slides.

    A platen presses the block on the plane and holds it, by twice the friction; the
    plane is drawn away, along no edge of the mesh.

    Args:
        comm: MPI communicator.
        friction: Coefficient of friction between block and plane; the tolerances hold up to 0.5:
            with more the drag tips the block so far that its rear slips first.
        strain: Compression of the block.
        slip: Distance to slide [m].
        divisions: Bricks along the length.
    """
    s, beat = _pressed(comm, friction, strain, divisions)
    plane, platen = map(s.walls.names.index, ("z_min", "z_max"))

    def state():
        """Drag and normal force of the plane, drag of the platen [N], work of friction [J]."""
        drag, hold = s.comm.allreduce(-s.walls.force[[plane, platen]] @ WAY)
        work = s.comm.allreduce(s.contact.dissipation.total)
        return np.array([drag, s.wall_forces()[plane], hold, work])

    # Well below the limit: the plane moves by a few parts of the elastic displacement at it.
    step = 0.4 * friction * strain * HEIGHT
    rest = state()
    stuck = []
    for move in (step, step, -2 * step):
        drive(s, {"z_min": move * WAY}, beat)
        settle(s, 1e-12)
        stuck.append(state() - rest)

    # On to 1.4 times the elastic displacement at the limit: the block has to hold up to there
    # and to let go there. Slowly, for waves add to the drag.
    reach = 2 * step * friction * rest[1] / stuck[1][0]
    ratios = []

    def record_ratio():
        drag, normal, *_ = state()
        ratios.append(drag / (friction * normal))

    drive(s, {"z_min": 1.4 * reach * WAY}, 6 * beat, at_step=record_ratio)
    settle(s, 1e-12)

    before = state()
    mean_force, slid = _slide(s, plane, slip, strain, beat)
    end, energy = state(), s.energies()

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
        # Coulomb's law holds at each node; only waves move the sum of them off its limit.
        "threshold: largest drag over mu N": compare(max(ratios), 1.0, 0.005),
        "sliding: drag over normal force": compare(end[0] / end[1], friction, 0.005),
        "friction work [J]": compare(
            end[3] - before[3], friction_work(friction, mean_force, slid), 0.005
        ),
        "energy residual over work": compare(
            energy["residual"] / energy["work"], 0.0, 1e-3, scale=1.0
        ),
    }
    return results, [s]


def _pressed(comm, friction, strain, divisions):
    """The block between plane and platen, pressed and at rest; the time of some waves [s]."""
    material = Elastic(E, NU, RHO)
    body = box((LENGTH, LENGTH, HEIGHT), (divisions, divisions, max(divisions // 2, 1)))
    s = build(
        comm, [body], material, (0, 0, 0), (0, 0, HEIGHT), axes="z",
        wall_friction={"z_min": friction, "z_max": 2 * friction},
        damping=math.pi * material.wave_speed / LENGTH,
    )  # fmt: skip
    beat = 8 * LENGTH / material.wave_speed

    drive(s, {"z_max": (0, 0, -strain * HEIGHT)}, beat)
    settle(s, 1e-12)
    return s, beat


def _slide(s, plane, slip, strain, beat):
    """Draw the plane on by ``slip`` [m]; mean normal force [N], way of the block on it [m]."""
    u_before = _foot(s)
    forces, places = [s.wall_forces()[plane]], [s.walls.point[plane] @ WAY]

    def record():
        forces.append(s.wall_forces()[plane])
        places.append(s.walls.point[plane] @ WAY)

    # The stress of its inertia, rho c v, stays some percent of the pressure.
    speed = 0.02 * strain * Elastic(E, NU, RHO).wave_speed
    drive(s, {"z_min": slip * WAY}, max(slip / speed, beat), at_step=record)
    mean_force = np.trapezoid(np.array(forces), places) / slip
    return mean_force, slip - (_foot(s) - u_before)


def _foot(s):
    """Mean displacement along the way of the block's face on the plane [m]."""
    bottom = s.mesh.x[:, 2] < 1e-9
    return s.comm.allreduce((s.state.u[bottom] @ WAY).sum()) / s.comm.allreduce(bottom.sum())
