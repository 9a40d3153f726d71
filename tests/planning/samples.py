"""Scenes, samples and points of the evidence that plans are tried on."""

from mufe_fenicsx.analysis.evidence import Point, command_of
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.planning.sample import Sample
from mufe_fenicsx.scene import Contact, Oedometer, Scene
from mufe_fenicsx.scene.stages import Axis, Loading, Stage

ROCK = {"E": 100e9, "nu": 0.15, "rho": 2650.0}

J2_ROCK = J2(**ROCK, yield_stress=((0.0, 10e6), (0.05, 110e6)))


def point(error, seconds, case="hertz", series="averaged", curve=(), cells=20000, **parameters):
    command = command_of(case, parameters)
    return Point(case, series, error, seconds, 1e6 * seconds, cells, 100, "done", command, curve)


def course(error):
    """Stress at eight parts of the strain that is off by a part everywhere."""
    return tuple(1e6 * k * (1 + error) for k in range(1, 9))


def scene(material=J2_ROCK, **more):
    return Scene(material, Contact(0.23), Oedometer(0.1, 1.0), **more)


def sample(n, num_grains=500):
    """Grains of 0.2 mm, 1000 tetrahedra each, n elements per contact radius of 20 um."""
    labels = tuple(range(1, num_grains + 1))
    return Sample("grains", labels, num_grains * 1000, 20e-6 / n, 20e-6 / n, 200e-6)


def staged(**last):
    """Seating, 5 MPa on all sides, then shear."""
    stages = (
        Stage(zero=True, xyz=Axis(stress=5e5, speed=3.0)),
        Stage("isotropic", xyz=Axis(stress=5e6), hold=5e-6),
        Stage("shear", **({"z": Axis(strain=0.03)} | last)),
    )
    return Scene(J2_ROCK, Contact(0.23), loading=Loading(speed=0.5, ramp=0.001), stages=stages)
