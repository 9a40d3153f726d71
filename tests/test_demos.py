"""Demos start, and those that carry code of a user's own do what they say."""

import dataclasses
import importlib.util
import runpy
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest
from PIL import Image

import mufe_fenicsx
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.planning.course import elastic_wave_speed
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.scene.shipped import shipped_mesh
from tests.made_up_run import write_whole_run

DEMOS = Path(__file__).resolve().parents[1] / "demos"


#: All but the one without arguments, which is tested below, and what some of them import.
NO_ARGUMENTS = "drucker_prager"
WITH_ARGUMENTS = sorted({path.stem for path in DEMOS.glob("*.py")} - {NO_ARGUMENTS, "command"})


@pytest.mark.parametrize("name", WITH_ARGUMENTS)
def test_a_demo_says_what_it_does(name, monkeypatch, capsys):
    """In this process, which has the libraries loaded."""
    program = str(DEMOS / f"{name}.py")
    monkeypatch.setattr(sys, "argv", [program, "--help"])
    monkeypatch.syspath_prepend(DEMOS)
    with pytest.raises(SystemExit) as end:
        runpy.run_path(program, run_name="__main__")
    assert not end.value.code
    assert "usage" in capsys.readouterr().out


@pytest.fixture
def demo(monkeypatch, capsys):
    """Run a demo as a program, in this process; gives what it prints."""

    def run(name, *arguments):
        program = str(DEMOS / f"{name}.py")
        monkeypatch.setattr(sys, "argv", [program, *map(str, arguments)])
        monkeypatch.syspath_prepend(DEMOS)
        capsys.readouterr()
        try:
            runpy.run_path(program, run_name="__main__")
        except SystemExit as end:
            assert not end.code, end.code
        return capsys.readouterr().out

    return run


@pytest.mark.slow
def test_the_first_run(tmp_path):
    """The report has all its figures, and says that the result can be believed."""
    command = [sys.executable, "-m", "mufe_fenicsx", "run", DEMOS / "first.toml", "-o", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'class="pass"' in page and 'class="warn"' not in page and 'id="missing"' not in page
    assert f"{tmp_path / 'report.html'}" in done.stdout


def import_demo(name):
    if str(DEMOS) not in sys.path:  # for what demos import from each other
        sys.path.append(str(DEMOS))
    spec = importlib.util.spec_from_file_location(name, DEMOS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_demo_that_is_stopped_waits_for_its_run(monkeypatch):
    """Which keeps a checkpoint before it ends, and has said so."""
    process = Mock(wait=Mock(side_effect=[KeyboardInterrupt, 130]))
    command = import_demo("command")
    monkeypatch.setattr(command.subprocess, "Popen", lambda words: process)
    with pytest.raises(SystemExit) as end:
        command.call("run", "scene.toml")
    assert end.value.code == 130 and process.wait.call_count == 2


def test_order_and_limit_of_stresses_on_three_meshes():
    """Of σ₀ + C h^p both come out exactly; what is not monotone, or too slow, has none."""
    demo = import_demo("known_sample")
    h, nothing = np.array([0.3, 0.2, 0.14, 0.1]), np.zeros(4)
    p, limit, error = demo.extrapolate(h, 5.0 + 40.0 * h**1.7, nothing)
    assert (p, limit) == pytest.approx((1.7, 5.0), rel=1e-9)
    assert error == pytest.approx(1.25 * 40.0 * 0.1**1.7, rel=1e-9)
    for stress in ([9.0, 7.0, 6.0, 6.5], [9.0, 8.0, 7.0, 5.0]):
        assert np.isnan(demo.extrapolate(h, stress, nothing)).all()
    assert demo.limit_of_second_order(h, 5.0 + 40.0 * h**2) == pytest.approx(5.0, rel=1e-12)


def test_two_spheres(tmp_path, demo, monkeypatch):
    """The demo compares its forces with Hertz's itself."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    out = demo("two_spheres", "--figure", tmp_path / "curve.png")
    assert len(out.splitlines()) == 11  # a head and ten increments
    assert (tmp_path / "curve.png").stat().st_size > 10_000


def test_an_analysis_of_ones_own(tmp_path, demo):
    """The demo presses balls, and checks the stress of their contacts against the walls itself."""
    out = demo("own_analysis", tmp_path)
    assert "missing" not in out and "in force chains" in out
    assert (tmp_path / "own_analysis.csv").read_text().count("\n") == 10  # a head and 9 grains
    assert (tmp_path / "own_analysis.png").stat().st_size > 20_000


@pytest.fixture(scope="module")
def drucker_prager():
    spec = importlib.util.spec_from_file_location("drucker_prager", DEMOS / "drucker_prager.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["drucker_prager"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_a_law_of_ones_own_acts_in_the_elements(drucker_prager):
    """A cube sheared under an even pressure reaches cohesion + friction x pressure."""
    p, q = drucker_prager.sheared_cube(drucker_prager.STRONG, 6e-4)
    assert p[-1] > 40e6
    # Waves in the cube: 1e-4 of the stress.
    assert q[-1] == pytest.approx(40e6 + p[-1], rel=1e-3)


def test_scene_files_name_a_material_of_ones_own(drucker_prager, tmp_path):
    from mufe_fenicsx.run.demo import demo_scene
    from mufe_fenicsx.scene import scene_to_toml

    text = demo_scene().read_text()
    start = text.index("[material]")
    own = '[material]\nmodel = "drucker-prager"\nE = "100 GPa"\nnu = 0.15\nrho = "2650 kg/m^3"\n'
    own += 'cohesion = "40 MPa"\nfriction = 1.0\n\n'
    path = tmp_path / "scene.toml"
    path.write_text(text[:start] + own + text[text.index("\n[", start) :])
    scene = load_scene(path)
    assert scene.material == drucker_prager.STRONG
    path.write_text(scene_to_toml(scene))
    assert load_scene(path).material == drucker_prager.STRONG


def test_the_gallery_has_each_picture_that_is_made():
    """One a part, small, on the page with its command; the scene beside them can be read."""
    demo, folder = import_demo("gallery"), DEMOS.parent / "docs" / "gallery"
    page = (DEMOS.parent / "docs" / "gallery.md").read_text(encoding="utf-8")
    pictures = [path for path in folder.iterdir() if path.suffix != ".toml"]
    assert sorted(path.stem for path in pictures) == sorted(demo.PARTS)
    assert sum(path.stat().st_size for path in pictures) <= 1_500_000
    for path in pictures:
        limit = demo.LARGEST_ANIMATION if path.suffix == ".gif" else demo.LARGEST
        assert path.stat().st_size <= limit
        assert f"(gallery/{path.name})" in page and f"`python demos/gallery.py {path.stem}`" in page
    assert [stage.name for stage in load_scene(demo.SCENE).stages] == ["aside", "crush"]


def test_a_picture_of_the_gallery(tmp_path):
    """Of a made-up run: white stays white, and colours are few."""
    demo = import_demo("gallery")
    (tmp_path / "snow" / "run").mkdir(parents=True)
    write_whole_run(tmp_path / "snow" / "run")
    sizes = demo.main(["cut"], tmp_path / "pictures", tmp_path)
    with Image.open(tmp_path / "pictures" / "cut.png") as picture:
        assert picture.mode == "P" and picture.width == demo.WIDTHS[0]
        assert picture.convert("RGB").getpixel((2, 2)) == (255, 255, 255)
    assert 5_000 < sizes["cut"] <= demo.LARGEST


def test_shapes_of_sand():
    """Power of a modulus, ratio of stresses, peak and dilation of made-up tests come out."""
    demo = import_demo("sand")
    stress = np.geomspace(1e5, 4e6, 400)
    strain = (stress**0.3 - stress[0] ** 0.3) / 3e3  # dσ/dε = 1e4 σ^0.7
    test = pd.DataFrame({"strain_z": strain, "stress_z": stress, "void_ratio": 0.7 - strain})
    numbers, _ = demo.of_compression(test.assign(stress_x=0.4 * stress, stress_y=0.5 * stress))
    # A line over a factor of two in stress: 0.7 of its power, some 1 % of its slope.
    assert numbers["power"] == pytest.approx(0.7, abs=1e-3)
    assert numbers["modulus_1_MPa"] == pytest.approx(1e-2 * 1e6**0.7, rel=0.02)
    assert numbers["k0_1_MPa"] == pytest.approx(0.45, rel=1e-9)

    axial = np.linspace(0.0, 0.2, 401)
    q = 3e6 * np.minimum(axial / 0.05, 1.0)
    side = 1 - np.sqrt((1 + 0.5 * axial) / (1 - axial))  # the volume grows by half of the strain
    test = {"strain_x": side, "strain_y": side, "strain_z": axial, "void_ratio": 0.7 + axial}
    stresses = {"stress_x": 1e6, "stress_y": 1e6, "stress_z": 1e6 + q}
    numbers, _ = demo.of_shear(pd.DataFrame(test | stresses))
    assert numbers["peak"] == numbers["end"] == pytest.approx(1.5, rel=1e-9)  # 3 / (1 + 3 / 3)
    assert numbers["volume_at_end"] == pytest.approx(-0.1, rel=1e-9)
    assert numbers["dilation"] == pytest.approx(0.5, rel=1e-9)


def test_springs_of_sand():
    """Six contacts a ball of 0.6 solid are those by which waves of plans are judged."""
    demo = import_demo("sand")
    quartz = Elastic(E=demo.YOUNG, nu=demo.POISSON, rho=2650.0)
    square = elastic_wave_speed(quartz, 2e5) ** 2
    assert demo.springs(6, 1 / 0.6 - 1, 2e5) == pytest.approx(0.6 * 2650 * square, rel=1e-9)


def test_powers_of_the_laboratory_of_sand(monkeypatch):
    """Void ratios that fall as stress to the power 0.3 give a modulus of power 0.7."""
    demo = import_demo("sand")
    table = np.array([[0.9, 0.9 - 0.01 * 100**0.3, 0.9 - 0.01 * 407**0.3, 0.0]])
    monkeypatch.setattr(demo, "OEDOMETER", table)
    assert demo.powers_of_laboratory() == pytest.approx([0.7], rel=1e-9)


@pytest.mark.slow
def test_sand_from_packing_to_table(tmp_path, demo):
    """Eight grains go all the way; the same command again finds all done, with the same table."""
    words = ["--packing-friction", 0.3, "--count", 8, "--edges", 5, "--edges-at-contacts", 7]
    words += ["--start", 0.5, "--largest", 2, "--strain", 0.01, "--figure", tmp_path / "sand.png"]
    out = demo("sand", tmp_path, *words)
    assert "test=oedometer" in out and "test=triaxial" in out
    assert (tmp_path / "sand.png").stat().st_size > 20_000
    table = (tmp_path / "sand.csv").read_text()
    assert table.count("\n") == 3  # a head and two tests
    demo("sand", tmp_path, *words)
    assert (tmp_path / "sand.csv").read_text() == table


def test_sand_takes_no_results_of_other_options(tmp_path):
    """Neither packings nor runs; grains that are moved apart keep their shapes."""
    sand = import_demo("sand")
    scene, run = tmp_path / "test.toml", tmp_path / "test"
    sand.keep(scene, "friction = 0.5", run)
    sand.keep(scene, "friction = 0.2", run)  # nothing was run yet
    run.mkdir()
    sand.keep(scene, "friction = 0.2", run)
    with pytest.raises(SystemExit, match="other options"):
        sand.keep(scene, "friction = 0.5", run)
    grains = mufe_fenicsx.load_grains(shipped_mesh("meshes:twelve_grains", "SOURCE"))
    boxed = dataclasses.replace(grains, box=np.array([[0.0] * 3, [1e-3] * 3]))
    mufe_fenicsx.save_grains(tmp_path / "grains", boxed)
    moved = mufe_fenicsx.load_grains(tmp_path / sand.parted(tmp_path, 0.015))
    assert np.allclose(moved.volumes, grains.volumes, rtol=1e-9)
    assert np.allclose(moved.centroids, 1.015 * grains.centroids, rtol=1e-9)
