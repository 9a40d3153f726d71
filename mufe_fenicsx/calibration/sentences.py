"""What a calibration determines and what it does not, in sentences, and the block for a scene."""

import math

import numpy as np
from scipy.stats import t as student

from ..units import with_unit
from .fit import ELASTIC, MODEL_ERRORS, WIDE

#: Correlation from which on two values are told by their combination alone.
ALIKE = 0.95
WORDS = {"E": "Young's modulus", "yield": "the yield stress", "hardening": "the hardening",
         "compliance": "the compliance of the machine"}  # fmt: skip
#: Of unknowns, by the first word of their names.
UNITS = {"E": "Pa", "yield": "Pa", "hardening": "Pa", "compliance": "m/N", "offset": "m"}


#: Largest over smallest value of an interval from which on nothing is stated.
LARGEST = 10.0


def determined(ends):
    """Whether an interval states anything: not where its ends are over a factor of ten apart.

    One that reaches to zero or below is none of a factor: it states how large a value is at most.
    """
    low, high = ends
    return low <= 0.0 or high <= LARGEST * low


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
    others = [other["yield"] + other["hardening"] * strain for other in fit.others]
    low, high = stress * math.exp(-half), stress * math.exp(min(half, 50.0))
    return strain, stress, (min(low, *others, low), max(high, *others, high))


def yielded(fit):
    """Whether any grain left the elastic branch."""
    return "yield" in fit.names


def least_yield(fit):
    """Yield stress [Pa] that grains have at least which did not leave the elastic branch."""
    return fit.material["yield"] * math.sqrt(fit.yields / ELASTIC)


def reasons(fit, given, law=None):
    """Why the curves do not determine the modulus, each a sentence; none where they do.

    Args:
        fit: :class:`~.fit.Fit`.
        given: :class:`~.fit.Given`.
        law: :class:`~.parts.Agreement`, or None.
    """
    if given.E is not None:
        return []
    said = []
    if "E" in fit.held:
        end = with_unit(fit.value("E"), "Pa")
        said.append(
            f"E = {end} is an end of what is sought: the curves do not determine it; "
            "give --modulus."
        )
    elif _is_wide(fit, "E"):
        said.append(f"The curves do not determine Young's modulus{_what_fits(fit, 'E')}.")
    return said + ([_other_law(law)] if law and not law.agrees else [])


def _what_fits(fit, name):
    ends = fit.interval(name)
    if not determined(ends):
        return ""
    said = " to ".join(with_unit(end, "Pa") for end in ends)
    return f": {said} fit"


def _is_wide(fit, name):
    low, high = fit.interval(name)
    return 0.5 * math.log(high / low) > WIDE


def _other_law(law):
    """Of parts of the curves that tell another value than the whole, or lack."""
    if law.begins_late:
        return (
            f"Curves begin at {100 * law.begins:.0f} % of their largest force, where grains may "
            "flow: they do not tell Young's modulus. Give --modulus, or curves from the touch on."
        )
    whole, *lower = (with_unit(value, "Pa") for value in law.values)
    parts = [f"up to {part:g} of it {value}"
             for part, value in zip(law.parts[1:], lower, strict=True)]  # fmt: skip
    said = (
        f"Up to their largest force curves give {WORDS[law.name]} {whole}, {', '.join(parts)}: "
        "grains do not harden linearly, or grains and machine give way otherwise than the model. "
    )
    if law.until is None:
        return said + f"None is confirmed: give --modulus or cut curves below {law.parts[-1]:g}."
    part = law.parts[law.until]
    if law.name != "E":
        return said + f"Cut curves at {part:g} of their force, or take the table as a mean."
    # The lowest part has the least of the law of hardening.
    value, ends = with_unit(law.values[-1], "Pa"), law.intervals[-1]
    if np.isfinite(ends).all() and determined(ends):
        value += f'" ({" to ".join(with_unit(end, "Pa") for end in ends)})'
    else:
        value += '"'
    return said + (
        f'Give --modulus "{value}, the lowest part, which others confirm '
        f"up to {part:g} of the force, or what you know."
    )


def misfit(fit):
    """A sentence where forces stray from the model in one piece and not by noise, else None."""
    if fit.scatter**2 - fit.noise**2 < max(fit.noise, 2 * MODEL_ERRORS[0]) ** 2:
        return None
    return (
        f"The model does not fit: forces are {100 * fit.scatter:.2g} % off, neighbours differ by "
        f"{100 * fit.noise:.2g} %. Grains are no balls or do not harden linearly: cut curves where "
        "curves.png shows that they leave the model, or give --modulus."
    )


def doubts(fit, given, law=None):
    """Sentences for which a sought modulus is no result; arguments as of :func:`reasons`."""
    return [*reasons(fit, given, law), *filter(None, [misfit(fit)])]


def limits_of(fit, given, law=None):
    """Sentences on what the curves do not determine; arguments as of :func:`reasons`."""
    said = [
        f"{name} = {with_unit(fit.value(name), UNITS[name.partition(' ')[0]])} is an end of what "
        "is sought: the curves do not determine it." for name in fit.held if name != "E"
    ]  # fmt: skip
    said += doubts(fit, given, law)
    if law and not law.agrees and given.E is not None:
        said.append(_other_law(law))
    if not yielded(fit):
        if misfit(fit) is not None:
            return said
        return [
            *said, "No curve leaves the elastic branch: the yield stress is at least about "
            f"{with_unit(least_yield(fit), 'Pa')}, hardening is not determined.",
        ]  # fmt: skip
    strain, _, (low, high) = end_of_table(fit)
    if _is_wide(fit, "yield"):
        said.append(f"The curves do not determine the yield stress{_what_fits(fit, 'yield')}.")
    if 0.5 * math.log(high / low) > WIDE:
        said.append("The curves do not determine the hardening.")
    said += _alike(fit)
    said.append(
        f"No grain passes a plastic strain of {fit.strain:.2g}: the hardening beyond is not "
        f"determined, and the table ends at {strain:g}."
    )
    return said


def _alike(fit):
    """Of values that are told by their combination."""
    known = [n for n in ("E", "yield", "hardening", "compliance") if n in fit.names]
    at, said = [fit.names.index(n) for n in known], []
    part = np.abs(fit.correlation[np.ix_(at, at)])
    for i, j in zip(*np.nonzero(np.triu(part, 1) > ALIKE), strict=True):
        advice = ""
        if "E" in (known[i], known[j]):
            advice = "; with --modulus the other one is known better"
        elif "compliance" in (known[i], known[j]):
            advice = "; measure the machine without a grain and give --compliance"
        said.append(
            f"Of {WORDS[known[i]]} and {WORDS[known[j]]} the curves tell a combination better than "
            f"each (correlation {fit.correlation[at[i], at[j]]:.2f}){advice}."
        )
    return said


def material_block(fit, nu, density, unsure=False):
    """The table [material] of a scene, as TOML.

    Args:
        fit: :class:`~.fit.Fit`.
        nu: Poisson's ratio.
        density: [kg/m³].
        unsure: The modulus is not determined: neither it nor stresses are lines of the table.
    """
    E = with_unit(fit.material["E"], "Pa")
    modulus = (
        f"# E: state it; the curves do not tell it, {E} is no result" if unsure else f'E = "{E}"'
    )
    lines = ["[material]", f'model = "{"j2" if yielded(fit) else "elastic"}"', modulus,
             f"nu = {nu:g}", f'rho = "{density:g} kg/m^3"']  # fmt: skip
    if yielded(fit):
        strain, stress, ends = end_of_table(fit)
        first = with_unit(fit.material["yield"], "Pa")
        if unsure:
            lines.append("# yield_stress: calibrate again with that E")
        elif not (determined(fit.interval("yield")) and determined(ends)):
            lines.append("# yield_stress: state it; the curves do not tell it")
        else:
            last = with_unit(stress, "Pa")
            lines.append(f'yield_stress = [[0.0, "{first}"], [{strain:g}, "{last}"]]')
        lines.append(f'beyond = "flat"   # not determined by the data beyond {strain:g}')
    return "\n".join(lines) + "\n"
