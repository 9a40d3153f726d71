"""`mufe watch`: where a run stands by files that are still being written."""

import json
import os
import time

import pytest
from mpi4py import MPI

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.cli.watch import _line
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output.run_lock import RunLock
from mufe_fenicsx.results.watch import Watch

ENERGIES = "kinetic,elastic,plastic,friction,contact,damping,work,unbalanced_z"
COLUMNS = f"step,time,dt,stage,strain,height,speed,force_z_min,force_z_max,stress,{ENERGIES}"
#: When the files of the made-up run were written [s].
STARTED = 1_000_000.0


def row(step, strain, stage="loading"):
    return f"{step},1e-5,1e-9,{stage},{strain},1e-3,1.0,9.0,11.0,1e7,0.5,20,80,10,1,0,111.7,-2.0"


class MadeUpRun:
    """A folder as `mufe run` keeps it, with the time at which each file was written."""

    def __init__(self, folder):
        self.folder = folder
        self.rows, self.now = [COLUMNS], STARTED
        (folder / "scene.toml").write_text("[oedometer]\nstrain = 0.1\n")
        self.summary(finished=False, stop_reason="running")

    def summary(self, **changes):
        path = self.folder / "run.json"
        run = {"title": "[bold] sand", "num_steps": 0, "num_cells": 1000, **changes}
        path.write_text(json.dumps(run))
        os.utime(path, (self.now, self.now))

    def write(self, *rows, seconds, torn=""):
        """Rows that come after so many seconds, and the beginning of another."""
        self.rows += rows
        self.now += seconds
        path = self.folder / "history.csv"
        path.write_text("\n".join(self.rows) + "\n" + torn)
        os.utime(path, (self.now, self.now))


def test_a_run_from_its_start_to_its_end(tmp_path):
    run = MadeUpRun(tmp_path)
    watch = Watch(tmp_path, clock=lambda: run.now)
    assert watch.look().state == "starting"
    (tmp_path / "history.csv").write_text(COLUMNS[:30])  # not even the names are complete
    assert watch.look().state == "starting"

    run.write(row(0, 0.0, "seating"), row(1000, 0.0, "seating"), seconds=10)
    now = watch.look()
    assert now.state == "running" and now.seconds_left is None  # strain does not grow yet
    assert now.steps_per_second == 100  # since run.json was written

    # 400 steps and a strain of 0.01 from row to row, 200 steps a second, 0.05 to go.
    run.write(row(1400, 0.01), row(1800, 0.02), seconds=4, torn="2200,1e-5,1e-")
    now = watch.look()
    assert now.values["step"] == 1800 and now.values["strain"] == 0.02
    assert now.steps_per_second == 200 and now.cells_per_second == 2e5
    run.write(row(2200, 0.03), row(2600, 0.04), row(3000, 0.05), seconds=6)
    now = watch.look()
    assert now.steps_per_second == 200 and now.seconds_left == pytest.approx(0.05 / 0.01 * 2)
    assert now.values["kinetic_ratio"] == pytest.approx(0.005)
    assert now.values["force_difference"] == pytest.approx(0.2)
    assert now.values["plastic_share"] == pytest.approx(80 / 111.7)

    run.now += 1000  # no row any more: it computes, or was killed
    assert watch.look().state == "silent"
    run.now -= 1000
    run.rows = run.rows[:4]  # the run went back to a checkpoint
    run.write(row(1500, 0.012), seconds=1)
    assert watch.look().values["step"] == 1500
    run.write(row(1900, 0.022), seconds=4)
    assert watch.look().steps_per_second == 100  # rows before it went back do not count
    assert "facets" not in _line(watch.look())
    run.rows[0] += ",num_opened,num_fragments,broken_grains,cracks_fracture"
    run.rows[1:] = [f"{line},7,3,1,2.5e-6" for line in run.rows[1:]]
    run.write(seconds=0)
    assert "; 7 facets opened, 3 fragments of 1 grains, fracture work 2.5 µJ" in _line(watch.look())
    run.summary(finished=True, stop_reason="final strain reached", num_steps=9, wall_s=3.0)
    now = watch.look()
    assert now.ended and now.state == "finished" and now.seconds_left is None
    run.summary(finished=False, stop_reason="grain 7 is inverted")
    assert watch.look().as_dict()["why"] == "grain 7 is inverted"


def test_time_left_of_a_test_by_stages(tmp_path):
    """A stage has 300/3 rows; those that come are taken to be as long as the present one."""
    run = MadeUpRun(tmp_path)
    stages = "[output]\nhistory = 301\n[[stage]]\nzero = true\n" + "[[stage]]\nhold = 1\n" * 2
    (tmp_path / "scene.toml").write_text(stages)
    watch = Watch(tmp_path, clock=lambda: run.now)
    run.write(*(row(100 * k, 0.0, "seating") for k in range(5)), seconds=10)
    assert watch.look().seconds_left is None  # walls still come on to the sample
    run.write(row(500, 0.0, "load"), seconds=5)
    watch.look()
    run.write(*(row(500 + 20 * k, -1e-3 * k, "load") for k in range(1, 26)), seconds=10)
    now = watch.look()
    # 500 steps in 10 s for a quarter of this stage: 1500 are left of it, 2000 come after it.
    # The first look but one saw 500 steps after 15 s, so that speed is that of 500 steps in 10 s.
    assert now.seconds_left == pytest.approx(3500 / now.steps_per_second)
    assert now.values["target_strain"] is None
    assert now.rests_on == "if later stages take as many steps as this one"
    # The first stage, at rest until the sample is seated, may have any name.
    run.rows = [COLUMNS]
    run.write(*(row(100 * k, 0.0, "settle") for k in range(5)), seconds=10)
    (tmp_path / "scene.toml").write_text(
        "[output]\nhistory = 301\n" + '[[stage]]\nname = "settle"\nzero = true\n' + "[[stage]]\n"
    )
    assert watch.look().seconds_left is None


def test_the_command_prints_once_and_as_json(tmp_path, capfd):
    run = MadeUpRun(tmp_path)
    run.write(row(0, 0.0), row(400, 0.01), seconds=4, torn="7")
    with pytest.raises(SystemExit) as end:
        main(["watch", str(tmp_path), "--once", "--json", "-"])
    out, err = capfd.readouterr()
    assert end.value.code == 0 and json.loads(out)["strain"] == 0.01
    assert "[bold] sand" in err and "force on the top platen" in err and "0.0100 of 0.1" in err
    run.summary(finished=True, stop_reason="final strain reached")
    with pytest.raises(SystemExit) as end:
        main(["watch", str(tmp_path)])  # ends by itself
    assert end.value.code == 0 and "final strain reached" in capfd.readouterr().out


def test_a_run_that_was_killed_is_told_and_ends(tmp_path, capfd):
    """Its process, which the lock names, is gone; in another case it is there."""
    run = MadeUpRun(tmp_path)
    run.write(row(0, 0.0, "seating"), row(400, 0.0, "seating"), seconds=4)
    lock = RunLock(MPI.COMM_SELF, tmp_path)
    lock.take()
    watch = Watch(tmp_path, clock=lambda: run.now)
    assert watch.look().state == "running"
    kept = json.loads((tmp_path / "run.lock").read_text())
    lock.free()
    (tmp_path / "run.lock").write_text(json.dumps(kept | {"started": -5}))
    now = watch.look()
    assert now.ended and "the run died" in now.why and "it left no checkpoint" in now.why
    (tmp_path / "checkpoints" / "step-000000100").mkdir(parents=True)
    with pytest.raises(SystemExit) as end:
        main(["watch", str(tmp_path)])  # ends by itself
    out = capfd.readouterr().out
    assert end.value.code == 0 and "--resume goes on from its checkpoint" in out
    assert "step 400, vertical stress 10 MPa" in out
    (tmp_path / "run.lock").write_text(json.dumps(kept | {"machine": "another"}))
    assert watch.look().state == "running"


def test_a_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(InputError, match="none of run"):
        Watch(tmp_path)
    with pytest.raises(InputError, match="absent"):
        Watch(tmp_path / "nothing")
    (tmp_path / "mine.txt").write_text("")  # no run will be written here
    with pytest.raises(InputError, match="none of run"):
        Watch(tmp_path, wait=True)


def test_a_run_that_has_yet_to_begin_is_waited_for(tmp_path, monkeypatch, capfd):
    folder, looks = tmp_path / "results", []
    watch = Watch(folder, wait=True)
    assert watch.look().state == "waiting" and not watch.look().ended
    folder.mkdir()
    (folder / "run.lock").write_text("")  # what a run makes first
    assert watch.look().state == "waiting"

    def begin(_):
        looks.append(1)
        if len(looks) == 2:
            run = MadeUpRun(folder)
            run.write(row(0, 0.0), row(400, 0.01), seconds=4)
            run.summary(finished=True, stop_reason="final strain reached")

    monkeypatch.setattr(time, "sleep", begin)
    with pytest.raises(SystemExit) as end:
        main(["watch", str(folder)])
    out = capfd.readouterr().out
    assert end.value.code == 0 and out.count("waiting: the run has yet to begin") == 2
