"""Parameters of a sweep: lists, ranges, the hypercube, tables of an outer loop."""

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.planning.sweep.parameters import (
    hypercube,
    product,
    read_parameters,
    stated,
    table_text,
)
from mufe_fenicsx.units import base_number


def test_lists_and_ranges_are_told_apart():
    lists, ranges = stated(
        ["a=0.1, 0.2", "b=[1,2],[3,4]", 'c="x,y"', "d=meshes:one,meshes:two", "e=50 GPa:70 GPa"]
    )
    assert lists == {
        "a": ["0.1", "0.2"],
        "b": ["[1,2]", "[3,4]"],
        "c": ['"x,y"'],
        "d": ["meshes:one", "meshes:two"],
    }
    assert [(r.name, r.ends, r.log) for r in ranges] == [("e", (5e10, 7e10), False)]


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["friction"], '--set "friction", expected name=value,value or name=low:high'),
        (["a=1", "a=2"], "a is set twice, expected all its values behind one --set"),
        (["a=1,,2"], "has an empty value, expected values between commas"),
        (["a=1,1"], "has a value twice, expected different ones"),
        (["a=2:1"], 'a = "2:1", expected a range that grows'),
        (["a=0:1:log"], 'a = "0:1:log", expected a range above 0 for log'),
        (["a=1:2:3"], 'a = "1:2:3", expected low:high or low:high:log'),
        (["a=1:x"], 'a = "1:x", expected low:high or low:high:log'),
    ],
)
def test_what_is_no_parameter_is_one_line(texts, said):
    with pytest.raises(InputError) as error:
        stated(texts)
    assert said in str(error.value)


def test_a_hypercube_has_one_sample_in_each_part_of_each_range():
    """Also where the parts are even in the logarithm; another seed gives other samples."""
    _, ranges = stated(["a=0.1:0.4", "b=1 MPa:1 GPa:log"])
    rows = hypercube(ranges, 16, seed=3)
    a, b = (np.array([float(row[name]) for row in rows]) for name in "ab")
    parts = (a - 0.1) / 0.3, np.log(b / 1e6) / np.log(1e3)
    for part in parts:
        assert sorted(np.floor(16 * part).astype(int)) == list(range(16))
    assert rows == hypercube(ranges, 16, seed=3) != hypercube(ranges, 16, seed=4)


def test_the_product_has_each_pair_once():
    rows = product([{}], [{"a": "1"}, {"a": "2"}, {"a": "3"}], [{"b": "x"}, {"b": "y"}])
    assert [tuple(row.values()) for row in rows] == [(a, b) for a in "123" for b in "xy"]
    with pytest.raises(InputError, match="a is set twice"):
        product([{"a": "1"}], [{"a": "2"}])
    with pytest.raises(InputError, match="runs = 1000000, expected at most 10000"):
        product([{"a": "1"}] * 1000, [{"b": "1"}] * 1000)


def test_a_table_is_read_as_it_is_written(tmp_path):
    """The numbers that it has are those of the texts; what is no number is in a comment."""
    rows = [{"contact.friction": "0.1", "material.E": "50 GPa", "sample.grains": "a"},
            {"contact.friction": "0.4", "material.E": "7e10", "sample.grains": "b"}]  # fmt: skip
    text = table_text(rows)
    comment = "# no number, to be given beside this table: --set sample.grains=a,b\n"
    assert text == f"# contact.friction material.E\n{comment}0.1 50000000000.0\n0.4 70000000000.0\n"
    path = tmp_path / "t.txt"
    path.write_text(text)
    found, described = read_parameters(path)
    assert described is None
    for row, back in zip(rows, found, strict=True):
        assert {k: float(v) for k, v in back.items()} == {k: base_number(row[k]) for k in back}


def test_a_table_of_a_batch_has_descriptions(tmp_path):
    """As GrainLearning writes samples: threads, description and key are no parameters."""
    path = tmp_path / "t.txt"
    path.write_text(
        "!OMP_NUM_THREADS description key contact.friction \n"
        " 8 sand_Iter0_Sample0         0     1.0000000000e-01 \n"
        " 8 sand_Iter0_Sample1         1     2.5000000000e-01 \n"
    )
    rows, described = read_parameters(path)
    assert [float(row["contact.friction"]) for row in rows] == [0.1, 0.25]
    assert described == ["sand_Iter0_Sample0", "sand_Iter0_Sample1"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no header, expected a first line"),
        ("a b\n1 2\n", "has no header, expected a first line"),
        ("# a a\n1 2\n", "names a, a, expected different parameters"),
        ("#\n1\n", "expected different parameters"),
        ("# a b\n", "has no rows, expected one a run"),
        ("# a b\n1 2\n1\n", "line 3 has 1 values, expected 2"),
        ("# a b\n1 nan\n", 'line 2: b = "nan", expected a number'),
        ("# a b\n1 x\n", 'line 2: b = "x", expected a number'),
    ],
)
def test_what_is_no_table_is_one_line(tmp_path, text, said):
    path = tmp_path / "t.txt"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_parameters(path)
    assert said in str(error.value) and str(path) in str(error.value)
    with pytest.raises(InputError, match="cannot be read"):
        read_parameters(tmp_path / "absent.txt")
