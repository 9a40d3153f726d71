"""A free grain that turns a thousand times with stresses locked in."""

import math

import numpy as np

from ..bulk.solid import von_mises
from ..geometry.bodies.shapes import sphere
from ..materials.elastic import Elastic
from ..materials.j2 import J2
from ..run.from_bodies import build, sum_over_nodes
from ..theory.rotation import mean_centrifugal_stress
from .case import case, compare
from .strain_paths import Tets, rotations, tensor

E, NU, RHO, RADIUS = 100e9, 0.15, 2650.0, 1e-3
#: Hardens, so that the locked-in stresses differ from element to element.
GRAIN = J2(E, NU, RHO, ((0.0, 1e-3 * E), (0.05, 2e-3 * E)))
PERFECT = J2(E, NU, RHO, ((0.0, 1e-3 * E),))
#: Steps in which the start is brought to rest in the turning frame, and the part of the
#: velocities there that each takes away.
REST_STEPS, REST_RATE = 4000, 0.1


@case("spin", num_bodies=1)
def spin(comm, turns=1000.0, relative_stress=2e-4, element_size=1.0, angle_per_step=0.1):
    """A free grain with locked-in stress turns: stress, angular momentum and energy are kept.

    Two grains, elastic with a random eigenstress and one left so by plastic flow, are brought to
    rest in the frame that turns with them about their axis of largest inertia. That is a
    solution of the time steps themselves: positions turn by the same angle in each step
    and strain increments at the midpoint vanish, so that what changes afterwards is round-off.
    The fast spin is what makes it cheap: a turn takes 2π c/(ω R) times the steps in which a wave
    passes a radius, about 1000 at ρ ω² R²/E = 2e-4 on the default mesh. The stresses locked in
    are larger than the centrifugal ones. A rate form whose tangent is not symmetric fails
    here: with the rate of Cauchy stress vibrations grow from round-off by 1.5 q ω/E in
    time, q the von Mises stress locked in, until the grain broke up after some 700 turns.

    A third grain starts without stress, for a quarter of the turns, and so swings about its
    state of rest all the time. And elements that lie on the yield surface are turned by
    prescribed motion: where round-off pushes them out they yield, which adds up.

    Args:
        comm: MPI communicator.
        turns: Number of turns.
        relative_stress: ρ ω² R² / E, the size of the centrifugal stress; it sets the rate.
        element_size: Edge of the elements over the radius.
        angle_per_step: Of the elements at yield [rad].
    """
    results, simulations = {}, []
    omega = math.sqrt(relative_stress * E / RHO) / RADIUS
    for name, material in (("elastic", Elastic(E, NU, RHO)), ("plastic", GRAIN)):
        s = _locked_in(comm, material, omega, element_size)
        results |= {f"{name}: {k}": line for k, line in _turn(s, turns, omega).items()}
        simulations.append(s)
    s, lines = _swinging(comm, 0.25 * turns, omega, element_size)
    results |= {f"swinging: {k}": line for k, line in lines.items()}
    results |= {
        f"at yield: {k}": line for k, line in _at_yield(comm, turns, angle_per_step).items()
    }
    return results, [*simulations, s]


def _grain(comm, material, element_size, velocity):
    points, cells = sphere(RADIUS, element_size * RADIUS)
    corners = points[cells]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    points = points - np.average(corners.mean(axis=1), axis=0, weights=volume)
    # The shape stays, so the first time step does.
    return build(
        comm, [(points, cells)], material, (0, 0, 0), (0, 0, 0), axes="", velocity=velocity,
        time_step_factor=0.8, refresh=10**9,
    )  # fmt: skip


def _locked_in(comm, material, omega, element_size):
    """A grain at rest in the turning frame, with stresses that are in equilibrium."""

    def strain(x, _grain):
        # Bends and twists up to 6 yield strains.
        speed = 6e-3 * math.sqrt(E / RHO) / RADIUS**2
        return speed * np.column_stack([x[:, 1] * x[:, 2], x[:, 0] * x[:, 2], x[:, 0] ** 2])

    plastic = isinstance(material, J2)
    s = _grain(comm, material, element_size, strain if plastic else None)
    if not plastic:
        noise = np.random.default_rng(1).normal(size=s.state.deviator.shape)
        noise[:, :3] -= noise[:, :3].mean(axis=1)[:, None]
        s.state.deviator[:] = 1e-3 * E * noise
    mass = s.solid.mass[:, None]
    s.state.v -= (mass * s.state.v).sum(axis=0) / mass.sum()  # it stays where it is
    for k in range(REST_STEPS):
        s.step()
        x, v = s.state.x, s.state.v
        if plastic and k < 100:
            continue  # it flows first
        _, axes = np.linalg.eigh((mass * x).T @ x)
        axis = axes[:, 0] * math.copysign(1.0, axes[2, 0])  # of least (x, x): of largest inertia
        v += REST_RATE * (np.cross(omega * axis, x) - v)
    return s


def _turn(s, turns, omega):
    """Free flight: results by name."""
    mass, state = s.solid.mass[:, None], s.state
    x0, stress0 = state.x.copy(), tensor(s.solid.stress(state))
    L0, energy0, flow0 = _angular_momentum(s), s.energies(), state.plastic_strain.copy()
    prestress = von_mises(state.deviator).max()
    axis = L0 / np.linalg.norm(L0)
    # At whole steps the speed is sin(angle)/dt times the radius.
    inertia = (mass * np.cross(axis, x0) ** 2).sum()
    angle = math.asin(np.linalg.norm(L0) / inertia * s.dt)
    num_steps = math.ceil(turns * 2 * math.pi / angle)
    changed, every = 0.0, max(num_steps // 1000, 1)
    for k in range(num_steps):
        s.step()
        if k % every == 0 or k == num_steps - 1:
            R = _rotation_between(x0, state.x)
            stress = R.T @ tensor(s.solid.stress(state)) @ R
            changed = max(changed, np.abs(stress - stress0).max())
    energy = s.energies()
    whole = sum(energy[k] - energy0[k] for k in ("kinetic", "elastic", "plastic"))
    volume = np.linalg.det(np.diff(state.x[s.mesh.cells], axis=1)) / 6
    mean = np.einsum("e,eij->ij", volume, tensor(s.solid.stress(state))) / volume.sum()
    total = mass.sum()
    square = (mass * np.cross(axis, state.x) ** 2).sum() / total
    # Of central differences: the acceleration is (2 - 2 cos angle)/dt² times the radius.
    rate = 2 * math.sin(0.5 * angle) / s.dt
    theory = mean_centrifugal_stress(total / volume.sum(), rate, square)
    largest = max(prestress, 0.3 * RHO * omega**2 * RADIUS**2)
    rounding = _rounding(num_steps)
    return {
        # The target. Round-off in strain increments leaves 1e-10 over a million steps.
        "change of the stress in the turning frame, over the largest von Mises": compare(
            changed / largest, 0.0, 1e-6, scale=1.0
        ),
        "largest locked-in von Mises stress over ρω²R², 1 or more": compare(
            min(prestress / (RHO * (omega * RADIUS) ** 2), 1.0), 1.0, 0.0
        ),
        # The virial theorem holds for nodal forces too, and locked-in stresses have no mean:
        # what remains is what is left of vibrations.
        "mean centrifugal stress": compare(np.trace(mean), theory, 1e-6),
        "angular momentum over its start": compare(
            np.linalg.norm(_angular_momentum(s) - L0) / np.linalg.norm(L0),
            0.0,
            min(rounding, 1e-10),
            scale=1.0,
        ),
        # Central differences keep it in a steady motion: round-off.
        "energy gained or lost over the kinetic one": compare(
            whole / energy0["kinetic"], 0.0, 1e-9, scale=1.0
        ),
        "plastic strain since the start": compare(
            (state.plastic_strain - flow0).max(), 0.0, 1e-12, scale=1.0
        ),
    }


def _swinging(comm, turns, omega, element_size):
    """A grain that is set in rotation at once, without stress."""

    def rigid(x, _grain):
        return omega * np.column_stack([-x[:, 1], x[:, 0], np.zeros(len(x))])

    s = _grain(comm, Elastic(E, NU, RHO), element_size, rigid)
    L0, energy0 = _angular_momentum(s), s.energies()["kinetic"]
    num_steps = math.ceil(turns * 2 * math.pi / omega / s.dt)
    every = 7  # no multiple of a period of the grain
    course = np.zeros(max(num_steps // every, 2))
    for k in range(course.size):
        for _ in range(every):
            s.step()
        course[k] = von_mises(s.state.deviator).max()
    scale = RHO * (omega * RADIUS) ** 2
    tenth = max(course.size // 10, 1)
    return s, {
        # It swings as at the start; its mean over a tenth of the time is known to some percent.
        "growth of the mean von Mises stress over ρω²R²": compare(
            (course[-tenth:].mean() - course[:tenth].mean()) / scale, 0.0, 0.05, scale=1.0
        ),
        "angular momentum over its start": compare(
            np.linalg.norm(_angular_momentum(s) - L0) / np.linalg.norm(L0), 0.0, 1e-10, scale=1.0
        ),
        # The scheme conserves to (ω_max Δt)² of the swinging part, of order ρ ω² R²/E.
        "energy over its start": compare(
            1.0 - s.energies()["residual"] / energy0, 1.0, RHO * (omega * RADIUS) ** 2 / E
        ),
    }


def _at_yield(comm, turns, angle_per_step):
    """Elements on the yield surface, turned about an odd axis."""
    tets = Tets(comm, [PERFECT] * 20)
    rng = np.random.default_rng(1)
    strain = 2e-3 * rng.normal(size=(20, 3, 3))
    F0 = np.eye(3) + 0.5 * (strain + strain.transpose(0, 2, 1))
    for part in np.linspace(0.05, 1.0, 20):
        tets.step(np.eye(3) + part * (F0 - np.eye(3)))
    stress0, flow0 = tets.stress(), tets.state.plastic_strain.copy()
    axis = np.array([[0.3, -0.5, 0.8]])
    axis /= np.linalg.norm(axis)
    changed, num_steps = 0.0, math.ceil(turns * 2 * math.pi / angle_per_step)
    for k in range(1, num_steps + 1):
        R = rotations(k * angle_per_step * axis)[0]
        tets.step(R @ F0)
        if k % 100 == 0 or k == num_steps:
            changed = max(changed, np.abs(R.T @ tets.stress() @ R - stress0).max())
    flow = (tets.state.plastic_strain - flow0).max() / 1e-3
    # The target; as above.
    return {
        "change of the stress in the turning frame, over the yield stress": compare(
            changed / 1e-3 / E, 0.0, 1e-6, scale=1.0
        ),
        "plastic strain since the start, over the yield strain": compare(
            flow, 0.0, 1e-6, scale=1.0
        ),
    }


def _angular_momentum(s):
    return sum_over_nodes(s, s.solid.mass[:, None] * np.cross(s.state.x, s.state.v))


def _rotation_between(before, after):
    """Rotation that takes ``before`` to ``after`` best (Kabsch 1976)."""
    U, _, Vt = np.linalg.svd(after.T @ before)
    return U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt


def _rounding(num_steps):
    """Of each velocity update, as a random walk with a drift of up to 1/10 of eps."""
    return 1e-15 * math.sqrt(num_steps) + 0.1 * np.finfo(float).eps * num_steps
