"""An elastic ball pressed between two rigid planes."""

import math

import numpy as np

from ..geometry.shapes import sphere_near_contact
from ..materials.elastic import Elastic
from ..theory.finite_sphere import force_of_approach
from ..theory.hertz import contact_radius, effective_modulus, hertz_force, largest_pressure
from .build import build, drive, settle
from .case import case, compare

E, RHO, RADIUS = 100e9, 2650.0, 1e-3


@case("hertz", num_bodies=1)
def hertz(comm, elements_per_radius=4.0, a_over_R=0.04, nu=0.15, growth=0.1):
    """Elastic ball between two smooth rigid planes: force, contact radius and pressure of Hertz.

    Both poles are refined and both planes move, so the centre of the ball stays
    at rest and half the approach of the planes is that of one contact. Hertz's theory
    is the limit of a small contact; the force of the whole ball at this a/R comes from
    linear elasticity (theory.finite_sphere), so the error that remains is the mesh's.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        a_over_R: Contact radius over that of the ball, by Hertz.
        nu: Poisson's ratio.
        growth: Growth of the element size with the distance from the contact.
    """
    a, delta = a_over_R * RADIUS, a_over_R**2 * RADIUS
    body = sphere_near_contact(
        RADIUS, a / elements_per_radius, growth, contact_radius=a, both_poles=True
    )
    material = Elastic(E, nu, RHO)
    # Lowest mode that the squeeze excites, S2 of the free ball (Lamb 1882).
    shear_speed = math.sqrt(material.shear_modulus / RHO)
    omega = 2.63 * shear_speed / RADIUS
    corner = np.full(3, RADIUS)
    # Nodes meet the planes at speed: below 0.7 of the limit they keep their energy.
    s = build(
        comm, [body], material, -corner, corner, axes="z", damping=omega, time_step_factor=0.65
    )
    moves = {"z_min": (0, 0, delta), "z_max": (0, 0, -delta)}
    period = 2 * math.pi / omega
    drive(s, moves, 2 * period)
    # The centre itself moves slowly: its motion cancels in the mean of both forces.
    settle(s, 1e-6, max_steps=int(2 * period / s.dt))

    force = s.wall_forces()
    modulus = effective_modulus((E, nu))
    theory = hertz_force(delta, RADIUS, modulus)
    finite, a_finite, p0_finite = force_of_approach(delta / RADIUS, nu)
    finite, a_finite, p0_finite = (
        finite * modulus * RADIUS**2,
        a_finite * RADIUS,
        p0_finite * modulus,
    )
    reached, p0 = _contact(s, a_finite)
    # At 4 elements per radius. Mesh: 2 % in force (c = 0.15 of the layer takes out the leading
    # error, not all). Large strain of the model, about 0.2 a/R in strain at the contact: 1 %.
    coarse = max(4.0 / elements_per_radius, 1.0)
    results = {
        "force [N], whole ball": compare(0.5 * (force[0] + force[1]), finite, 0.03 * coarse),
        # Finite size is in this one: that of the theory for the whole ball is added.
        "force [N], Hertz": compare(
            0.5 * (force[0] + force[1]), theory, 0.03 * coarse + abs(finite / theory - 1)
        ),
        "finite size: whole ball over Hertz": compare(finite / theory, 1.0, 0.5 * a_over_R),
        # Settled to 1e-6 in energies, so 1e-3 in forces.
        "one plane against the other": compare(force[0], force[1], 5e-3),
        # Contact ends between two rings of nodes: half an element of the radius.
        "contact radius [m]": compare(
            reached, contact_radius(delta, RADIUS), 0.5 / elements_per_radius
        ),
        # The layer evens out what varies within an element.
        "largest pressure [Pa]": compare(
            p0, largest_pressure(theory, contact_radius(delta, RADIUS)), 0.05 * coarse
        ),
    }
    return results, [s]


def _contact(s, a):
    """Radius [m] of the contact by the area of its nodes; p0 [Pa] of the best half-ellipse."""
    pairs, contact = s.walls.pairs, s.contact
    on = pairs.closed
    node = pairs.node[on]
    depth = pairs.offset[on] - pairs.gap[on]
    pressure = depth / s.contact.layer[node]
    area = contact.points.area[node]
    radius2 = (contact.positions.array[node, :2] ** 2).sum(axis=1)
    inner = radius2 < (0.7 * a) ** 2
    shape = np.sqrt(1 - radius2[inner] / a**2)
    weight = area[inner]
    p0 = (weight * pressure[inner] * shape).sum() / (weight * shape**2).sum()
    return math.sqrt(area.sum() / 2 / math.pi), p0
