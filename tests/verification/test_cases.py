"""The cases of `mufe verify`, in their cheap versions.

`make verify` has all of them on several ranks.
"""

import json

import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.solid import ELEMENTS
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.verification.cases import CASES, run_cases
from mufe_fenicsx.verification.intrusion import what_is_missing


def run(name, **parameters):
    (answer,) = run_cases([name], parameters, MPI.COMM_WORLD)
    failed = {k: line for k, line in answer["results"].items() if line["passed"] is False}
    assert not failed
    assert answer["passed"] and answer["num_cells"] > 0 and answer["num_steps"] > 0
    assert json.loads(json.dumps(answer)) == answer
    return answer


#: Cases and parameters that make them cheap; "slow": in `make verify`.
CHEAP = [
    ("patch", {}, ""),
    ("spin", {"turns": 5}, "slow"),
    ("sliding-block", {"slip": "2e-6"}, ""),
    ("energy", {"strain": 0.01}, ""),
    ("hertz", {"bodies": "sphere-plane"}, "slow"),
    ("hertz", {"bodies": "cylinders", "elements_per_radius": 1.5}, ""),
    ("hertz", {"bodies": "spheres-E1:10"}, "slow"),
    ("hertz-stress", {"elements_per_radius": 2.5}, "slow"),
    ("calibrate", {"sets": 2, "elements_per_radius": 5}, "slow"),
    ("curved-walls", {}, "slow"),
    ("confined-cylinder", {}, "slow"),
    ("undrained-elastic", {"elements": 3}, "slow"),
    ("tube-in-torsion", {"layers": 4}, ""),
    ("sheared-box", {"divisions": 4}, ""),
    ("balloon", {}, "slow"),
    ("membrane-tube", {}, "slow"),
    ("membrane-specimen", {}, "slow"),
    ("membrane-correction", {}, "slow"),
    ("disc", {"ends": "held", "elements_per_radius": 2, "a_over_R": 0.1}, ""),
    ("hiramatsu-oka", {"elements_per_radius": 2, "a_over_R": 0.1}, ""),
    ("overlap", {"element_size": 0.5, "steps": 20}, "slow"),
    ("impact", {"num_speeds": 1}, ""),
    ("oblique-impact", {"num_angles": 1, "a_over_R": 0.06, "growth": 0.4}, "slow"),
    ("mindlin", {"elements_per_radius": 2, "growth": 0.4, "periods": 12}, ""),
    ("torsion", {"elements_per_radius": 2.5, "growth": 0.4, "periods": 16}, "slow"),
    ("rolling", {"elements_per_radius": 2, "periods": 12}, "slow"),
    ("stability-close-contacts", {}, "slow"),
    ("stability-edge", {}, "slow"),
    ("stability-conforming", {}, "slow"),
    ("stability-plastic", {}, "slow"),
    ("rigid-top", {"turns": 20, "steps_per_turn": 40}, ""),
    ("rigid-rolling", {"element_size": 0.2}, ""),
    ("rigid-impact", {}, ""),
    ("rigid-mix", {"strain": 0.01}, ""),
    ("feature-pairs", {"num_random": 8, "slow": 0.02, "rounds": 1}, "slow"),
    ("fidelity", {"layers": 2, "strain": 0.004}, "slow"),
    ("known-sample", {}, "slow"),
    *(("free-sphere", {"elements_per_radius": 3, "element": e}, "") for e in ELEMENTS),
    ("bar-impact", {"divisions": 20}, ""),
    ("bar-impact", {"divisions": 10, "integrator": "implicit"}, "slow"),  # no energy is gained
    ("material-point", {"paths": 60, "steps_per_leg": 60}, ""),
    ("plastic-sphere", {"what": "curves", "elements_per_radius": 1.5}, "slow"),
    (
        "paper-sphere",
        {"elements_per_radius": 3.5, "refinement": 1.15, "num_yields": 2, "periods": 25},
        "slow",
    ),
    (
        "paper-sphere",
        {
            "elements_per_radius": 2,
            "refinement": 1.1,
            "num_yields": 1,
            "integrator": "static",
            "increments": 8,
        },
        "slow",
    ),
    ("damaged-block", {"cubes": 3, "steps": 4000, "undamped_steps": 12000}, ""),
    ("bar-in-tension", {}, ""),
    ("cracked-strip", {}, "slow"),
    ("expanding-ring", {}, ""),
    ("brazilian-disc", {}, "slow"),
    ("ball-crushing", {}, "slow"),
    ("crushing-strengths", {}, "slow"),
    ("stability-cracks", {}, "slow"),
    ("kalthoff-winkler", {}, "slow"),
    ("branching-plate", {}, "slow"),
    ("strain-cycle", {"paths": 12, "steps": 400}, ""),
    ("tracking", {}, "slow"),
    ("crush", {"element_size": 0.4, "speed": 10}, "slow"),
]


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        pytest.param(name, more, marks=[getattr(pytest.mark, mark)] if mark else [])
        for name, more, mark in CHEAP
    ],
    ids=[" ".join([name, *map(str, more.values())]) for name, more, _ in CHEAP],
)
def test_case(name, parameters):
    run(name, **parameters)


@pytest.mark.mpi
def test_the_answer_of_a_case_is_known_to_all_ranks():
    """Of one grain, which lives on one of them."""
    run("column")


@pytest.mark.slow
def test_segmentation():
    """Without meshes or steps: labels of an image, of the least size that has grains enough."""
    # Packings differ with the processor: without AVX-512, five of the 62 grains of seed 1
    # are slivers at the border.
    (answer,) = run_cases(["segmentation"], {"seed": 3}, MPI.COMM_SELF)
    assert answer["passed"], answer["results"]


@pytest.mark.slow
def test_packing():
    if why := what_is_missing():
        pytest.skip(why)
    run("packing", columns=2, layers=2, states=5)


@pytest.mark.slow
def test_plastic_sphere():
    answer = run("plastic-sphere", what="plateau", finest=3.5)
    lines = answer["results"]
    plain = [line for name, line in lines.items() if name.endswith("plain P1")]
    # Flow of constant volume locks plain elements: 1.5 and 1.8 times at E/Y = 1000.
    assert sum(line["computed"] > 1.4 * line["theory"] for line in plain) == 2


def test_every_case_of_the_command_line_says_what_it_is():
    assert len(CASES) > 6
    for function in CASES.values():
        assert function.__doc__.splitlines()[0]


@pytest.mark.parametrize(
    "names, parameters, expected",
    [
        (["colum"], {}, "column"),
        (["column"], {"strian": 1}, "strain"),
        (["column"], {"turns": 1}, "turns"),
        (["column"], {"divisions": "many"}, "whole number"),
        (["column"], {"divisions": 2.5}, "whole number"),
        (["column"], {"strain": "nan"}, "number"),
        (["hertz"], {"bodies": "sphere"}, "sphere"),
        (["disc"], {"a_over_R": 0.25}, "below 0.25"),
    ],
)
def test_what_cannot_be_run_is_said_on_all_ranks(names, parameters, expected):
    with pytest.raises(InputError, match=expected):
        run_cases(names, parameters, MPI.COMM_WORLD)
