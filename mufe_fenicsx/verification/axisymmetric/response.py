"""Makes the table of `mufe calibrate`: what a ball between platens bears, in numbers without units.

    python -m mufe_fenicsx.verification.axisymmetric.response FILE TABLE

takes about 25 minutes on one core, goes on with the balls that FILE has, and writes TABLE from it.
Half of a ball stands on its plane of symmetry, on which it slides freely, and a rigid plane comes
down on its pole. The material hardens linearly. Lengths are over the radius R, stresses over
E* = E/(1 - ν²), forces over that of Hertz at the same approach.
"""

import csv
import gc
import itertools
import math
import sys
from pathlib import Path

import numpy as np
from petsc4py import PETSc
from scipy.interpolate import RegularGridInterpolator, interp1d

from ...calibration.ball import KNEE
from ...materials.j2 import J2
from .solver import Ball

#: Yield stress over E*, and slope of hardening over the yield stress.
YIELD = 10.0 ** (-4.5 + np.arange(1, 11) / 3)
HARDENING = (0.0, 4.0, 12.0, 40.0, 120.0, 400.0, 1200.0, 4000.0)
#: Poisson's ratio of the whole grid, and one of fewer points.
NU, OTHER_NU = 0.15, 0.35
#: Largest approaches over R, each with a mesh of its own, and those of the other Poisson's ratio.
LARGEST, OTHER_LARGEST = (0.04, 0.01, 0.0025), (0.04, 0.0025)
#: Edges per contact radius at the end, how much shorter they are on the surface, steps.
ELEMENTS, SURFACE, STEPS = 8, 4, 16
#: Added to strains before their logarithm.
LEAST = 1e-6
#: The first step that is kept: half of the edges.
FIRST = 8


def press(nu, Y, k, largest, steps=STEPS, elements=ELEMENTS, surface=SURFACE):
    """Approach, force over that of Hertz and largest plastic strain, shape (steps, 3). One rank."""
    E = 1e11
    modulus = E / (1 - nu**2)
    material = J2(E, nu, 2650.0, ((0.0, Y * modulus), (1.0, Y * modulus * (1 + k))))
    # An elastic contact has √δ; what flows piles up.
    elastic = largest < 4 * (2.5 * Y) ** 2
    radius = (1.05 if elastic else 1.45) * math.sqrt(largest)
    ball = Ball(material, radius, elements, surface, "smooth")
    rows = []
    for i in range(1, steps + 1):
        state = ball.press(largest * (i / steps) ** 2)
        hertz = 4 / 3 * state.delta**1.5 / (1 - nu**2)
        rows.append((state.delta, state.force / hertz, state.strain.max()))
    return np.array(rows)


def converged(nu, Y, k, largest, steps=STEPS, **options):
    """The same at every second step, drawn on to steps of no length: radial return is of order 1.

    Strains are as they are.
    """
    many, few = (press(nu, Y, k, largest, n, **options) for n in (steps, steps // 2))
    many = many[1::2]
    many[:, 1] = 2 * many[:, 1] - few[:, 1]
    return many[FIRST // 2 - 1 :]


def grid_of(rows):
    """The grid of the table from pressed balls: φ and strain at (ν, Y, k, δ).

    Of an approach that two meshes reach, the mesh made for the smaller contact counts. The other
    Poisson's ratio differs by little: its difference is interpolated from fewer points.

    Args:
        rows: (ν, Y, k, largest, approach, ratio, strain) of each step that is kept.

    Returns:
        A list of (ν, Y, k, approach, ratio, strain).
    """
    best = {}
    for nu, Y, k, largest, delta, ratio, strain in rows:
        if delta < 0.249 * largest:
            continue
        key = nu, Y, k
        place = float(f"{delta:.5g}")
        found = best.setdefault(key, {})
        if place not in found or largest < found[place][0]:
            found[place] = largest, math.log(ratio), math.log(strain + LEAST)
    deltas = sorted({delta for found in best.values() for delta in found})
    full = {}
    for (nu, Y, k), found in best.items():
        known = sorted(found)
        values = np.array([found[delta][1:] for delta in known])
        full[nu, Y, k] = interp1d(np.log(known), values, axis=0)(np.log(deltas))
    yields, ks = (sorted({key[i] for key in full if key[0] == NU}) for i in (1, 2))
    few_yields, few_ks = (sorted({key[i] for key in full if key[0] == OTHER_NU}) for i in (1, 2))
    change = np.array([[full[OTHER_NU, Y, k][:, 0] - full[NU, Y, k][:, 0] for k in few_ks]
                       for Y in few_yields])  # fmt: skip
    between = RegularGridInterpolator((np.log(few_yields), _slope(few_ks)), change)
    made = []
    for Y in yields:
        for k in ks:
            at = (
                np.clip(np.log(Y), *np.log(few_yields)[[0, -1]]),
                np.clip(_slope(k), *_slope(few_ks)[[0, -1]]),
            )
            for nu, more in ((NU, 0.0), (OTHER_NU, between(at)[0])):
                log_ratio, log_strain = full[NU, Y, k].T
                ratio, strain = np.exp(log_ratio + more), np.exp(log_strain) - LEAST
                made += [(nu, Y, k, d, r, max(e, 0.0))
                         for d, r, e in zip(deltas, ratio, strain, strict=True)]  # fmt: skip
    return sorted(made)


def _slope(k):
    return np.log1p(np.asarray(k, dtype=float) / KNEE)


def main():
    """Press the balls that FILE has not yet; then write TABLE from all of them."""
    path, table = Path(sys.argv[1]), Path(sys.argv[2])
    if not path.exists():
        path.write_text("nu,yield,hardening,largest,approach,ratio,strain\n", encoding="utf-8")
    made = {row[:4] for row in _read(path)}
    balls = [*itertools.product([OTHER_NU], OTHER_LARGEST, YIELD[1:], HARDENING[::2])]
    balls += itertools.product([NU], LARGEST, YIELD[::-1], HARDENING)
    for nu, largest, Y, k in balls:
        name = (nu, float(f"{Y:.6g}"), k, largest)
        if name in made:
            continue
        try:
            rows = converged(nu, Y, k, largest)
        except RuntimeError as error:
            print(name, error, flush=True)
            continue
        with open(path, "a", encoding="utf-8") as file:
            file.writelines(_line((*name, *row), 6) for row in rows)
        print(name, rows[-1], flush=True)
        gc.collect()
        PETSc.garbage_cleanup()
    with open(table, "w", encoding="utf-8") as file:
        file.write("nu,yield,hardening,approach,ratio,strain\n")
        file.writelines(_line(row, 5) for row in grid_of(_read(path)))


def _read(path):
    with open(path, encoding="utf-8", newline="") as file:
        return [tuple(map(float, row)) for row in itertools.islice(csv.reader(file), 1, None)]


def _line(row, digits):
    return ",".join(f"{x:.{digits}g}" for x in row) + "\n"


if __name__ == "__main__":
    main()
