"""What a cap on a rigid base yields beyond the half-space of the theories of contact.

Those theories count displacement from points infinitely far away in a half-space; the
cap ends at its base and is narrower than that. The difference is a linear compliance, the
same for the contact whatever slips in it, and is added to the theory.
"""

import h5py  # noqa: F401  before dolfinx.fem.petsc, whose HDF5 has no compression
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import LinearProblem
from mpi4py import MPI

from ..geometry.bodies.half_ball import half_ball
from ..kernels.build.compiled_forms import compiled_form
from ..mesh import create_grain_mesh


def shear_compliance(cap, material, elements_per_radius=2.5, growth=0.3):
    """Compliance of one cap under a tangential force at its pole less that of a half-space [m/N].

    Linear elasticity on quadratic elements, with the tangential traction q ~ √(1 - r²/a²)
    on the circle of contact. It moves a half-space by 3 (2 - ν) Q/(20 G a) in the
    mean weighted by q (Johnson 1985, section 3.7: u = πq0 [4(2-ν)a² - (4-3ν)x² - (4-ν)y²]/32Ga).

    Args:
        cap: :class:`~mufe_fenicsx.verification.half_balls.HalfBalls`.
        material: Elastic material.
        elements_per_radius, growth: Of the mesh; the cap's own is finer than needed.
    """
    a, height = cap.contact_radius / cap.radius, cap.height / cap.radius
    points, cells = half_ball(1.0, a / elements_per_radius, growth, contact_radius=a, height=height)
    zero = np.zeros(len(cells), dtype=int)
    domain = create_grain_mesh(
        MPI.COMM_SELF, points, cells, zero, np.array([1]), np.array([0])
    ).mesh
    V = fem.functionspace(domain, ("Lagrange", 2, (3,)))
    u, w = ufl.TrialFunction(V), ufl.TestFunction(V)
    nu, identity = material.nu, ufl.Identity(3)  # in units of the shear modulus

    def stress(v):
        strain = ufl.sym(ufl.grad(v))
        return 2 * strain + 2 * nu / (1 - 2 * nu) * ufl.tr(strain) * identity

    x = ufl.SpatialCoordinate(domain)
    square = 1 - (x[0] ** 2 + x[1] ** 2) / a**2
    inside = ufl.And(square > 0, x[2] < -1 + 0.5 * height)
    q = ufl.conditional(inside, ufl.sqrt(abs(square)), 0.0)
    traction = ufl.as_vector((q, 0, 0))
    ds = ufl.ds(metadata={"quadrature_degree": 10})
    base = fem.locate_dofs_geometrical(V, lambda X: X[2] > height - 1 - 1e-9)
    solution = LinearProblem(
        ufl.inner(stress(u), ufl.sym(ufl.grad(w))) * ufl.dx,
        ufl.inner(traction, w) * ds,
        bcs=[fem.dirichletbc(np.zeros(3), base, V)],
        petsc_options={
            "ksp_type": "preonly",
            "pc_type": "cholesky",
            "pc_factor_mat_solver_type": "mumps",
            "ksp_error_if_not_converged": True,
        },
        petsc_options_prefix="finite_body_",
    ).solve()
    force = fem.assemble_scalar(compiled_form(q * ds))
    whole = fem.assemble_scalar(compiled_form(ufl.inner(traction, solution) * ds)) / force**2
    beyond = whole - 3 * (2 - nu) / (20 * a)
    return float(beyond / (material.shear_modulus * cap.radius))
