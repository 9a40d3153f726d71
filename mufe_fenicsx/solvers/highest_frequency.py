"""Highest frequency of the assembled system, which limits the explicit time step."""

import copy
import math

import numpy as np

from ..kernels.bulk.lanczos import add, begin, products, square, subtract, take_known, weigh

#: Numbers of a vector from which on it has an array of its own: two large pages of memory.
LARGE = 2 << 18
#: A vector is made orthogonal again where no more than this part of its square is left: few springs
#: have few frequencies, and rounding makes up more than 1e-12 of the difference then.
AGAIN = 1e-4


class HighestFrequency:
    """Lanczos iteration on M⁻¹K, started again from its last vector at each call.

    The largest Ritz value approaches the highest eigenvalue from below, and the
    residual of its vector bounds its distance to an eigenvalue (B. N. Parlett, The
    Symmetric Eigenvalue Problem, 1998, section 13.2): their sum is returned. That
    this eigenvalue is the highest is not proven; a safety factor and the energy
    balance guard against the rest.

    Args:
        comm: MPI communicator.
        mass: Nodal masses [kg], shape (num_nodes,), or those of each row and component
            of whatever moves (moments of inertia of what turns), shape (num_rows, 3).
        x: Reference positions [m] of the nodes or rows, shape (num_rows, 3).
        add_stiffness: ``add_stiffness(y, q)`` adds K q to y; collective.
        size: Vectors in one sweep.
        tolerance: Residual over eigenvalue at which to stop.
        max_sweeps: Sweeps at most.
        turned: Rows whose components are along axes of their own, shape (n,), and these axes as
            columns, shape (n, 3, 3); None: none. The iteration starts from the same vector in
            space whichever axes were chosen: those of equal moments, and the sign of any, hang
            on rounding.
    """

    def __init__(
        self, comm, mass, x, add_stiffness, size=7, tolerance=0.02, max_sweeps=12, turned=None
    ):
        self.comm = comm
        self.set_mass(mass)
        self.noise = _noise(x, np.sqrt(comm.allreduce(np.vdot(x, x)) / comm.allreduce(x.size)))
        if turned is not None:
            rows, axes = turned
            self.noise[rows] = np.einsum("nij,ni->nj", axes, self.noise[rows])
        self.add_stiffness = add_stiffness
        self.size, self.tolerance, self.max_sweeps = size, tolerance, max_sweeps
        self._vector = self._rows = None
        self.num_products = 0  #: products with K so far

    def of(self, add_stiffness):
        """The same of another operator on the same rows, which shares what it can. Local."""
        other = copy.copy(self)
        other.add_stiffness, other.vector, other.num_products = add_stiffness, None, 0
        return other

    @property
    def vector(self):
        """The last vector, from which the next call begins, shape (num_rows, 3); None: none."""
        if self._rows is None:
            return self._vector
        whole = np.zeros_like(self.noise)
        whole[self._rows] = self._vector
        return whole

    @vector.setter
    def vector(self, whole):
        self._vector, self._rows = whole, None

    def set_mass(self, mass):
        """Take other masses, shaped as those before; they stay where they are. Local."""
        self.mass = _of_rows(mass)

    def _sums(self, values):
        return self.comm.allreduce(np.array(values)) if self.comm.size > 1 else values

    def __call__(self, rows=None, add_stiffness=None, mass=None):
        """Highest angular frequency [rad/s]. Collective.

        Args:
            rows: Those that the operator acts on and that it leaves nothing outside of,
                ascending, shape (n,), here on this rank; None: all.
            add_stiffness: As ``add_stiffness``, between vectors of these rows alone.
            mass: Of these rows, as of :meth:`set_mass`; None: those of there.
        """
        noise, masses = self.noise, self.mass
        if rows is None:
            add_stiffness = self.add_stiffness
        else:
            noise = noise.take(rows, axis=0)
            masses = masses.take(rows, axis=0) if mass is None else _of_rows(mass)
        basis = _vectors(self.size + 1, noise.shape)
        start, last = basis[:2]
        begin(start, masses, noise)
        if not (size := self._sums(square(start, masses))) > 0.0:
            return 0.0  # of no rows on any rank
        if self._vector is not None:
            # As much of either: what is the highest now may have no part in what it was.
            self._take_last(last, rows)
            if weight := self._sums(square(last, masses)):  # else it was of other rows
                last *= math.sqrt(size / weight)
                start += last
            self.vector = None  # its room is free for the next one
        for _ in range(self.max_sweeps):
            value, residual = self._sweep(basis, masses, add_stiffness)
            if residual <= self.tolerance * value:
                break
        self._vector, self._rows = (start if start.base is None else start.copy()), rows
        return math.sqrt(value + residual)

    def _take_last(self, out, rows):
        """The last vector at rows, None for all, into ``out``; zero where it has none."""
        if rows is not None and self._rows is not None:
            take_known(out, rows, self._vector, self._rows)
        elif rows is not None:
            self._vector.take(rows, axis=0, out=out, mode="clip")
        else:
            out[:] = self.vector

    def _sweep(self, basis, mass, add_stiffness):
        """One sweep from ``basis[0]``: largest Ritz value and its residual.

        Its vector is in ``basis[0]`` afterwards; ``basis`` is scratch otherwise.
        """
        basis[0] /= math.sqrt(self._sums(square(basis[0], mass)))
        diagonal, off = [], []
        for k in range(self.size):
            v, before, w = basis[k], basis[max(k - 1, 0)], basis[k + 1]
            w[:] = 0.0
            add_stiffness(w, v)
            self.num_products += 1
            along, size = self._sums(weigh(w, mass, v, before, off[-1] if k else 0.0))
            diagonal.append(along)
            # Against the last two vectors; the others are orthogonal to it in so short a sweep.
            left = size - along**2
            if left <= AGAIN * along**2:
                subtract(w, along, v, 1.0)
                along, back, size = self._sums(products(w, mass, v, before))
                if k:
                    subtract(w, back, before, 1.0)
                    size -= back**2
                left = max(size - along**2, 0.0)
            norm = math.sqrt(left)
            # Less than this is not worth a vector, of which rounding would be the larger part.
            if k + 1 == self.size or norm <= 1e-4 * self.tolerance * max(diagonal):
                break
            off.append(norm)
            subtract(w, along, v, 1.0 / norm)
        T = np.diag(diagonal) + np.diag(off, 1) + np.diag(off, -1)
        values, vectors = np.linalg.eigh(T)
        basis[0] *= vectors[0, -1]
        for share, v in zip(vectors[1:, -1], basis[1 : k + 1], strict=True):
            add(basis[0], share, v)
        return values[-1], abs(norm * vectors[-1, -1])


def _vectors(number, shape):
    """Arrays for vectors, which take most of the memory here: the rest is made in their place.

    Small ones are parts of one array, for which systems have large pages of memory more readily.
    """
    if math.prod(shape) < LARGE:
        return [*np.empty((number, *shape))]
    return [np.empty(shape) for _ in range(number)]


def _of_rows(mass):
    """Masses with a column for each component, or one for all of a row."""
    mass = np.ascontiguousarray(mass)
    return mass if mass.ndim == 2 else mass[:, None]


def _noise(x, scale):
    """Numbers without pattern in ]-1, 1[ that depend on positions alone, so not on the ranks."""
    waves = np.array([[12.9898, 78.233, 37.719], [39.346, 11.135, 83.155], [73.156, 52.235, 9.151]])
    noise = 2 * np.modf(np.sin(x @ waves.T / scale) * 43758.5453)[0]
    return noise - np.trunc(noise)
