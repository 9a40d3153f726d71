"""Makes the table of `mufe calibrate`: what a ball between platens bears, in numbers without units.

    python -m mufe_fenicsx.verification.axisymmetric.response FILE TABLE

takes about 25 minutes on one core, goes on with the balls that FILE has, and writes TABLE from it.
Half of a ball stands on its plane of symmetry, on which it slides freely, and a rigid plane comes
down on its pole. The material hardens linearly. Lengths are over the radius R, stresses over
E* = E/(1 - ν²), forces over that of Hertz at the same approach.
"""

import csv
import itertools
import math
import sys
from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator

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
#: The first step that is kept: half of the edges.
FIRST = 8


def press(nu, Y, k, largest, steps):
    """Approach, force over that of Hertz and largest plastic strain, shape (steps, 3). One rank."""
    E = 1e11
    modulus = E / (1 - nu**2)
    material = J2(E, nu, 2650.0, ((0.0, Y * modulus), (1.0, Y * modulus * (1 + k))))
    # An elastic contact has √δ; what flows piles up.
    elastic = largest < 4 * (2.5 * Y) ** 2
    radius = (1.05 if elastic else 1.45) * math.sqrt(largest)
    ball = Ball(material, radius, ELEMENTS, SURFACE)
    rows = []
    for i in range(1, steps + 1):
        state = ball.press(largest * (i / steps) ** 2)
        hertz = 4 / 3 * state.delta**1.5 / (1 - nu**2)
        rows.append((state.delta, state.force / hertz, state.strain.max()))
    return np.array(rows)


def converged(nu, Y, k, largest):
    """The same at every second step, drawn on to steps of no length: radial return is of order 1.

    Strains are as they are.
    """
    many, few = (press(nu, Y, k, largest, n) for n in (STEPS, STEPS // 2))
    many = many[1::2]
    many[:, 1] = 2 * many[:, 1] - few[:, 1]
    return many[FIRST // 2 - 1 :]


def grid_of(rows):
    """The grid of the table from pressed balls: φ and strain at (ν, Y, k, δ).

    Of an approach that two meshes reach, the mesh made for the smaller contact counts. The other
    Poisson's ratio differs by little: its difference, on the same meshes, is interpolated from
    fewer points.

    Args:
        rows: (ν, Y, k, largest, approach, ratio, strain) of each step that is kept.

    Returns:
        A list of (ν, Y, k, approach, ratio, strain).
    """
    raw = {}
    for nu, Y, k, largest, delta, ratio, strain in rows:
        if delta > 0.249 * largest:
            raw.setdefault((nu, Y, k), {})[float(f"{delta:.5g}"), largest] = ratio, strain
    keys = sorted((Y, k) for nu, Y, k in raw if nu == NU)
    few = [sorted({key[i] for key in raw if key[0] == OTHER_NU}) for i in (1, 2)]
    deltas = np.unique([delta for delta, _ in raw[NU, *keys[0]]])
    change = np.array([[_change(raw[NU, Y, k], raw[OTHER_NU, Y, k], deltas) for k in few[1]]
                       for Y in few[0]])  # fmt: skip
    between = RegularGridInterpolator((np.log(few[0]), _slope(few[1])), change)
    made = []
    for Y, k in keys:
        at = np.log(np.clip(Y, few[0][0], few[0][-1])), _slope(np.clip(k, 0.0, few[1][-1]))
        # The mesh of the smaller contact comes first.
        own = [min((largest, *raw[NU, Y, k][d, largest]) for d, largest in raw[NU, Y, k] if d == x)
               for x in deltas]  # fmt: skip
        for nu, more in ((NU, np.zeros(deltas.size)), (OTHER_NU, between(at).ravel())):
            made += [
                (nu, Y, k, delta, ratio * math.exp(m), strain)
                for delta, m, (_, ratio, strain) in zip(deltas, more, own, strict=True)
            ]
    return sorted(made)


def _change(ball, other, deltas):
    """Logarithm of the ratio of forces of two balls on the same meshes, at approaches."""
    same = {delta: math.log(other[delta, mesh][0] / ball[delta, mesh][0]) for delta, mesh in other}
    at = sorted(same)
    return np.interp(np.log(deltas), np.log(at), [same[delta] for delta in at])


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
