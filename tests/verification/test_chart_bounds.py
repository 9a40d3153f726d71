"""Points of charts of a cylinder wall, a tool and a membrane, and their figure."""

import pytest
from mpi4py import MPI

from mufe_fenicsx.analysis.evidence import read_points
from mufe_fenicsx.theory import hertz
from mufe_fenicsx.verification.cases import run_cases
from mufe_fenicsx.verification.charts import bounds
from mufe_fenicsx.verification.charts.draw import draw_side_by_side
from mufe_fenicsx.verification.charts.grid import CHARTS
from mufe_fenicsx.verification.hertz_bodies import RADIUS, E, whole_contact

CASES = ("cylinder-wall", "tool", "membrane")


def test_contact_and_ball_in_series_are_the_whole_ball_on_a_plane():
    """From whose compliance it is made: exact at its own contact radius, to the grid of 2000."""
    a, nu = 0.03 * RADIUS, 0.22
    stiffness = hertz.hertz_force(1.0, RADIUS, hertz.effective_modulus((E, nu)))
    whole = whole_contact("sphere-plane", a, nu)
    found = bounds.force_on_ball(whole.delta, stiffness, a, nu)
    assert found == pytest.approx(whole.force, rel=1e-5)
    # The ball itself is 1 % of it: without it the test would say nothing.
    assert abs(stiffness * whole.delta**1.5 / whole.force - 1) > 3e-3


@pytest.mark.parametrize(
    ("case", "parameters"),
    [
        ("cylinder-wall-point", {"elements_per_radius": "2", "added_mass": "0.01"}),
        pytest.param(
            "tool-point", {"elements_per_radius": "1.5", "integrator": "static"},
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "membrane-point", {"ends_over_t": "1", "layers": "1"}, marks=pytest.mark.slow
        ),
    ],
)  # fmt: skip
def test_points_repeat_their_rows(case, parameters):
    """Each error is that of the stored table."""
    (answer,) = run_cases([case], parameters, MPI.COMM_SELF)
    (row,) = (p for p in read_points() if f"{p.case}-point" == case and p.parameters == parameters)
    # Rounding differs between processors; six digits are stored.
    assert answer["results"]["error"]["computed"] == pytest.approx(row.error, rel=1e-3)
    assert answer["num_cells"] >= row.num_cells and answer["num_steps"] == row.num_steps


@pytest.mark.parametrize("cases", [CASES, pytest.param(tuple(CHARTS), marks=pytest.mark.slow)])
def test_cases_stand_side_by_side(cases, tmp_path):
    """Two costs each, three abreast; all of them too."""
    found = draw_side_by_side(read_points(), cases, tmp_path)
    assert [p.name for p in found] == ["cases.png", "cases.pdf"]
    assert all(p.stat().st_size for p in found)
