"""What tests of loading by stages share: an elastic cube, the march to the end, runs in folders."""

import numpy as np
from mpi4py import MPI

from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.loading.stages import StagedLoading
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene.stages import Loading, named
from tests.bodies import RADIUS, packed_grains

COMM = MPI.COMM_WORLD
SIZE, STUFF = 1e-3, Elastic(1e9, 0.2, 2650.0)
TOLERANCE, RAMP = 2e-3, 1e-4
#: A measured motion.
MOTION = """# of a test on sand
time [min], strain_x [%], displacement_y [um], z_max [mm]
0, 0.1, 0, 5
1, 0.2, 1, 5

3, 0.15, 1.5, 4.998
4, 0.3, 1, 4.997
"""


def cube(divisions=3):
    """A simulation of an elastic cube between six smooth walls."""
    body = box((SIZE,) * 3, (divisions,) * 3)
    return build(MPI.COMM_SELF, [body], STUFF, np.zeros(3), np.full(3, SIZE))


def loading_of(sim, program, speed, quasi_static=None, **settings):
    """The loading of a simulation by stages."""
    settings = Loading(speed=speed, ramp=RAMP, tolerance=TOLERANCE, **settings)
    return StagedLoading(sim, settings, named(program), quasi_static)


def steps(sim, loading, most=40000):
    """March to the end of a test; yields after each step."""
    while not loading.finished:
        loading.before_step()
        sim.step()
        yield
        assert sim.state.num_steps < most


def shared_folder(tmp_path_factory, **grains):
    """A folder that all ranks share, with grains by name: spheres along axes, h over the radius."""
    path = COMM.bcast(tmp_path_factory.mktemp("stages") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        for name, (numbers, h) in grains.items():
            save_grains(path / name, packed_grains(numbers, h=h * RADIUS))
    COMM.Barrier()
    return path


def run(folder, name, given, grains="grains", **options):
    """Run a scene with grains of a folder in a folder of it."""
    return run_scene(given, folder / grains, folder / name, COMM, quiet=True, **options)
