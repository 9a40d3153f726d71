"""Scenes of `mufe new` and `mufe pack`, run to their end: seated at rest, and trusted early.

They take minutes each and belong to `make verify`.
"""

import json

import numpy as np
import pytest

import mufe_fenicsx
from mufe_fenicsx.analysis.checks import UNTRUSTED, check_trust
from mufe_fenicsx.analysis.quasi_static import KINETIC, UNBALANCED, judged
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.synthetic.rigid_packing.measures import HELD_WITH_FRICTION, bearing
from mufe_fenicsx.synthetic.starter_scenes import IN_MEMBRANE, KINDS
from tests.cli.test_pack import pack as mufe

#: Scene of a grain that breaks, which is dynamic.
BREAKS = "crushing"
#: Part of a test from which on it has to be trusted, at the latest.
LATEST = 2 * UNTRUSTED
PACKED = "pack", "--spheres", "--count", "30", "--element-size", "60 um"
SCENES = {
    **{kind: ("new", kind) for kind, (_, make) in KINDS.items() if make and kind != BREAKS},
    **{f"{kind} in a membrane": ("new", kind, "--membrane") for kind in IN_MEMBRANE},
    "packed box": PACKED,
    "packed cylinder": (*PACKED, "--cylinder", "1 mm,1.2 mm"),
    "box under a stress": (
        *PACKED,
        "--contact-size",
        "30 um",
        "--stress",
        "6.8 MPa",
        "--k0",
        "0.5",
    ),
}
#: Scenes of a few balls, which no four contacts hold.
FEW = "single-grain", "two-spheres"


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(
            name,
            marks=pytest.mark.xfail(reason="single slips of 60 rigid balls are dynamic"),
        )
        if name == "shear-box"
        else name
        for name in SCENES
    ],
)
def test_it_is_seated_at_rest_and_trusted_early(name, tmp_path):
    mufe(*SCENES[name], "-o", tmp_path / "a")
    mufe("run", tmp_path / "a" / "scene.toml", "-o", tmp_path / "b", "--quiet")
    history = read_history(tmp_path / "b" / "history.csv")
    told = json.loads((tmp_path / "b" / "run.json").read_text())
    trust = check_trust(history, told["mass"])
    assert trust.row is not None and trust.largest <= LATEST, trust.text
    if name in FEW or name == "shear-box":
        return
    begins = next(stage["step"] for stage in told["stages"] if stage["name"] != "seating")
    seated = np.searchsorted(history["step"], begins)  # row of strain 0
    kinetic, unbalanced = (values[seated] for values in judged(history, told["mass"]))
    assert kinetic < KINETIC and unbalanced < 1.5 * UNBALANCED
    run = mufe_fenicsx.open_run(tmp_path / "b")
    first = int((run.states.stage != "seating").idxmax())
    assert coordination(run.contacts(first), told["num_grains"]) >= 4.0


@pytest.mark.slow
def test_a_grain_comes_apart(tmp_path):
    mufe("new", BREAKS, "-o", tmp_path / "a")
    mufe("run", tmp_path / "a" / "scene.toml", "-o", tmp_path / "b", "--quiet")
    history = read_history(tmp_path / "b" / "history.csv")
    assert history["broken_grains"][0] == 0 and history["broken_grains"][-1] == 1


def coordination(contacts, num_grains):
    """Mean number of contacts, with grains and walls, of grains that bear."""
    contacts = contacts[contacts.normal_force > 0]
    a, b = contacts.grain_a.to_numpy(), contacts.grain_b.to_numpy()
    between = (a > 0) & (b > 0)
    at_walls = np.bincount(np.maximum(a, b)[~between], minlength=num_grains + 1)[1:]
    pairs = np.column_stack([a, b])[between] - 1
    bears, count = bearing(num_grains, pairs, at_walls, HELD_WITH_FRICTION)
    assert bears.mean() > 0.6
    return count[bears].mean()
