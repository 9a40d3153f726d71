"""Makes the table of `mufe calibrate`: what a ball between platens bears, in numbers without units.

    python -m mufe_fenicsx.verification.axisymmetric.response FILE

takes 25 minutes on one core. Half of a ball stands on its plane of symmetry, on which it slides
freely, and a rigid plane comes down on its pole. The material hardens linearly. Lengths are over
the radius R, stresses over E* = E/(1 - ν²), forces over that of Hertz at the same approach.
"""

import csv
import gc
import itertools
import math
import sys
from pathlib import Path

import numpy as np
from petsc4py import PETSc

from ...materials.j2 import J2
from .solver import Ball

#: Yield stress over E*, and slope of hardening over the yield stress.
YIELD = 10.0 ** (-4.5 + np.arange(1, 11) / 3)
HARDENING = (0.0, 4.0, 12.0, 40.0, 120.0, 400.0, 1200.0, 4000.0)
NU = (0.15, 0.35)
#: Largest approaches over R, each with a mesh of its own.
LARGEST = (0.01, 0.04, 0.0025)
#: Edges per contact radius at the end, how much shorter they are on the surface, steps.
ELEMENTS, SURFACE, STEPS = 8, 4, 16
#: The first step that is kept: an eighth of the edges.
FIRST = 4


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


def main():
    path = Path(sys.argv[1])
    made = set()
    if path.exists():
        with open(path, encoding="utf-8", newline="") as file:
            made = {
                tuple(map(float, row[:4])) for row in itertools.islice(csv.reader(file), 1, None)
            }
    else:
        path.write_text("nu,yield,hardening,largest,approach,ratio,strain\n", encoding="utf-8")
    for nu, largest, Y, k in itertools.product(NU, LARGEST, YIELD, HARDENING):
        name = (nu, float(f"{Y:.6g}"), k, largest)
        if name in made:
            continue
        try:
            rows = converged(nu, Y, k, largest)
        except RuntimeError as error:
            print(name, error, flush=True)
            continue
        with open(path, "a", encoding="utf-8") as file:
            for row in rows:
                file.write(",".join(f"{x:.6g}" for x in (*name, *row)) + "\n")
        print(name, rows[-1], flush=True)
        gc.collect()
        PETSc.garbage_cleanup()


if __name__ == "__main__":
    main()
