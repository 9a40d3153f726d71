"""Elements that turn inside out: the speed it takes, and how soon the program sees it."""

import math
from types import SimpleNamespace

import numpy as np

from ...errors import SolverError
from ...geometry.bodies.shapes import box, tetrahedron
from ...materials.elastic import Elastic
from ...materials.j2 import J2
from ...run.from_bodies import build, distribute, drive
from ...theory.stability import inversion_speed
from ..case import case, compare
from .limits import NEVER, NU, RHO, SIZE, E, bisect

#: Yield stress over E of the tetrahedron: what it takes up by flow is no more than that.
SOFT = 1e-6
RATIOS = (0.0, 0.15, 0.3, 0.45)


class _Shot:
    """One tetrahedron whose apex is shot at its base."""

    def __init__(self, comm, nu, yield_stress):
        points, cells = tetrahedron(SIZE)
        self.material = (
            J2(E, nu, RHO, ((0.0, yield_stress),)) if yield_stress else Elastic(E, nu, RHO)
        )
        self.mesh = distribute(comm, [(points, cells)])
        self.comm, self.last = comm, None
        self.axis = points[0] / np.linalg.norm(points[0])
        away = np.linalg.norm(self.mesh.x - points[0], axis=1)
        self.apex = int(away.argmin())

    def inverts(self, speed, steps_per_edge=1500):
        """Whether it does at a speed of the apex against the base [m/s]."""
        s = build(
            self.comm, [(self.mesh.x.copy(), self.mesh.cells.astype(np.int64))], self.material,
            np.zeros(3), np.zeros(3), axes="", element="p1", refresh=NEVER,
        )  # fmt: skip
        apex = int(np.linalg.norm(s.mesh.x - self.mesh.x[self.apex], axis=1).argmin())
        s.state.v[:] = 0.25 * speed * self.axis
        s.state.v[apex] = -0.75 * speed * self.axis
        self.last = s
        s.limit.schedule.margin = math.inf  # the step stays as it is set, and nothing else stops it
        height = math.sqrt(2 / 3) * SIZE
        s.dt = height / speed / steps_per_edge
        for k in range(3 * steps_per_edge):
            s.step()
            if s.solid.inverted >= 0:
                return True
            if k % 50 == 0 and self._opening(s, apex):
                return False
        return False

    def _opening(self, s, apex):
        others = np.delete(np.arange(4), apex)
        return (s.state.v[apex] - s.state.v[others].mean(axis=0)) @ self.axis > 0


def inversion_map(comm, ratios=RATIOS, trials=10):
    """Speed at which a soft tetrahedron inverts, measured and of theory, by Poisson's ratio."""
    rows, simulations = [], []
    for nu in ratios:
        shot = _Shot(comm, nu, SOFT * E)
        theory = float(inversion_speed(shot.material.bulk_modulus, RHO))
        measured = bisect(lambda v, f=shot, t=theory: f.inverts(v * t), 0.6, 1.6, trials)
        rows.append(SimpleNamespace(nu=nu, theory=theory, measured=measured * theory))
        simulations.append(shot.last)
    return rows, simulations


def crushed(comm, strain=1.2, refresh=400):
    """A cube whose platens pass each other: the program's words, strain, steps since inversion."""
    material = Elastic(E, NU, RHO)
    s = build(
        comm, [box((SIZE,) * 3, (2, 2, 2))], material, np.zeros(3), np.full(3, SIZE), axes="z",
        refresh=refresh,
    )  # fmt: skip
    inverted = []

    def watch():
        if s.solid.inverted >= 0 and not inverted:
            inverted.append(s.state.num_steps)

    try:
        drive(s, {"z_max": (0, 0, -strain * SIZE)}, 20 * SIZE / material.wave_speed, at_step=watch)
    except SolverError as error:
        reached = 1 - (s.walls.point[1, 2] - s.walls.point[0, 2]) / SIZE
        late = s.state.num_steps - inverted[0] if inverted else 0
        return SimpleNamespace(message=str(error), strain=reached, late=late, simulation=s)
    return SimpleNamespace(message="", strain=strain, late=math.inf, simulation=s)


@case("stability-inversion", num_bodies=1)
def inversion(comm, trials=8):
    """A soft tetrahedron turns inside out where its motion has the energy K V, and is noticed.

    Args:
        comm: MPI communicator.
        trials: Bisections.
    """
    rows, simulations = inversion_map(comm, (0.15, 0.45), trials)
    results = {}
    for row in rows:
        # Flow takes up a little: the yield stress is 1e-6 E. The logarithm is steep at J = 0, and a
        # step is 1/1500 of the height.
        results[f"ν = {row.nu:g}: speed over √(32 K/3ρ)"] = compare(
            row.measured / row.theory, 1.0, 0.05
        )
    found = crushed(comm)
    results["a crushed cube: the program says so"] = compare(float(bool(found.message)), 1.0, 0.0)
    results["a crushed cube: steps until then, at most one interval of checks"] = compare(
        found.late, 0.0, 400, scale=1.0
    )
    return results, [*simulations, found.simulation]
