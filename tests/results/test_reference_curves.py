"""Measured curves: what a file may hold, and how far a run is from them."""

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.results.reference_curves import (
    branches_of,
    differences,
    read_reference,
    values_beside,
)
from mufe_fenicsx.scene.reference import Column, Reference


def written(folder, text):
    path = folder / "lab.csv"
    path.write_text(text)
    return Reference(path)


def test_columns_become_si_units_by_their_names(tmp_path):
    """n = 0.4 is e = 2/3, and K0 follows from both stresses; other names of them are known."""
    text = "# a comment, with commas\nstrain [%], Sigma1 [MPa], sigma3 [kPa], porosity [-]\n"
    rows = "0, 0, 0, 0.4\n2.5, 2, 800, 0.375\n"
    found = read_reference(written(tmp_path, text + rows))
    exact = {
        "strain": [0, 0.025], "stress": [0, 2e6], "side_stress": [0, 8e5],
        "porosity": [0.4, 0.375], "void_ratio": [2 / 3, 0.6], "k0": [np.nan, 0.4],
    }  # fmt: skip
    assert found.label == "lab" and set(found.columns) == set(exact)
    for name, values in exact.items():
        np.testing.assert_allclose(found.columns[name], values, rtol=1e-15)


def test_a_scene_says_which_columns_to_take(tmp_path):
    """Headers of any form; the unit may stand in the scene; others are left aside."""
    given = written(tmp_path, "Axial strain (%),note,s [MPa]\n1,abc,2\n2,,3\n")
    columns = {"strain": Column("Axial strain (%)", "%"), "stress": Column("s")}
    found = read_reference(Reference(given.file, "sand", columns))
    assert found.label == "sand"
    assert found.columns["strain"].tolist() == [0.01, 0.02]
    assert found.columns["stress"].tolist() == [2e6, 3e6]


HEAD = "strain [%], stress [MPa]\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("strian [%], stress [MPa]\n0, 1\n", "line 1: \"strian\" is not a known column, expected"),
        ("strain, stress [MPa]\n0, 1\n", "line 1: strain has no unit, expected one behind"),
        ("strain [%], stress [-]\n0, 1\n", "line 1: stress has the unit \"-\", expected one of"),
        ("strain [mm], stress [MPa]\n0, 1\n", "line 1: strain has the unit \"mm\", expected one"),
        ("strain [%], stress [kPas]\n0, 1\n", "has the unit \"kPas\", expected one of [Pa], [kPa]"),
        ("strain [%];stress [MPa]\n0,1;1,5\n", "line 1 is separated by semicolons, expected com"),
        ("strain [%], stress [MPa]\n0, \n1,\n", "stress has no number, expected one at least"),
        ("strain [%], stress [MPa], sigma1 [MPa]\n0, 1, 1\n", "stress is there twice, expected"),
        ("strain [%], porosity [-]\n0, 1\n", "line 2: porosity = 1, expected less than 1"),
        ("strain [%]\n0\n", "line 1: strain, expected columns to compare, such as strain and"),
        (HEAD, "has 0 rows, expected at least one"),
        ("", "has no line, expected the names of columns"),
        (HEAD + "0, 1\n1, nan\n", "line 3: stress = \"nan\", expected a finite number"),
        (HEAD + "0, 1\n1\n", "line 3 has 1 values, expected 2"),
    ],
)  # fmt: skip
def test_what_is_no_curve_is_one_line(tmp_path, text, said):
    with pytest.raises(InputError) as error:
        read_reference(written(tmp_path, text))
    assert said in str(error.value) and "lab.csv" in str(error.value)


def test_a_column_that_the_file_has_not_is_one_line(tmp_path):
    given = written(tmp_path, HEAD + "0, 1\n")
    with pytest.raises(InputError, match='has no column "sigma", expected'):
        read_reference(Reference(given.file, "", {"stress": Column("sigma")}))
    with pytest.raises(InputError, match=r"columns\.strss of a reference is not known, expected"):
        read_reference(Reference(given.file, "", {"strss": Column("stress")}))


def test_branches_end_where_the_strain_turns():
    """Loading to 3, unloading to 2, reloading to 4; a turn below 2 % of the range is noise."""
    way = np.concatenate([np.linspace(0, 3, 31), np.linspace(2.95, 2, 20), np.linspace(2.1, 4, 20)])
    way[15] -= 0.12  # back by 0.02, half a percent of 4
    assert branches_of({"strain": way}) == [slice(0, 31), slice(30, 51), slice(50, 71)]


def cycle():
    """A run that loads, unloads and reloads: σ = ε, then ε - 1, then ε - 0.5 [MPa]; K0 = 1/2."""
    up, down, again = np.linspace(0, 2, 41), np.linspace(1.99, 1.2, 80), np.linspace(1.21, 3, 180)
    stress = np.concatenate([up, down - 1.0, again - 0.5])
    strain = np.concatenate([up, down, again]) / 100
    return {"strain": strain, "stress": 1e6 * stress, "k0": np.full(strain.shape, 0.5)}


def test_each_branch_is_compared_with_its_own(tmp_path):
    """Measured: a tenth less stress, and K0 lower by 0.1. Points of other strains than the run."""
    run = cycle()
    lines = []
    for rows in (slice(0, 41), slice(41, 121), slice(121, 301)):
        strain, stress = run["strain"][rows], run["stress"][rows]
        inner = np.linspace(strain[0], strain[-1], 17)
        order = np.argsort(strain)
        lines += zip(inner, np.interp(inner, strain[order], stress[order]), strict=True)
    text = "strain [-], stress [Pa], k0 [-]\n"
    text += "".join(f"{e!r}, {s / 1.1!r}, 0.4\n" for e, s in lines).replace("np.float64", "")
    given = read_reference(written(tmp_path, text.replace("(", "").replace(")", "")))
    found = {(d.quantity, d.branch): d for d in differences(given, run)}
    for branch in ("loading", "unloading", "reloading"):
        stress, k0 = found["stress", branch], found["k0", branch]
        # Both are straight lines: only rounding remains.
        assert stress.mean == pytest.approx(0.1, rel=1e-9)
        assert stress.largest == pytest.approx(0.1, rel=1e-9)
        assert k0.mean == pytest.approx(0.1, rel=1e-9) and not k0.relative
    assert found["stress", "unloading"].low >= 0.012 and found["k0", "loading"].over == "stress"


def test_the_same_curve_has_no_difference(tmp_path):
    run = cycle()
    rows = zip(run["strain"], run["stress"], run["k0"], strict=True)
    text = "strain [-], stress [Pa], k0 [-]\n"
    text += "".join(f"{e:.17g}, {s:.17g}, {k:.17g}\n" for e, s, k in rows)
    found = differences(read_reference(written(tmp_path, text)), run)
    assert len(found) == 6
    assert max(abs(d.largest) for d in found) < 1e-12  # rounding


def test_a_curve_out_of_reach_is_one_line(tmp_path):
    given = read_reference(written(tmp_path, HEAD + "5, 1\n6, 2\n"))
    with pytest.raises(InputError) as error:
        differences(given, cycle())
    assert str(error.value) == (
        f"strain of {given.path} = 0.05 to 0.06, expected points in the range of the run, "
        "0 to 0.03, of branches that go the same way"
    )
    turned = read_reference(written(tmp_path, HEAD + "0, 0\n-1, -1\n-2, -2\n"))
    with pytest.raises(InputError, match="the same way: compression is positive, here and in the"):
        differences(turned, cycle())


def test_units_are_whole_words_and_cells_may_be_empty(tmp_path):
    """1 kN/m² = 1 kPa and 1 N/mm² = 1 MPa; an empty cell takes no number from other columns."""
    text = "strain (%), stress [kN/m^2], q [N/mm²]\n0, 100,\n, 200, 1\n2,,2\n"
    found = read_reference(written(tmp_path, text)).columns
    np.testing.assert_array_equal(found["strain"], [0, np.nan, 0.02])
    np.testing.assert_array_equal(found["stress"], [1e5, 2e5, np.nan])
    np.testing.assert_array_equal(found["q"], [np.nan, 1e6, 2e6])


@pytest.mark.parametrize("header", ["void ratio", "void ratio [-]", "void  ratio[-]"])
def test_a_header_is_found_with_and_without_its_bracket(tmp_path, header):
    """Columns that are not listed keep their own names, and others are left aside."""
    given = written(tmp_path, "strain [%], void ratio [-], stress [MPa], note\n1, 0.6, 2, x\n")
    found = read_reference(Reference(given.file, "", {"void_ratio": Column(header)})).columns
    assert {name: values.tolist() for name, values in found.items()} == {
        "strain": [0.01], "void_ratio": [0.6], "stress": [2e6],
    }  # fmt: skip


def test_points_that_are_not_compared_are_counted(tmp_path):
    """The run only loads, from strain 1e-4 on to 0.01: σ = 100 MPa · ε.

    The point at strain 0 is its first row's, as is that at the end its last; two are beyond; of the
    stress the first is below a tenth of the largest. Unloading has no branch to be compared with,
    and K0 no values.
    """
    strain = np.linspace(1e-4, 0.009999, 201)
    run = {"strain": strain, "stress": 1e8 * strain, "volumetric_strain": strain.copy()}
    text = "strain [-], stress [Pa], volumetric_strain [-], k0 [-]\n"
    for e in (0, 0.005, 0.01, 0.011, 0.012, 0.011, 0.01):
        text += f"{e}, {1e8 * e}, {e}, 0.5\n"
    given = read_reference(written(tmp_path, text))
    found = {(d.quantity, d.branch): d for d in differences(given, run)}
    counted = {key: (d.num_points, d.num_measured, d.left_out) for key, d in found.items()}
    absent = (0, 3, "3 of a branch that the run has not")
    assert counted == {
        ("stress", "loading"): (2, 5, "2 beyond the run, 1 below 0.1 of the largest"),
        ("volumetric_strain", "loading"): (3, 5, "2 beyond the run"),
        ("stress", "unloading"): absent,
        ("volumetric_strain", "unloading"): absent,
        ("k0", "loading"): (0, 5, "5 of a quantity that the run has not"),
        ("k0", "unloading"): (0, 3, "3 of a quantity that the run has not"),
    }
    assert found["stress", "unloading"].mean is None
    values = values_beside(given, run)["volumetric_strain"]
    np.testing.assert_allclose(values, [1e-4, 0.005, 0.009999, *[np.nan] * 4], rtol=1e-12)
