"""Energies of grains from a stored state: elastic, plastically dissipated, kinetic."""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.analysis.by_grain import index_grains, sum_by_grain
from mufe_fenicsx.geometry.measure import tet_volumes

#: Elements whose energies are known.
ELEMENTS = ("averaged", "p1")
#: Plastic strain that no grain reaches.
FAR = 1e3


@dataclass(frozen=True)
class GrainEnergy:
    """Energies of each grain [J], shape (num_grains,)."""

    labels: np.ndarray
    elastic: np.ndarray
    plastic: np.ndarray  #: dissipated so far
    kinetic: np.ndarray


@dataclass(frozen=True)
class GrainMaterial:
    """Of all grains."""

    E: float  #: Young's modulus [Pa]
    nu: float  #: Poisson's ratio [-]
    rho: float  #: density [kg/m³]
    flows: bool  #: it yields, so that elements keep a volume of their own (kernels.bulk.solid)


def grain_energy(
    reference,
    points,
    cells,
    grain_of_cell,
    stress,
    work,
    velocity,
    material,
    element="averaged",
):
    """Energies of grains of one material.

    Elastic: s:s/4G of the deviator and K (J ln J - J + 1) of the volume ratio J, which an element
    takes as its own ("p1") or as the mean at its nodes ("averaged"); in the latter, of a material
    that flows, G (e^4/4 + e^5/5 + ...), e = 1 - 1/J, of its own besides. Kinetic: with a quarter of
    the mass of a tetrahedron at each of its nodes, without added mass.

    Args:
        reference, points: Nodes then and now [m], shape (num_nodes, 3).
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        grain_of_cell: Label of each cell's grain, shape (num_cells,).
        stress: Cauchy stress xx, yy, zz, xy, yz, xz [Pa], shape (num_cells, 6).
        work: Plastic work of the cells [J], shape (num_cells,).
        velocity: Of nodes [m/s], shape (num_nodes, 3), or None: kinetic energy is nan.
        material: :class:`GrainMaterial`.
        element: One of :data:`ELEMENTS`, as of the run.

    Returns:
        :class:`GrainEnergy`, grains in the order of their labels.
    """
    labels, index = index_grains(grain_of_cell)
    E, nu = material.E, material.nu
    G, K = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
    before, now = tet_volumes(reference, cells), tet_volumes(points, cells)

    def total(values):
        return sum_by_grain(values, index, labels.size)

    square = np.einsum("ci,ci->c", stress, stress) + np.einsum(
        "ci,ci->c", stress[:, 3:], stress[:, 3:]
    )
    square -= stress[:, :3].sum(axis=1) ** 2 / 3
    # s is the Cauchy deviator; what belongs to the first volume is that of J s.
    elastic = total(now**2 / before * square / (4 * G))
    if element == "averaged":
        if material.flows:
            e = 1 - before / now
            elastic += total(G * before * (-np.log1p(-e) - e - e**2 / 2 - e**3 / 3))
        ratio = _ratio_at_nodes(cells, before, now, len(reference))
        density = (K * volume_energy(ratio))[cells].mean(axis=1)
        # A node has a quarter of each cell around it, and a cell a quarter of it back.
        elastic += total(before * density)
    else:
        elastic += total(before * K * volume_energy(now / before))
    speed2 = np.full(len(before), np.nan)
    if velocity is not None:
        speed2 = np.einsum("ni,ni->n", velocity, velocity)[cells].mean(axis=1)
    return GrainEnergy(labels, elastic, total(work), 0.5 * material.rho * total(before * speed2))


def volume_energy(J):
    """J ln J - J + 1, to rounding of J - 1 where J is near 1."""
    return J * np.log1p(J - 1) - (J - 1)


def _ratio_at_nodes(cells, before, now, num_nodes):
    """Volume of the cells around each node over that before, shape (num_nodes,)."""
    corners = cells.ravel()
    first, last = (np.bincount(corners, np.repeat(v, 4), num_nodes) for v in (before, now))
    return np.divide(last, first, out=np.ones(num_nodes), where=first > 0)


def plastic_work(plastic_strain, yield_stress, beyond="flat"):
    """Work dissipated by plastic flow for a unit volume, ∫ σ_Y dε_p from 0 [J/m³].

    Exact for the piecewise linear table.

    Args:
        plastic_strain: ε_p, any shape.
        yield_stress: Points (plastic strain [-], stress [Pa]), the first at strain 0.
        beyond: "flat" or "slope" after the last point.
    """
    strain, stress = np.array(yield_stress, dtype=float).T
    slope = 0.0
    if beyond == "slope" and strain.size > 1:
        slope = (stress[-1] - stress[-2]) / (strain[-1] - strain[-2])
    strain = np.append(strain, FAR)
    stress = np.append(stress, stress[-1] + slope * (FAR - strain[-2]))
    steps = np.diff(strain)
    before = np.append(0.0, np.cumsum(0.5 * steps * (stress[1:] + stress[:-1])))
    at = np.clip(np.searchsorted(strain, plastic_strain, side="right") - 1, 0, steps.size - 1)
    d = plastic_strain - strain[at]
    return before[at] + d * (stress[at] + 0.5 * d * np.diff(stress)[at] / steps[at])
