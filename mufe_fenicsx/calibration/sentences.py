"""What a calibration determines and what it does not, in sentences, and the block for a scene."""

import math

import numpy as np
from scipy.stats import t as student

from ..units import with_unit

#: Half-width of an interval in logarithms from which on a value counts as not determined.
WIDE = math.log(2.0)
#: Correlation from which on two values are told by their combination alone.
ALIKE = 0.95
#: Approach over that of first yield below which the force is that of an elastic ball.
ELASTIC = 1.9
#: Deviation of forces over those of the model from which on it is not that of these grains.
FAR = 0.3
#: Correlation of neighbours among the residuals from which on the model is another one.
STRAY = 0.5
WORDS = {"E": "Young's modulus", "yield": "the yield stress", "hardening": "the hardening",
         "compliance": "the compliance of the machine"}  # fmt: skip
#: Of unknowns, by the first word of their names.
UNITS = {"E": "Pa", "yield": "Pa", "hardening": "Pa", "compliance": "m/N", "offset": "m"}


def end_of_table(fit):
    """Plastic strain of the last point of the hardening table, of two digits, and its stress.

    Returns:
        Strain; stress [Pa]; interval of 95 % of this [Pa].
    """
    strain = float(f"{max(fit.strain, 1e-4):.1g}")
    Y, H = fit.material["yield"], fit.material["hardening"]
    stress = Y + H * strain
    slopes = np.zeros(len(fit.names))
    slopes[fit.names.index("yield")] = Y / stress
    slopes[fit.names.index("hardening")] = H * strain / stress
    half = student.ppf(0.975, fit.freedom) * math.sqrt(slopes @ fit.covariance @ slopes)
    return strain, stress, (stress * math.exp(-half), stress * math.exp(min(half, 50.0)))


def yielded(fit):
    """Whether any grain left the elastic branch."""
    return fit.yields > ELASTIC


def limits_of(fit, given_E):
    """Sentences on what the curves do not determine."""
    said = [
        f"{name} = {with_unit(fit.value(name), UNITS[name.partition(' ')[0]])} is an end of what "
        f"is sought: the curves do not determine it{'; give --modulus' if name == 'E' else ''}."
        for name in fit.held
        if yielded(fit) or name not in ("yield", "hardening")
    ]
    if fit.scatter > FAR:
        said.append(f"The model does not fit: forces are {100 * fit.scatter:.0f} % off.")
    if not yielded(fit):
        return [
            *said, "No curve leaves the elastic branch: the yield stress is at least "
            f"{with_unit(fit.material['yield'], 'Pa')}, hardening is not determined.",
        ]  # fmt: skip
    strain, _, (low, high) = end_of_table(fit)
    for name in ("E", "yield"):
        if name not in fit.names:
            continue
        ends = fit.interval(name)
        if 0.5 * math.log(ends[1] / ends[0]) > WIDE:
            said.append(
                f"The curves do not determine {WORDS[name]}: {with_unit(ends[0], 'Pa')} to "
                f"{with_unit(ends[1], 'Pa')} fit."
            )
    if 0.5 * math.log(high / low) > WIDE:
        said.append("The curves do not determine the hardening.")
    known = [n for n in ("E", "yield", "hardening", "compliance") if n in fit.names]
    at = [fit.names.index(n) for n in known]
    part = np.abs(fit.correlation[np.ix_(at, at)])
    for i, j in zip(*np.nonzero(np.triu(part, 1) > ALIKE), strict=True):
        advice = ""
        if "E" in (known[i], known[j]) and given_E is None:
            advice = "; with --modulus the other one is known better"
        elif "compliance" in (known[i], known[j]):
            advice = "; measure the machine without a grain and give --compliance"
        said.append(
            f"Of {WORDS[known[i]]} and {WORDS[known[j]]} the curves tell a combination better than "
            f"each (correlation {fit.correlation[at[i], at[j]]:.2f}){advice}."
        )
    said.append(
        f"No grain passes a plastic strain of {fit.strain:.2g}: the hardening beyond is not "
        f"determined, and the table ends at {strain:g}."
    )
    if fit.straying > STRAY:
        said.append(
            "Curves stray from the model in one piece (neighbours correlate with "
            f"{fit.straying:.2f}): grains are no balls, or do not harden linearly. "
            "Intervals are widened for it."
        )
    return said


def material_block(fit, nu, density):
    """The table [material] of a scene, as TOML."""
    E = fit.material["E"]
    lines = ["[material]", f'model = "{"j2" if yielded(fit) else "elastic"}"',
             f'E = "{with_unit(E, "Pa")}"', f"nu = {nu:g}",
             f'rho = "{density:g} kg/m^3"']  # fmt: skip
    if yielded(fit):
        strain, stress, _ = end_of_table(fit)
        first = with_unit(fit.material["yield"], "Pa")
        lines.append(
            f'yield_stress = [[0.0, "{first}"], [{strain:g}, "{with_unit(stress, "Pa")}"]]'
        )
        lines.append(f'beyond = "flat"   # not determined by the data beyond {strain:g}')
    return "\n".join(lines) + "\n"
