"""Stress, strain and stiffness of the whole sample, from its walls and from its contacts.

Compression is positive throughout, as in the history of a run.
"""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.analysis.grain_means import void_ratio
from mufe_fenicsx.analysis.rows import branches
from mufe_fenicsx.analysis.stress_strain import side_forces, tangent_modulus

#: Walls across each axis.


def contact_stress(force, branch, volume):
    """Mean stress of a sample from its contacts, σ = Σ f ⊗ l / V [Pa], shape (3, 3).

    Over all contacts, those with walls included, whose branch vectors end on the wall.

    Args:
        force: On grain a from b, or from the wall [N], shape (num_contacts, 3).
        branch: From the centre of b (or the contact's centroid on the wall) to that of a [m],
            shape (num_contacts, 3). Where there is no force it may be nan: a contact that has
            opened has no place on its wall.
        volume: Grains and voids [m³].

    Source: A. E. H. Love, A Treatise on the Mathematical Theory of Elasticity, 1927, p. 618;
    J. Weber, Cahiers du Groupe Français de Rhéologie 3, 1966, 161-170.
    """
    force, branch = np.asarray(force), np.asarray(branch)
    acts = force.any(axis=1)
    return np.einsum("ci,cj->ij", force[acts], branch[acts]) / volume


def inertial_stress(force, centre, middle, volume):
    """Part of the walls' mean stress that accelerates grains, -Σ m a ⊗ (x - x̄) / V [Pa].

    The mean stress of opposite walls is that of the contacts plus this one, whatever the speed:
    Σ f ⊗ l over all contacts is -Σ f ⊗ x over those with walls plus Σ m a ⊗ x over grains,
    and with x̄ in the middle of the sample the sum over two walls is their mean stress. What
    then is left is how far grains are pressed into the walls over the sample's size.

    Args:
        force: Of all contacts on each grain, its mass times acceleration [N], (num_grains, 3).
        centre: Centres of mass [m], shape (num_grains, 3).
        middle: Of the box between the walls [m], shape (3,).
        volume: Of that box [m³].
    """
    return -np.einsum("gi,gj->ij", force, np.asarray(centre) - middle) / volume


def wall_stress(normal_forces, lengths):
    """Mean normal stress of the two walls across x, y and z [Pa], shape (..., 3).

    Args:
        normal_forces: On x_min, x_max, y_min, y_max, z_min, z_max [N], shape (..., 6).
        lengths: Distances of opposite walls along x, y, z [m], shape (..., 3).
    """
    lengths = np.asarray(lengths, dtype=float)
    pairs = np.asarray(normal_forces, dtype=float).reshape(*lengths.shape, 2)
    return pairs.mean(axis=-1) * lengths / lengths.prod(axis=-1)[..., None]


@dataclass(frozen=True)
class WallFriction:
    """What a wall feels along itself."""

    normal: float  #: normal force on it [N]
    shear: np.ndarray  #: force of the grains along it [N], shape (3,)
    mobilised: float  #: Σ |t| over Σ n of its contacts with grains [-]; nan without any


def wall_friction(force, normal):
    """Normal and tangential force of the grains on one wall.

    Args:
        force: Of the wall on each grain [N], shape (num_contacts, 3).
        normal: Unit normals there, from the wall into the sample, shape (num_contacts, 3).

    Returns:
        :class:`WallFriction`.
    """
    push = np.einsum("ci,ci->c", force, normal)
    along = force - push[:, None] * normal
    total = push.sum()
    mobilised = np.linalg.norm(along, axis=1).sum() / total if total > 0 else np.nan
    return WallFriction(float(total), -along.sum(axis=0), float(mobilised))


def oedometer_curves(history, lengths, solid_volume, width=0.01):
    """Curves of an oedometer test, a value a row.

    Args:
        history: dict column -> array.
        lengths: Distances of the side walls along x and y [m], shape (num_rows, 2).
        solid_volume: Of the grains in the reference configuration [m³]: the void ratio counts
            their own (elastic) compression as loss of voids, as the test on real sand does.
        width: Of the window in strain over which moduli are fitted.

    Returns:
        dict of arrays, shape (num_rows,): ``strain``, ``stress`` (vertical, of both platens over
        the present area) and ``stress_x``, ``stress_y`` [Pa], ``void_ratio``, ``log10_stress``
        (nan without compression), ``modulus`` M = dσ/dε, a least-squares line over the window
        in the same stage [Pa], nan in the seating stage, and ``K0``, the mean side stress over the
        vertical one.
    """
    height = np.asarray(history["height"], dtype=float)
    forces = [*side_forces(history).values(), history["force_z_min"], history["force_z_max"]]
    sizes = np.column_stack([lengths, height])
    stress_x, stress_y, stress = wall_stress(np.column_stack(forces), sizes).T
    strain = np.asarray(history["strain"], dtype=float)
    positive = stress > 0
    modulus = np.full(strain.shape, np.nan)
    for branch in branches(history):  # unloading has another slope at the same strain
        rows = branch.rows
        modulus[rows] = moduli(strain[rows], stress[rows], width)
    side = 0.5 * (stress_x + stress_y)
    nothing = np.full(strain.shape, np.nan)
    return {
        "strain": strain,
        "stress": stress,
        "stress_x": stress_x,
        "stress_y": stress_y,
        "void_ratio": void_ratio(solid_volume, sizes.prod(axis=1)),
        "log10_stress": np.log10(stress, out=nothing.copy(), where=positive),
        "modulus": modulus,
        "K0": np.divide(side, stress, out=nothing.copy(), where=positive),
    }


def triaxial_curves(history):
    """Invariants of a test by stages, a value a row.

    Args:
        history: dict column -> array.

    Returns:
        dict of arrays, shape (num_rows,): ``p`` the mean stress, ``q`` the deviator with the sign
        of σz less the mean of σx and σy [Pa], ``strain_volume``, loss of volume over that at
        strain 0.
    """
    x, y, z = (np.asarray(history[f"stress_{axis}"], dtype=float) for axis in "xyz")
    q = np.sqrt(0.5 * ((x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2))
    lengths = [1.0 - np.asarray(history[f"strain_{axis}"], dtype=float) for axis in "xyz"]
    return {
        "p": (x + y + z) / 3.0,
        "q": np.where(z < 0.5 * (x + y), -q, q),
        "strain_volume": 1.0 - np.prod(lengths, axis=0),
    }


def moduli(strain, stress, width):
    """Constrained modulus at each row: the slope of the line fitted around it [Pa].

    Near the ends the window is cut, and the slope belongs to the middle of what is left.

    Args:
        strain: Increasing, shape (num_rows,).
        stress: [Pa], shape (num_rows,).
        width: Of the window in strain.
    """
    return np.array([tangent_modulus(strain, stress, at, width) for at in strain])


def compression_index(log10_stress, ratio):
    """C_c = -Δe/Δ log₁₀ σ' of the line fitted to rows of the e-log σ' curve [-].

    nan with fewer than two different stresses.

    Args:
        log10_stress: Shape (num_rows,); rows that are nan are left out.
        ratio: Void ratio e, shape (num_rows,).
    """
    known = np.isfinite(log10_stress) & np.isfinite(ratio)
    x, e = np.asarray(log10_stress)[known], np.asarray(ratio)[known]
    if x.size < 2 or np.ptp(x) == 0:
        return np.nan
    x = x - x.mean()
    return -float(x @ e / (x @ x))
