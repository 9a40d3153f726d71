"""Single tetrahedra on prescribed paths of deformation, and a material point to compare with."""

import math

import numpy as np

from ..bulk.solid import Solid, von_mises
from ..errors import SolverError
from ..run.from_bodies import distribute
from ..state import initial_state

VOIGT = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


class Tets:
    """Tetrahedra that touch nothing, each a grain with a material of its own. Collective.

    Args:
        comm: At most as many ranks as materials.
        materials: One for each tetrahedron.
        element: "averaged" or "p1"; the same for a single tetrahedron.
        seed: Of their random shapes.
    """

    def __init__(self, comm, materials, element="averaged", seed=1):
        bodies = []
        corners = 1e-3 * np.vstack([np.zeros(3), np.eye(3)])
        side = math.ceil(len(materials) ** (1 / 3))
        for k in range(len(materials)):
            jog = np.random.default_rng([seed, k]).uniform(-1e-4, 1e-4, (4, 3))
            place = 3e-3 * np.array([k % side, k // side % side, k // side**2])
            bodies.append((corners + jog + place, np.array([[0, 1, 2, 3]])))
        self.mesh = mesh = distribute(comm, bodies)
        self.materials = [materials[g] for g in mesh.grains]
        self.solid = Solid(mesh, self.materials, element)
        self.state = initial_state(mesh.x, mesh.num_cells)
        #: Number of the path of each local element.
        self.number = mesh.grains[mesh.grain_of_cell]
        self.force = np.zeros_like(mesh.x)
        self.outside = 0.0  #: largest distance from the yield surface over the yield stress, of J2
        of_cell = [self.materials[g] for g in mesh.grain_of_cell]
        yields = {m for m in of_cell if hasattr(m, "yield_stress")}
        self._like = {m: np.flatnonzero([m == own for own in of_cell]) for m in yields}
        self._origin = mesh.x[mesh.cells].mean(axis=1)
        self._arm = mesh.x[mesh.cells] - self._origin[:, None]

    def step(self, F, dt=1e-6):
        """Deform the elements in one step to the gradients ``F``, shape (num_cells, 3, 3)."""
        s, cells = self.state, self.mesh.cells
        before, alpha = s.x[cells], s.plastic_strain.copy()
        now = np.einsum("eij,eaj->eai", F, self._arm) + self._origin[:, None]
        s.x[cells] = now
        s.v[cells] = (now - before) / dt
        s.dt, s.t, s.num_steps = dt, s.t + dt, s.num_steps + 1
        self.force[:] = 0.0
        bad = self.solid.add_internal_forces(self.force, s, dt)
        if bad >= 0:
            raise SolverError(f"element {bad} is inverted or collapsed, expected sound ones")
        self._watch(s.plastic_strain > alpha)

    def _watch(self, yielding):
        """How far the stress lies off the yield surface where it yields, beyond it elsewhere."""
        q = von_mises(self.state.deviator)
        for material, e in self._like.items():
            Y = np.interp(self.state.plastic_strain[e], *np.array(material.yield_stress).T)
            off = (q[e] - Y) / Y
            self.outside = max(self.outside, np.where(yielding[e], np.abs(off), off).max())

    def stress(self):
        """Cauchy stress [Pa], shape (num_cells, 3, 3)."""
        return tensor(self.solid.stress(self.state))

    def force_error(self):
        """Largest difference of the nodal forces from -V σ ∇N, over the largest of them."""
        x = self.state.x[self.mesh.cells]
        edges = x[:, 1:] - x[:, :1]
        gradient = np.linalg.inv(edges).transpose(0, 2, 1)  # of nodes 1 to 3
        volume = np.linalg.det(edges) / 6
        expected = -volume[:, None, None] * np.einsum("eij,eaj->eai", self.stress(), gradient)
        error = self.force[self.mesh.cells][:, 1:] - expected
        return float(np.abs(error).max() / np.abs(expected).max())


class MaterialPoints:
    """The same law in NumPy, on all points at once: no batches, no fast arithmetic.

    Args:
        materials: One for each point.
    """

    def __init__(self, materials):
        n = len(materials)
        self.K = np.array([m.bulk_modulus for m in materials])
        self.G = np.array([m.shear_modulus for m in materials])
        self.tables = [np.array(m.yield_stress).T for m in materials]
        self.groups = {}
        for i, (strain, stress) in enumerate(self.tables):
            self.groups.setdefault((tuple(strain), tuple(stress)), []).append(i)
        self.F = np.tile(np.eye(3), (n, 1, 1))
        self.deviator = np.zeros((n, 3, 3))  # of the Kirchhoff stress
        self.plastic_strain, self.plastic_work = np.zeros(n), np.zeros(n)  # work over V0

    def step(self, F):
        """One step to the gradients ``F``, shape (n, 3, 3)."""
        eye, G = np.eye(3), self.G[:, None, None]
        L = (F - self.F) @ np.linalg.inv(0.5 * (F + self.F))
        D, W = 0.5 * (L + L.transpose(0, 2, 1)), 0.5 * (L - L.transpose(0, 2, 1))
        R = np.linalg.solve(eye - 0.5 * W, eye + 0.5 * W)
        half = G * (D - np.trace(D, axis1=1, axis2=2)[:, None, None] / 3 * eye)
        trial = R @ (self.deviator + half) @ R.transpose(0, 2, 1) + half
        q = np.sqrt(1.5 * (trial**2).sum(axis=(1, 2)))
        dp = np.zeros_like(q)
        for (strain, stress), points in self.groups.items():
            i = np.array(points)
            dp[i] = _return(q[i], self.plastic_strain[i], self.G[i], strain, stress)
        self.deviator = trial * (1 - 3 * self.G * dp / np.where(q > 0, q, 1))[:, None, None]
        self.plastic_strain += dp
        self.F = F.copy()
        self.plastic_work += (q - 3 * self.G * dp) * dp

    def stress(self):
        """Cauchy stress [Pa], shape (n, 3, 3)."""
        J = np.linalg.det(self.F)[:, None, None]
        # Averaged elements that can flow have a mean stress of their own volume besides.
        p = self.K[:, None, None] * np.log(J) + self.G[:, None, None] * (1 - 1 / J) ** 3 / J
        return self.deviator / J + p * np.eye(3)


def _return(q, alpha, G, strain, stress):
    """Root dp >= 0 of q - 3 G dp = Y(alpha + dp), by Newton's method on the table."""
    slope = np.append(np.diff(stress) / np.diff(strain), 0.0) if len(strain) > 1 else np.zeros(1)
    dp = np.zeros_like(q)
    for _ in range(2 * len(strain) + 2):
        total = alpha + dp
        H = slope[np.searchsorted(strain, total, side="right") - 1]
        dp += np.maximum((q - 3 * G * dp - np.interp(total, strain, stress)) / (3 * G + H), -dp)
    return dp


def tensor(voigt):
    """xx yy zz xy yz xz, shape (n, 6), as matrices (n, 3, 3)."""
    full = np.empty((len(voigt), 3, 3))
    for k, (i, j) in enumerate(VOIGT):
        full[:, i, j] = full[:, j, i] = voigt[:, k]
    return full


class RandomPaths:
    """Deformation gradients R(t) exp ε(t): ε runs straight between random points, R turns.

    Args:
        numbers: Of the paths, which make them the same on any number of ranks.
        sizes: Yield strain of each, shape (n,): legs are of random length from 1 to
            ``reach`` of these.
        legs: Number of straight parts.
        reach: Longest leg over the yield strain.
        turn: Largest angle of rotation on one leg [rad].
        seed: Of the random numbers.
    """

    def __init__(self, numbers, sizes, legs, reach, turn, seed):
        self.strain = np.zeros((legs + 1, len(numbers), 3, 3))
        self.spin = np.zeros((legs + 1, len(numbers), 3))
        for i, (number, size) in enumerate(zip(numbers, sizes, strict=True)):
            rng = np.random.default_rng([seed, 7, number])
            steps = rng.normal(size=(legs, 3, 3))
            steps = 0.5 * (steps + steps.transpose(0, 2, 1))
            length = rng.uniform(1.0, reach, legs) / np.linalg.norm(steps, axis=(1, 2))
            self.strain[1:, i] = np.cumsum(size * length[:, None, None] * steps, axis=0)
            axes = rng.normal(size=(legs, 3))
            axes /= np.linalg.norm(axes, axis=1)[:, None]
            self.spin[1:, i] = np.cumsum(rng.uniform(0, turn, (legs, 1)) * axes, axis=0)

    def at(self, leg, part):
        """Gradients after the ``part`` (0 to 1) of a leg, shape (n, 3, 3)."""
        strain = (1 - part) * self.strain[leg] + part * self.strain[leg + 1]
        spin = (1 - part) * self.spin[leg] + part * self.spin[leg + 1]
        values, vectors = np.linalg.eigh(strain)
        stretch = (vectors * np.exp(values)[:, None]) @ vectors.transpose(0, 2, 1)
        return rotations(spin) @ stretch


def rotations(vectors):
    """Rotation matrices of rotation vectors [rad], shape (n, 3): Rodrigues' formula."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    K = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -z, y, -x
    K -= K.transpose(0, 2, 1)
    half = np.sinc(angle / (2 * np.pi))
    return np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half**2 * K @ K
