"""A flat tetrahedron in a mesh of thick ones.

The bound of elements falls as its altitude, the limit of the system as the root.
"""

import math
from types import SimpleNamespace

import numpy as np

from ...geometry.bodies.shapes import box
from ...materials.elastic import Elastic
from ...mesh import create_grain_mesh
from ...run.from_bodies import build
from ...theory.stability import cap_step
from ..case import case, compare
from .limits import NEVER, NU, RHO, SIZE, E, Snapshot, bisect, growth, highest_frequency, message_of

#: Altitude of the flat element over that of the others.
ALTITUDES = (1e-5, 1e-4, 1e-3, 0.003, 0.01, 0.03, 0.1, 0.25)


def body_with_cap(part, divisions=3):
    """A cube one of whose inner tetrahedra is four, the flattest ``part`` of its altitude high.

    Returns:
        Points, cells, and the flat cell: apex last.
    """
    points, cells = box((SIZE,) * 3, (divisions,) * 3)
    middle = points[cells].mean(axis=1)
    e = int(np.linalg.norm(middle - 0.5 * SIZE, axis=1).argmin())
    a, b, c, d = cells[e]
    apex = len(points)
    # Near the middle of a, b, c: the altitude above it is the part that d counts for.
    weights = np.array([(1 - part) / 3] * 3 + [part])
    points = np.vstack([points, weights @ points[cells[e]]])
    new = [[a, b, c, apex], [a, b, apex, d], [a, apex, c, d], [apex, b, c, d]]
    cells = np.vstack([np.delete(cells, e, axis=0), new])
    return points, cells, np.array(new[0])


def sliver_map(comm, altitudes=ALTITUDES, trials=12):
    """One row for each altitude: limits [s] measured, exact, by Lanczos, of elements, by theory."""
    material = Elastic(E, NU, RHO)
    rows, simulations = [], []
    for part in altitudes:
        points, cells, flat = body_with_cap(part)
        s = build(
            comm, [(points, cells)], material, np.zeros(3), np.zeros(3), axes="", element="p1",
            refresh=NEVER,
        )  # fmt: skip
        node = [int(np.linalg.norm(s.mesh.x - points[i], axis=1).argmin()) for i in flat]
        x = s.mesh.x[node]
        area = 0.5 * np.linalg.norm(np.cross(x[1] - x[0], x[2] - x[0]))
        altitude = abs(np.linalg.det(x[1:] - x[0])) / (2 * area)
        exact = 2.0 / highest_frequency(s, springs=False)
        start = Snapshot(s)
        measured = bisect(lambda f, s=s, a=start, e=exact: growth(s, a, f * e)[1], 0.5, 1.5, trials)
        mass = s.solid.mass[node]
        rows.append(
            SimpleNamespace(
                part=part, altitude=altitude, exact=exact, measured=measured * exact,
                lanczos=2.0 / s.stable.highest(), element=s.dt_element,
                theory=float(
                    cap_step(altitude, area, material.constrained_modulus, mass[3], mass[:3])
                ),
            )
        )  # fmt: skip
        simulations.append(s)
    return rows, simulations


def messages(comm):
    """What the program says to elements without volume, and how it describes flat ones."""
    points, cells, flat = body_with_cap(0.25)
    base = points[flat[:3]].mean(axis=0)
    none, tangled = points.copy(), points.copy()
    none[flat[3]] = base
    tangled[flat[3]] += 2.0 * (base - points[flat[3]])

    def load(x):
        grain = np.zeros(len(cells), dtype=int)
        return create_grain_mesh(comm, x, cells, grain, np.array([1]), np.array([0]))

    return {"no volume": message_of(load, none), "tangled": message_of(load, tangled)}


@case("stability-slivers", num_bodies=1)
def slivers(comm, trials=10):
    """One flat tetrahedron: the limit falls as the root of its altitude, the elements' bound as it.

    Args:
        comm: MPI communicator.
        trials: Bisections.
    """
    rows, simulations = sliver_map(comm, (1e-4, 1e-3, 0.01), trials)
    results = {}
    for row in rows:
        name = f"altitude {row.part:g}"
        # Little of the noise is in the one mode of a light apex: it needs more steps to show.
        results[f"{name}: measured limit over 2/ω"] = compare(row.measured / row.exact, 1.0, 0.02)
        # Of a flat element: the others add their stiffness, 0.4 of √altitude.
        results[f"{name}: limit against the swinging apex"] = compare(
            row.exact, row.theory, 0.01 + 0.4 * math.sqrt(row.part)
        )
        results[f"{name}: Lanczos over 2/ω"] = compare(row.lanczos / row.exact, 1.0, 0.02)
    ratio = rows[0].element / rows[1].element
    results["bound of elements falls as the altitude"] = compare(ratio, 0.1, 0.01)
    said = messages(comm)
    for name, text in said.items():
        results[f"refused: {name}"] = compare(float(bool(text)), 1.0, 0.0)
    return results, simulations
