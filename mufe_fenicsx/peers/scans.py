"""From labels of scans, and tracks by others, to a folder with a run beside them."""

import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..geometry.image.label_files import read_labels
from ..geometry.tracking.bodies import ROUND, bodies_of
from ..geometry.tracking.track import track_bodies
from ..machine.files import new_folder
from ..report.scan_surfaces import grains_shown, stage_of, view_of, write_surfaces
from ..report.scans import write_scans
from ..results import Run
from ..results.sample_ends import cut_walls, first_places, places_by_scans
from ..results.scans import beside, stage_ends, start_moment, start_of
from .scan_doubts import (
    about_grains,
    about_lost,
    about_offset,
    about_seating,
    about_shift,
    about_walls,
    about_ways,
    beyond,
)
from .tracks import read_track

#: Table of all grains, by which a folder of a comparison is known; places of walls by the scans;
#: and stages that follow these.
TABLE, MOTION, STAGES = "compare.csv", "motion.csv", "stages.toml"


@dataclass(frozen=True)
class How:
    """How a run is held against scans."""

    strains: tuple = ()  #: of the run's states at each later scan; none: see `compare_scans`
    align: bool = False  #: see `results.scans.beside`
    grains: tuple = ()  #: whose surfaces are shown; none: the few that differ most at the end


def compare_scans(
    run, labels, output, *, tracks=(), how=How(), voxel_size=None, key=None, progress=None,
    overwrite=False,
):  # fmt: skip
    """Hold a run against scans of its sample, grain by grain.

    Writes ``compare.csv`` (a row a grain and scan), ``motion.csv`` (places of the run's walls by
    the scans, a row a scan, see `results.sample_ends`), ``stages.toml`` (a stage a scan that
    follows it, by the name of the scan), ``report.html`` and ``figures``. A scan stands beside the
    end of the stage of its name, where the run has one.

    Args:
        run: Folder that ``mufe run`` wrote.
        labels: Label images, first that of the sample before the test: the labels that were meshed,
            or others of the same sample in the same place, as meshed or as seated. Then those of
            later scans; where others tracked these, they may be left out.
        tracks: Tables of `peers.tracks.read_track`, one for each later scan; none: tracked here.
        how: :class:`How`.
        voxel_size, key: See `label_files.read_labels`.
        progress: Called with numbers of grains done and of all, and a text.
        overwrite: Replace a folder that was written by this before.

    Returns:
        A dictionary: files, and ``scans``, a list of what `results.scans.Beside` counts.

    Raises:
        InputError: Scans, tracks and run do not belong together, or the output cannot be written.
    """
    start = time.perf_counter()
    run, strains = Run(run), how.strains
    labels, tracks, notices = [Path(p) for p in labels], [Path(p) for p in tracks], []
    num = _num_scans(labels, tracks, strains)
    images, size = _read_scans(labels, voxel_size, key, notices)
    first = bodies_of(images[0], str(labels[0]))
    begin = start_of(run, images[0], size, labels[0])
    warnings = about_grains(begin, run, labels[0], size)
    names = [p.name for p in (labels[1:] or tracks)]
    states = [None] * num if strains else [stage_ends(run).get(n) for n in stage_names(names)]
    found, followed, before = [], [], None
    with new_folder(output, overwrite=overwrite, marker=TABLE) as folder:
        for k in range(num):
            later = images[k + 1] if len(images) > 1 else None
            if tracks:
                track = _track_of_others(tracks[k], first, later, size)
            else:
                new = bodies_of(later, str(labels[k + 1]))
                told = progress and (lambda done, n, text=names[k]: progress(done, n, text))
                track = track_bodies(first, new, size, (labels[0], labels[k + 1]), before, told)
                before = track
            strain = strains[k] if strains else None
            pair = (images[0], later)
            found.append(
                beside(run, track, begin, size, strain=strain, state=states[k], labels=pair,
                       align=how.align)
            )  # fmt: skip
            followed.append(_aligned(track, found[-1]) if how.align else track)
            warnings += about_lost(track, names[k])
            warnings += beyond(found[-1].numbers, names[k], images[0].shape[0])
            notices += [] if how.align else about_shift(found[-1].numbers, names[k], size)
        warnings += about_offset(begin, found[0].numbers, run, labels[0], size)
        cut = cut_walls(run, images[0], first_places(run, begin), size)
        places = places_by_scans(run, begin, followed, [f.moment for f in found], size, cut)
        seated_late = about_seating(begin, found, images[0].shape[0])
        warnings += (of_stages := seated_late + about_walls(places, found, names, size))
        _write_table(folder / TABLE, names, found)
        ways = about_ways(places[0], cut)
        comments = [ways, *(f"Warning: {doubt}" for doubt in of_stages)]
        _write_led(folder, output, places, names, comments, bool(seated_late))
        about = [*_about(labels[0], tracks, begin, how, states), f"{ways}."]
        about += [f"Warning: {w}." for w in warnings]
        view = _write_surfaces(folder, run, begin, images, list(zip(names, found, strict=True)),
                               size, how)  # fmt: skip
        shown = list(zip(names, found, images[1:] or [None] * num, strict=True))
        write_scans(folder, run, shown, size, about, view)
    return {
        **_files(output),
        "voxel_size": size,
        **_of_start(begin),
        "walls": {wall: "centres" if wall in cut else "surfaces" for wall in places[0]},
        "notices": [ways, *notices],
        "warnings": warnings,
        "scans": [{"scan": n} | f.numbers for n, f in zip(names, found, strict=True)],
        "seconds": round(time.perf_counter() - start, 2),
    }


def _files(output):
    """Paths of what is written, as texts."""
    return {
        "output": str(output),
        "table": str(Path(output) / TABLE),
        "stages": str(Path(output) / STAGES),
        "report": str(Path(output) / "report.html"),
    }


def _of_start(begin):
    """What is told of the start of the run."""
    return {
        "run_counts_from": "seated" if begin.seated else "meshed",
        "overlap_meshed": begin.overlaps[0],
        "overlap_seated": begin.overlaps[1],
        "diameter_ratio": begin.diameter_ratio,
    }


def _num_scans(labels, tracks, strains):
    """How many later scans there are, after a check of the numbers of files."""
    later = len(labels) - 1
    if not labels or (later < 1 and not tracks):
        raise InputError(
            f"{len(labels)} of the labels given, expected two at least: before the test and of a "
            "later scan (or its track, --tracks)"
        )
    if tracks and later not in (0, len(tracks)):
        raise InputError(f"{len(tracks)} tracks of {later} later scans, expected as many")
    num = len(tracks) or later
    if strains and len(strains) != num:
        raise InputError(f"{len(strains)} strains of {num} later scans, expected as many")
    return num


def _read_scans(paths, voxel_size, key, notices):
    """Labels of all scans on the same voxels, and their size [m]."""
    images, first = [], None
    for path in paths:
        image, size = read_labels(
            path, voxel_size=voxel_size, unstated=first, key=key, notices=notices
        )
        if first is None:
            first = size
        if image.shape != (images[0].shape if images else image.shape):
            raise InputError(
                f"labels {path} have shape {image.shape}, expected {images[0].shape} as {paths[0]}"
            )
        if abs(size / first - 1) > 1e-3:
            raise InputError(
                f"labels {path} have voxels of {size:g} m, expected {first:g} m as {paths[0]}"
            )
        if not image.any():
            raise InputError(f"labels {path}: no grain, all voxels are 0, expected at least one")
        images.append(image.astype(np.int32))
    return images, first


def _track_of_others(path, first, later, size):
    """A table of others as a track; round grains have no rotation."""
    track = read_track(path, first, size)
    track.rotation[first.round] = np.nan
    return track if later is None else _with_labels(track, later, size)


def _aligned(track, found):
    """A track without the motion that all grains share beyond that of the run."""
    shift = np.array([found.numbers[f"common_shift_{a}"] for a in "xyz"])
    return replace(track, displacement=track.displacement - shift)


def _with_labels(track, later, voxel_size):
    """A track by others with the labels of the later scan at the places where grains went."""
    place = (track.centre + np.where(track.found[:, None], track.displacement, 0.0)) / voxel_size
    voxel = np.floor(place).astype(np.int64)[:, ::-1]
    inside = track.found & ((voxel >= 0) & (voxel < later.shape)).all(axis=1)
    track.label_now[inside] = later[tuple(voxel[inside].T)]
    return track


def _write_table(path, names, found):
    """All grains of all scans; the name of the scan comes first."""
    import pandas

    tables = [f.table.assign(scan=n) for n, f in zip(names, found, strict=True)]
    for table in tables:
        table.attrs.clear()
    table = pandas.concat(tables, ignore_index=True)
    table[["scan", *(c for c in table if c != "scan")]].to_csv(path, index=False)


def _write_led(folder, output, places, names, comments, before):
    """Places of walls, and stages that follow them from the folder's later place."""
    _write_motion(folder / MOTION, places)
    motion = Path(output).resolve() / MOTION
    _write_stages(folder / STAGES, motion, names, comments, before)


def _write_motion(path, places):
    """Places of walls at each scan, whose number stands for the time."""
    rows = [[k, *found.values()] for k, found in enumerate(places, start=1)]
    head = ", ".join(["time [s]", *(f"{wall} [m]" for wall in places[0])])
    np.savetxt(path, rows, fmt="%.9g", delimiter=", ", header=head, comments="")


def _write_surfaces(folder, run, begin, images, scans, size, how):
    """Surfaces of a few grains at all scans for ParaView, and as a view; None without labels."""
    table = scans[-1][1].table
    shown = grains_shown(table, how.grains)
    if len(images) == 1:
        return None
    first = {g: begin.grains[g] for g in shown}
    stages = [stage_of("first scan", start_moment(run, begin.seated), images[0], first, size)]
    for (name, found), image in zip(scans, images[1:], strict=True):
        now = dict(
            zip(found.table["grain"].tolist(), found.table["label_now"].tolist(), strict=True)
        )
        label_of = {g: now[g] for g in shown if g in now}
        shift = [found.numbers[f"common_shift_{a}"] if how.align else 0.0 for a in "xyz"]
        stages.append(stage_of(name, found.moment, image, label_of, size, shift))
    write_surfaces(folder, stages)
    return view_of(stages, run.container)


def stage_names(names):
    """Names of stages for scans: those of their files without ending, with numbers if alike."""
    stems = [Path(name).stem for name in names]
    return [s if stems.count(s) == 1 else f"{s} {k}" for k, s in enumerate(stems, start=2)]


def _quoted(text):
    """A text as TOML has it."""
    return json.dumps(text, ensure_ascii=False)


def _write_stages(path, motion, names, comments, before):
    """A stage a scan in which walls go on to where it shows them.

    Args:
        path: File.
        motion: File of the places of walls.
        names: Of the later scans.
        comments: Sentences.
        before: Whether the stages belong before that which seats the sample.
    """
    text = [
        f"# {'Before' if before else 'After'} the stage that seats the sample: walls go as its "
        "ends in the scans.\n",
        *(f"# {comment}.\n" for comment in comments),
        f"# With [output] fields = {len(names) + 1} or more a state is stored at each of them.\n",
    ]
    for row, name in enumerate(stage_names(names), start=2):
        keys = f"name = {_quoted(name)}\nfollow = {_quoted(str(motion))}\nrow = {row}\n"
        text.append(f"\n[[stage]]\n{keys}")
    path.write_text("".join(text), encoding="utf-8")


def _about(first, tracks, begin, how, states):
    """How the comparison came about, in sentences."""
    way = "read from tables of others" if tracks else "tracked by assignment and rigid registration"
    said = [f"Grains of {first.name} were {way} in later scans."]
    where = "where the same grains are pressed as much along z"
    if how.strains:
        said.append("The strains of the run were given.")
    elif None not in states:
        said.append("Each scan stands beside the end of the run's stage of its name.")
    elif any(state is not None for state in states):
        said.append(f"Scans stand beside ends of stages of their names, or {where}.")
    else:
        said.append(f"Each scan stands beside the run {where}.")
    said.append(
        "Displacements count from the first scan, and in the run from "
        + ("the first stored state" if begin.seated else "the grains as meshed")
        + f", by what fits the first scan: overlaps are {begin.overlaps[0]:.3f} as meshed and "
        f"{begin.overlaps[1]:.3f} in that state."
    )
    said.append(
        f"Nothing tells how round grains turn, whose principal moments are within {ROUND:.0%}: "
        "their rotation is empty in the table and in no mean."
    )
    if how.align:
        said.append("The motion that all grains share beyond that of the run was taken out.")
    return said
