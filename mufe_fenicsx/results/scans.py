"""A run beside scans of the same sample: grains at the same strain, one by one and all together.

Columns of the table, a row a grain: ``grain`` in the run, ``label`` in the first scan and
``label_now``; ``volume`` at the start of the run [m³]; ``center_x`` … in the first scan [m];
``displacement_x`` … from the first scan and ``run_displacement_x`` … from the start of the run
[m], that of its :class:`Start`; ``displacement_difference``, the length of their difference;
``rotation_x`` … and ``run_rotation_x`` …, rotation vectors [rad]; ``rotation_difference``, the
angle between both; nan where the scan does not tell, as of round grains.

``strain_zz``, ``strain_volume``, ``strain_deviator``, and with ``run_`` those of the run, are
logarithmic, compression positive: means at the grain over Delaunay cells of centres
(:mod:`mufe_fenicsx.analysis.localisation`), for both the cells of the first scan. ``misfit`` is
that of the registration. ``run_tensile_stress_xx`` … is the mean Cauchy stress of the grain in the
nearer state of the run, tension positive [Pa].

With labels of the later scan: ``dice``, the overlap of its label with the run's grain, and
``contacts_gained``, ``contacts_lost``, and with ``run_`` those of the run: labels that begin or
cease to share faces of voxels, the run's grains on the same voxels.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas
from scipy.spatial.transform import Rotation

from ..analysis.by_grain import index_grains
from ..analysis.grain_stress import grain_stress
from ..analysis.kinematics import grain_motion
from ..analysis.localisation import delaunay_cells, grain_strain
from ..errors import InputError
from ..geometry.image.compare_labels import matched_grains
from ..geometry.image.labels import touching_labels
from ..geometry.measure import tet_volumes
from ..kernels.geometry.voxels import label_cells
from .columns import STRESS, columns_of, vectors

#: Share of the run's grains that have to lie on a label of the first scan.
ENOUGH = 0.5


@dataclass(frozen=True)
class Moment:
    """A run at some strain, between two of its stored states."""

    strain: float  #: as the states count it [-]
    time: float  #: of the run [s], linear between both states
    states: tuple  #: numbers of the two states
    weight: float  #: of the second, 0 to 1
    points: np.ndarray  #: nodes [m], shape (num_nodes, 3)
    state: object  #: :class:`~mufe_fenicsx.results.state.State` whose mesh it is


def moment_at(run, strain):
    """The :class:`Moment` at which a run first comes by a strain; places in between are linear.

    Raises:
        InputError: The run has no states of loading, or does not come by that strain.
    """
    states = run.states
    if len(states) == 0:
        raise InputError(f"{run.path / 'fields'} has no stored states, expected two or more")
    known, numbers = states["strain"].to_numpy(dtype=float), states.index.to_numpy()
    low, high = known.min(), known.max()
    slack = 1e-9 + 1e-6 * (high - low)
    if not low - slack <= strain <= high + slack:
        raise InputError(
            f"strain = {strain:g} of a scan, expected {low:g} to {high:g} as the states of "
            f"{run.path} have"
        )
    strain = min(max(strain, low), high)
    between = (known[:-1] - strain) * (known[1:] - strain) <= 0
    k = int(np.argmax(between)) if between.any() else 0
    ends = numbers[[k, min(k + 1, len(known) - 1)]]
    gap = known[min(k + 1, len(known) - 1)] - known[k]
    weight = float((strain - known[k]) / gap) if gap else 0.0
    later = run.state(int(ends[1]))
    points, time = later.points, later.time
    if weight < 1.0:
        first = run.state(int(ends[0]))
        points = (1 - weight) * later.points_of(first) + weight * points
        time = (1 - weight) * first.time + weight * time
    return Moment(float(strain), float(time), tuple(int(e) for e in ends), weight, points, later)


def moment_of(run, number):
    """A stored state as a :class:`Moment`."""
    state = run.state(number)
    return Moment(
        float(state.strain), float(state.time), (number, number), 1.0, state.points, state
    )


def stage_ends(run):
    """Stored states at the ends of stages, dict name of the stage -> number of the state."""
    states, found = run.states, {}
    try:
        stages = run.summary.get("stages", [])
    except InputError:  # a run that was killed early
        return {}
    following = [*(stage["time"] for stage in stages[1:]), np.inf]
    for stage, end in zip(stages, following, strict=True):
        own = states[states["stage"] == stage["name"]]
        if len(own) and (own["time"].iloc[-1] == end or (np.isinf(end) and run.finished)):
            found[stage["name"]] = int(own.index[-1])
    return found


def start_points(run, state, seated):
    """Nodes from which the motion of a run counts [m], in the order of a state, (num_nodes, 3).

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        state: :class:`~mufe_fenicsx.results.state.State`.
        seated: From the first stored state on, the end of seating; False: from the grains as
            meshed, the reference configuration.
    """
    return state.points_of(run.state(int(run.states.index[0]))) if seated else state.reference


def start_moment(run, seated):
    """The start of a run, see :func:`start_points`, as a :class:`Moment`."""
    first = moment_at(run, float(run.states["strain"].iloc[0]) if len(run.states) else 0.0)
    return first if seated else replace(first, points=first.state.reference)


def voxels_of(moment, shape, voxel_size, shift=(0.0, 0.0, 0.0)):
    """Grains of a :class:`Moment` as labels on the voxels of a scan.

    Args:
        moment: The run at some strain.
        shape: Of the image, (z, y, x).
        voxel_size: [m].
        shift: By which the run is moved before [m], (x, y, z).
    """
    labels = np.zeros(shape, dtype=np.int32)
    place = np.ascontiguousarray((moment.points + np.asarray(shift)) / voxel_size)
    cells = np.ascontiguousarray(moment.state.cells, dtype=np.int64)
    label_cells(labels, place, cells, moment.state.grain.astype(np.int32))
    return labels


@dataclass(frozen=True)
class Start:
    """Where a run starts, by the labels of a first scan."""

    grains: dict  #: {grain: label in the scan} of those that lie on a label of their own
    seated: bool  #: see :func:`start_points`
    overlaps: tuple  #: mean Dice of all grains with the labels, as meshed and seated [-]
    num_grains: int  #: of the run
    diameter_ratio: float  #: diameters of equal volume, labels over run, median [-]


def start_of(run, labels, voxel_size, source):
    """The :class:`Start` of a run: its grains as meshed, or seated, whichever fits labels better.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        labels: Of the first scan, (z, y, x).
        voxel_size: [m].
        source: Name of the labels in messages.

    Raises:
        InputError: Fewer than half of the grains lie on a label of their own.
    """
    fits = [_fit(start_moment(run, seated), labels, voxel_size) for seated in (False, True)]
    seated = fits[1][1] > fits[0][1]
    grains, num = fits[seated][0], len(run.state(int(run.states.index[0])).labels)
    if len(grains) < ENOUGH * num:
        raise InputError(
            f"labels {source}: {len(grains)} of {num} grains of {run.path} lie on a label, "
            f"expected {ENOUGH:.0%} at least: labels in the place and with the voxel size of those "
            "meshed"
        )
    volume = _volumes(run, np.array(list(grains)), seated)
    of_labels = np.bincount(labels.ravel())[list(grains.values())] * voxel_size**3
    ratio = float(np.median(np.cbrt(of_labels / volume)))
    return Start(grains, seated, tuple(fit[1] for fit in fits), num, ratio)


def _fit(moment, labels, voxel_size):
    """Dictionary {grain: label} of a run at a moment, and the mean Dice of all grains [-]."""
    ours = voxels_of(moment, labels.shape, voxel_size)
    found = matched_grains(labels, ours)
    dice = _dice(ours, labels, np.array(list(found)), np.array(list(found.values())))
    return found, float(np.sum(dice)) / len(moment.state.labels)


def linear_field(centre, displacement):
    """The linear field that fits displacements best: gradients and constants, shape (4, 3).

    The displacement at x is ``[*x, 1] @ field``.

    Args:
        centre: Before [m], (x, y, z), shape (num_grains, 3).
        displacement: [m], the same; rows with nan are left out.

    Raises:
        InputError: Fewer than four grains are known.
    """
    known = np.isfinite(displacement).all(axis=1)
    if known.sum() < 4:
        raise InputError(f"{known.sum()} tracked grains, expected 4 at least for a strain")
    place = np.column_stack([centre[known], np.ones(known.sum())])
    return np.linalg.lstsq(place, displacement[known], rcond=None)[0]


def mean_strains(centre, displacement):
    """Shortening along x, y and z of the :func:`linear_field` of displacements [-], shape (3,)."""
    return -np.diag(linear_field(centre, displacement)[:3])


def shortenings(run, grains, known, seated):
    """Shortening along z of grains of a run at its states [-], shape (num_states,).

    See :func:`mean_strains`: walls, and grains that no scan shows, do not matter.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        grains: Labels in the run, shape (num_grains,).
        known: Their centres in the first scan [m], shape (num_grains, 3).
        seated: See :func:`start_points`.
    """
    found = []
    for number in run.states.index:
        state = run.state(int(number))
        start = start_points(run, state, seated)
        motion = grain_motion(start, state.points, state.cells, state.grain)
        moved = motion.translation[np.searchsorted(motion.labels, grains)]
        found.append(mean_strains(known, moved)[2])
    return np.array(found)


def strain_at(run, of_states, wanted):
    """Strain of the states of a run at which something that each state has is as wanted.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        of_states: What the states have, shape (num_states,); linear in between.
        wanted: Its value.

    Returns:
        Strain of the states; that of the nearest state where the run does not come by.
    """
    known = run.states["strain"].to_numpy(dtype=float)
    between = (of_states[:-1] - wanted) * (of_states[1:] - wanted) <= 0
    if not between.any():
        return float(known[np.argmin(np.abs(of_states - wanted))])
    k = int(np.argmax(between))
    gap = of_states[k + 1] - of_states[k]
    part = (wanted - of_states[k]) / gap if gap else 0.0
    return float(known[k] + part * (known[k + 1] - known[k]))


@dataclass(frozen=True)
class Beside:
    """A run beside one later scan."""

    table: pandas.DataFrame  #: a row a grain, see above
    numbers: dict  #: of all grains together
    moment: Moment
    run_labels: np.ndarray | None  #: the run's grains on the scan's voxels; None without labels


def beside(
    run, track, start, voxel_size, *, strain=None, state=None, labels=(None, None), align=False
):
    """A run beside a scan that was tracked.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        track: :class:`~mufe_fenicsx.geometry.tracking.track.Track`.
        start: Of :func:`start_of`.
        voxel_size: [m].
        strain: Of the run's states at which it is looked at; None: where its grains are as much
            shorter along z, since the start, as the same grains in the scan.
        state: Number of that at which it is looked at instead.
        labels: Of the first scan and of the later one, (z, y, x); None where there are none.
        align: Take the mean difference of displacements, as of a sample that was mounted anew, out
            of the scan.

    Returns:
        :class:`Beside`.

    Raises:
        InputError: Fewer than four grains are tracked, or the run does not come by the strain.
    """
    grain, at = _tracked(track, start.grains)
    numbers, wanted = {}, float(mean_strains(track.centre[at], track.displacement[at])[2])
    how = "stage" if state is not None else "strain" if strain is not None else "motion"
    if how == "motion":
        of_states = shortenings(run, grain, track.centre[at], start.seated)
        strain = strain_at(run, of_states, wanted)
        numbers |= {"run_shortening_seated": of_states[0]}
        numbers |= {"run_shortening_least": of_states.min(), "run_shortening_most": of_states.max()}
    moment = moment_at(run, strain) if state is None else moment_of(run, state)
    table, offset, shift = _motions(run, track, moment, (grain, at), (start.seated, align))
    run_labels = None
    if labels[1] is not None:
        run_labels = voxels_of(moment, labels[1].shape, voxel_size, shift if align else np.zeros(3))
        table["dice"] = _dice(run_labels, labels[1], grain, track.label_now[at])
        before = voxels_of(start_moment(run, start.seated), labels[0].shape, voxel_size)
        _add_contacts(table, labels, (before, run_labels))
    for name, values in _stresses(run, moment, grain).items():
        table[name] = values
    ours = mean_strains(track.centre[at], vectors(table, "run_displacement"))[2]
    numbers |= {"shortening": wanted, "run_shortening": ours}
    numbers = {name: float(value) for name, value in numbers.items()}
    numbers |= {"beside": how, "num_grains": start.num_grains, "num_on_labels": len(start.grains)}
    numbers |= _numbers(table, track, voxel_size, moment)
    for name, of_all in (("label_offset", offset), ("common_shift", shift)):
        numbers |= {f"{name}_{a}": float(value) for a, value in zip("xyz", of_all, strict=True)}
    of_all = mean_strains(track.centre, track.displacement)
    numbers |= {f"sample_strain_{a}": float(s) for a, s in zip("xyz", of_all, strict=True)}
    return Beside(table, numbers, moment, run_labels)


def _tracked(track, grains):
    """Grains of the run that are tracked, and their places in the track."""
    label_of = {label: k for k, label in enumerate(track.label.tolist())}
    pairs = [(g, label_of[n]) for g, n in sorted(grains.items()) if n in label_of]
    pairs = [(g, k) for g, k in pairs if track.found[k]]
    if len(pairs) < 4:
        raise InputError(f"{len(pairs)} grains of the run are tracked, expected 4 at least")
    return tuple(np.array(x) for x in zip(*pairs, strict=True))


def _motions(run, track, moment, grains, how):
    """Columns of motions and strains; how far all labels are off, and moved beyond the run [m]."""
    (grain, at), (seated, align) = grains, how
    centre, moved, volume = track.centre[at], track.displacement[at], _volumes(run, grain, seated)
    start = start_points(run, moment.state, seated)
    own = grain_motion(start, moment.points, moment.state.cells, moment.state.grain)
    mine = np.searchsorted(own.labels, grain)
    # The place of a label's centre as the run takes it there: both move the same point.
    off = centre - own.centre[mine]
    ours = own.translation[mine] + np.einsum("gij,gj->gi", own.rotation[mine], off) - off
    shift = (moved - ours).mean(axis=0)
    moved = moved - shift if align else moved
    table = pandas.DataFrame(
        {"grain": grain, "label": track.label[at], "label_now": track.label_now[at]}
        | {"volume": volume}
        | columns_of("center", centre)
        | columns_of("displacement", moved)
        | columns_of("run_displacement", ours)
        | {"displacement_difference": np.linalg.norm(moved - ours, axis=1)}
        | _rotations(track.rotation[at], own.rotation[mine])
        | _strains(volume, centre, (moved, ours))
        | {"misfit": track.misfit[at]}
    )
    return table, off.mean(axis=0), shift


def _rotations(scan, run):
    """Columns of rotations of scan and run, and the angle between both."""
    known = np.isfinite(scan).all(axis=(1, 2))
    vectors = [np.full((len(scan), 3), np.nan) for _ in range(2)]
    angle = np.full(len(scan), np.nan)
    vectors[1] = Rotation.from_matrix(run).as_rotvec()
    if known.any():
        of_scan = Rotation.from_matrix(scan[known])
        vectors[0][known] = of_scan.as_rotvec()
        angle[known] = (of_scan * Rotation.from_matrix(run[known]).inv()).magnitude()
    return (
        columns_of("rotation", vectors[0])
        | columns_of("run_rotation", vectors[1])
        | {"rotation_difference": angle}
    )


def _volumes(run, grain, seated):
    """Of grains at the start of a run [m³], shape (num_grains,)."""
    first = start_moment(run, seated)
    labels, index = index_grains(first.state.grain)
    volume = np.bincount(index, tet_volumes(first.points, first.state.cells))
    return volume[np.searchsorted(labels, grain)]


def _strains(volume, centre, displacements):
    """Columns of the strains around each grain, of scan and run; none where no cell is."""
    try:
        cells = delaunay_cells(centre, np.cbrt(3 * volume / (4 * np.pi)))
    except InputError:  # a few grains, or all in a plane
        return {}
    columns = {}
    for prefix, moved in zip(("", "run_"), displacements, strict=True):
        found = grain_strain(cells, centre, centre + moved)
        columns |= {
            f"{prefix}strain_zz": found.strain[:, 2, 2],
            f"{prefix}strain_volume": found.strain_volume,
            f"{prefix}strain_deviator": found.strain_deviator,
        }
    return columns


def _dice(ours, theirs, grain, label_now):
    """2 |A ∩ B| / (|A| + |B|) of each grain of the run and its label [-]; nan without a label."""
    base = int(theirs.max()) + 1
    both = (ours > 0) & (theirs > 0)
    key, count = np.unique(ours[both].astype(np.int64) * base + theirs[both], return_counts=True)
    shared = dict(zip(key.tolist(), count.tolist(), strict=True))
    size = [np.bincount(x.ravel()) for x in (ours, theirs)]
    dice = []
    for g, n in zip(grain.tolist(), label_now.tolist(), strict=True):
        whole = (size[0][g] if g < len(size[0]) else 0) + size[1][n]
        dice.append(2 * shared.get(g * base + n, 0) / whole if n > 0 else np.nan)
    return np.array(dice)


def _add_contacts(table, labels, run_labels):
    """Contacts gained and lost of each grain, of scan and run, as columns of the table."""
    known = set(table["grain"].tolist())
    scan = [dict(zip(table[name], table["grain"], strict=True)) for name in ("label", "label_now")]
    own = {g: g for g in known}
    for prefix, pair in (
        ("", zip(labels, scan, strict=True)),
        ("run_", zip(run_labels, (own, own), strict=True)),
    ):
        old, new = (pairs_of(image, grain_of) for image, grain_of in pair)
        for name, changed in (("gained", new - old), ("lost", old - new)):
            count = pandas.Series([g for p in changed for g in p], dtype=np.int64).value_counts()
            table[f"{prefix}contacts_{name}"] = count.reindex(
                table["grain"], fill_value=0
            ).to_numpy()
        table.attrs[f"{prefix}contacts"] = old, new


def pairs_of(labels, grain_of):
    """Pairs of grains whose labels share faces of voxels, a set of (a, b) with a < b.

    Args:
        labels: (z, y, x).
        grain_of: Dictionary {label: grain}; other labels are left out.
    """
    found = [p for p in touching_labels(labels) if p[0] in grain_of and p[1] in grain_of]
    return {tuple(sorted((grain_of[a], grain_of[b]))) for a, b in found}


def _stresses(run, moment, grain):
    """Columns of the mean stress of each grain in the nearer of both states."""
    state = run.state(moment.states[1] if moment.weight >= 0.5 else moment.states[0])
    found = grain_stress(
        state.stress, state.von_mises, state.plastic_strain, state.volume, state.grain
    )
    return columns_of(
        "run_tensile_stress", found.stress[np.searchsorted(found.labels, grain)], STRESS
    )


def _numbers(table, track, voxel_size, moment):
    """What the table says of all grains together, a dict of plain numbers."""
    difference = table["displacement_difference"].to_numpy()
    numbers = {
        "strain": moment.strain,
        "states": list(moment.states),
        "num_tracked": len(table),
        "num_lost_in_scan": int((~track.found).sum()),
        "lost_in_scan": track.label[~track.found].tolist(),
        "mean_displacement": float(
            np.linalg.norm(table[[f"displacement_{a}" for a in "xyz"]], axis=1).mean()
        ),
        "mean_displacement_difference": float(difference.mean()),
        "rms_displacement_difference": _rms(difference),
        "mean_difference_voxels": float(difference.mean() / voxel_size),
        "num_rotations": int(table["rotation_difference"].notna().sum()),
        "mean_rotation_difference": _mean(table["rotation_difference"]),
        "rms_rotation_difference": _rms(table["rotation_difference"].dropna()),
    }
    for name in ("strain_zz", "strain_volume", "strain_deviator"):
        if name in table:
            for prefix in ("", "run_"):
                numbers[f"mean_{prefix}{name}"] = _mean(table[prefix + name])
            both = table[[name, f"run_{name}"]].dropna()
            known = len(both) > 2 and both.std().min() > 0.0
            numbers[f"correlation_{name}"] = float(both.corr().iloc[0, 1]) if known else np.nan
    if "dice" in table:
        numbers["mean_dice"] = _mean(table["dice"])
        scan, own = table.attrs["contacts"], table.attrs["run_contacts"]
        for prefix, (old, new) in (("", scan), ("run_", own)):
            counts = {"before": old, "now": new, "gained": new - old, "lost": old - new}
            numbers |= {f"{prefix}contacts_{name}": len(pairs) for name, pairs in counts.items()}
        numbers["contacts_now_in_both"] = len(scan[1] & own[1])
    return numbers


def _mean(values):
    values = np.asarray(values, dtype=float)
    return float(np.nanmean(values)) if np.isfinite(values).any() else np.nan


def _rms(values):
    values = np.asarray(values, dtype=float)
    return float(np.sqrt(np.mean(values**2))) if values.size else np.nan
