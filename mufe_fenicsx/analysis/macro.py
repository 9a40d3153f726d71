"""Stress, strain and stiffness of the whole sample, from its walls and from its contacts.

Compression is positive throughout, as in the history of a run.
"""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.analysis.grain_means import void_ratio
from mufe_fenicsx.analysis.rows import branches, waiting_rows
from mufe_fenicsx.analysis.stress_strain import tangent_modulus
from mufe_fenicsx.container import container_of_history

#: Columns of a history with the shear stress of the platens [Pa], of those that move along.
SHEAR_STRESS = ("shear_xz", "shear_tz")
#: That with γ of a box whose walls across x are tilted.
TILT = "gamma_xz"


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


def wall_stresses(history, lengths):
    """Mean normal stress of the walls across each axis [Pa], shape (num_rows, num_axes).

    Args:
        history: dict column -> array.
        lengths: Along the axes of the container [m], shape (num_rows, num_axes).
    """
    container = container_of_history(history)
    forces = np.column_stack([history[f"force_{name}"] for name in container.walls])
    tilt = history[TILT] if TILT in history else 0.0
    return container.stresses(across_areas(forces, tilt), lengths)


def across_areas(normal_forces, tilt):
    """Those parts of normal forces that the areas between lengths are loaded by [N].

    Walls across x of a box that is sheared are tilted: N cos θ, with tan θ = γ.

    Args:
        normal_forces: Of all walls [N], shape (..., num_walls), those two first.
        tilt: γ, shape (...); 0 where nothing is tilted.
    """
    found = np.array(normal_forces, dtype=float)
    found[..., :2] /= np.sqrt(1.0 + np.asarray(tilt, dtype=float)[..., None] ** 2)
    return found


def inner_lengths(history):
    """Lengths along the axes of the container [m], (num_rows, num_axes); None where not known.

    Runs of earlier versions did not store those beside the height.
    """
    names = container_of_history(history).widths
    if not all(name in history for name in names):
        return None
    return np.column_stack([history[name] for name in (*names, "height")])


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
        lengths: Along the axes of the container [m], shape (num_rows, num_axes).
        solid_volume: Of the grains in the reference configuration [m³]: the void ratio counts
            their own (elastic) compression as loss of voids, as the test on real sand does.
        width: Of the window in strain over which moduli are fitted.

    Returns:
        dict of arrays, shape (num_rows,): ``strain``, ``stress`` (vertical, of both platens over
        the present area) and those of the sides (``stress_x``, ``stress_y`` of a box, ``stress_r``
        of a cylinder) [Pa], ``void_ratio``, ``log10_stress``
        (nan without compression), ``modulus`` M = dσ/dε, a least-squares line over the window
        in the same stage [Pa], nan in the seating stage, and ``K0``, the mean side stress over the
        vertical one.
    """
    container = container_of_history(history)
    stresses = wall_stresses(history, lengths)
    *sides, stress = stresses.T
    strain = np.asarray(history["strain"], dtype=float)
    positive = stress > 0
    modulus = np.full(strain.shape, np.nan)
    for branch in branches(history, whole=True):  # unloading has another slope there
        rows = branch.rows
        modulus[rows] = moduli(strain[rows], stress[rows], width)
    side = container.three_stresses(stresses, lengths)[:, :2].mean(axis=1)
    nothing = np.full(strain.shape, np.nan)
    return {
        "strain": strain,
        "stress": stress,
        **{f"stress_{a}": s for a, s in zip(container.axes[:-1], sides, strict=True)},
        "void_ratio": void_ratio(solid_volume, container.volume(lengths)),
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
        of σz less the mean of σx and σy [Pa], to which a shear stress of the platens adds;
        ``q_axial`` that difference itself, which goes through zero where sides differ;
        ``strain_volume``, loss of volume over that at strain 0.
    """
    container = container_of_history(history)
    stress, strain = (
        np.column_stack([np.asarray(history[f"{name}_{a}"], dtype=float) for a in container.axes])
        for name in ("stress", "strain")
    )
    lengths = inner_lengths(history)
    x, y, z = container.three_stresses(stress, lengths).T
    shear = next((np.asarray(history[n], dtype=float) for n in SHEAR_STRESS if n in history), 0.0)
    q = np.sqrt(0.5 * ((x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2) + 3.0 * shear**2)
    return {
        "p": (x + y + z) / 3.0,
        "q": np.where(z < 0.5 * (x + y), -q, q),
        "q_axial": z - 0.5 * (x + y),
        "strain_volume": 1.0 - np.prod(1.0 - container.three_strains(strain, lengths), axis=1),
    }


#: Rows count for strength whose mean stress is above this part of the largest.
LOADED = 0.1
#: Part of the range of strains of a stage over which its slope at the peak is fitted.
WINDOW = 0.2


@dataclass(frozen=True)
class Strength:
    """The largest q/p of a test in triaxial compression, and how the volume changes there."""

    row: int  #: of the history
    ratio: float  #: q/p there [-]
    last_ratio: float  #: at the end of the same stage [-]
    volume_slope: float  #: dε_vol/dε_a of logarithmic strains [-], negative: the volume grows

    @property
    def friction_angle(self):
        """Mobilised friction angle φ at the largest q/p [degrees]."""
        return friction_angle(self.ratio)

    @property
    def dilatancy_angle(self):
        """Angle ψ, sin ψ = -s/(2 - s) with the slope s [degrees]; negative: the volume falls.

        Source: T. Schanz & P. A. Vermeer, Géotechnique 46, 1996, 145-151, for equal lateral
        strains.
        """
        return float(np.degrees(np.arcsin(-self.volume_slope / (2 - self.volume_slope))))

    @property
    def is_passed(self):
        """Whether q/p falls beyond it by more than a twentieth in the same stage."""
        return self.last_ratio < 0.95 * self.ratio


def friction_angle(ratio):
    """Mobilised friction angle of a ratio q/p in triaxial compression [degrees].

    sin φ = (σ₁ - σ₃)/(σ₁ + σ₃) with σ₁ = p + 2q/3 and σ₃ = p - q/3.

    Args:
        ratio: Above 0 and below 3, where σ₃ vanishes.
    """
    return float(np.degrees(np.arcsin(3 * ratio / (6 + ratio))))


def triaxial_strength(history, curves):
    """Largest q/p and the dilatancy there, :class:`Strength`; None without compression.

    Args:
        history: dict column -> array.
        curves: Of :func:`triaxial_curves`.
    """
    p, q, volume = (np.asarray(curves[name]) for name in ("p", "q", "strain_volume"))
    strain, best = np.asarray(history["strain_z"], dtype=float), None
    waits = waiting_rows(history)
    for branch in branches(history):
        rows = np.arange(len(p))[branch.rows]
        rows = rows[~waits[rows]]
        rows = rows[p[rows] > LOADED * p.max()]
        if not rows.size or np.ptp(strain[rows]) == 0:
            continue
        ratio = q[rows] / p[rows]
        k = int(np.argmax(ratio))
        if not 0 < ratio[k] < 3 or (best is not None and ratio[k] <= best.ratio):
            continue
        axial, lost = -np.log1p(-strain[rows]), -np.log1p(-volume[rows])
        slope = tangent_modulus(axial, lost, axial[k], WINDOW * np.ptp(axial))
        best = Strength(int(rows[k]), float(ratio[k]), float(ratio[-1]), slope)
    return best


def moduli(strain, stress, width):
    """Constrained modulus at each row: the slope of the line fitted around it [Pa].

    Near the ends the window is cut, and the slope belongs to the middle of what is left.

    Args:
        strain: Increasing, shape (num_rows,).
        stress: [Pa], shape (num_rows,).
        width: Of the window in strain.
    """
    return np.array([tangent_modulus(strain, stress, at, width) for at in strain])
