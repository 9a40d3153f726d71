"""A sleeve that folds: with contact of its own it stays on its side of itself."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.geometry.bodies.sleeve import sleeve
from mufe_fenicsx.loading.membrane import Membrane
from mufe_fenicsx.loading.oedometer import smooth_step
from mufe_fenicsx.materials.neo_hookean import NeoHookean
from mufe_fenicsx.run.from_bodies import build

R, H, T, EDGE = 2e-3, 4e-3, 0.1e-3, 0.3e-3
UP, LATEX = np.array([0.0, 0.0, 1.0]), NeoHookean()


def middle_surface(mesh):
    """Inner nodes, the outer ones across the sheet, and the facets of the inner ones."""
    r, angle = np.hypot(*mesh.x[:, :2].T), np.arctan2(mesh.x[:, 1], mesh.x[:, 0])
    inner, outer = (np.flatnonzero(side) for side in (r < R + 0.5 * T, r > R + 0.5 * T))
    turned = np.round(angle, 6) % (2 * np.pi - 1e-6)
    order = [n[np.lexsort((turned[n], np.round(mesh.x[n, 2], 9)))] for n in (inner, outer)]
    across = np.full(mesh.num_nodes, -1)
    across[order[0]] = order[1]
    return order[0], order[1], mesh.facets[(across[mesh.facets] >= 0).all(axis=1)]


def num_crossings(y, facets):
    """Edges that pass through facets which do not share a node with them: all against all."""
    pairs = np.vstack([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]])
    a, b, c = (y[facets[:, i]] for i in range(3))
    n, count = np.cross(b - a, c - a), 0
    for p, q in np.unique(np.sort(pairs, axis=1), axis=0):
        above = [np.einsum("ni,ni->n", y[end] - a, n) for end in (p, q)]
        away = ~((facets == p) | (facets == q)).any(axis=1)
        k = np.flatnonzero(away & (above[0] * above[1] < 0.0))
        part = above[0][k] / (above[0][k] - above[1][k])
        at = y[p] + part[:, None] * (y[q] - y[p])
        sides = [
            np.einsum("ni,ni->n", np.cross(v[k] - u[k], at - u[k]), n[k]) > 0.0
            for u, v in ((a, b), (b, c), (c, a))
        ]
        count += int(np.logical_and.reduce(sides).sum())
    return count


@pytest.mark.slow
@pytest.mark.parametrize("self_contact", [True, False])
def test_a_slack_sleeve_that_folds_does_not_pass_through_itself(self_contact):
    """An empty sleeve buckles under its cell and is shortened by 70 %: its walls meet and fold.

    Its middle surface crosses itself only where contact is off, and then in hundreds of places.
    """
    walls = [
        Wall("bottom", np.zeros(3), UP, bonded=[1]),
        Wall("top", H * UP, -UP, bonded=[1]),
    ]
    rate = (LATEX.E / LATEX.rho) ** 0.5 / R  # of its breathing
    s = build(
        MPI.COMM_SELF, [sleeve(R, T, H, EDGE)], LATEX, [0] * 3, [0] * 3, "", walls=walls,
        damping=rate, sleeves=["side"], self_contact=self_contact, points="nodes",
    )  # fmt: skip
    membrane, duration, found = Membrane(s, 1), 80.0 / rate, []
    inner, outer, facets = middle_surface(s.mesh)
    np.testing.assert_allclose(s.mesh.x[outer, :2] * R / (R + T), s.mesh.x[inner, :2], atol=1e-9)
    while s.state.t < 0.9 * duration:
        now, then = s.state.t / duration, (s.state.t + s.dt) / duration
        membrane.set_pressure(3e3 * smooth_step(min(2.0 * now, 1.0)))
        s.walls.velocity[1] = -UP * 0.7 * H * (smooth_step(then) - smooth_step(now)) / s.dt
        s.step()
        if s.state.num_steps % 1000 == 0:
            y = s.state.x.copy()
            y[inner] = 0.5 * (y[inner] + y[outer])
            found.append(num_crossings(y, facets))
    energies = s.energies()
    fed = energies["work"] - energies["energy_cell_pressure"]
    # Points that come upon a fold between two steps: a part of what they press with.
    assert abs(energies["residual"]) < 0.01 * fed
    if self_contact:
        assert energies["contact"] > 0.0 and max(found) == 0
    else:
        assert found[0] == 0 and found[-1] > 50
