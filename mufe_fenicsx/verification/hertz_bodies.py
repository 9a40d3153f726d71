"""The pairs of bodies of the case `hertz`: their meshes and what theory says of them."""

import math
from dataclasses import dataclass
from functools import lru_cache

from ..geometry.bodies.half_ball import half_ball
from ..geometry.bodies.half_cylinder import half_cylinder
from ..geometry.bodies.half_ellipsoid import half_ellipsoid
from ..materials.elastic import Elastic
from ..theory import hertz, two_spheres
from .pressed import Body, turn

E, RHO, RADIUS = 100e9, 2650.0, 1e-3

#: Radii over the effective radius and moduli over ``E`` of spheres; one alone meets a plane.
SPHERES = {
    "sphere-plane": ((1.0,), (1.0,)),
    "spheres": ((2.0, 2.0), (1.0, 1.0)),
    "spheres-R1:3": ((4 / 3, 4.0), (1.0, 1.0)),
    "spheres-E1:10": ((2.0, 2.0), (1.0, 0.1)),
}
#: Angle between the axes of two like cylinders; the contact is 2.07 times as long as wide.
CYLINDERS = {"cylinders": math.pi / 3}
#: Semi-axes over ``RADIUS``; the contact with a plane is 1.87 times as long as wide.
ELLIPSOIDS = {"ellipsoid-plane": (1.3, 0.8, 1.0)}
NAMES = (*SPHERES, *CYLINDERS, *ELLIPSOIDS)


@dataclass(frozen=True)
class Contact:
    """Theory of a contact at an approach."""

    delta: float  #: [m]
    force: float  #: [N]
    a: float  #: longer semi-axis [m]
    b: float  #: shorter semi-axis [m]
    p0: float  #: [Pa]

    @property
    def radius(self):
        """√(a b) [m]."""
        return math.sqrt(self.a * self.b)


def make(name, elements_per_radius, a_over_R, nu, growth, variant=0, coarser=1.0):
    """Bodies of a pair, to be given to :class:`~.pressed.Pressed`.

    Args:
        name: One of :data:`NAMES`.
        elements_per_radius: Contact radius √(ab) over the length of edges there.
        a_over_R: That radius, by Hertz, over the effective radius.
        nu: Poisson's ratio.
        growth: Growth of the element size with the distance, times elements_per_radius:
            all sizes shrink alike as that number grows.
        variant: Number of the way in which the meshes are slid and turned.
        coarser: Element size of the second body over that of the first.
    """
    a = a_over_R * RADIUS
    sizes = [(k * a / elements_per_radius, k * growth / elements_per_radius) for k in (1, coarser)]
    if name in ELLIPSOIDS:
        axes = tuple(RADIUS * axis for axis in ELLIPSOIDS[name])
        mesh = half_ellipsoid(axes, *sizes[0], hertz_contact(name, a, nu).a)
        return [Body(*mesh, axes[2], Elastic(E, nu, RHO))]
    bodies = []
    for k, (ratio, modulus) in enumerate(zip(*_radii_and_moduli(name), strict=True)):
        radius, (h, slope) = ratio * RADIUS, sizes[k]
        if name in CYLINDERS:
            mesh = half_cylinder(radius, 2 * radius, h, slope, hertz_contact(name, a, nu).a)
            spin = k * CYLINDERS[name]
        else:
            mesh = _ball(radius, h, slope, a)
            spin = k + 2.4 * variant
        slide = _slide(radius, h, 2 * variant + k, name in CYLINDERS)
        bodies.append(Body(*mesh, radius, Elastic(modulus * E, nu, RHO), slide, spin))
    return bodies


@lru_cache(maxsize=16)
def _ball(radius, h, growth, a):
    return half_ball(radius, h, growth, (0.0, 0.0, 1.0), a)


def _radii_and_moduli(name):
    return ((1.0, 1.0), (1.0, 1.0)) if name in CYLINDERS else SPHERES[name]


def _slide(radius, h, number, along_axis):
    """Slide a mesh along its surface by a part of an element, so that no node meets the pole."""
    # Multiples of the golden ratio fill the interval evenly.
    x, y = (h * ((0.8 + 0.618034 * k) % 1.0 - 0.5) for k in (2 * number, 2 * number + 1))

    def jog(points):
        if along_axis:
            return points @ turn([x / radius, 0, 0]).T + [y, 0, 0]
        return points @ turn([x / radius, y / radius, 0]).T

    return jog


def hertz_contact(name, radius, nu):
    """Hertz's :class:`Contact` of the size √(ab) = ``radius`` [m]."""
    unit = hertz_at(name, RADIUS, nu)
    return hertz_at(name, RADIUS * (radius / unit.radius) ** 2, nu)


def hertz_at(name, delta, nu):
    """Hertz's :class:`Contact` at the approach ``delta`` [m]."""
    if name in CYLINDERS:
        A, B = hertz.crossed_cylinders(RADIUS, RADIUS, CYLINDERS[name])
    elif name in ELLIPSOIDS:
        a, b, c = (RADIUS * axis for axis in ELLIPSOIDS[name])
        A, B = 0.5 * c / a**2, 0.5 * c / b**2
    else:
        A = B = 0.5 / RADIUS
    moduli = (1.0,) if name in ELLIPSOIDS else _radii_and_moduli(name)[1]
    modulus = hertz.effective_modulus(*((m * E, nu) for m in moduli))
    return Contact(delta, *(float(v) for v in hertz.elliptic_contact(delta, A, B, modulus)))


def whole_contact(name, radius, nu):
    """:class:`Contact` of the whole bodies, of the size √(ab) = ``radius`` [m].

    Spheres as they are, by linear elasticity. Of cylinder and ellipsoid nothing is known
    but the limit a/R to 0, which is Hertz's.
    """
    if name not in SPHERES:
        return hertz_contact(name, radius, nu)
    spheres = tuple((r * RADIUS, m * E, nu) for r, m in zip(*SPHERES[name], strict=True))
    delta, force, p0 = two_spheres.compression(radius, spheres)
    return Contact(delta, force, radius, radius, p0)
