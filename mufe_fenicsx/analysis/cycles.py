"""Cycles of loading: loops between turning points of the strain, their stiffness and damping."""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.analysis.rows import TURN


@dataclass(frozen=True)
class Cycle:
    """A loop from one turning point of the strain to the next, and back to the same strain.

    The secant stiffness is that between the turning points, mean of both branches. The damping
    ratio compares the area of the loop with the energy of an elastic body of that stiffness,

        E = (|Δσ₁| + |Δσ₂|)/(|Δε₁| + |Δε₂|),    D = ∮σ dε / (4π · ½ Δσ/2 Δε/2).

    Where strain does not come back to that of the start, a straight line closes the loop.

    Source: ASTM D3999, Standard Test Methods for the Determination of the Modulus and Damping
    Properties of Soils Using the Cyclic Triaxial Apparatus.
    """

    start: int  #: row of the first turning point
    turn: int  #: row of the next one
    end: int  #: row where the strain is that of the start again, or turns before
    stiffness: float  #: secant [Pa]
    work: float  #: dissipated in the loop, over the volume [J/m³]
    damping: float  #: damping ratio [-]


def turning_points(strain):
    """Rows where a strain turns back, with the first row and the last turn.

    Changes below :data:`TURN` of the whole range are none.

    Args:
        strain: Shape (num_rows,).
    """
    strain = np.asarray(strain, dtype=float)
    least = TURN * np.ptp(strain)
    found, furthest, sense = [0], 0, 0.0
    for row, value in enumerate(strain):
        if sense == 0:
            if abs(value - strain[0]) > least:
                furthest, sense = row, np.sign(value - strain[0])
        elif sense * (value - strain[furthest]) >= 0:
            furthest = row
        elif sense * (strain[furthest] - value) > least:
            found.append(furthest)
            furthest, sense = row, -sense
    return [*found, furthest]


def find_cycles(strain, stress):
    """The whole cycles of a test in turn, list of :class:`Cycle`; the first loading is none.

    Args:
        strain: Compression positive, shape (num_rows,).
        stress: [Pa], shape (num_rows,).
    """
    strain, stress = np.asarray(strain, dtype=float), np.asarray(stress, dtype=float)
    if strain.size < 2 or not np.ptp(strain) > 0:
        return []
    turns = turning_points(strain)[1:]
    return [_cycle(strain, stress, *turns[k : k + 3]) for k in range(0, len(turns) - 2, 2)]


def _cycle(strain, stress, start, turn, end):
    """The :class:`Cycle` of three turning points."""
    back = np.sign(strain[start] - strain[turn])
    beyond = back * (strain[turn : end + 1] - strain[start]) >= 0
    if beyond.any():  # the next branch goes further than the one before
        end = turn + int(np.argmax(beyond))
    tips = [start, turn, end]
    d_strain, d_stress = (np.abs(np.diff(values[tips])).sum() for values in (strain, stress))
    e, s = strain[start : end + 1], stress[start : end + 1]
    # Each side of the polygon, the closing one too.
    work = abs(float(0.5 * (e @ np.roll(s, -1) - s @ np.roll(e, -1))))
    stored = 0.5 * (0.25 * d_stress) * (0.25 * d_strain)
    damping = work / (4 * np.pi * stored) if stored > 0 else np.nan
    return Cycle(start, turn, end, float(d_stress / d_strain), work, float(damping))
