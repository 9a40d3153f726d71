"""Energies of single grains from stored states, beside those that the run itself summed."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import Contact, Oedometer, Output, QuasiStatic, Scene
from tests.bodies import RADIUS, packed_grains

ROCK = (100e9, 0.15, 2650.0)


def pressed(folder, material):
    """A run of two columns of balls."""
    scene = Scene(
        material=material,
        contact=Contact(friction=0.4, wall_friction=0.2),
        oedometer=Oedometer(strain=0.008, speed=20.0, seating_stress=1e4),
        output=Output(fields=2, history=11),
        quasi_static=QuasiStatic(kinetic=0.5, unbalanced=0.2, loaded=0.004),
    )
    save_grains(folder / "grains", packed_grains((1, 2, 2), h=0.7 * RADIUS))
    run_scene(scene, folder / "grains", folder / "run", MPI.COMM_SELF, quiet=True)
    return Source(folder / "run")


def test_plastic_energies_of_grains_add_up_to_the_history(tmp_path):
    """With dents, which have a part of it; tolerance: the rounding of some thousand sums."""
    source = pressed(tmp_path, J2(*ROCK, ((0.0, 10e6), (0.05, 110e6))))
    course, history = source.course, source.history
    row = np.searchsorted(history["time"], course["time"][-1])
    assert history["time"][row] == course["time"][-1]
    total, dents = history["plastic"][row], history["plastic_dents"][row]
    assert 0.05 * total < dents < 0.95 * total
    assert course["energy"]["plastic"][-1].sum() == pytest.approx(total, rel=1e-12)
    assert not course["without_work"]


def test_grains_that_do_not_yield_keep_no_work_of_dents(tmp_path):
    source = pressed(tmp_path, Elastic(*ROCK))
    assert "plastic_work" not in source.run.state(-1).fields
    assert not source.history["plastic_dents"].any()
    assert not source.course["energy"]["plastic"].any()
