"""Points of the evidence, and the errors that follow from them, by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.analysis import evidence
from mufe_fenicsx.analysis.evidence import cheapest, cost_at, pareto
from mufe_fenicsx.cli.arguments import number_or_text
from mufe_fenicsx.planning.errors import GRAINS, falling, of_loading, sample_errors, time_for
from mufe_fenicsx.verification.cases import run_cases
from tests.planning.samples import point, sample


def test_front_of_the_best():
    """Of five points three are beaten by none: 1 s 10 %, 2 s 4 %, 8 s 1 %."""
    a, b, c, d, e = (point(*v) for v in [(0.1, 1), (0.12, 1.5), (0.04, 2), (0.05, 3), (0.01, 8)])
    assert pareto([d, e, b, c, a]) == [a, c, e]
    assert cheapest([a, b, c, d, e], 0.05) is c
    assert cheapest([a, b, c, d, e], 0.005) is None
    # Increments have no element-steps: wherever they stand, they are not of that front.
    some = replace(b, error=0.001, element_steps=math.nan)
    for points in ([d, some, b, c, e, a], [some, d, e, b, c, a], [a, b, c, some, d, e]):
        assert pareto(points, "element_steps") == [a, c, e]


def test_cost_at_an_error_lies_on_a_straight_line_of_logarithms():
    """Error 0.1 to 0.01 while cost grows 1 to 100: at 0.0316 it is 10, and no more is known."""
    points = [point(0.1, 1.0), point(0.01, 100.0)]
    assert cost_at(points, 10**-1.5) == pytest.approx(10.0, rel=1e-12)
    assert math.isnan(cost_at(points, 0.005)) and cost_at(points, 0.5) == 1.0


def test_a_table_gives_back_its_points(tmp_path):
    wanted = [point(0.125, 2.0, "oedometer", curve=(1.0, 2.5), element="p1", element_size=0.5)]
    evidence.write_points(tmp_path / "t.csv", wanted)
    assert evidence.read_points(tmp_path / "t.csv") == wanted
    assert wanted[0].parameters == {"element": "p1", "element_size": "0.5"}


def test_error_of_inertia():
    """ln(r)/(2 r²): 0.0115 at ten times the time of a wave; and back."""
    assert of_loading(10.0) == pytest.approx(0.5 * math.log(10) / 100, rel=1e-12)
    assert time_for(of_loading(10.0)) == pytest.approx(10.0, rel=1e-9)
    assert math.isinf(of_loading(2.0)) and math.isinf(time_for(0.0))


def test_the_mean_error_of_inertia_is_that_of_its_course():
    """Weighted by a force that grows with the time s: error (T/s)²/4 from s = T on."""
    s = np.linspace(1.0, 10.0, 200001)
    mean = np.trapezoid(0.25 / s**2 * s, s) / np.trapezoid(np.linspace(0, 10, 3), dx=5.0)
    assert of_loading(10.0) == pytest.approx(mean, rel=1e-6)


def test_an_error_that_happens_to_vanish_does_not_count():
    assert falling([(10, 0.2), (20, 0.01), (40, 0.05)]) == ((10, 0.2), (20, 0.05), (40, 0.05))


def test_errors_follow_from_the_table(table):
    errors = sample_errors(table)
    assert errors.of_mesh(1.0) == pytest.approx(0.08)
    # Half-way in logarithms between 8 and 2 %.
    assert errors.of_mesh(math.sqrt(2)) == pytest.approx(0.04)
    # Beyond, and that far twice, with the order of the two finest.
    assert errors.of_mesh(4.0) == pytest.approx(0.005)
    assert math.isinf(errors.of_mesh(0.4)) and math.isinf(errors.elements_for(0.0049))
    assert errors.elements_for(0.04) == pytest.approx(math.sqrt(2), rel=1e-6)
    assert errors.masses[0.01] == pytest.approx((0.005, 1.0))
    assert errors.fidelities["rigid"] == pytest.approx(0.5)
    assert errors.of_path(4 * GRAINS) == pytest.approx(0.001)
    assert sample_errors(table, "p1").of_mesh(1.0) == pytest.approx(0.3)


def test_errors_of_samples_that_are_not_known_grow_as_those_of_single_contacts(table):
    """Plain tets: 0.6/0.32, 0.3/0.08 and 0.15/0.02 times the error, of which the largest counts."""
    contacts = [p for p in table if p.case != "sample" or "element" not in p.parameters]
    assert sample_errors(contacts, "p1").of_mesh(1.0) == pytest.approx(0.08 * 7.5)


def test_meshes_for_a_contact(table):
    """Even edges at half the length: eight times as many; or patches, 7 x 500 n²."""
    errors, grains = sample_errors(table), sample(0.5)
    assert grains.mesh_for(0.25, 0.1, errors) == pytest.approx((80e-6, 80e-6, 125))
    assert grains.mesh_for(1.0, 0.1, errors) == pytest.approx((20e-6, 40e-6, 1000 + 3500))
    even = sample(0.9).mesh_for(1.0, 0.1, errors)
    assert even == pytest.approx((20e-6, 20e-6, 1000 / 0.9**3))


def test_the_stored_table_repeats():
    """A cheap point's command gives its stored error again: nothing random, to rounding."""
    stored = evidence.read_points()
    point = next(p for p in stored if p.case == "impact" and p.series == "rigid")
    given = {name: number_or_text(text) for name, text in point.parameters.items()}
    (answer,) = run_cases(["impact-point"], given, MPI.COMM_SELF)
    # Different processors round differently; impacts of rigid balls do not amplify that.
    assert answer["results"]["error"]["computed"] == pytest.approx(point.error, rel=1e-3)


def test_a_coarser_patch_needs_no_more_tetrahedra_than_a_finer_one(table):
    """The mesh of a coarse contact is nearly uniform, and has more than a patch does."""
    coarse = [
        replace(p, num_cells=5000) if p.parameters.get("elements_per_radius") == "1" else p
        for p in table
    ]
    errors = sample_errors(coarse)
    assert errors.cells_of_contact(1.0) == errors.cells_of_contact(2.0) == 2000
