"""Closed cycles of elastic strain in grains that turn, and the energy that they leave."""

import math
from types import SimpleNamespace

import numpy as np

from ..materials.elastic import Elastic
from ..theory.hypoelastic import residual_strain, residual_strain_bound
from .case import case, compare
from .strain_paths import Tets, rotations, tensor

MATERIALS = [Elastic(100e9, nu, 2650.0) for nu in (0.0, 0.15, 0.3, 0.45)]


@case("strain-cycle", num_bodies=1)
def strain_cycle(comm, paths=48, strain=0.01, steps=6400, largest=0.1, seed=3):
    """Closed cycles of elastic strain while the grain turns once: energy gained or lost.

    The path is F = R(t) exp e(t): e runs once around an ellipse in a random plane of strains and
    back to zero, R makes a whole turn about a random axis. Two errors are told apart.

    The rate form. The deviator follows a rate, so it is not a function of the strain, and a
    closed cycle leaves a stress; but its energy is a function of that stress and takes up all
    work, so none comes from nowhere: what a cycle loses lies in the stress that it leaves.
    That is up to 0.33 a⁴ of the peak for these cycles of strains up to a, so 1e-6 holds up to
    strains of 0.04. By theory it is below (⅔ a l)² for any cycle of length l
    (theory.hypoelastic); for round ones, l = π a, that is 4.4 a⁴, and 1e-6 holds up to
    0.02 in any case. n like cycles leave n² times that. Were the rate that of Cauchy stress instead
    of Kirchhoff's, energy of 0.8 a of the peak would come from nowhere in each cycle.

    The steps. Work is summed as ½ (f + f') (x' - x), as the time steps do it: the error is
    up to 0.5 θ² of the peak for a turn by θ a step, of second order and the same for all
    strains. 1e-6 holds up to θ = 1.4e-3; a grain that turns once in a thousand steps errs by 2e-5.

    Args:
        comm: MPI communicator.
        paths: Number of cycles.
        strain: Norm of the logarithmic strain at which the energy is balanced.
        steps: Steps of a cycle there; the rate form is looked at with a fourth of them.
        largest: The largest strain of those by which orders are fitted.
        seed: Of the random numbers.
    """
    rng = np.random.default_rng(seed)
    planes = [_units(rng, paths), _units(rng, paths)]
    axis = rng.normal(size=(paths, 3))
    axis *= 2 * math.pi / np.linalg.norm(axis, axis=1)[:, None]

    half = _cycle(comm, planes, axis, strain, max(steps // 2, 1))
    whole = _cycle(comm, planes, axis, strain, steps)
    missing = [np.abs((c.work - c.stored) / c.peak).max() for c in (half, whole)]
    angle = 2 * math.pi / steps
    results = {
        # The target, where steps are fine enough for it.
        f"strain {strain:g}: energy gained or lost, over the peak": compare(
            np.abs(whole.work / whole.peak).max(),
            0.0,
            max(1e-6, 0.6 * angle**2) + 0.34 * strain**4,
            scale=1.0,
        ),
        # What is neglected is of fourth order.
        "energy that steps leave out: order in their length": compare(
            math.log2(missing[0] / missing[1]), 2.0, max(0.02, angle), scale=1.0
        ),
    }
    simulations, sizes, left, few = [half, whole], [0.03 * largest, largest], [], steps // 4
    for a in sizes:
        c = _cycle(comm, planes, axis, a, few)
        e = np.array([_ellipse(planes, a, t) for t in np.linspace(0, 1, 4001)])[:, c.number]
        e -= np.trace(e, axis1=2, axis2=3)[..., None, None] / 3 * np.eye(3)
        theory = residual_strain(e)
        bound = residual_strain_bound(
            np.linalg.norm(e, axis=(2, 3)).max(axis=0),
            np.linalg.norm(np.diff(e, axis=0), axis=(2, 3)).sum(axis=0),
        )
        largest_left = np.linalg.norm(theory, axis=(1, 2)).max()
        results |= {
            # The expansion neglects a² of it; the steps turn by 2π/n: their square.
            f"strain {a:g}: residual strain against theory": compare(
                np.linalg.norm(c.strain - theory, axis=(1, 2)).max() / largest_left,
                0.0,
                a**2 + (2 * math.pi / few) ** 2,
                scale=1.0,
            ),
            f"strain {a:g}: residual strain over its bound, 1 or less": compare(
                max((np.linalg.norm(c.strain, axis=(1, 2)) / bound).max(), 1.0), 1.0, 0.0
            ),
            # The bound for round cycles; ellipses of random planes stay below.
            f"strain {a:g}: energy left over the peak and a⁴": compare(
                (c.stored / c.peak).max() / a**4, 0.0, 4.4, scale=1.0
            ),
        }
        left.append((c.stored / c.peak).max())
        simulations.append(c)
    results["energy left: order in the strain"] = compare(
        math.log(left[1] / left[0]) / math.log(sizes[1] / sizes[0]), 4.0, 0.05, scale=1.0
    )
    return results, simulations


def _units(rng, n):
    A = rng.normal(size=(n, 3, 3))
    A = A + A.transpose(0, 2, 1)
    return A / np.linalg.norm(A, axis=(1, 2))[:, None, None]


def _ellipse(planes, a, t):
    """Logarithmic strains after the part ``t`` of the cycle, zero at both ends."""
    A, B = planes
    turn = 2 * math.pi * t
    return 0.5 * a * ((1 - math.cos(turn)) * A + math.sin(turn) * B)


def _cycle(comm, planes, axis, a, num_steps):
    """One cycle: work, energy stored at the end and at most [J], and the strain left."""
    materials = [MATERIALS[k % len(MATERIALS)] for k in range(len(axis))]
    tets = Tets(comm, materials)
    planes, axis = [plane[tets.number] for plane in planes], axis[tets.number]
    cells, s = tets.mesh.cells, tets.state
    work, peak = np.zeros(len(cells)), np.zeros(len(cells))
    for k in range(1, num_steps + 1):
        t = k / num_steps
        values, vectors = np.linalg.eigh(_ellipse(planes, a, t))
        U = (vectors * np.exp(values)[:, None]) @ vectors.transpose(0, 2, 1)
        x, f = s.x[cells], tets.force[cells]
        tets.step(rotations(t * axis) @ U)
        work -= 0.5 * ((f + tets.force[cells]) * (s.x[cells] - x)).sum(axis=(1, 2))
        peak = np.maximum(peak, tets.solid.elastic_energy(s))
    G = np.array([m.shear_modulus for m in tets.materials])
    return SimpleNamespace(
        mesh=tets.mesh,
        state=s,
        number=tets.number,
        work=work,
        peak=peak,
        stored=tets.solid.elastic_energy(s),
        strain=tensor(s.deviator) / (2 * G[:, None, None]),
    )
