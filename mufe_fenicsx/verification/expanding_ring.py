"""A bar that stretches at an even rate and breaks into fragments, beside its twin, a chain."""

import numpy as np

from ..bulk.cracks.cracks import Cracks
from ..geometry.bodies.shapes import box
from ..materials.elastic import Elastic
from ..materials.fracture import Fracture
from ..run.from_bodies import build
from ..theory.cohesion import fragment_size_grady, fragment_size_zhou
from .case import case, compare

E, RHO, STRENGTH = 275e9, 2750.0, 300e6
ENERGY = 100.0


@case("expanding-ring", num_bodies=1)
def expanding_ring(comm, rate=2e4, zone=12.0, divisions=320, scatter=40.0, seed=0):
    """A bar whose ends run away stretches alike until it breaks, as a ring that expands.

    Strengths scatter by Weibull's law, without which all sections would break at once. The number
    of fragments lies between what kinetic energy allows (Grady 1982) and what waves allow in
    simulations of rings (Zhou, Molinari & Ramesh 2006). A chain of masses with the same law and
    strengths judges it.

    Args:
        comm: MPI communicator.
        rate: Of the strain at the start [1/s].
        zone: Length of the cohesive zone, E G/σ², in bricks: it sets their size.
        divisions: Bricks along the bar, one across.
        scatter: Weibull modulus.
        seed: Of the strengths.
    """
    edge = E * ENERGY / STRENGTH**2 / zone
    length, material = divisions * edge, Elastic(E, 0.0, RHO)
    s = build(
        comm, [box((edge, edge, length), (1, 1, divisions))], material, (0, 0, 0), (0, 0, 0), "",
        velocity=lambda x, _grain: rate * (x[:, 2:] - 0.5 * length) * [0.0, 0.0, 1.0],
    )  # fmt: skip
    cracks = Cracks(s.specimen, Fracture(STRENGTH, ENERGY))
    z = s.mesh.x[cracks.facets.nodes(s.mesh)[:, :3], 2] / edge
    section = np.rint(z.mean(axis=1)).astype(int)
    across = np.ptp(z, axis=1) < 0.1
    # One strength a section, so that the bar stays one of one dimension; other facets never open.
    sections = STRENGTH * np.random.default_rng(seed).weibull(scatter, divisions + 1)
    cracks.strength[:] = np.where(across, sections[section], np.inf)
    s.add_term(cracks)
    end = 6.0 * STRENGTH / (E * rate) + 2.0 * np.sqrt(RHO / E) * fragment_size_grady(
        RHO, rate, ENERGY
    )
    while s.state.t < end:
        s.step(everywhere=False)
    p = cracks.points
    gone = (p["open"] != 0.0) & (p["furthest"] - p["strength"] / p["stiffness"] >= p["ultimate"])
    fragments = 1 + np.unique(section[cracks.opened][gone.all(axis=1)]).size
    twin, of_twin = chain(edge, divisions, rate, sections, end, s.dt)
    low = length / fragment_size_grady(RHO, rate, ENERGY)
    high = length / fragment_size_zhou(E, RHO, rate, ENERGY, STRENGTH)
    e = s.energies()
    spent = e["cracks_fracture"] / (ENERGY * edge**2)
    results = {
        "fragments over those of the chain": compare(fragments / twin, 1.0, 0.15),
        "fracture work over that of the chain": compare(spent / of_twin, 1.0, 0.15),
        "fragments": compare(fragments, np.clip(fragments, *sorted((low, high))), 0.25),
        "fragments by Grady": compare(low, low, np.inf),
        "fragments by Zhou and others": compare(high, high, np.inf),
        "energy residual": compare(abs(e["residual"]) / e["cracks_fracture"], 0.0, 5e-3, scale=1.0),
    }
    return results, [s]


def chain(edge, num, rate, sections, end, dt):
    """Fragments and fracture work over G of a chain of bricks with cohesive sections in between.

    Each brick is a spring of two masses; a section opens where its traction, that which lets both
    masses beside it go on alike, reaches its strength.

    Args:
        edge: Length of a brick [m]; area 1.
        num: Bricks.
        rate: Of the strain at the start [1/s].
        sections: Strengths of the sections, ends among them [Pa].
        end, dt: Time of the end, and of steps [s].
    """
    x = edge * np.stack([np.arange(num), np.arange(1, num + 1)], axis=1)
    v, u, m = rate * (x - 0.5 * num * edge), np.zeros((num, 2)), 0.5 * RHO * edge
    most, open_ = np.zeros(num - 1), np.zeros(num - 1, dtype=bool)
    strength = sections[1:-1].copy()
    limit = 2.0 * ENERGY / strength
    for _ in range(int(end / dt)):
        u += dt * v
        stress = E * (u[:, 1] - u[:, 0]) / edge
        f = np.stack([stress, -stress], axis=1)
        # What joins two masses: half the difference of their forces.
        traction = 0.5 * (stress[:-1] + stress[1:])
        opening = u[1:, 0] - u[:-1, 1]
        starts = ~open_ & (traction >= strength)
        strength[starts], limit[starts] = traction[starts], 2.0 * ENERGY / traction[starts]
        open_ |= starts
        most = np.where(open_, np.maximum(most, opening), 0.0)
        k, first = E / edge, strength * edge / E
        soft = np.maximum(strength * (1.0 - most / limit), 0.0) / (most + first)
        t = np.where(opening + first > 0.0, soft, k) * (opening + first)
        bears = np.where(open_, t, traction)
        f[:-1, 1] += bears
        f[1:, 0] -= bears
        v += dt / m * f
        # Joined masses go on as one: rounding alone parts them.
        both = 0.5 * (v[:-1, 1] + v[1:, 0])
        v[:-1, 1], v[1:, 0] = np.where(open_, v[:-1, 1], both), np.where(open_, v[1:, 0], both)
    share = np.clip(most / limit, 0.0, 1.0)
    return 1 + int((share >= 1.0).sum()), float((share * (2.0 - share))[open_].sum())
