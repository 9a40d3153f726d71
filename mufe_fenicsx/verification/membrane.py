"""Rubber sheets: a balloon, a tube in a cell, and samples in a membrane."""

import math
import time

import numpy as np

from ..contact.walls import Wall
from ..geometry.bodies.shapes import cylinder
from ..geometry.bodies.sleeve import sleeve
from ..geometry.bodies.spherical_shell import spherical_shell
from ..kernels.bulk.pressure import enclosed_volume
from ..loading.membrane import Membrane
from ..loading.oedometer import smooth_step
from ..loading.pressure import Pressure
from ..materials.elastic import Elastic
from ..materials.neo_hookean import NeoHookean
from ..run.from_bodies import build
from ..theory import membranes
from .axisymmetric_tube import tube_under_pressure
from .case import case, compare

LATEX = NeoHookean()
#: Pressure in a tube over E t/R: its middle becomes about a sixth wider.
BLOWN_UP = 0.2
UP = np.array([0.0, 0.0, 1.0])


@case("balloon", num_bodies=1)
def balloon(comm, divisions=16, layers=2, stretch=1.5, t_over_R=0.05, nu=0.49):
    """A neo-Hookean sphere that a liquid blows up, against the equation of a thick sphere.

    The pressure has its largest value at a stretch of 7^(1/6) = 1.38, so that it is the volume
    which is prescribed: a liquid of little compressibility flows in. Beyond it a whole sphere
    bulges to one side (D. M. Haughton, R. W. Ogden, J. Mech. Phys. Solids 26, 1978, 111-138);
    an eighth between mirrors cannot.

    Args:
        comm: MPI communicator.
        divisions: Edges along a quarter of a great circle.
        layers: Elements through the wall.
        stretch: Radius at the end over that of the start.
        t_over_R: Thickness over inner radius.
        nu: Poisson's ratio.
    """
    R, rubber = 10e-3, NeoHookean(nu=nu)
    G, K = rubber.shear_modulus, rubber.bulk_modulus
    body = spherical_shell(R, t_over_R * R, divisions, layers, octant=True)
    walls = [
        Wall(name, np.zeros(3), n, mirror=True) for name, n in zip("xyz", np.eye(3), strict=True)
    ]
    # Slow beside breathing, √(12 G/ρ)/R, and so little damped that its drag carries nothing.
    rate = math.sqrt(12.0 * G / rubber.rho) / R
    damping, duration = 0.05 * rate, 240.0 / rate
    s = build(comm, [body], rubber, [0] * 3, [0] * 3, "", walls=walls, damping=damping)
    # Its pressure is that of the step before: a liquid that is stiffer would swing ever more.
    origin, liquid = np.zeros(3), 10.0 * G * t_over_R
    inside = 0.5 * R  # how far a facet of the inside faces the origin
    term = Pressure(
        s.mesh, 0.0, where=lambda x, n: np.einsum("ni,ni->n", x, n) < -inside, origin=origin
    )
    s.add_term(term)
    first = -enclosed_volume(s.state.x, term.facets, origin)
    rows = []
    while s.state.t < duration:
        volume = -enclosed_volume(s.state.x, term.facets, origin)
        wanted = 1.0 + (stretch**3 + 0.2 - 1.0) * smooth_step(s.state.t / duration)
        term.set_pressure(liquid * (wanted - volume / first), s.state)
        rows.append((np.cbrt(volume / first), term.pressure))
        s.step()
    at, p = np.array(rows).T
    results = {}
    for part in (0.2, 0.5, 1.0):
        value = 1.0 + part * (stretch - 1.0)
        found = float(np.interp(value, at, p))
        theory = membranes.thick_balloon(value, R, (1.0 + t_over_R) * R, G, K)
        thin = membranes.thin_balloon(value, t_over_R, G)
        results[f"pressure at stretch {value:.2f}"] = compare(found, theory, 0.01)
        results[f"thin and incompressible at {value:.2f}"] = compare(theory, thin, math.inf)
    energies = s.energies()
    fed = -energies["energy_pressure"]
    results["energy"] = compare(energies["residual"] / fed, 0.0, 1e-3, 1.0)
    return results, [s]


@case("membrane-tube", num_bodies=1)
def membrane_tube(
    comm, h_over_t=1.0, layers=2, t_over_R=0.06, H_over_R=1.5, inwards=0.4, ends_over_t=0.25
):
    """A tube that two platens hold, under cell pressure, against axisymmetric elements.

    Pressed inwards at a part of the pressure at which it buckles, and blown up by a cell pressure
    below that inside until its middle is about a sixth wider. Beside the platens it bends. Linear
    elements of length L along shear where they bend, which stores G (κ L)²/12 at a curvature κ
    beside E (κ t)²/12: so they are short there. What is left stands over the deflection too, for
    information. The reference has elements of second order, four through the wall, and the same law
    (verification.axisymmetric_tube).

    Args:
        comm: MPI communicator.
        h_over_t: Length of edges over the thickness.
        layers: Elements through the wall.
        t_over_R: Thickness over inner radius.
        H_over_R: Height over inner radius.
        inwards: Pressure inwards over that of buckling, 0.92 E (t/R)² √(R t)/H.
        ends_over_t: Length of edges along at the platens over the thickness.
    """
    buckling = 0.92 * t_over_R**2 * math.sqrt(t_over_R) / H_over_R
    results, simulations = {}, []
    for name, p in (("pressed inwards", inwards * buckling), ("blown up", -BLOWN_UP * t_over_R)):
        s, found, reference, _ = deflected(
            comm, p, h_over_t, layers, t_over_R, H_over_R, ends_over_t
        )  # fmt: skip
        size = np.abs(reference).max()
        off = float(np.abs(found - reference).max())
        results[f"{name}: largest difference of radii"] = compare(off, 0.0, 0.01, 1.0)
        results[f"{name}: the same over deflection"] = compare(off / size, 0.0, math.inf, 1.0)
        results[f"{name}: deflection over radius"] = compare(size, 0.0, math.inf, 1.0)
        energies = s.energies()
        fed = abs(energies["energy_cell_pressure"])
        results[f"{name}: energy"] = compare(energies["residual"] / fed, 0.0, 1e-3, 1.0)
        simulations.append(s)
    return results, simulations


def deflected(
    comm, pressure_over_E, h_over_t, layers, t_over_R, H_over_R, ends_over_t, **options
):  # fmt: skip
    """A tube that two platens hold, at rest under a cell pressure. Collective, one rank.

    Args:
        comm, h_over_t, layers, t_over_R, H_over_R, ends_over_t: As of :func:`membrane_tube`.
        pressure_over_E: Of the cell, over Young's modulus.
        options: Of the simulation.

    Returns:
        The simulation, the mean way of the inner surface outwards at each of its heights over R,
        shape (num_heights,), that of axisymmetric elements, and time of the processor [s].
    """
    R = 5e-3
    t, H, p = t_over_R * R, H_over_R * R, pressure_over_E * LATEX.E
    s, membrane = _tube(comm, R, t, H, h_over_t * t, layers, ends_over_t * t, **options)
    began = time.process_time()
    _ramp(s, membrane, p, 24.0 / s.damping, 0.4)
    spent = time.process_time() - began
    x0 = s.mesh.x
    inner = np.hypot(x0[:, 0], x0[:, 1]) < R + 0.5 * t / layers
    z0, r0 = x0[inner, 2], np.hypot(*x0[inner, :2].T)
    level, which = np.unique(np.round(z0 / H, 9), return_inverse=True)
    r = np.hypot(*s.state.x[inner, :2].T)
    found = np.bincount(which, r - r0) / np.bincount(which)
    return s, found / R, tube_under_pressure(R, t, H, LATEX, p, level * H) / R, spent


def _tube(comm, R, t, H, h, layers, at_ends, **options):
    """A tube between platens and its membrane, with twice the damping of its breathing."""
    body = sleeve(R, t, H, h, layers, at_ends)
    walls = [
        Wall("bottom", np.zeros(3), UP, bonded=[1]),
        Wall("top", H * UP, -UP, bonded=[1]),
    ]
    damping = 2.0 * math.sqrt(LATEX.E / LATEX.rho) / R
    s = build(
        comm, [body], LATEX, [0] * 3, [0] * 3, "", walls=walls, damping=damping, sleeves=["side"],
        **options,
    )  # fmt: skip
    return s, Membrane(s, 1)


def _ramp(s, membrane, pressure, duration, rest=0.25):
    """Bring the cell smoothly to a pressure [Pa] and let all come to rest. Collective."""
    start, begun = membrane.pressure, s.state.t
    while (t := s.state.t - begun) < (1.0 + rest) * duration:
        part = smooth_step(min((t + 0.5 * s.dt) / duration, 1.0))
        membrane.set_pressure(start + part * (pressure - start))
        s.step()


class _Sample:
    """A cylinder between smooth platens in a membrane, and how it is loaded. Collective.

    Args:
        comm: MPI communicator.
        material: Of the cylinder.
        radius, height: Of the cylinder [m].
        h: Length of its edges [m].
        thickness: Of the membrane [m].
        gap: Between it and the cylinder at the start [m].
        edge: Length of the membrane's edges [m].
        friction: Between membrane and cylinder.
    """

    def __init__(self, comm, material, radius, height, h, thickness, gap, edge, friction):
        self.radius, self.height = radius, height
        solid = cylinder(radius, height, h)
        self.ring = math.pi * thickness * (2.0 * (radius + gap) + thickness)
        around = sleeve(radius + gap, thickness, height, edge)
        walls = [
            Wall("bottom", np.zeros(3), UP, bonded=[2]),
            Wall("top", height * UP, -UP, bonded=[2]),
        ]
        damping = 2.0 * math.sqrt(LATEX.E / LATEX.rho) / radius
        self.sim = s = build(
            comm, [solid, around], [material, LATEX], [0] * 3, [0] * 3, "", walls=walls,
            damping=damping, friction=friction, sleeves=["side"],
        )  # fmt: skip
        self.membrane = Membrane(s, 2)
        grain, z = s.mesh.grains[s.mesh.grain_of_node], s.mesh.x[:, 2] / height
        self.nodes = np.flatnonzero((grain == 0) & (np.abs(z - 0.5) < 1 / 6))
        self.duration = 60.0 / damping

    def press(self, pressure):
        """Bring the cell to a pressure [Pa]. Collective."""
        _ramp(self.sim, self.membrane, pressure, self.duration)

    def shorten(self, strain, at_step=None):
        """Move the top down by a part of the height, smoothly, and rest. Collective."""
        s, begun, T = self.sim, self.sim.state.t, self.duration
        before, s.damping = s.damping, 0.02 * s.damping  # whose drag would be a load on the sleeve
        while (t := s.state.t - begun) < 1.25 * T:
            ahead = smooth_step((t + s.dt) / T) - smooth_step(t / T)
            s.walls.velocity[1] = -UP * strain * self.height * ahead / s.dt
            s.step()
            if at_step:
                at_step()
        s.walls.velocity[1], s.damping = 0.0, before

    def strains(self):
        """Axial and radial strain of its middle third, compression positive. Collective.

        As of gauges on a sample: the glued rims hold its ends.
        """
        s = self.sim
        x, u = s.mesh.x[self.nodes], s.state.u[self.nodes]
        z, w = x[:, 2] - 0.5 * self.height, u[:, 2]
        of_plane = np.vdot(x[:, :2], u[:, :2]), np.vdot(x[:, :2], x[:, :2])
        sums = np.array([len(z), z.sum(), w.sum(), z @ w, z @ z, *of_plane])
        n, z, w, zw, zz, across, width = s.comm.allreduce(sums)
        # Slope of the line through the displacements along, and of those outwards.
        return -np.array([(zw - z * w / n) / (zz - z * z / n), across / width])

    def stress(self):
        """Mean stress of the cylinder's middle third, across and along, compression positive [Pa].

        Collective.
        """
        s = self.sim
        cells = np.flatnonzero(s.mesh.grains[s.mesh.grain_of_cell] == 0)
        middle = s.mesh.x[s.mesh.cells[cells], 2].mean(axis=1) / self.height
        cells = cells[np.abs(middle - 0.5) < 1 / 6]
        volume = s.solid.volume0[cells]
        stress = s.solid.stress(s.state, cells)
        sums = s.comm.allreduce(np.append(volume @ stress[:, :3], volume.sum()))
        x, y, z = -sums[:3] / sums[3]
        return 0.5 * (x + y), z

    def sleeve_force(self):
        """Axial force in the middle third of the membrane, compression positive [N]. Collective.

        Of the stress along beyond that through the sheet, which is the pressure around it: that of
        the cell on a section that grows is no force of the rubber.
        """
        s = self.sim
        cells = np.flatnonzero(s.mesh.grains[s.mesh.grain_of_cell] == 1)
        middle = s.mesh.x[s.mesh.cells[cells], 2].mean(axis=1) / self.height
        cells = cells[np.abs(middle - 0.5) < 1 / 6]
        corner = s.state.x[s.mesh.cells[cells]]
        volume = np.linalg.det(corner[:, 1:] - corner[:, :1]) / 6
        x, y = corner.mean(axis=1)[:, :2].T
        xx, yy, zz, xy, _, _ = s.solid.stress(s.state, cells).T
        through = (xx * x**2 + yy * y**2 + 2.0 * xy * x * y) / (x**2 + y**2)
        along = (zz - through) @ volume
        along, first = s.comm.allreduce(np.array([along, s.solid.volume0[cells].sum()]))
        # Mean stress times the present area, which is that of the start times J/λ.
        return -along / first * self.ring / (1.0 - self.strains()[0])

    def axial_stress(self):
        """Force of the platens less the membrane's over the present area [Pa]. Collective."""
        force = self.sim.wall_forces() - self.membrane.axial_forces()
        wide = self.radius * (1.0 - self.strains()[1])
        return float(force.mean()) / (math.pi * wide**2)


@case("membrane-specimen", num_bodies=2)
def membrane_specimen(comm, E=50e6, nu=0.25, pressure=200e3, strain=0.01, edges=5.0):
    """An elastic cylinder in a membrane: confined, then compressed, as in a triaxial cell.

    Young's modulus follows from the platens' forces less the membrane's share. The stress across in
    its middle is that of the cell, but for what the sheet itself carries.

    Args:
        comm: MPI communicator.
        E: Of the cylinder [Pa].
        nu: Its Poisson's ratio.
        pressure: Of the cell [Pa].
        strain: Axial, in the second part.
        edges: Of the cylinder, along its radius.
    """
    R, H = 5e-3, 12e-3
    sample = _Sample(
        comm, Elastic(E, nu, 2000.0), R, H, R / edges, 0.3e-3, 0.002 * R, 0.6e-3, 0.3
    )  # fmt: skip
    sample.press(pressure)
    before, first = sample.strains(), sample.axial_stress()
    across, _ = sample.stress()
    sample.shorten(strain)
    along, sideways = sample.strains() - before
    rise = sample.axial_stress() - first
    s, share = sample.sim, sample.membrane.axial_forces()
    energies = s.energies()
    fed = energies["work"] - energies["energy_cell_pressure"]
    volume = sample.membrane.volume() / (
        math.pi * R**2 * H * np.prod(1.0 - sample.strains()[[0, 1, 1]])
    )
    return {
        "stress across over cell pressure": compare(across / pressure, 1.0, 0.005),
        "Young's modulus": compare(rise / along, E, 0.01),
        "Poisson's ratio": compare(-sideways / along, nu, 0.01),
        "volume inside over that of the cylinder": compare(volume, 1.0, math.inf),
        "membrane's share of the axial force": compare(
            share.mean() / s.wall_forces().mean(), 0.0, math.inf, 1.0
        ),
        "energy": compare(energies["residual"] / fed, 0.0, 1e-3, 1.0),
    }, [s]


@case("membrane-correction", num_bodies=2)
def membrane_correction(comm, pressure=100e3, strain=0.05, t_over_D=0.0188, edges=4.0):
    """The axial stress that a membrane carries, against the formula of Henkel and Gilbert (1952).

    The sample is of soft rubber, which keeps its volume as clay does that cannot drain: so the
    membrane is free to widen as it shortens, which the formula assumes. It is so away from its
    ends: against the glued rims, which do not widen, the sample pushes as it does.

    Args:
        comm: MPI communicator.
        pressure: Of the cell [Pa].
        strain: Axial.
        t_over_D: Thickness of the membrane over the diameter of the sample.
        edges: Of the sample, along its radius.
    """
    R, rubber = 8e-3, NeoHookean(E=5e6, nu=0.49)
    H, t = 2.0 * R, 2.0 * R * t_over_D
    sample = _Sample(comm, rubber, R, H, R / edges, t, 0.005 * R, 3.0 * t, 0.5)
    sample.press(pressure)
    first, rows = sample.strains()[0], []
    none = np.array([sample.sleeve_force(), sample.membrane.axial_forces().mean()])

    def measure():
        if sample.sim.state.num_steps % 100 == 0:
            along, across = sample.strains()
            area = math.pi * (R * (1.0 - across)) ** 2
            now = np.array([sample.sleeve_force(), sample.membrane.axial_forces().mean()])
            rows.append((along - first, *(now - none) / area))

    sample.shorten(strain, measure)
    measured = np.array(rows)
    M = LATEX.E * t
    results = {}
    for part in (0.2, 0.4, 0.7, 1.0):
        at = part * strain
        found, ends = (float(np.interp(at, measured[:, 0], measured[:, k])) for k in (1, 2))
        theory = membranes.membrane_correction(at, M, 2.0 * R)
        results[f"stress at strain {at:.3f}"] = compare(found, theory, 0.05)
        results[f"at the glued ends, at {at:.3f}"] = compare(ends, theory, math.inf)
    return results, [sample.sim]
