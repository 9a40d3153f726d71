"""A ball pressed by rigid planes, at rest: axisymmetric finite elements of second order.

A reference that shares no code with the three-dimensional model: DOLFINx forms, Newton's method,
a contact without any compliance. By symmetry half of the ball, as a quarter disc (r, z), whose
base slides in its plane and onto whose pole a smooth plane moves. Lengths are in radii of the ball,
stresses in units of Young's modulus.

No node may pass the plane, z + u_z <= 1 - δ: with λ >= 0 the force of the plane on a node and
g its gap, max(-c g, -λ) = 0 at each, c > 0, whose Newton steps are those of an active set (M.
Hintermüller, K. Ito, K. Kunisch, SIAM J. Optim. 13, 2002, 865-888). Equilibrium is λ = -R, R
the internal force on it along z.
"""

import math
import weakref
from dataclasses import dataclass

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc

from ...kernels.build.compiled_forms import compiled_form
from . import law
from .mesh import quarter_disc

#: Degree up to which integrals are exact.
DEGREE = 4
#: Line searches, one after the other until one converges: full steps overshoot where much flows,
#: shorter ones can stop where elements begin or cease to flow in turn.
SEARCHES = ("bt", "basic", "nleqerr")
#: Halvings of a step of the approach at which Newton's method does not converge.
HALVINGS = 5


@dataclass(frozen=True)
class State:
    """A ball at rest; lengths over R, forces over E R²."""

    delta: float  #: approach of plane and base
    push: np.ndarray  #: forces of the plane on the circles through the nodes of the surface
    strain: np.ndarray  #: plastic strain of the material points

    @property
    def force(self):
        """Of the plane."""
        return float(self.push.sum())


class BallForms:
    """Equilibrium of a ball as forms of displacement and mean stress.

    Args:
        mesh: Of the quarter disc (r, z).
        material: As of :class:`Ball`.

    Attributes:
        W: Space of displacement and mean stress.
        w, w_before: Functions on it, now and at the start of the step.
        state: Deviator and plastic strain at the start of the step.
        residual, tangent: Compiled forms.
        values: Of the present state: deviator and plastic strain, volume ratio.
    """

    def __init__(self, mesh, material):
        mixed = basix.ufl.mixed_element(
            [
                basix.ufl.element("Lagrange", "triangle", 2, shape=(2,)),
                basix.ufl.element("Lagrange", "triangle", 1),
            ]
        )
        quadrature = basix.ufl.quadrature_element("triangle", value_shape=(5,), degree=DEGREE)
        self.W = fem.functionspace(mesh, mixed)
        self.w, self.w_before = fem.Function(self.W), fem.Function(self.W)
        self.state = fem.Function(fem.functionspace(mesh, quadrature))

        # Plastic strain, yield stress over E.
        points = material.parameters()[2:].reshape(2, -1).T / (1.0, material.E)
        moduli = np.array([material.bulk_modulus, material.shear_modulus]) / material.E
        values = np.concatenate([moduli, np.ravel(points)])
        parameters = fem.Constant(mesh, values)
        bulk, shear = parameters[0], parameters[1]
        table = [(parameters[2 * k + 2], parameters[2 * k + 3]) for k in range(len(points))]

        X = ufl.SpatialCoordinate(mesh)
        u, p = ufl.split(self.w)
        v, q = ufl.TestFunctions(self.W)
        now = law.Motion(X[0], u)
        before = law.Motion(X[0], ufl.split(self.w_before)[0])
        state = law.deviator(now, before, self.state, shear, table)
        dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": DEGREE})
        work = 2 * math.pi * X[0] * law.virtual_work(now, state, p, v, q, bulk) * dx
        self.residual = compiled_form(work)
        self.tangent = compiled_form(ufl.derivative(work, self.w))
        rows = [*(state[i] for i in range(5)), now.J]
        where, _ = basix.make_quadrature(basix.CellType.triangle, DEGREE)
        self.values = fem.Expression(ufl.as_vector(rows), where)


class Ball:
    """Half a ball on its base, and a plane on its pole. One rank.

    Args:
        material: :class:`~mufe_fenicsx.materials.j2.J2`.
        contact_radius: Largest one expected, for the mesh.
        elements: Edges per that radius, but for ``surface``.
        surface: How much shorter edges are on the surface. A node is closed or open, so that the
            area that carries a perfectly plastic contact, and the force, grows in steps.
    """

    def __init__(self, material, contact_radius, elements, surface):
        # All sizes shrink alike.
        self.h = contact_radius / (elements * surface)
        self.mesh = quarter_disc(
            self.h, 7.2 / elements, min(1.3 * contact_radius, 0.8), min(4.8 / elements, 0.15)
        )
        self.delta = 0.0
        self.forms = BallForms(self.mesh, material)
        self._holds(min(3 * contact_radius, 0.9))
        self._solver()

    def _holds(self, reach):
        def dofs(component, where):
            part = self.forms.W.sub(0).sub(component)
            collapsed, _ = part.collapse()
            found, own = fem.locate_dofs_geometrical((part, collapsed), where)
            return found, collapsed.tabulate_dof_coordinates()[own, :2]

        def on_surface(x):
            return (np.abs(np.hypot(x[0], x[1]) - 1) < 1e-9) & (x[0] < reach)

        held = [dofs(0, lambda x: x[0] < 1e-12)[0], dofs(1, lambda x: x[1] < 1e-12)[0]]
        self.held = np.unique(np.concatenate(held))
        along, place = dofs(1, on_surface)
        order = np.argsort(place[:, 0])
        self.along, self.first = along[order], place[order]

    def _solver(self):
        self.A = petsc.create_matrix(self.forms.tangent)
        self.A.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        self.x, self.f = self.A.createVecs()
        self.R = self.f.duplicate()
        self.snes = snes = PETSc.SNES().create(MPI.COMM_SELF)
        snes.setType("newtonls")
        # PETSc keeps what it calls: a ball that it kept would keep 13 of the 2048 communicators
        # that MPICH has, and nothing would be left after 157 balls.
        own = weakref.proxy(self)
        snes.setFunction(lambda *args: own._function(*args), self.f)
        snes.setJacobian(lambda *args: own._jacobian(*args), self.A)
        snes.getKSP().setType("preonly")
        snes.getKSP().getPC().setType("lu")
        snes.getKSP().getPC().setFactorSolverType("mumps")

    def _assemble(self, x):
        self.forms.w.x.array[:] = x.array_r
        with self.R.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self.R, self.forms.residual)

    def _function(self, snes, x, f):
        self._assemble(x)
        R = self.R.array_r
        f.array[:] = R
        f.array[self.held] = x.array_r[self.held]
        f.array[self.along] = np.maximum(-self.h * self._gap(x), R[self.along])

    def _gap(self, x):
        """Of the nodes of the surface from the plane at the approach that is sought."""
        return 1 - self.goal - self.first[:, 1] - x.array_r[self.along]

    def _jacobian(self, snes, x, A, P):
        self._assemble(x)
        A.zeroEntries()
        petsc.assemble_matrix(A, self.forms.tangent)
        A.assemble()
        closed = self.along[-self.h * self._gap(x) > self.R.array_r[self.along]]
        A.zeroRows(closed.astype(np.int32), self.h)
        A.zeroRows(self.held.astype(np.int32), 1.0)

    def press(self, delta):
        """Move the plane to the approach ``delta`` and bring the ball to rest.

        Returns:
            :class:`State`.

        Raises:
            RuntimeError: Newton's method does not converge, not for steps 2⁵ times shorter.
        """
        start, done, part = self.delta, 0.0, 1.0
        while done < 1.0:
            goal = start + (delta - start) * min(done + part, 1.0)
            if any(self._newton(goal, search) for search in SEARCHES):
                done += part
            elif part > 0.5**HALVINGS:
                part *= 0.5
            else:
                raise RuntimeError(
                    f"approach = {delta:g} R: Newton's method ended with "
                    f"{self.snes.getConvergedReason()}, expected to converge"
                )
        return State(self.delta, -self.R.array_r[self.along], self.last[..., 4].ravel())

    def _newton(self, delta, search):
        """True and the state of that approach, or False and that of before."""
        self.goal = delta
        before = self.forms.w_before.x.array
        self.x.array[:] = before
        if self.delta:
            # As if all grew alike from here as in the last step.
            self.x.array[:] += (delta - self.delta) * self.rate
        # Of the force of Hertz, and what rounding leaves of 1 + strain.
        accuracy = 1e-8 * delta**1.5 + 1e-15
        self.snes.getLineSearch().setType(search)
        self.snes.setTolerances(rtol=1e-30, atol=accuracy, stol=0.0, max_it=25)
        self.snes.solve(None, self.x)
        if self.snes.getConvergedReason() <= 0:
            return False
        self._assemble(self.x)
        self.last = self.forms.values.eval(self.mesh, np.arange(self._num_cells(), dtype=np.int32))
        if not np.isfinite(self.last).all() or self.last[..., 5].min() <= 0:
            return False
        dofs = self.forms.state.function_space.dofmap.list
        self.forms.state.x.array.reshape(-1, 5)[dofs] = self.last[..., :5]
        self.rate = (self.x.array_r - before) / (delta - self.delta)
        before[:] = self.x.array_r
        self.delta = delta
        return True

    def _num_cells(self):
        return self.mesh.topology.index_map(2).size_local
