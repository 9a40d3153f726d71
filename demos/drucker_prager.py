"""A material of one's own: Drucker and Prager's, whose strength grows with pressure.

    python demos/drucker_prager.py FOLDER          draws what it does to a cube, and to a grain
    python demos/drucker_prager.py run SCENE       any command of mufe, with this material

In the second form a scene file may say

    [material]
    model = "drucker-prager"
    E = "100 GPa"
    nu = 0.15
    rho = "2650 kg/m^3"
    cohesion = "40 MPa"
    friction = 1.0

The yield stress is Y = cohesion + friction · pressure + hardening · plastic strain, and not below
zero. Flow keeps the volume (no dilatancy), so it is not associated. Nadimi & Fonseca (2018) note
that grains fail by both invariants of stress, where von Mises knows one.

Source: D. C. Drucker, W. Prager, Q. Appl. Math. 10, 1952, 157-165.
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib
import numba
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.bulk.solid import von_mises
from mufe_fenicsx.cli.main import main as mufe
from mufe_fenicsx.geometry.bodies.shapes import box, sphere
from mufe_fenicsx.materials.elastic import IsotropicSolid
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.report import style
from mufe_fenicsx.run.from_bodies import build, drive
from mufe_fenicsx.scene import register_material
from mufe_fenicsx.units import REQUIRED, setting


@numba.njit
def increment(q, mean, alpha, dt, shear, parameters):
    """Plastic strain increment; arguments as of kernels.bulk.hardening.plastic_increment."""
    _, cohesion, friction, hardening = parameters[0], parameters[1], parameters[2], parameters[3]
    # Under tension the strength vanishes at the apex.
    base = cohesion - friction * mean
    dp = (q - base - hardening * alpha) / (3.0 * shear + hardening)
    return min(max(dp, 0.0), q / (3.0 * shear))


@dataclass(frozen=True)
class DruckerPrager(IsotropicSolid):
    """Isotropic elasticity with a strength that grows with pressure.

    Raises:
        InputError: cohesion, friction or hardening is not >= 0.
    """

    cohesion: float = setting(REQUIRED, "Pa", "strength without pressure", ge=0)
    friction: float = setting(REQUIRED, "-", "growth of the strength with pressure", ge=0)
    hardening: float = setting(0.0, "Pa", "growth of the strength with plastic strain", ge=0)

    plastic_increment = staticmethod(increment)

    def parameters(self):
        # Under tension the material can yield at any stress.
        return np.array([0.0, self.cohesion, self.friction, self.hardening])


register_material("drucker-prager", DruckerPrager)

E, NU, RHO = 100e9, 0.15, 2650.0
SIZE = 1e-3
STRONG = DruckerPrager(E, NU, RHO, cohesion=40e6, friction=1.0)
VON_MISES = J2(E, NU, RHO, ((0.0, 40e6),))


def sheared_cube(material, compression, shear=2e-3):
    """Compress a cube by ``compression`` evenly, then shear it at constant volume.

    Returns:
        Pressure and von Mises stress on the way [Pa], shape (num_steps,).
    """
    edge = (SIZE,) * 3
    s = build(
        MPI.COMM_SELF, [box(edge, (2, 2, 2))], material, (0, 0, 0), edge,
        damping=2 * math.pi * material.wave_speed / SIZE,
    )  # fmt: skip
    path, duration = [], 40 * SIZE / material.wave_speed

    def record():
        stress = s.solid.stress(s.state)
        mean = stress[:, :3].mean(axis=1)
        path.append((-mean.mean(), von_mises(s.state.deviator).mean()))

    for x, z in ((compression, compression), (-0.5 * shear, shear)):
        moves = {}
        for axis, name in enumerate("xyz"):
            way = 0.5 * SIZE * (z if name == "z" else x)
            moves[f"{name}_min"] = way * np.eye(3)[axis]
            moves[f"{name}_max"] = -way * np.eye(3)[axis]
        drive(s, moves, duration, at_step=record)
    return np.array(path).T


def pressed_ball(material, strain=0.06):
    """Press a ball between platens; approach [m] and force [N]."""
    radius = 0.5 * SIZE
    s = build(
        MPI.COMM_SELF, [sphere(radius, 0.12 * radius)], material, -radius * np.ones(3),
        radius * np.ones(3), axes="z", damping=0.02 * material.wave_speed / radius,
    )  # fmt: skip
    curve = []

    def record():
        curve.append((2 * radius - np.ptp(s.walls.point[:, 2]), np.mean(s.wall_forces())))

    way = 2 * radius * strain
    drive(s, {"z_max": (0, 0, -way)}, 150 * SIZE / material.wave_speed, at_step=record)
    return np.array(curve).T


def draw(folder):
    """The figure; the worst distance from the yield surface over the cohesion."""
    folder.mkdir(parents=True, exist_ok=True)
    worst = 0.0
    with matplotlib.rc_context(style.RC):
        figure, (left, right) = style.new_figure(style.PAGE, 2.6, ncols=2)
        for material, colour, line, name in (
            (STRONG, style.RED, "-", "Drucker-Prager"),
            (VON_MISES, style.BLUE, "--", "von Mises"),
        ):
            for k, compression in enumerate((1e-4, 3e-4, 6e-4)):
                p, q = sheared_cube(material, compression)
                left.plot(p / 1e6, q / 1e6, line, color=colour, label=None if k else name)
                if material is STRONG:
                    worst = max(worst, abs(q[-1] / (40e6 + p[-1]) - 1))
            approach, force = pressed_ball(material)
            right.plot(1e6 * approach, force, line, color=colour, label=name)
        p = np.linspace(0, 75, 2)
        left.plot(p, 40 + p, color=style.GREY, lw=0.7, ls="--", label="40 MPa + pressure")
        left.set(xlabel="pressure (MPa)", ylabel="von Mises stress (MPa)")
        right.set(xlabel="approach of the platens (µm)", ylabel="force (N)")
        for k, axis in enumerate((left, right)):
            style.panel_letter(axis, k)
            axis.legend()
        figure.savefig(folder / "drucker_prager.png")
    return worst


if __name__ == "__main__":
    if len(sys.argv) == 2 and not sys.argv[1].startswith("-") and sys.argv[1] != "demo":
        print(f"strength of the sheared cube within {draw(Path(sys.argv[1])):.1e} of the law")
    else:
        mufe()
