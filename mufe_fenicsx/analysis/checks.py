"""Targets of a quasi-static test, whether a run meets them, and from where on it is trusted.

A test begins without a load, where ratios say little. So each target is to be met over the whole
course but its first tenth, to the end.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from mufe_fenicsx.analysis import energy_check, quasi_static, stress_strain
from mufe_fenicsx.analysis.carriers import BRIDGED
from mufe_fenicsx.analysis.check_targets import NAMES, TARGETS, WORDS
from mufe_fenicsx.analysis.contact_resolution import COARSE
from mufe_fenicsx.analysis.evidence.mesh_errors import error_at, known_samples, mesh_errors
from mufe_fenicsx.analysis.held import lack_of_stress
from mufe_fenicsx.analysis.rows import (
    counted_rows,
    course,
    largest,
    lasting,
    load,
    loading_rows,
    tool_load,
    turns_back,
)
from mufe_fenicsx.geometry.form.proportions import FEW, LEAST_HEIGHT, words_of_height

#: Why forces of an older run between rough walls say nothing.
NO_BALANCE = (
    "rough side walls or others may carry a part of the load, and the history has no unbalanced_z"
)
#: Part of the test at its start where targets may be missed without a warning.
UNTRUSTED = 0.1
#: Why a start from rest is trusted late, though it is the gentler one: at the time t of a ramp
#: v = a t the ratio of a linear sample, v²/(3 c² ε²) with ε = a t²/(2 H), is 4/3 (T/t)².
RAMP = (
    " Loading begins at rest: on the way to its speed kinetic over internal energy is four times "
    "that at a constant speed, as strain lags behind. Such a start is trusted later than one with "
    "a platen that strikes, and yet disturbs the grains less."
)
#: Part of the normal force that coarse contacts may carry without a warning.
COARSE_FORCE = 0.5
#: Part of the normal force that contacts which the segmentation doubts may carry.
DOUBTFUL = 0.25
#: Energies that are never below zero, and the part of the largest work that is rounding.
POSITIVE, ROUNDING = ("kinetic", "elastic", "plastic", "friction", "contact"), 1e-6


@dataclass(frozen=True)
class Check:
    """One target and what the run reached; all numbers are ratios."""

    name: str
    target: float
    largest: float  #: beyond the first tenth of the course; nan if there is no row
    mean: float  #: of the same rows
    passed: bool
    text: str  #: in plain words
    since: float = math.nan  #: vertical strain from which on it is met to the end; nan: not there
    failed: bool = False  #: nothing of the run can be used
    row: int | None = None  #: of the history, from which on it is met; None: not there
    stage: str | None = None  #: of that row, in a test by stages

    @property
    def grade(self):
        """How the page marks it: "pass", "warn" or "fail"."""
        return "fail" if self.failed else "pass" if self.passed else "warn"

    @property
    def reached(self):
        """Largest value, and the mean in brackets, as a text."""
        if not np.isfinite(self.largest):
            return "not known"
        return f"{ratio(self.largest)} ({ratio(self.mean)})"


def ratio(value):
    """A ratio in per cent: "0.61%", and "0.0015%" where two digits would leave nothing."""
    small = 0 < value < 5e-5
    return f"{value:.{1 - math.floor(math.log10(100 * value)) if small else 2}%}"


def check_run(history, mass=None, contacts=None, sample=None):
    """From where on all checks hold, the test is quasi-static, and its targets are met.

    Args:
        history: dict column -> array.
        mass: Of all grains [kg], by which it is known how long waves travel; None: single rows
            are judged.
        contacts: Arguments of :func:`check_contacts` after the history, or None.
        sample: Arguments of :func:`check_sample` after the history, or None.

    Returns:
        List of Check: that of :func:`check_all` first, that of :func:`check_trust` next. Where
        grains broke and most of the load is lost, rows after the largest one are not judged.
    """
    last = None if faults(history) else _broken_from(history)
    if last is not None:
        history = {name: values[: last + 1] for name, values in history.items()}
    kinetic, difference = quasi_static.judged(history, mass)
    led = tool_load(history) is not None
    values = {
        "kinetic": kinetic,
        "tool" if led else "platens": difference,
        "residual": energy_check.residual_ratio(history),
        "switching": energy_check.switching_ratio(history),
    }
    opening = energy_check.opening_ratio(history)
    if opening is not None:
        values["opening"] = opening
    if "overlap" in history:
        values["overlap"] = np.asarray(history["overlap"], dtype=float)
    if not led:
        values["load"] = stress_strain.lost_load(history)
    lack = lack_of_stress(history)
    if lack is not None and np.isfinite(lack[loading_rows(history)]).any():
        time, window = (
            history["time"],
            quasi_static.WINDOW * quasi_static.travel_time(history, mass),
        )
        values["held"] = np.abs(quasi_static.mean_of_recent(lack, time, window))
    fault = faults(history)
    targets = [_check(name, history, found, fault) for name, found in values.items()]
    found = [check_trust(history, mass), *targets]
    if contacts is not None:
        found.append(check_contacts(history, *contacts))
    if sample is not None and not led:
        found += check_sample(history, *sample)
    verdict = check_all(history, found)
    if last is not None:
        broke = f"Grains break under the largest load, at {where(history, last)}; what follows is "
        broke += "not judged."
        verdict = replace(verdict, text=f"{verdict.text} {broke}")
    return [_staged(history, check) for check in (verdict, *found)]


def _broken_from(history):
    """Row of the largest load before grains that break lose most of it; None: they do not.

    What follows it is a collapse in motion. Unloading on purpose loses nothing.
    """
    if tool_load(history) is not None or not np.any(history.get("broken_grains", 0)):
        return None
    lost = np.flatnonzero(stress_strain.lost_load(history) > TARGETS["load"])
    return int(np.argmax(history["stress"][: lost[0]])) if lost.size else None


def _staged(history, check):
    """A check with the stage from which on it is met."""
    if check.row is None or "strain_z" not in history:
        return check
    return replace(check, stage=str(history["stage"][check.row]))


def check_all(history, checks):
    """From where on, to the end, all checks hold: the :class:`Check` named "all", the verdict.

    Its ``largest`` is the part of the test before, as of :func:`~.rows.course`.
    """
    open_at_end = [c.name for c in checks if c.row is None]
    failed = any(c.failed for c in checks)
    if open_at_end:
        fault, names = faults(history), ", ".join(NAMES[name] for name in open_at_end)
        text = (
            f"Trust no part of the test: {fault or f'checks that do not hold at its end: {names}'}."
        )
        return Check("all", UNTRUSTED, math.nan, math.nan, False, text, math.nan, failed)
    last = max(checks, key=lambda c: c.row)
    share = float(course(history)[last.row])
    text = f"Trust it from {_start(history)} on: all checks hold."
    if share > 0:
        text = (
            f"Trust it from {where(history, last.row)} on: all checks hold to the end, that of "
            f"{NAMES[last.name]} last. Before lie {ratio(share)} of the test."
        )
    row, since = last.row, last.since
    if share > 1 - UNTRUSTED:
        row, since = None, math.nan
        text = (
            "Trust no part of the test: all checks hold at its very end alone, that of "
            f"{NAMES[last.name]} last."
        )
    passed = share <= UNTRUSTED
    return Check("all", UNTRUSTED, share, math.nan, passed, text, since, failed, row)


def judged_rows(history):
    """Rows where targets count: of the loading, beyond its first tenth, shape (num_rows,)."""
    return np.nan_to_num(course(history), nan=-1.0) >= UNTRUSTED


def holds_from(checks, history):
    """Where each check begins to hold to the end, dict name -> place or None; for JSON.

    The place is a strain; of a test by stages a dict with stage, strain and time [s].
    """
    return {c.name: None if c.row is None else _place(history, c.row) for c in checks}


def _place(history, row):
    strain = float(history["strain"][row])
    if "strain_z" not in history:
        return strain
    at = {"stage": str(history["stage"][row]), "strain": strain}
    return at | {"time": float(history["time"][row])}


def check_trust(history, mass=None):
    """From where on, to the end, inertia plays no part: the :class:`Check` named "trusted".

    Its ``largest`` is the part of the test before, as of :func:`~.rows.course`, to be compared with
    its ``target``; it has failed if the end of the test is dynamic, or the history has a fault.

    Args:
        history, mass: As of :func:`check_run`.
    """
    trust, fault = quasi_static.trusted_from(history, mass), faults(history)
    targets = f"kinetic over internal energy within {100 * quasi_static.KINETIC:g}%, "
    targets += (
        f"unbalanced force within {100 * quasi_static.UNBALANCED:g}% of the load"
        if quasi_static.knows_balance(history)
        else f"forces not judged, as {NO_BALANCE}"
    )
    targets += " (single rows)" if mass is None else " (means over half the travel time of a wave)"
    ratios = _ratios(trust)
    failed, since = bool(fault) or trust.row is None, math.nan
    if fault:
        text = f"Quasi-static nowhere: {fault}."
    elif trust.row is None:
        dynamic = f"the test is dynamic to its end: {ratios}"
        text = f"Quasi-static nowhere: {dynamic if ratios else _no_values(history)}."
    else:
        since = float(history["strain"][trust.row])
        if trust.share == 0:
            text = f"Quasi-static from {_start(history)} on."
        else:
            by_time = turns_back(history) or tool_load(history) is not None
            before = "time" if by_time else "strain"
            text = (
                f"Quasi-static from {where(history, trust.row)} on. Before, in "
                f"{ratio(trust.share)} of the {before}, {100 * trust.missed:.3g}% of the rows are "
                f"dynamic{f': {ratios}' if ratios else ''}."
            )
    if not fault and trust.share > 0 and _ramps_from_rest(history, mass):
        text += RAMP
    text += f" Targets: {targets}."
    passed = not failed and trust.share <= UNTRUSTED
    share = math.nan if failed else trust.share
    row = None if failed else trust.row
    return Check("trusted", UNTRUSTED, share, math.nan, passed, text, since, failed, row)


def _ramps_from_rest(history, mass):
    """Whether loading begins at rest and its first tenth has too much kinetic energy."""
    if tool_load(history) is not None:
        return False
    rows = np.flatnonzero(loading_rows(history))
    kinetic, early = quasi_static.judged(history, mass)[0][rows], course(history)[rows] < UNTRUSTED
    known = np.isfinite(kinetic)
    at_rest = known.any() and kinetic[known][0] <= quasi_static.KINETIC
    return bool(at_rest and (kinetic[known & early] > quasi_static.KINETIC).any())


def check_contacts(history, found, which, edges=None):
    """Whether facets resolve the contacts: the :class:`Check` named "contacts".

    It asks for half of the force in patches of COARSE elements per contact radius or more, and for
    grains no coarser than any whose error is known.

    Args:
        history: dict column -> array, with the median of each row.
        found: :class:`~mufe_fenicsx.analysis.contact_resolution.Resolution`.
        which: Contacts of what, and when, in words.
        edges: A diameter of grains, by which the error of the sample's stress is known; or None.
    """
    force = load(history)
    unloaded = force < quasi_static.UNLOADED * np.maximum.accumulate(force)
    coarseness = np.where(unloaded, math.nan, -history["elements_per_radius"])
    row, since, place = _since(history, coarseness, -COARSE)
    if edges is not None and math.isinf(error_at(known_samples(), edges)):
        row, since, place = None, math.nan, ""
    passed = found.coarse <= COARSE_FORCE and row is not None and course(history)[row] <= UNTRUSTED
    if passed:
        verdict = "contacts are resolved"
    elif not place:
        verdict = "grains are coarser than any whose error is known: refine their surfaces"
    elif found.coarse <= COARSE_FORCE and row is not None:
        verdict = "but only after the first tenth: refine the surfaces of the grains"
    else:
        verdict = "the mesh decides on the stiffness of contacts: refine the surfaces of the grains"
    text = (
        f"Normal force in contacts of fewer than {COARSE:g} elements per contact radius: "
        f"{ratio(found.coarse)} of all, target {100 * COARSE_FORCE:g}%; {verdict}. A tenth of the "
        f"force has fewer than {found.tenth:.2f}, half of it {found.half:.2f}, nine tenths "
        f"{found.nine_tenths:.2f} ({which}). {_errors(found.half, edges)} {place}"
    ).rstrip()
    return Check(
        "contacts", COARSE_FORCE, found.coarse, math.nan, bool(passed), text, since, row=row
    )


def check_sample(history, carriers, diameters):
    """Whether the grains are a sample: list of :class:`Check`; none of fewer than FEW grains.

    Args:
        history: dict column -> array.
        carriers: :class:`~.carriers.Carriers` of the state under the largest load.
        diameters: Height of the sample in median diameters of its grains.
    """
    c = carriers
    if c.num_grains < FEW:
        return []
    grain = f"grain {c.heaviest}, which carries most, has {ratio(c.most)}"
    need, many = (f"{n} grain{'s'[: n != 1]}" for n in (c.least, c.num_half))
    labels = ", ".join(map(str, c.bridging[:FEW])) + (", …" if c.bridging[FEW:] else "")
    parts = [
        (
            "carriers", c.least, c.num_half, c.num_half >= c.least,
            f"Half of the load is in {many} of {c.num_grains}, target {need} or more: {grain}; "
            f"{c.num_idle} are idle",
        ),
        (
            "bridges", BRIDGED, c.bridged, c.bridged <= BRIDGED,
            "Force between opposite walls through grains that touch both: "
            f"{ratio(c.bridged)}, target {100 * BRIDGED:g}%; "
            + (f"grains {labels}" if c.bridging else "no grain does"),
        ),
        (
            "height", LEAST_HEIGHT, diameters, diameters >= LEAST_HEIGHT,
            f"The sample is {diameters:.1f} median diameters high, target {LEAST_HEIGHT:g} or "
            f"more; {words_of_height(diameters)}",
        ),
    ]  # fmt: skip
    if c.doubtful is not None:
        parts.append((
            "doubtful", DOUBTFUL, c.doubtful, c.doubtful <= DOUBTFUL,
            "Normal force through contacts that the segmentation doubts, wide necks that may cut "
            f"one grain in two: {ratio(c.doubtful)} of all, target {100 * DOUBTFUL:g}%",
        ))  # fmt: skip
    rows = np.flatnonzero(counted_rows(history))
    found = []
    for name, target, value, passed, text in parts:
        row = int(rows[0]) if passed and rows.size else None
        since = math.nan if row is None else float(history["strain"][row])
        more = "" if passed else ": the curve is not that of a packing"
        found.append(
            Check(name, target, float(value), math.nan, passed, f"{text}{more}.", since, row=row)
        )
    return found


def _errors(n, edges):
    """What contacts of n elements per radius and grains of so many edges are off by, in words."""
    text = (
        f"A single contact of {n:.2f} is off by {_error(mesh_errors('plastic-sphere'), n)} where "
        f"it flows and {_error(mesh_errors('hertz'), n)} where it is elastic."
    )
    if edges is None:
        return text
    flows, elastic = (_error(known_samples(fidelity=name), edges) for name in ("j2", "elastic"))
    return (
        f"{text} With {edges:.1f} edges a diameter the stress of twenty grains of known shape is "
        f"off by {flows} where they flow and {elastic} where they are elastic, at strains of 0.01 "
        "to 0.05."
    )


def _error(known, n):
    """Error at n by stored points, in words."""
    error = error_at(known, n)
    return f"{error:.0%}" if math.isfinite(error) else f"more than {known[0][1]:.0%}"


def _ratios(trust):
    """What both ratios reached, in words; "" where neither is known."""
    reached = ("kinetic energy", trust.kinetic), ("unbalanced force", trust.unbalanced)
    return ", ".join(f"{what} up to {ratio(r)}" for what, r in reached if np.isfinite(r))


def _start(history):
    """Where targets begin to count, in words."""
    if tool_load(history) is not None:
        return "where the tool has half of its largest force"
    return "the start of loading"


def _no_values(history):
    """Why a check has nothing to go by."""
    if not loading_rows(history).any():
        return "the test has not gone beyond its seating"
    return "the sample was never loaded"


def faults(history):
    """What no run may have: values that are no numbers, energies below zero. A text, or ""."""
    for name, values in history.items():
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            count = int((~np.isfinite(values)).sum())
            return f"{name} is not a number in {count} of {len(values)} rows"
    most = float(np.abs(history["work"]).max(initial=0.0))
    for name in POSITIVE:
        below = int((history[name] < -ROUNDING * most).sum())
        if below:
            return f"the {name} energy is below zero in {below} of {len(history[name])} rows"
    return ""


def worst_of(checks, names):
    """The checks of several runs as one list, each by the run that is farthest from its target.

    Args:
        checks: List of lists of Check, one a run; not every run has each of them.
        names: Of the runs.
    """
    by_name, found = {}, []
    for name, of_run in zip(names, checks, strict=True):
        for check in of_run:
            by_name.setdefault(check.name, []).append((name, check))
    for same in by_name.values():
        order = [c.largest if np.isfinite(c.largest) else np.inf for _, c in same]
        name, check = same[int(np.argmax(order))]
        missed = sum(not c.passed for _, c in same)
        others = f"; {missed} of them miss the target" if missed else ""
        text = f"{check.text} Worst of {len(same)} runs: {name}{others}."
        failed = any(c.failed for _, c in same)
        found.append(replace(check, text=text, passed=not missed, failed=failed))
    return found


def _check(name, history, values, fault):
    what, good, bad = WORDS[name]
    judged, target = values[judged_rows(history)], TARGETS[name]
    worst = largest(judged)
    finite = judged[np.isfinite(judged)]
    mean = float(finite.mean()) if finite.size else np.nan
    missed = finite > target
    passed = bool(finite.size) and not lasting(missed).any() and not fault
    if not finite.size:
        unknown = name in ("platens", "tool") and not quasi_static.knows_balance(history)
        why = f"not judged, as {NO_BALANCE}" if unknown else _no_values(history)
        return Check(name, target, worst, mean, False, f"{what}: {why}.")
    row, since, place = _since(history, values, target)
    words = good if passed else bad
    if passed and missed.any():
        words += f"; single rows, {missed.sum()} of them, are beyond it"
    if fault:
        words = f"the result is void where {fault}: lower solver.damping and the time step"
    text = (
        f"{what}: at most {ratio(worst)} (mean {ratio(mean)}) beyond the first tenth of the test, "
        f"target {100 * target:g}%; {words}. {place}"
    )
    return Check(name, target, worst, mean, passed, text, since, bool(fault), row)


def _since(history, values, target):
    """Where a target is met from to the end: row or None, its strain or nan, and in words.

    Rows without a value do not count, nor does a single row, beyond the target or within it.
    """
    rows = np.flatnonzero(counted_rows(history) & ~np.isnan(values))
    missed = np.flatnonzero(lasting(values[rows] > target))
    if not rows.size or (missed.size and missed[-1] >= len(rows) - 2):
        met = np.delete(rows, missed)
        last = f": last at {where(history, met[-1])}" if met.size else ""
        return None, math.nan, f"Not met at the end{last}."
    row = int(rows[missed[-1] + 1] if missed.size else rows[0])
    since = f"from {where(history, row)} on, to the end." if missed.size else "in all judged rows."
    return row, float(history["strain"][row]), f"Met {since}"


def where(history, row):
    """A row of the history in words: "strain 0.0123", of a test by stages with the stage.

    Where tools load there is no strain, and it is the time.
    """
    stage = f' of stage "{history["stage"][row]}"' if "strain_z" in history else ""
    if tool_load(history) is not None:
        return f"time {history['time'][row]:.3g} s{stage}"
    return f"strain {history['strain'][row]:.4f}{stage}"
