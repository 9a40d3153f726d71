"""Strain around each grain between two stored states of a run, and what it says of the sample."""

from dataclasses import dataclass

import numpy as np
import pandas

from ..analysis import shear_band
from ..analysis.grain_means import void_ratio
from ..analysis.kinematics import grain_motion
from ..analysis.localisation import (
    delaunay_cells,
    grain_strain,
    rotation_vectors,
    voronoi_volumes,
)
from ..errors import InputError
from .columns import STRESS, columns_of, vectors
from .grain_tables import grain_volumes

#: So many grains have to be inside for a void ratio there.
FEWEST_INSIDE = 20


def localisation(run, number=-1, since=None):
    """Strain, rotation and void ratio around each grain between two stored states, a row a grain.

    Strains are logarithmic, means over the Delaunay cells at the grain, compression positive.

    Columns: ``grain`` (label), ``center_x`` … in the first of the states [m], ``volume`` of the
    grain now [m³]; ``num_cells`` at it, ``inside`` (cells close round it), ``cell_volume``, its
    quarter of them in the first state [m³]; ``strain_volume``, ``strain_deviator`` √(2/3 e:e),
    ``strain_xx`` … of the tensor in the axes of the first state; ``rotation_x`` … of the grain
    between the states (rotation vector [rad]) and its ``angle``, ``neighbours_x`` … of its cells,
    ``excess_x`` … and ``excess``, by which it turns beyond them [rad]; ``void_ratio_before`` and
    ``void_ratio`` of its Voronoi cell, nan where it is not inside. Strains are nan where a grain
    has no cell.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        number: Of the stored state; -1 is the last.
        since: Of an earlier one, from which strain counts; None: the first that is stored.

    Raises:
        InputError: A state was not stored, the second is not later than the first, or grains are
            too few, or too far apart, for a cell.
    """
    if since is None:
        since = int(run.states.index[0]) if len(run.states) else 0
    first, last = run.state(since), run.state(number)
    if last.index <= first.index:
        raise InputError(
            f"strain from state {first.index} to state {last.index}, expected a later second one"
        )
    return strain_table(Places.of(first), Places.of(last))


@dataclass(frozen=True)
class Places:
    """Where the grains are in a stored state, and how they have turned."""

    state: int  #: its number
    labels: np.ndarray  #: shape (num_grains,)
    centre: np.ndarray  #: of mass [m], shape (num_grains, 3)
    rotation: np.ndarray  #: since the reference configuration, shape (num_grains, 3, 3)
    volume: np.ndarray  #: [m³], shape (num_grains,)

    @classmethod
    def of(cls, state):
        """Those of a :class:`~mufe_fenicsx.results.state.State`."""
        motion = grain_motion(state.reference, state.points, state.cells, state.grain)
        labels, volume = grain_volumes(state)
        return cls(state.index, labels, motion.centre + motion.translation, motion.rotation, volume)

    @property
    def radius(self):
        """Of balls of the same volumes [m], shape (num_grains,)."""
        return np.cbrt(3 * self.volume / (4 * np.pi))


def strain_table(first, last):
    """The table of :func:`localisation` between two :class:`Places`.

    Raises:
        InputError: As there.
    """
    if not np.array_equal(first.labels, last.labels):
        raise InputError(f"states {first.state} and {last.state} have different grains")
    cells = delaunay_cells(first.centre, first.radius)
    found = grain_strain(cells, first.centre, last.centre)
    turn = last.rotation @ np.swapaxes(first.rotation, 1, 2)
    own = rotation_vectors(turn)
    excess = rotation_vectors(turn @ np.swapaxes(found.rotation, 1, 2))
    ratio = [void_ratio(p.volume, voronoi_volumes(p.centre, found.inside)) for p in (first, last)]
    tensor = np.stack(
        [found.strain[:, "xyz".index(e[0]), "xyz".index(e[1])] for e in STRESS], axis=1
    )
    return pandas.DataFrame(
        {"grain": last.labels}
        | columns_of("center", first.centre)
        | {"volume": last.volume, "num_cells": found.num_cells, "inside": found.inside}
        | {"cell_volume": found.volume[0]}
        | {"strain_volume": found.strain_volume, "strain_deviator": found.strain_deviator}
        | columns_of("strain", tensor, STRESS)
        | columns_of("rotation", own)
        | {"angle": np.linalg.norm(own, axis=1)}
        | columns_of("neighbours", rotation_vectors(found.rotation))
        | columns_of("excess", excess)
        | {"excess": np.linalg.norm(excess, axis=1)}
        | {"void_ratio_before": ratio[0], "void_ratio": ratio[1]}
    )


@dataclass(frozen=True)
class Localisation:
    """What the strains around all grains say of the sample."""

    num_grains: int  #: with a strain
    spread: float  #: standard deviation of the deviatoric strain over its mean [-]
    band: shear_band.Band | None  #: that explains most of it; None: strain is the same everywhere
    void_ratio: tuple[float, float]  #: inside, before and now [-]; nan: too few grains are

    @property
    def is_band(self):
        """Whether strain gathers in the band: by its share of the variance and its contrast."""
        band = self.band
        if band is None:
            return False
        return band.share > shear_band.ENOUGH and band.contrast >= shear_band.TWICE


def judge(table):
    """Whether the strain of a sample gathers in a band, and the void ratio inside.

    Args:
        table: Of :func:`localisation`.

    Returns:
        :class:`Localisation`; ``band.members`` belong to the rows that have a strain.

    Raises:
        InputError: Fewer grains have a strain than tell of a band.
    """
    known = table[np.isfinite(table["strain_deviator"])]
    if len(known) < shear_band.FEWEST:
        raise InputError(
            f"{len(known)} grains with neighbours, expected {shear_band.FEWEST} or more to tell "
            "whether strain is in a band"
        )
    strain, weight = (known[name].to_numpy() for name in ("strain_deviator", "cell_volume"))
    diameter = float(np.cbrt(6 * known["volume"].mean() / np.pi))
    ratios = []
    for name in ("void_ratio_before", "void_ratio"):
        inside = table[np.isfinite(table[name])]
        solid = inside["volume"].to_numpy()
        enough = len(inside) >= FEWEST_INSIDE
        ratios.append(float(solid @ inside[name] / solid.sum()) if enough else np.nan)
    return Localisation(
        num_grains=len(known),
        spread=shear_band.spread(strain, weight),
        band=shear_band.find_band(vectors(known, "center"), strain, weight, diameter),
        void_ratio=tuple(ratios),
    )
