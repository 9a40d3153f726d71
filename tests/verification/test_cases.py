"""The cases of `mufe verify`, in their cheap versions, on any number of ranks."""

import json

import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.verification import CASES, run_cases


def run(name, **parameters):
    (answer,) = run_cases([name], parameters, MPI.COMM_WORLD)
    failed = {k: line for k, line in answer["results"].items() if not line["passed"]}
    assert not failed
    assert answer["passed"] and answer["num_cells"] > 0 and answer["num_steps"] > 0
    assert json.loads(json.dumps(answer)) == answer
    return answer


@pytest.mark.mpi
def test_column():
    run("column")


@pytest.mark.mpi
def test_patch():
    run("patch")


@pytest.mark.mpi
def test_spin():
    run("spin", turns=3)


@pytest.mark.mpi
def test_sliding_block():
    run("sliding-block", slip="2e-6")


@pytest.mark.mpi
def test_energy():
    run("energy", strain=0.01)


@pytest.mark.mpi
def test_hertz():
    run("hertz", elements_per_radius=1.5, growth=0.25)


@pytest.mark.mpi
def test_feature_pairs():
    run("feature-pairs", num_random=8, slow=0.02, rounds=1)


def test_all_cases_of_the_command_line_exist():
    assert set(CASES) == {
        "column",
        "patch",
        "spin",
        "sliding-block",
        "energy",
        "hertz",
        "feature-pairs",
    }
    for function in CASES.values():
        assert function.__doc__.splitlines()[0]


@pytest.mark.mpi
@pytest.mark.parametrize(
    "names, parameters, expected",
    [
        (["colum"], {}, "column"),
        (["column"], {"strian": 1}, "strain"),
        (["column"], {"turns": 1}, "turns"),
        (["column"], {"divisions": "many"}, "whole number"),
        (["column"], {"divisions": 2.5}, "whole number"),
        (["column"], {"strain": "nan"}, "number"),
    ],
)
def test_what_cannot_be_run_is_said_on_all_ranks(names, parameters, expected):
    with pytest.raises(InputError, match=expected):
        run_cases(names, parameters, MPI.COMM_WORLD)
