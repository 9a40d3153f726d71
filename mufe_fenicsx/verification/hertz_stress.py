"""The stress below a Hertz contact."""

import itertools
from typing import Literal

import numpy as np

from ..bulk.solid import von_mises
from ..theory.hertz import stress_on_axis
from .case import case, compare
from .hertz_bodies import RADIUS, make, whole_contact
from .pressed import AXIS, FRAME, Pressed

#: Size of the patch for :func:`recover`, in elements.
PATCH = 2.5
#: Powers of the coordinates of a quadratic function in the plane and in space, the constant first.
POWERS = {
    dim: sorted((k for k in itertools.product(range(3), repeat=dim) if sum(k) <= 2), key=sum)
    for dim in (2, 3)
}
#: Barycentric coordinates of four points in a tetrahedron, exact for quadratic functions.
POINTS = 0.1381966011250105 + 0.4472135954999579 * np.eye(4)


@case("hertz-stress", num_bodies=1)
def hertz_stress(
    comm,
    elements_per_radius=5.0,
    a_over_R=0.02,
    nu=0.15,
    other_nu=0.3,
    growth=0.25,
    depth=1.5,
    integrator: Literal["static", "explicit"] = "static",
):
    """The largest von Mises stress below a ball on a plane, and its depth.

    Stresses are constant in a tetrahedron and jump between them. At a point they are taken from
    the quadratic function whose means over the tetrahedra within 2.5 elements fit theirs best
    (:func:`recover`). The mean over the tetrahedra around a node flattens the maximum by 6 %
    more at 5 elements per contact radius: it is that of a region two elements wide.

    Args:
        comm: MPI communicator.
        elements_per_radius, a_over_R, growth: As of the case `hertz`.
        nu, other_nu: Poisson's ratios of the first and of the second ball.
        depth: How deep to look, over the contact radius.
        integrator: As of the case `hertz`.
    """
    results, simulations = {}, []
    # The error is of second order; the target holds at 5 elements.
    tolerance = 0.05 * max(5.0 / elements_per_radius, 1.0) ** 2
    for ratio in (nu, other_nu):
        axis = profile(
            comm, elements_per_radius, a_over_R, ratio, growth, depth, integrator=integrator
        )
        theory, computed = axis["theory"].argmax(), axis["computed"].argmax()
        zeta = axis["zeta"]
        results |= {
            f"{name} (nu = {ratio:g})": line
            for name, line in {
                "largest von Mises stress over p0": compare(
                    axis["computed"][computed], axis["theory"][theory], tolerance
                ),
                "its depth over a": compare(
                    zeta[computed], zeta[theory], 1 / elements_per_radius, scale=1.0
                ),
                # Beside the error of the maximum that of the surface, where stress varies fastest.
                "von Mises stress over p0, mean deviation": compare(
                    np.sqrt(np.mean((axis["computed"] - axis["theory"]) ** 2)), 0.0, tolerance, 1.0
                ),
            }.items()
        }
        simulations.append(axis["simulation"])
    return results, simulations


def profile(comm, elements_per_radius, a_over_R=0.02, nu=0.15, growth=0.5, depth=1.5, num=61,
            integrator="static"):  # fmt: skip
    """Von Mises stress on the axis of a ball that is pressed on a plane. One rank.

    Returns:
        A dict: zeta, depths below the plane over a, shape (num,); computed and theory, von
        Mises stresses over p0 there; simulation.
    """
    bodies = make("sphere-plane", elements_per_radius, a_over_R, nu, growth)
    pressed = Pressed(comm, bodies, integrator)
    theory = whole_contact("sphere-plane", a_over_R * RADIUS, nu)
    pressed.press(theory.delta)
    s = pressed.simulation

    plane, force, *_ = pressed.contact()
    middle = FRAME[:, :2] @ (force @ plane / force.sum())
    # The first depth lies in the body: its surface meets the plane but for the contact layer.
    zeta = np.linspace(0.02, depth, num)
    places = middle - theory.a * zeta[:, None] * AXIS
    stress = recover(s, s.solid.deviator(s.state), places, PATCH * theory.a / elements_per_radius)
    axial, radial = stress_on_axis(zeta, nu)
    return {
        "zeta": zeta,
        "computed": von_mises(stress) / theory.p0,
        "theory": np.abs(axial - radial),
        "simulation": s,
    }


def recover(s, values, places, reach):
    """Values at places by least squares from those of the tetrahedra around them. Local.

    A quadratic function of position is fitted whose means over the tetrahedra are their
    values, each weighted by its volume and by (1 - d²/reach²)² at the distance d.

    Args:
        s: Simulation.
        values: Of the tetrahedra, shape (num_cells, k).
        places: In the deformed body [m], shape (n, 3).
        reach: Tetrahedra with centroids so near take part [m].

    Returns:
        Values, shape (n, k).

    Source: after O. C. Zienkiewicz, J. Z. Zhu, Int. J. Numer. Methods Eng. 33, 1992, 1331-1364.
    """
    corners = s.state.x[s.mesh.cells]
    return fit(corners, s.solid.volume0, values, places, np.full(len(places), reach))


def fit(corners, volume, values, places, reach):
    """The fit of :func:`recover`, in space or in a plane onto which the tetrahedra are projected.

    In a plane the function is a mean over the thickness.

    Args:
        corners: Of the tetrahedra [m], shape (num_cells, 4, dim), dim 2 or 3.
        volume: Their volumes [m³], shape (num_cells,).
        values: Shape (num_cells, k).
        places: [m], shape (n, dim).
        reach: [m], shape (n,).

    Returns:
        Values, shape (n, k).
    """
    powers = POWERS[corners.shape[2]]
    centroid = corners.mean(axis=1)
    result = np.empty((len(places), values.shape[1]))
    for i, (place, h) in enumerate(zip(places, reach, strict=True)):
        distance2 = ((centroid - place) ** 2).sum(axis=1) / h**2
        near = distance2 < 1
        if near.sum() < 2 * len(powers):
            raise ValueError(
                f"tetrahedra = {near.sum()} within {h:g} m of {place}, expected {2 * len(powers)}"
            )
        points = (np.einsum("qi,nij->nqj", POINTS, corners[near]) - place) / h
        means = np.stack([np.prod(points**k, axis=2).mean(axis=1) for k in powers], axis=1)
        weight = np.sqrt(volume[near]) * (1 - distance2[near])
        found = np.linalg.lstsq(means * weight[:, None], values[near] * weight[:, None], rcond=None)
        result[i] = found[0][0]  # of the power 0
    return result
