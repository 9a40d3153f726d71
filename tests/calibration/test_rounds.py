"""The solver on a grain's own mesh gives the material of a curve back; others are refused."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.calibration import data as tables
from mufe_fenicsx.calibration.calibrate import Options, calibrate
from mufe_fenicsx.calibration.data import Data, Size, read_data
from mufe_fenicsx.calibration.fit import Given
from mufe_fenicsx.calibration.model import Setup
from mufe_fenicsx.calibration.rounds import Grain, read_grain, to_run
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import sphere_near_contact
from mufe_fenicsx.geometry.grains import Grains, save_grains
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.verification.calibrate_stone import Curve, scene_text, write_curve
from tests.doors import mufe as run_mufe

pytestmark = pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork")
#: Radius of a ball [m], and what makes an egg of it.
RADIUS, AXES = 0.35e-3, (1.25, 0.9, 1.0)
MATERIAL = (70e9, 1.5e9, 10e9)
STEEL = (210e9, 0.3)


def write_grains(folder, number=1):
    """A coarse egg between platens, or some on top of each other."""
    points, cells = sphere_near_contact(
        RADIUS, 0.05 * RADIUS, 1.0, (0.0, 0.0, 1.0), 0.1 * RADIUS, both_poles=True
    )
    meshes = [(points * AXES + [0, 0, 2 * RADIUS * k], cells) for k in range(number)]
    save_grains(folder / "grains", Grains.from_list(np.arange(1, number + 1), meshes, RADIUS))


@pytest.mark.slow
def test_the_material_of_a_run_comes_back_from_its_curve(tmp_path):
    """From a modulus a fifth off and a yield stress a third off; a second call makes no run.

    Between rigid walls it gives way as one with a larger modulus does between platens of steel.
    """
    modulus = 1 / (1 / MATERIAL[0] - (1 - STEEL[1] ** 2) / STEEL[0] / (1 - 0.2**2))
    write_grains(tmp_path)
    for name, material in (("true", MATERIAL), ("guess", (85e9, 2e9, 8e9))):
        text = scene_text(*material, "static")
        text = text.replace("2.5e-4", "1e-3").replace("5e-4", "1e-3")
        (tmp_path / f"{name}.toml").write_text(text)
    scene = load_scene(tmp_path / "true.toml")
    run_scene(scene, tmp_path / "grains", tmp_path / "true", MPI.COMM_SELF, quiet=True)
    write_curve(tmp_path / "curve.csv", tmp_path / "true", Curve(noise=0.002, points=300))
    grain = read_grain(tmp_path / "guess.toml")
    options = Options(
        Setup(0.2, "platens", STEEL), Given(compliance=5e-8), 2650.0, grain.size, grain
    )
    made = []
    for overwrite in (False, True):
        found = calibrate([tmp_path / "curve.csv"], options, tmp_path / "out", overwrite)
        rows = {row["name"]: row for row in found["parameters"]}
        made.append([path.stat().st_mtime for path in tmp_path.glob("out/grain/runs/*/run.json")])
        for name, true in zip(
            ("Young's modulus", "yield stress"), (modulus, MATERIAL[1]), strict=True
        ):
            # Between rows of a run ψ is a line; without noise 0.3 % are left (docs/record).
            assert rows[name]["value"] == pytest.approx(true, rel=0.02)
            assert rows[name]["low"] < true < rows[name]["high"]
    assert made[0] == made[1] and len(made[0]) >= 2


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            '"grains"',
            '"grains"\nseparation = false\n[walls.z_min]\nmirror = true',
            "walls.z_min.mir",
        ),
        ('grains = "grains"', "", "sample.grains is missing"),
        (
            "[contact]",
            "[material.scatter]\nstrength = 0.2\n[contact]",
            "[material.scatter] is given",
        ),
        ("[contact]", "[materials.hard]\nlabels = [1]\nE = 1e10\n[contact]", "[materials] is"),
        ('model = "j2"', 'model = "rigid"', 'material.model = "rigid", expected "elastic" or "j2"'),
        ("z = { strain = 0.03 }", 'z = { stress = "1 MPa" }', "no stage leads z to a strain > 0"),
        ("two grains", "", "2 grains, expected one between platens"),
        ("--nu", "0.3", "--nu 0.3, expected with --scene 0.2"),
        ("--test", "grains", "--test grains, expected with --scene platens"),
    ],
)
def test_scenes_that_press_no_single_grain_are_refused(tmp_path, old, new, said):
    """One line, status 2, no folder."""
    write_grains(tmp_path, 2 if old == "two grains" else 1)
    text = scene_text(*MATERIAL, "explicit")
    if "rigid" in new:
        text = "\n".join(line for line in text.splitlines() if not line.startswith("yield_"))
    (tmp_path / "scene.toml").write_text(text.replace(old, new))
    (tmp_path / "curve.csv").write_text(
        "displacement [um], force [N]\n" + "".join(f"{x}, {x}\n" for x in range(1, 11))
    )
    more = [old, new] * old.startswith("--")
    status, lines = run_mufe(
        "calibrate", tmp_path / "curve.csv", "--scene", tmp_path / "scene.toml",
        "-o", tmp_path / "out", *more,
    )  # fmt: skip
    assert status == 2 and len(lines) == 1 and said in lines[0], lines
    assert not (tmp_path / "out").exists()


def test_runs_of_another_scene_are_refused(tmp_path):
    write_grains(tmp_path)
    (tmp_path / "scene.toml").write_text(scene_text(*MATERIAL, "static"))
    (tmp_path / "curve.csv").write_text(
        "displacement [um], force [N]\n" + "".join(f"{x}, {x}\n" for x in range(1, 11))
    )
    (tmp_path / "out" / "grain").mkdir(parents=True)
    (tmp_path / "out" / "grain" / "scene.toml").write_text("title = 1\n")
    grain = read_grain(tmp_path / "scene.toml")
    options = Options(Setup(0.2), Given(), 2650.0, grain.size, grain)
    with pytest.raises(InputError, match="runs of another scene"):
        calibrate([tmp_path / "curve.csv"], options, tmp_path / "out")
    assert not (tmp_path / "out" / "parameters.csv").exists()

    (tmp_path / "out" / "notes.txt").write_text("not of a calibration\n")
    with pytest.raises(InputError, match="is not empty"):
        calibrate([tmp_path / "curve.csv"], options, tmp_path / "out")


def test_noise_of_dense_curves_is_no_fall(tmp_path):
    """A thousand rows of 3 %; a force that drops by a quarter is one."""
    x = np.linspace(0.1, 20, 1000)
    force = x**1.5 * (1 + 0.03 * np.random.default_rng(0).standard_normal(x.size))
    for end, falls in ((1.0, False), (0.75, True)):
        force[-20:] *= end
        rows = "".join(f"{a:.5g}, {b:.5g}\n" for a, b in zip(x, force, strict=True))
        (tmp_path / "curve.csv").write_text("displacement [um], force [N]\n" + rows)
        if falls:
            with pytest.raises(InputError, match="falls from"):
                read_data([tmp_path / "curve.csv"], object())
        else:
            assert read_data([tmp_path / "curve.csv"], object()).curves[0].force.size == 1000


def test_runs_of_an_elastic_fit_do_not_yield():
    """Between softer platens a run has a lower modulus, which no yield stress may exceed."""
    setup = Setup(0.2, "platens", (60e9, 0.3))
    found = {"E": 7e10, "yield": 7e10, "hardening": 7e10}
    softer = setup.modulus(7e10) * (1 - 0.2**2)
    assert softer < 4e10
    assert to_run(found, True, setup) == (softer, softer, softer)
    assert to_run(found, False, setup) == (softer, softer, 7e10)
    assert to_run(found | {"yield": 1e9}, False, setup) == (softer, 1e9, 7e10)


def test_the_mesh_tells_the_size_of_its_grain():
    """A height of 0.56 of a grain as large as a ball of 0.72 made yield 1.4 times too large."""
    grain = Grain(None, 0.72e-3, 0.56e-3)
    curves = [tables.Curve(name, np.arange(3.0), np.arange(3.0), Size(*[d] * 3))
              for name, d in (("A", 0.56e-3), ("B", 0.721e-3))]  # fmt: skip
    found = grain.sized(Data(curves, [], np.array([]), np.array([]), []))
    assert [curve.size.diameter for curve in found.curves] == pytest.approx([0.72e-3] * 2)
    assert len(found.notes) == 1 and "diameter of curve A = 560 µm is not used" in found.notes[0]
