"""A scene with a membrane: cell pressure by stages, its columns, resume, ranks, refusals."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.output.fields import read_state
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.output.run_folder import read_run_json
from mufe_fenicsx.run.opened import open_run
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import load_scene, scene_to_toml
from tests.bodies import RADIUS, packed_grains

SCENE = """
[sample]
grains = "{grains}"
separation = false
[material]
model = "elastic"
E = "1 GPa"
nu = 0.2
rho = "2500 kg/m^3"
[contact]
friction = 0.3
[container]
shape = "cylinder"
[membrane]
thickness = "0.2 mm"
size = "0.6 mm"
rho = "100 kg/m^3"
[walls.side]
friction = 0.2
[solver]
damping = "400 ms^-1"
[loading]
speed = "2 m/s"
ramp = 0.0005
tolerance = 0.05
[[stage]]
zero = true
rz = {{ stress = "20 kPa" }}
[[stage]]
name = "shear"
z = {{ strain = 0.002 }}
[output]
fields = 2
history = 30
"""


def scene(folder, text=SCENE, **changes):
    path = folder / "scene.toml"
    text = text.format(grains=folder / "grains")
    for old, new in changes.values():
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    comm = MPI.COMM_WORLD
    path = comm.bcast(tmp_path_factory.mktemp("cell") if comm.rank == 0 else None)
    if comm.rank == 0:
        save_grains(path / "grains", packed_grains((2, 2, 2), h=0.7 * RADIUS))
        scene(path)
    comm.Barrier()
    return path


def run(folder, name, comm, **options):
    test = load_scene(folder / "scene.toml")
    return run_scene(test, folder / "grains", folder / name, comm, quiet=True, **options)


def test_the_cell_goes_to_its_pressure_and_a_run_that_stops_goes_on(folder):
    run(folder, "whole", MPI.COMM_SELF, max_steps=300)
    run(folder, "whole", MPI.COMM_SELF, resume=True)
    history = read_history(folder / "whole" / "history.csv")
    assert history["cell_pressure"][-1] == 20e3
    assert np.all(np.diff(history["cell_pressure"][history["stage"] == "seating"]) >= 0)
    # Stress across is the pressure of the cell, and that along its own, to the scene's tolerance.
    np.testing.assert_allclose(history["stress_r"], history["cell_pressure"], rtol=1e-9)
    seated = history["stress_z"][history["stage"] == "seating"][-1]
    assert seated == pytest.approx(20e3, rel=0.05)
    # The sleeve stood around all balls, and is drawn in between them.
    assert history["diameter"][-1] < history["diameter"][0]
    assert history["strain_z"][-1] == pytest.approx(0.002)
    fed = history["work"][-1] - history["energy_cell_pressure"][-1]
    assert abs(history["residual"][-1]) < 1e-2 * fed
    # It is no grain.
    summary = read_run_json(folder / "whole")
    assert summary["num_grains"] == 8 and summary["membrane"] == {"label": 9}
    assert history["num_active_grains"].max() == 8
    assert history["num_active_contacts"].max() <= 6.0
    # The files for ParaView have it, what is read of a run for numbers of grains has not.
    opened, drawn = open_run(folder / "whole"), read_state(folder / "whole", 1)
    state, own = opened.state(1), drawn["grain"] != 9
    assert set(drawn["grain"]) == {*range(1, 10)} and state.labels.tolist() == [*range(1, 9)]
    np.testing.assert_array_equal(state.stress, drawn["stress"][own])
    x = (drawn.points + drawn["displacement"])[drawn.cells_dict[10][own]]
    np.testing.assert_array_equal(state.points[state.cells], x)
    assert state.fields["stress"] == state.stress.shape
    assert state.fields["displacement"] == state.displacement.shape
    assert opened.solid_volume * 2500.0 == pytest.approx(summary["mass"])
    assert summary["num_cells"] == own.sum() and np.abs(drawn["stress"][~own]).max() > 0.0
    contacts = opened.contacts(1)
    assert len(opened.grains(1)) == 8 and (contacts["wall"] == "side").any()
    # Without a stop the beginning is the same, beyond it too.
    run(folder, "begin", MPI.COMM_SELF, max_steps=450)
    begin = read_history(folder / "begin" / "history.csv")
    num_rows = np.count_nonzero(history["step"] <= 450)
    assert history["step"][num_rows - 1] > 300
    for name, values in history.items():
        np.testing.assert_array_equal(values[:num_rows], begin[name][:num_rows], err_msg=name)


@pytest.mark.slow
def test_mean_stress_and_ratio_are_kept_by_the_cell(tmp_path):
    """p and eta beside a strain of z: the pressure follows what the platens carry."""
    save_grains(tmp_path / "grains", packed_grains((2, 2, 2), h=0.7 * RADIUS))
    stages = (
        'z = {{ strain = 0.0002 }}\np = "20 kPa"\n'
        '[[stage]]\nname = "ratio"\nz = {{ strain = 0.0003 }}\neta = 0.4\n'
        '[[stage]]\nname = "path"\np = "25 kPa"\nq = "5 kPa"\n'
    )
    text = SCENE.replace("z = {{ strain = 0.002 }}\n", stages).replace("= 30", "= 400")
    test = scene(tmp_path, text)
    run_scene(test, tmp_path / "grains", tmp_path / "run", MPI.COMM_SELF, quiet=True)
    history = read_history(tmp_path / "run" / "history.csv")
    side, vertical = history["stress_r"], history["stress_z"]
    p, q = (2.0 * side + vertical) / 3.0, vertical - side
    np.testing.assert_allclose(side, history["cell_pressure"], rtol=1e-12)
    found = {}
    for name, num in (("shear", 40), ("ratio", 8), ("path", 8)):
        rows = np.flatnonzero(history["stage"] == name)[-num:]
        found[name] = p[rows].mean(), q[rows].mean()
    assert history["strain_z"][history["stage"] == "ratio"][-1] == pytest.approx(0.0003)
    # Eight balls ring by a tenth of p: over ten periods a mean keeps at most a tenth of that.
    assert found["shear"][0] == pytest.approx(20e3, rel=0.01)
    # The cell is 10 µs behind platens whose stress grows by 0.06 % a µs.
    mean, deviator = found["ratio"]
    eta, across = 0.4, (mean - deviator / 3) / (mean + 2 * deviator / 3)
    assert across == pytest.approx((3 - eta) / (3 + 2 * eta), rel=0.01)
    assert found["path"] == pytest.approx((25e3, 5e3), rel=0.05)
    # At a constant p single values would go through to the cell by half: means do not.
    kept = history["stage"] == "shear"
    jumps = [np.abs(np.diff(stress[kept])).max() for stress in (side, vertical)]
    assert jumps[0] < 0.25 * jumps[1] and side.min() >= 0.0


def test_a_sleeve_as_thick_as_the_sample_is_refused(folder, tmp_path):
    text = SCENE.replace('thickness = "0.2 mm"', 'thickness = "20 mm"')
    test = scene(tmp_path, text)
    with pytest.raises(InputError, match=r"membrane.thickness = 0.02 m, expected at most half"):
        run_scene(test, folder / "grains", tmp_path / "run", MPI.COMM_SELF, quiet=True)
    assert not (tmp_path / "run").exists()


@pytest.mark.mpi
def test_ranks_agree(folder):
    comm = MPI.COMM_WORLD
    run(folder, "together", comm, max_steps=20)
    if comm.rank:
        return
    run(folder, "alone", MPI.COMM_SELF, max_steps=20)
    histories = [read_history(folder / name / "history.csv") for name in ("together", "alone")]
    for name in ("diameter", "cell_pressure", "stress_z", "membrane_force", "elastic"):
        # Sums in another order: rounding, which twenty steps do not let grow much.
        np.testing.assert_allclose(
            histories[0][name], histories[1][name], rtol=1e-8, atol=1e-12, err_msg=name
        )


def test_scene_is_written_as_it_is_read(folder, tmp_path):
    test = load_scene(folder / "scene.toml")
    (tmp_path / "again.toml").write_text(scene_to_toml(test), encoding="utf-8")
    assert load_scene(tmp_path / "again.toml") == test


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ('shape = "cylinder"', 'shape = "box"'),
            'container.shape = "box", expected "cylinder" with [membrane]',
        ),
        (
            ('rz = { stress = "20 kPa" }', "r = { strain = 0.1 }"),
            "stage[1].r.stress is missing, expected one with [membrane]: the pressure of the cell, "
            "which leads no diameter",
        ),
        (
            ("z = { strain = 0.002 }", "z = { strain = 0.002 }\nundrained = true"),
            "stage[2].undrained = true, expected false with [membrane]: the cell presses, and "
            "keeps no volume",
        ),
        (
            ("z = { strain = 0.002 }", 'follow = "measured.csv"'),
            "stage[2].follow is given, expected none with [membrane]: the cell presses, and leads "
            "no diameter",
        ),
        (
            ("z = { strain = 0.002 }", 'z = { strain = 0.002 }\nturn = { angle = 0.1 }'),
            "stage[2].turn is given, expected none with [membrane]",
        ),
        (
            ("[output]", "[quasi_static]\n[output]"),
            "[quasi_static] is given, expected none beside [membrane]",
        ),
        (
            ("[output]", '[materials.membrane]\nlabels = [1]\nmodel = "elastic"\nE = 1e9\n'
             "nu = 0.2\nrho = 1000\n[output]"),
            "materials.membrane is given, expected another name with [membrane]",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_named(tmp_path, change, message):
    text = SCENE.replace('shape = "cylinder"\n', 'shape = "cylinder"\n')
    if "box" in change[1]:  # axes of a box, or the stage is refused first
        text = text.replace("rz = ", "xyz = ").replace("[walls.side]", "[walls.x_min]")
    with pytest.raises(InputError) as caught:
        scene(tmp_path, text, change=change)
    assert message in str(caught.value)
