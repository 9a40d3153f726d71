"""Plates and needles bend only with elements through their thickness, which a plan says."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.grains import Grains, save_grains
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.planning.errors import sample_errors
from mufe_fenicsx.planning.reasons import unknown
from mufe_fenicsx.planning.sample import read_sample
from mufe_fenicsx.run.from_bodies import build
from tests.planning.samples import scene

THICK, LONG = 1e-3, 8e-3


def needle(through):
    return box((LONG, THICK, THICK), (8 * through, through, through))


@pytest.mark.parametrize(("through", "part"), [(1, 0.34), (2, 0.67)])
def test_a_cantilever_bends_as_little_as_plans_say(through, part):
    """Under its weight w a length: w L⁴/8EI + w L²/(2 · 5/6 GA), E = 2.4 G (Timoshenko)."""
    wall = Wall("held", np.zeros(3), np.eye(3)[0], bonded=True)
    rock = Elastic(1e9, 0.2, 2500.0)
    s = build(MPI.COMM_SELF, [needle(through)], rock, (0, 0, 0), (LONG, THICK, THICK), "",
              walls=[wall], increment=1e-4, stabilisation=0.0, gravity=[0, 0, -10.0])  # fmt: skip
    s.step()
    tip = -s.state.u[s.state.x[:, 0] > 0.999 * LONG, 2].mean()
    w = rock.rho * 10.0 * THICK**2
    bent = w * LONG**4 / (8 * rock.E * THICK**4 / 12)
    bent += w * LONG**2 / (2 * 5 / 6 * rock.E / 2.4 * THICK**2)
    assert tip / bent == pytest.approx(part, abs=0.01)


def test_slender_grains_are_counted_and_told(tmp_path, table):
    bodies = [needle(2), needle(4), box((THICK,) * 3, (2, 2, 2))]
    grains = Grains.from_list([1, 2, 3], bodies, 0.5 * THICK, np.array([[0, 0, 0], [LONG] * 3]))
    save_grains(tmp_path / "grains", grains)
    assert read_sample(tmp_path / "grains").slender == 2
    errors = sample_errors(table, yields=True)
    assert any("how 2 plates and needles bend" in line for line in unknown(scene(), errors, 1, 2))
