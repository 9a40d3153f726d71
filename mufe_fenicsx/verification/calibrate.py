"""Parameters that were put into curves of pressed grains come back from `mufe calibrate`."""

import math

import numpy as np

from ..calibration import sentences
from ..calibration.data import Curve, Size
from ..calibration.fit import Given, fit_curves
from ..calibration.model import Setup, forces
from ..materials.j2 import J2
from . import reference
from .axisymmetric.platen import BallOnPlaten
from .case import at_least, case, compare
from .paper_sphere import HARDENING, NU, UNTIL, force_curve
from .paper_sphere import YIELD as PAPER_YIELD
from .paper_sphere import E as PAPER_E
from .plastic_ball import RADIUS

#: Glass that yields and hardens, between platens of steel.
E, GLASS_NU, YIELD, SLOPE = 70e9, 0.2, 1.5e9, 10e9
STEEL = (210e9, 0.3)
#: Of the machine [m/N]; diameters [m]; displacement at the end over the diameter.
COMPLIANCE, SMALLEST, LARGEST, DEPTH = 5e-8, 0.6e-3, 1.2e-3, 0.035
#: Largest offsets over the displacement at the end, and points of a curve.
OFFSET, POINTS = 0.05, 200
#: What has to come back.
MODULUS, STRESS, PAPER = 0.03, 0.10, 0.05
#: Where hardening ends, of the other model: forces differ by 1 %, and stresses there by 14 %.
OTHER = 0.2
#: Of 20 intervals of 95 % so many hold the true value, with a probability of 0.92.
HIT = 0.9


@case("calibrate", num_bodies=1)
def calibrate(comm, curves=20, noise=0.03, sets=20, elements=12, elements_per_radius=5.0):
    """Curves with noise, offsets and a soft machine give back modulus, yield stress and hardening.

    The first rows count sets of curves by the model of the fit itself. Those of "other model" are
    of curves by axisymmetric elements on a finer mesh, with platens as bodies. The last are of the
    paper's balls (figure 8), whose modulus is given: in three dimensions as `paper-sphere` makes
    them, and of its axisymmetric reference.

    Args:
        comm: MPI communicator.
        curves: Number of grains that are pressed.
        noise: Standard deviation of forces, over these.
        sets: Times that this is done, for the intervals.
        elements: Edges per contact radius of the finer mesh.
        elements_per_radius: Of the paper's ball in three dimensions.
    """
    setup = Setup(GLASS_NU, "platens", STEEL)
    true = {"E": E, "yield": YIELD, "hardening": SLOPE}
    course = setup.course(*true.values())
    near, held = np.zeros(3), np.zeros(3)
    for seed in range(sets):
        fit = fit_curves(made_curves(course, setup, curves, noise, seed), setup)
        near += [line["passed"] for line in _errors(fit, "").values()]
        held += [low < true[name] < high for name in true for low, high in [fit.interval(name)]]
    results = {}
    for name, part, count in zip(true, (MODULUS, STRESS, STRESS), near, strict=True):
        what = "yield stress where hardening ends" if name == "hardening" else name
        results[f"sets of {sets} with {what} within {100 * part:g} %"] = at_least(
            count, math.floor(HIT * sets)
        )
    for name, count in zip(true, held, strict=True):
        results[f"sets of {sets} with the true {name} in its interval"] = at_least(
            count, math.floor(HIT * sets)
        )
    fit = fit_curves(made_curves(other_course(elements), setup, curves, noise, 1), setup)
    results |= _errors(fit, "other model: ", OTHER)
    course = force_curve(comm, PAPER_YIELD[-1], elements_per_radius, 0.004, increments=60)
    inside = course.force > 0
    results |= _paper(course.approach[inside], course.force[inside], PAPER_YIELD[-1], "tetrahedra")
    for Y in PAPER_YIELD:
        stored = reference.load()[reference.paper_name(Y)]
        force = stored["force"] * PAPER_E * RADIUS**2
        results |= _paper(stored["delta"] * RADIUS, force, Y, "axisymmetric")
    return results, [course.simulation]


def made_curves(course, setup, number, noise, seed):
    """Curves of balls of different sizes with offsets, a soft machine and noise. Local.

    Args:
        course: Approach over radius and force over its square [Pa], as by
            :meth:`~mufe_fenicsx.calibration.model.Setup.course`.
        setup: Of the test.
        number: Of curves.
        noise: Standard deviation of forces, over these.
        seed: Of random numbers.
    """
    rng = np.random.default_rng(seed)
    found = []
    for i in range(number):
        d = rng.uniform(SMALLEST, LARGEST)
        way = rng.uniform(0.7, 1.0) * DEPTH * d
        x = np.linspace(0.0, way, POINTS + 1)[1:]
        curve = Curve(f"{i + 1}", x, np.zeros_like(x), Size(d, d, d))
        offset = rng.uniform(-1.0, 1.0) * OFFSET * way
        force = forces(curve, setup, course, offset, COMPLIANCE)[0]
        force = force * (1 + noise * rng.standard_normal(x.size))
        found.append(Curve(curve.name, x, force, curve.size))
    return found


def other_course(elements):
    """The same material by axisymmetric elements, a ball on a platen that is a body.

    Radial return is of the first order in steps: twice the forces of many less those of half.
    """
    material = J2(E, GLASS_NU, 2500.0, ((0.0, YIELD), (1.0, YIELD + SLOPE)))
    modulus = STEEL[0] / (1 - STEEL[1] ** 2) / E
    most, steps, found = 1.05 * DEPTH, 24, []
    for n in (steps, steps // 2):
        ball = BallOnPlaten(material, 1.4 * math.sqrt(most), elements, 3, modulus=modulus)
        states = [ball.press(most * (k / n) ** 2) for k in range(1, n + 1)]
        found.append(np.array([(s.delta, s.force * E) for s in states]))
    many, few = found[0][1::2], found[1]
    delta, stress = many[:, 0], 2 * many[:, 1] - few[:, 1]
    # Between steps force goes with a power of the approach, before the first with that of Hertz.
    fine = np.geomspace(1e-8, delta[-1], 2000)
    ratio = np.interp(np.log(fine), np.log(delta), np.log(stress / delta**1.5))
    return fine, np.exp(ratio) * fine**1.5


def _errors(fit, name, ends=STRESS):
    strain, stress, _ = sentences.end_of_table(fit)
    return {
        f"{name}Young's modulus [Pa]": compare(fit.value("E"), E, MODULUS),
        f"{name}yield stress [Pa]": compare(fit.value("yield"), YIELD, STRESS),
        f"{name}yield stress at strain {strain:g} [Pa]": compare(
            stress, YIELD + SLOPE * strain, ends
        ),
    }


def _paper(approach, force, Y, name):
    """Yield stress at strains 0 and 0.05 of a ball of the paper that yields first at Y [Pa]."""
    curve = Curve(name, approach, force, Size(*[2 * RADIUS] * 3))
    given = Given(E=PAPER_E, offset=0.0, compliance=0.0)
    fit = fit_curves([curve], Setup(NU, "platen"), given)
    name = f"paper, {Y / 1e6:g} MPa, {name}: yield stress"
    stress = fit.value("yield") + UNTIL * fit.value("hardening")
    return {
        f"{name} [Pa]": compare(fit.value("yield"), Y, PAPER),
        f"{name} at strain {UNTIL:g} [Pa]": compare(stress, Y + HARDENING, PAPER),
    }
