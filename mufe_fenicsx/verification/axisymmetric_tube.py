"""A neo-Hookean tube under pressure between two platens: axisymmetric elements of second order.

A reference that shares the law with the three-dimensional model and nothing else. With the places
r = R + u_r and z = Z + u_z of a point (R, Z) equilibrium makes

    Π = ∫ W 2π R dR dZ + p V,    V = ∫ π r² dz over the outer surface,

stationary, W of :class:`~mufe_fenicsx.materials.neo_hookean.NeoHookean`. The ends are held. DOLFINx
forms, Newton's method, sparse LU of SciPy.
"""

import math

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as meshes
from mpi4py import MPI
from scipy.interpolate import CubicSpline
from scipy.sparse.linalg import splu

from ..kernels.build.compiled_forms import compiled_form

#: Elements through the wall, and their longest edge over the thickness.
THROUGH, ALONG = 4, 0.25
#: Largest change of a pressure in one go, over E t/R.
STEP = 0.02
#: Newton's method ends below this over the first residual, or after so many iterations.
TOLERANCE, MOST = 1e-8, 30


def tube_under_pressure(radius, thickness, height, material, pressure, at):
    """Radial displacement of the inner surface [m] at heights ``at`` of the start, (num,). Local.

    Args:
        radius: Inner radius [m].
        thickness: [m].
        height: [m].
        material: :class:`~mufe_fenicsx.materials.neo_hookean.NeoHookean`.
        pressure: Of the fluid around it over that inside [Pa].
        at: Heights [m].

    Raises:
        RuntimeError: Newton's method does not converge.
    """
    # Lengths in radii, stresses in E.
    t, H, p = thickness / radius, height / radius, pressure / material.E
    domain = meshes.create_rectangle(
        MPI.COMM_SELF, [(1.0, 0.0), (1.0 + t, H)], [THROUGH, math.ceil(H / (ALONG * t))]
    )
    element = basix.ufl.element("Lagrange", "triangle", 2, shape=(2,))
    V = fem.functionspace(domain, element)
    u, now = fem.Function(V), fem.Constant(domain, 0.0)
    moduli = material.shear_modulus / material.E, material.bulk_modulus / material.E
    forms = _forms(domain, u, now, *moduli, 1.0 + t)
    ends = fem.locate_dofs_geometrical(V, lambda x: np.isclose(x[1] * (H - x[1]), 0.0))
    held = (2 * ends[:, None] + np.arange(2)).ravel()
    free = np.setdiff1d(np.arange(u.x.array.size), held)
    for part in np.linspace(0.0, 1.0, 1 + math.ceil(abs(p) / (STEP * t)))[1:]:
        now.value = part * p
        _newton(u, *forms, free)
    inner = fem.locate_dofs_geometrical(V, lambda x: np.isclose(x[0], 1.0))
    z = V.tabulate_dof_coordinates()[inner, 1]
    order = np.argsort(z)
    spline = CubicSpline(z[order], u.x.array[2 * inner[order]])
    return radius * spline(np.asarray(at) / radius)


def _forms(domain, u, pressure, G, K, outer):
    """Residual and tangent, compiled; lengths in radii, stresses in E."""
    X = ufl.SpatialCoordinate(domain)
    grad, hoop = ufl.grad(u), 1.0 + u[0] / X[0]
    plane = ufl.Identity(2) + grad
    J = ufl.det(plane) * hoop
    trace = ufl.inner(plane, plane) + hoop**2
    W = 0.5 * G * (J ** (-2.0 / 3.0) * trace - 3.0) + K * (J * ufl.ln(J) - J + 1.0)
    facets = meshes.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], outer))
    tags = meshes.meshtags(domain, 1, np.sort(facets), np.ones(facets.size, np.int32))
    ds = ufl.Measure("ds", domain, subdomain_data=tags)(1)
    r = X[0] + u[0]
    energy = W * 2.0 * math.pi * X[0] * ufl.dx + pressure * math.pi * r**2 * (1.0 + grad[1, 1]) * ds
    residual = ufl.derivative(energy, u)
    return compiled_form(residual), compiled_form(ufl.derivative(residual, u))


def _newton(u, residual, tangent, free):
    first = None
    for _ in range(MOST):
        r = fem.assemble_vector(residual).array[free]
        size = float(np.linalg.norm(r))
        first = size if first is None else first
        if size <= TOLERANCE * first + 1e-15:
            return
        matrix = fem.assemble_matrix(tangent).to_scipy().tocsr()[free][:, free]
        u.x.array[free] -= splu(matrix.tocsc()).solve(r)
    raise RuntimeError(f"tube under pressure: residual {size:.2g} after {MOST} iterations")
