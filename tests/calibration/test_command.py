"""`mufe calibrate` on tables: what it writes, and what it refuses in one line."""

import json
import tomllib

import numpy as np
import pytest
from scipy.stats import t as student

from mufe_fenicsx.calibration import sentences
from mufe_fenicsx.calibration.calibrate import Options, calibrate
from mufe_fenicsx.calibration.data import Size, read_data
from mufe_fenicsx.calibration.fit import Fit, Given
from mufe_fenicsx.calibration.friction import mindlin_force
from mufe_fenicsx.calibration.model import Setup
from mufe_fenicsx.calibration.own_mesh import shape_of_runs
from mufe_fenicsx.cli.calibrate import _print
from mufe_fenicsx.cli.terminal import Printer
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.units import to_si
from mufe_fenicsx.verification.calibrate import GLASS_NU, STEEL, YIELD, E, made_curves
from tests.doors import mufe as run_mufe
from tests.scene.scene_files import SMALLEST

pytestmark = pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork")
SETUP = Setup(GLASS_NU, "platens", STEEL)
#: Rows of a curve that rises.
RISING = "".join(f"{x}, {x**1.5:.4f}\n" for x in range(1, 11))
BALL = Size(1e-3, 1e-3, 1e-3)


def write_tables(folder):
    """Curves, contacts that are sheared, and strengths; their paths."""
    rng = np.random.default_rng(0)
    lines = ["displacement [um], force [mN], diameter [mm], time [s], curve\n"]
    for curve in made_curves(SETUP.course(E, YIELD, 10e9), SETUP, 3, 0.01, 0):
        lines += [
            f"{1e6 * x:.6g}, {1e3 * f:.6g}, {1e3 * curve.size.height:.6g}, 0, {curve.name}\n"
            for x, f in zip(curve.displacement, curve.force, strict=True)
        ]
    (folder / "pressed.csv").write_text("".join(lines))
    way = np.linspace(0, 3e-6, 30)
    force = mindlin_force(way, 2e6, 0.25 * 4.0) + 0.01 * rng.standard_normal(30)
    (folder / "rubbed.csv").write_text(
        "tangential_displacement [um], tangential_force [N], normal_force [N]\n"
        + "".join(f"{1e6 * x:.4f}, {q:.5f}, 4.0\n" for x, q in zip(way, force, strict=True))
    )
    strengths = 20.0 * rng.weibull(4.0, 25)
    (folder / "crushed.csv").write_text(
        "force [N], diameter [mm]\n" + "".join(f"{f:.4f}, 1.0\n" for f in strengths)
    )
    return [folder / f"{name}.csv" for name in ("pressed", "rubbed", "crushed")]


def test_what_is_written(tmp_path):
    """A block that scenes take, a table, a figure of each kind; friction beside the material."""
    options = Options(SETUP, Given(), 2500.0)
    result = calibrate(write_tables(tmp_path), options, tmp_path / "out")
    block = tomllib.loads((tmp_path / "out" / "material.toml").read_text())
    material = block["material"]
    assert material.pop("model") == "j2"
    table = tuple((strain, to_si(stress, "Pa", "")) for strain, stress in material["yield_stress"])
    found = J2(to_si(material["E"], "Pa", ""), material["nu"], 2500.0, table)
    assert found.E == pytest.approx(E, rel=0.1)  # three curves of 1 %, a soft machine
    assert block["contact"]["friction"] == pytest.approx(0.25, abs=0.01)
    assert block["fracture"] == {"scatter": "grain"}  # what grains bear is not what facets do
    text = (tmp_path / "out" / "material.toml").read_text()
    assert "# energy: state it; the data do not tell it." in text and "# reference_volume" in text
    names = [row["name"] for row in result["parameters"]]
    assert "Weibull modulus" in names and "friction" in names
    rows = (tmp_path / "out" / "parameters.csv").read_text().splitlines()
    assert rows[0] == "name,value,low_95,high_95,unit" and len(rows) == len(names) + 1
    for figure in ("curves", "friction", "survival"):
        assert (tmp_path / "out" / f"{figure}.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("displacment [um], force [N]\n" + RISING, "displacment"),
        ("disp [um], force [N], diameter [mm]\n1, 2, 3\n", "disp"),
        ("displacement, force [N]\n" + RISING, "displacement has no unit"),
        ("displacement [N], force [N]\n" + RISING, "displacement"),
        ("displacement [um], force [kPas m^2]\n" + RISING, "kPas"),
        ("displacement [um], force [N]\n1, 1\n", "1 points"),
        ("displacement [um], force [N]\n" + RISING + "11, 20\n12, 12\n13, 9\n14, 8\n", "falls"),
        ("displacement [um], force [N]\n1, a\n", "force"),
        ("velocity [m/s], mass [kg]\n1, 2\n", "velocity"),
        ("force [N]\n1\n", "1 grains"),
        ("force [N]\n" + "1\n" * 4 + "-1\n", "line 6: force = -1 N, expected 1e-15"),
        ("force [N]\n" + "1\n" * 5, "strengths scatter by 0"),
        ("displacement [um], force [N]\n" + "".join(f"{x}, 0\n" for x in range(9)), "force > 0"),
        ("displacement [mm], force [N]\n" + RISING, "no ball is known"),
        ("", "no line"),
    ],
)
def test_tables_that_cannot_be_used(tmp_path, text, said):
    path = tmp_path / "data.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as found:
        calibrate([path], Options(SETUP, Given(), 2500.0, BALL), tmp_path / "out")
    assert "\n" not in str(found.value)
    assert not (tmp_path / "out").exists()


def test_an_interval_of_more_than_a_factor_of_ten_states_nothing(tmp_path, capsys):
    """The strength of n grains with a modulus m is known to a factor exp(±2/(m √n)) about.

    With m = 0.5 its ends are a factor of 36 apart for five grains, of 3.5 for forty.
    """
    for number, wide in ((5, True), (40, False)):
        forces = 20.0 * np.random.default_rng(3).weibull(0.5, number)
        (tmp_path / "f.csv").write_text("force [N]\n" + "".join(f"{f:.4f}\n" for f in forces))
        options = Options(SETUP, Given(), 2500.0, BALL)
        found = calibrate([tmp_path / "f.csv"], options, tmp_path / "out", overwrite=True)
        rows = (tmp_path / "out" / "parameters.csv").read_text().splitlines()
        assert (found["parameters"][1]["value"] is None) == wide
        assert "strength F/d²" in rows[2] and rows[2].endswith(",,,,Pa") == wide
        assert ("# reference_volume = " in found["material"]) != wide
        _print(Printer(None), found)
        assert ("not determined" in capsys.readouterr().out) == wide


@pytest.mark.parametrize("half", [1.0, 1.3])
def test_a_yield_stress_that_is_not_determined_is_no_line_of_the_block(half):
    """Intervals of exp(±half): a factor of 7.4 is stated, one of 13.5 is not."""
    covariance = np.diag([1e-4, (half / student.ppf(0.975, 1000)) ** 2, 1e-4])
    material = {"E": 7e10, "yield": 1e9, "hardening": 1e10}
    fit = Fit(
        list(material), np.log(list(material.values())), covariance, 1000, [], 0.01, 0.01, 0.05,
        3.0, [], material,
    )  # fmt: skip
    said = " ".join(sentences.limits_of(fit, Given()))
    block = sentences.material_block(fit, 0.2, 2500.0)
    assert ("yield stress: 367.9 MPa to 2.718 GPa fit" in said) == (half == 1.0)
    assert "The curves do not determine the yield stress" in said
    assert ("\nyield_stress = " in block) == (half == 1.0)
    assert ("\n# yield_stress: state it" in block) == (half == 1.3)


def test_a_table_without_sizes_and_a_command_without_them(tmp_path):
    """One line, status 2, nothing left."""
    path = tmp_path / "data.csv"
    path.write_text("displacement [um], force [N]\n" + RISING)
    with pytest.raises(InputError, match="--diameter"):
        read_data([path])
    for given, said in (
        ([], "no size"),
        (["--diameter", "-1 mm"], "--diameter"),
        (["--diameter", "1 mm", "--platen", "steel"], "--platen"),
        (["--diameter", "1 mm", "--platen", "210,0.3"], "has a unit been left out?"),
        (["--diameter", "1 mm", "--modulus", "95"], "--modulus 95 Pa, expected 10 kPa to"),
        (["--diameter", "1 mm", "--density", "2.65"], "--density 2.65 kg/m³, expected"),
        (["--diameter", "1 mm", "--compliance", "0.05"], "compliance = 0.05 m/N, expected less"),
        (["--diameter", "1 mm", "--platen", "-210 GPa,0.3"], "--platen"),
        (["--diameter", "1 mm", "--compliance", "3 N"], "--compliance"),
        (["--diameter", "1 mm", "--compliance", "-3 um/N"], "--compliance"),
        (["--diameter", "1 mm", "--offset", "10 um"], "offset = 1e-05 m, expected less than"),
        ([path, "--diameter", "1 mm"], "curve data is there twice"),
    ):
        status, lines = run_mufe("calibrate", path, "-o", tmp_path / "out", *given)
        assert status == 2 and len(lines) == 1 and said in lines[0], lines
    assert not (tmp_path / "out").exists()


def test_unloading_is_left_out_and_said(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text("displacement [um], force [N]\n" + RISING + "9.5, 20\n9, 10\n")
    data = read_data([path], BALL)
    assert data.curves[0].force.size == 10
    assert "2 rows after the largest displacement" in data.notes[0]


def write_run(folder, factor, yield_stress=1e9, beside=0.0):
    """A run of a ball whose forces are those of the table times a function of the approach."""
    folder.mkdir()
    x = np.linspace(0.0, 0.02, 200)
    own = f"[[0.0, {yield_stress:g}], [0.05, {yield_stress + 1e9:g}]]"
    text = SMALLEST.replace("[[0.0, 10e6], [0.05, 110e6]]", own)
    (folder / "scene.toml").write_text(text)
    material = load_scene(folder / "scene.toml").material
    radius, height = 0.4e-3, 0.83e-3
    strain, stress = material.yield_table()
    slope = (stress[-1] - stress[0]) / strain[-1]
    delta, force, _ = Setup(material.nu).course(material.E, stress[0], slope)
    rows = {
        "step": np.arange(200),
        "height": height - 2 * radius * x,
        "force_z_min": factor(x) * radius**2 * np.interp(x, delta, force) * (x > 0),
        "elements_per_radius": 20 * np.sqrt(x),
    }
    rows["force_z_max"] = rows["force_z_min"]
    rows["force_x_max"] = beside * rows["force_z_max"]
    table = zip(*rows.values(), strict=True)
    lines = [",".join(rows), *(",".join(f"{v:.9g}" for v in row) for row in table)]
    (folder / "history.csv").write_text("\n".join(lines) + "\n")
    mass = material.rho * 4 / 3 * np.pi * radius**3
    (folder / "run.json").write_text(json.dumps({"num_grains": 1, "mass": mass}))
    return stress[0] * (1 - material.nu**2) / material.E, slope / stress[0]


def test_runs_with_its_mesh_tell_the_shape_of_a_grain(tmp_path):
    """ψ of each run at its material, between them a Gaussian process, from an edge a radius on."""

    def soft(x):
        return 1.3 * (1 + 0.1 * np.log10(0.01 / np.maximum(x, 1e-6)))

    own = write_run(tmp_path / "soft", soft)
    shape = shape_of_runs([tmp_path / "soft"])
    assert shape.delta[0] == pytest.approx(0.0025, rel=0.05)  # (1/20)², to a row
    # 200 rows of a smooth function.
    assert shape.ratio(shape.delta, *own) == pytest.approx(soft(shape.delta), rel=0.01)
    assert shape.distance(*own) == 0.0 and not shape.error(shape.delta, *own).any()

    other = write_run(tmp_path / "hard", lambda x: 1.1 + 0 * x, 2e9)
    both = shape_of_runs([tmp_path / "soft", tmp_path / "hard"])
    # A run may be off by NOISE, of which two a factor of two apart give little away.
    assert both.ratio(0.02, *other) == pytest.approx(1.1, rel=0.01)
    assert both.ratio(0.02, *own) == pytest.approx(soft(0.02), rel=0.01)
    assert both.distance(own[0] * 4, own[1]) > 0.5

    write_run(tmp_path / "held", soft, beside=0.05)
    with pytest.raises(InputError, match="on side walls, expected"):
        shape_of_runs([tmp_path / "held"])
