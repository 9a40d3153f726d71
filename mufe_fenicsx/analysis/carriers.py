"""Who carries the load of a sample: how many of its grains, and do some of them bridge its walls?

A grain carries the part tr(Σ f ⊗ (x - x_c)) of the sum of all grains: the trace of its mean stress
times its volume (Love, Weber). Many grains of a packing share its load. Where one reaches from
wall to wall, its own stiffness is measured.
"""

import math
from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.geometry.form.proportions import OPPOSITE

#: A grain that carries less than this part of the mean is idle.
IDLE = 0.01
#: Part of the force on two opposite walls that grains which touch both may carry.
BRIDGED = 0.1
#: Half of the load has to be in so many grains, or in this part of all where that is less.
SHARERS, PART_OF_ALL = 3, 0.25


@dataclass(frozen=True)
class Carriers:
    """How a sample shares its load."""

    num_grains: int
    num_idle: int  #: that carry next to nothing
    num_half: int  #: fewest that carry half of the load
    heaviest: int  #: label of the one that carries most
    most: float  #: the part of the load that it carries
    bridging: tuple  #: labels of those that touch opposite walls
    bridged: float  #: largest part of the force on two opposite walls that they carry
    doubtful: float | None  #: part of normal force where segmentation doubts contacts, if known

    @property
    def least(self):
        """Grains that half of the load has to be in."""
        return min(SHARERS, math.ceil(PART_OF_ALL * self.num_grains))


def find_carriers(contacts, grains, doubted=None):
    """:class:`Carriers` of one stored state; None where nothing is carried.

    Args:
        contacts, grains: Its tables, as of :func:`mufe_fenicsx.output.contacts.read_contacts`.
        doubted: Pairs of labels that the segmentation doubts, or None where that is not known.
    """
    labels, centre = np.asarray(grains["grain"]), _vectors(grains, "center")
    on = np.asarray(contacts["num_points"]) > 0
    a, b, wall = (np.asarray(contacts[name])[on] for name in ("grain_a", "grain_b", "wall"))
    force, place = (_vectors(contacts, name)[on] for name in ("force", "centroid"))
    press = np.maximum(np.asarray(contacts["normal_force"], dtype=float)[on], 0.0)
    load, inner = np.zeros(labels.size), b != 0
    for of, f, x in ((a, force, place), (b[inner], -force[inner], place[inner])):
        at = np.searchsorted(labels, of)
        np.add.at(load, at, np.einsum("ci,ci->c", f, centre[at] - x))
    load = np.maximum(load, 0.0)
    total = load.sum()
    if not total > 0.0:
        return None
    carried = np.cumsum(np.sort(load)[::-1]) / total
    first, bridged, bridging = int(np.argmax(load)), 0.0, set()
    for walls in OPPOSITE:
        on_wall = [{int(g): f for g, f in zip(a[wall == w], press[wall == w], strict=True)}
                   for w in walls]  # fmt: skip
        both = on_wall[0].keys() & on_wall[1].keys()
        sums = [(sum(own[g] for g in both), sum(own.values())) for own in on_wall]
        bridging |= both
        bridged = max(bridged, min(part / whole if whole > 0 else 0.0 for part, whole in sums))
    doubtful = None
    if doubted is not None and press[inner].sum() > 0:
        pairs = {frozenset(map(int, pair)) for pair in doubted}
        known = [
            frozenset(pair) in pairs
            for pair in zip(a[inner].tolist(), b[inner].tolist(), strict=True)
        ]
        doubtful = float(press[inner][np.array(known, dtype=bool)].sum() / press[inner].sum())
    return Carriers(
        labels.size, int((load < IDLE * total / labels.size).sum()),
        int(np.searchsorted(carried, 0.5 * (1 - 1e-12))) + 1, int(labels[first]),
        float(load[first] / total), tuple(sorted(bridging)), float(bridged), doubtful,
    )  # fmt: skip


def _vectors(table, name):
    return np.column_stack([np.asarray(table[f"{name}_{axis}"], dtype=float) for axis in "xyz"])
