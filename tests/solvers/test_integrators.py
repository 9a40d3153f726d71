"""One test by several integrators in turn."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import (
    Contact,
    Implicit,
    MassScaling,
    Oedometer,
    Output,
    QuasiStatic,
    Scene,
    Solver,
    Wall,
    load_scene,
    scene_to_toml,
)
from tests.bodies import RADIUS, packed_grains

COMM = MPI.COMM_WORLD
ROCK = (1e9, 0.15, 2650.0)
SCENE = Scene(
    material=J2(*ROCK, ((0.0, 5e6), (0.05, 20e6))),
    contact=Contact(friction=0.4, wall_friction=0.3),
    oedometer=Oedometer(strain=0.01, speed=1.0, ramp=0.002, seating_stress=2e4),
    implicit=Implicit(step=5e-4, stabilisation=1e-4),
    output=Output(fields=2, history=21),
)


def by(integrator, strain):
    """The scene with that integrator up to that strain."""
    return replace(
        SCENE,
        solver=Solver(integrator=integrator, damping=2e4),
        oedometer=replace(SCENE.oedometer, strain=strain),
    )


def test_a_test_goes_on_with_another_integrator(tmp_path_factory):
    """Time steps, static and implicit increments, time steps: one history without a jump.

    Tolerances: of the two platens, inertia at this speed; of the energy, 2 % of the work, half
    of which is the motion that the static solver takes out.
    """
    folder = COMM.bcast(tmp_path_factory.mktemp("turns") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        save_grains(folder / "grains", packed_grains((2, 2, 2), h=0.7 * RADIUS))
    COMM.Barrier()
    ends = (("explicit", 0.01), ("static", 0.014), ("implicit", 0.016), ("explicit", 0.017))
    steps = []
    for k, (integrator, strain) in enumerate(ends):
        summary = run_scene(
            by(integrator, strain), folder / "grains", folder / "run", COMM, quiet=True,
            resume=k > 0,
        )  # fmt: skip
        assert summary["finished"]
        steps.append(summary["num_steps"])
    assert steps[1] - steps[0] < 60
    assert steps[2] - steps[1] < 60
    history = read_history(folder / "run" / "history.csv")
    loading = np.array([stage == "loading" for stage in history["stage"]])
    strain, stress = history["strain"][loading], history["stress"][loading]
    assert (np.diff(strain) > 0).all()
    late = strain > 0.009
    assert (np.abs(np.diff(stress[late])) < 0.25 * stress[late].max()).all()
    top, bottom = history["force_z_max"][loading], history["force_z_min"][loading]
    static = (strain > 0.0105) & (strain <= 0.014)
    np.testing.assert_allclose(top[static], bottom[static], rtol=0.02)
    assert (history["kinetic"][loading][static] == 0).all()
    assert abs(history["residual"][-1]) < 0.02 * history["work"][-1]


def test_scenes_keep_what_concerns_increments(tmp_path):
    """A scene comes back from its text, and options of PETSc are read as on a command line."""
    scene = replace(
        by("static", 0.02), implicit=Implicit(step=1e-3, petsc="-ksp_rtol 1e-9 -snes_monitor")
    )
    (tmp_path / "scene.toml").write_text(scene_to_toml(scene), encoding="utf-8")
    again = load_scene(tmp_path / "scene.toml")
    assert again.implicit == scene.implicit
    assert again.solver.integrator == "static"
    assert again.implicit.petsc_options() == {"ksp_rtol": "1e-9", "snes_monitor": None}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"material": Rigid(*ROCK)}, "material is rigid"),
        ({"walls": {"x_max": Wall(stress=1e5, speed=1.0)}}, "walls.x_max.stress"),
        ({"mass_scaling": MassScaling(added=0.01)}, "mass_scaling"),
        ({"quasi_static": QuasiStatic()}, "quasi_static"),
        ({"contact": Contact(friction=0.1, law="kinematic")}, "kinematic"),
    ],
)
def test_what_only_time_steps_can_do_is_refused(changes, message):
    """Before anything is computed, in one line."""
    # Static increments hold walls at a stress too.
    integrator = "implicit" if "walls" in changes else "static"
    with pytest.raises(InputError, match=message):
        replace(by(integrator, 0.01), **changes)


@pytest.mark.parametrize(
    ("key", "value"),
    [("step", 0.0), ("smallest", 1.0), ("largest", 1e-9), ("spectral_radius", 1.1),
     ("stabilisation", -1.0), ("tolerance", 0.0), ("max_iterations", 0), ("petsc", "ksp_rtol 1")],
)  # fmt: skip
def test_settings_out_of_range_are_refused(key, value):
    """With the key at the start of the message."""
    with pytest.raises(InputError, match=key):
        Implicit(**{key: value})
