"""Plates in which a crack runs from a notch: struck beside it, and pulled apart."""

import numpy as np

from ..bulk.cracks.cracks import Cracks
from ..bulk.cracks.facets import Facets
from ..bulk.tools import Tool
from ..contact.walls import Wall
from ..errors import InputError
from ..geometry.bodies.shapes import box
from ..geometry.bodies.slit_plate import slit_plate
from ..loading.pressure import Pressure
from ..materials.elastic import Elastic
from ..materials.fracture import Fracture
from ..run.from_bodies import build
from ..theory.elasticity import rayleigh_speed
from .case import at_least, case, compare
from .cracked_strip import failed_area

Y, Z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
STEEL, STEEL_ENERGY = Elastic(190e9, 0.3, 8000.0), 2.213e4
GLASS, GLASS_ENERGY = Elastic(32e9, 0.2, 2450.0), 3.0
#: Part of the struck plate's crack whose direction counts [m].
FIRST = 0.03
#: Steps from one look at the crack to the next.
LOOK = 10


@case("kalthoff-winkler", num_bodies=1)
def kalthoff_winkler(comm, edge=1.5, strength=0.84, shear_ratio=2.0, way=40.0):
    """A steel plate is struck between two notches: cracks leave them at about 70 degrees.

    Half of the plate, above its plane of symmetry, has a notch at a quarter of its width. A rigid
    projectile pushes the edge below at half of its speed of 33 m/s. The crack of the notch opens
    in tension and runs upwards (J. F. Kalthoff, S. Winkler, 1987; J. F. Kalthoff, Int. J. Fract.
    101, 2000, 1-31). Plane strain: one layer of cells between two mirrors.

    Args:
        comm: MPI communicator.
        edge: Of the mesh [mm].
        strength: [GPa]; the cohesive zone E G/σ² is 6 mm long at 0.84 GPa.
        shear_ratio: β.
        way: Of the front from the tip of the notch at the end [mm].
    """
    size, tip, h, speed = 0.1, np.array([0.05, 0.025]), 1e-3 * edge, 16.5
    high = tip[1] - 0.5 * h  # the other face of the notch does not meet the projectile
    shot = Tool(
        "projectile", *box((0.01, high + h, 3.0 * h), (1, 1, 1), (-0.01 - 1e-3 * h, -h, -h)),
        velocity=(speed, 0.0, 0.0),
    )  # fmt: skip
    s, cracks, middle = _plate(
        comm, (size, size), h, tip, STEEL,
        Fracture(1e9 * strength, STEEL_ENERGY, shear_ratio),
        walls=[Wall("middle", 0.0 * Y, Y, mirror=True)], tools=[shot],
    )  # fmt: skip

    def front(x):
        return np.linalg.norm(x[x[:, 1] > tip[1]] - tip, axis=1).max(initial=0.0)

    times, fronts = _run(s, cracks, middle, 100e-6, front, 1e-3 * way)
    x, area = _failed(cracks, middle)
    x = x - tip
    near = np.linalg.norm(x, axis=1) < FIRST
    angle, spread = _direction(x[near], area[near])
    struck = (s.mesh.x[:, 0] == 0.0) & (s.mesh.x[:, 1] < high)
    results = {
        # It may leave the notch an edge beside its tip.
        "direction of the crack [degrees]": compare(
            angle, np.clip(angle, 65.0, 72.0), np.degrees(h / FIRST), scale=1.0
        ),
        "width of the crack over its length": compare(spread, 0.0, 0.2, scale=1.0),
        "way of the struck edge over that stated": compare(
            s.state.u[struck, 0].mean() / (speed * s.state.t), 1.0, 0.03
        ),
        **_shared(s, cracks, h, times, fronts, STEEL, 1.0),
    }
    return results, [s]


@case("branching-plate", num_bodies=1)
def branching_plate(comm, edge=1.5, strength=3.08, stress=1.0, shear_ratio=2.0):
    """A notched plate of glass is pulled apart at once: its crack runs and branches.

    Stress acts on both long edges from the start on. Cracks in glass stay below 0.6 of the speed
    of Rayleigh's waves. This one branches on its way (M. J. Borden et al., Comput. Methods Appl.
    Mech. Eng. 217-220, 2012, 77-95; J.-H. Song, H. Wang, T. Belytschko, Comput. Mech. 42, 2008,
    239-250). Two fronts run on beside each other; it hangs on the mesh whether one stops at last.
    Plane strain: one layer of cells between two mirrors.

    Args:
        comm: MPI communicator.
        edge: Of the mesh [mm].
        strength: [MPa]; the cohesive zone E G/σ² is 10 mm long at 3.08 MPa.
        stress: On both edges [MPa].
        shear_ratio: β.
    """
    length, height, h = 0.1, 0.04, 1e-3 * edge
    tip = np.array([0.5 * length, 0.5 * height])
    s, cracks, middle = _plate(
        comm, (length, height), h, tip, GLASS,
        Fracture(1e6 * strength, GLASS_ENERGY, shear_ratio),
    )  # fmt: skip
    pull = Pressure(
        s.mesh, -1e6 * stress, name="pull",
        where=lambda x, _normal: np.abs(x[:, 1] - tip[1]) > 0.499 * height,
    )  # fmt: skip
    s.add_term(pull)

    def front(x):
        return x[:, 0].max(initial=tip[0]) - tip[0]

    times, fronts = _run(s, cracks, middle, 90e-6, front, 0.45 * length)
    forked, num = _branches(_failed(cracks, middle)[0], h)
    results = {
        "fronts near the end": compare(num, 2.0, np.inf),
        "length of two fronts or more [mm]": at_least(1e3 * forked, 10.0),
        **_shared(s, cracks, h, times, fronts, GLASS, 0.6),
    }
    return results, [s]


def _plate(comm, size, h, tip, material, law, walls=(), **options):
    """A plate with an open slit to its ``tip``, its cracks, and middles of facets in its plane."""
    mirrors = [Wall("back", 0.0 * Z, Z, mirror=True), Wall("face", h * Z, -Z, mirror=True)]
    s = build(
        comm, [slit_plate(*size, h, tip)], material, (0, 0, 0), (0, 0, 0), "",
        walls=[*mirrors, *walls], **options,
    )  # fmt: skip
    facets = Facets(s.mesh, s.solid.volume0)
    x = s.mesh.x[facets.nodes(s.mesh)[:, :3], :2]
    cut = ((np.abs(x[:, :, 1] - tip[1]) < 1e-6 * h) & (x[:, :, 0] < tip[0] + 1e-6 * h)).all(axis=1)
    s.grow(facets.across[cut])
    cracks = Cracks(s.specimen, law)
    cracks.strength[cut] = np.inf
    s.add_term(cracks)
    return s, cracks, x.mean(axis=1)


def _run(s, cracks, middle, end, front, way):
    """Step until a time, or until the front has come so far; times and ways of the front.

    Raises:
        InputError: It does not leave the notch.
    """
    times, fronts = [0.0], [0.0]
    while s.state.t < end and fronts[-1] < way:
        s.step(everywhere=False)
        if s.state.num_steps % LOOK == 0:
            times.append(s.state.t)
            fronts.append(front(_failed(cracks, middle)[0]))
    if fronts[-1] <= 0.0:
        raise InputError(
            f"strength = {cracks.fracture.strength:g} Pa: no crack leaves the notch within "
            f"{s.state.t:.3g} s, expected one"
        )
    s.complete()
    return np.array(times), np.array(fronts)


def _failed(cracks, middle):
    """Middles in the plane [m] and areas [m²] of what has failed."""
    area = failed_area(cracks)
    return middle[cracks.opened][area > 0.0], area[area > 0.0]


def _direction(x, area):
    """Direction of places seen from the origin [degrees], and their width over their length."""
    if not len(x):
        return 0.0, np.inf
    (across, along), axes = np.linalg.eigh(np.einsum("n,ni,nj->ij", area, x, x))
    axis = axes[:, 1] * np.sign(area @ (x @ axes[:, 1]))
    return np.degrees(np.arctan2(axis[1], axis[0])), np.sqrt(max(across, 0.0) / along)


def _speed(times, fronts, low, high):
    """Mean speed of a front between two of its ways [m/s]."""
    on = (fronts > low) & (fronts < high)
    return np.polyfit(times[on], fronts[on], 1)[0] if on.sum() > 2 else 0.0


def _branches(x, h):
    """Length along x on which a crack has two fronts or more [m], and how many near its end."""
    column = (x[:, 0] / (2.0 * h)).astype(int)
    num = [1 + (np.diff(np.sort(x[column == k, 1])) > 3.0 * h).sum() for k in np.unique(column)]
    last = max(len(num) // 10, 1)  # of the foremost branch alone
    return 2.0 * h * np.greater(num, 1).sum(), float(np.median(num[-4 * last : -last]))


def _shared(s, cracks, h, times, fronts, material, limit):
    """What both cases tell: speed below a ``limit`` over Rayleigh's, and energies."""
    e, wave = s.energies(), rayleigh_speed(material.E, material.nu, material.rho)
    told = {
        "start of the crack [µs]": 1e6 * times[fronts > 0.0].min(initial=np.inf),
        "way of its front [mm]": 1e3 * fronts[-1],
        "fracture work over that of this way": e["cracks_fracture"]
        / (cracks.fracture.energy * h * fronts[-1]),
    }
    return {name: compare(value, value, np.inf) for name, value in told.items()} | {
        "speed of the front over that of Rayleigh's waves": compare(
            _speed(times, fronts, 2.0 * h, 0.9 * fronts[-1]) / wave, 0.0, limit, scale=1.0
        ),
        "energy residual over the fracture work": compare(
            abs(e["residual"]) / e["cracks_fracture"], 0.0, 0.01, scale=1.0
        ),
    }
