"""Curves of the report can be seen: legends beside them, single values that do not flatten them."""

from copy import copy
from dataclasses import replace
from itertools import pairwise

import matplotlib
import numpy as np
import pandas
import pytest
from matplotlib.quiver import Quiver

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output.history import COLUMNS
from mufe_fenicsx.report import curves, motion, scans, style
from mufe_fenicsx.report.animation import _write_mp4
from mufe_fenicsx.report.axes import without_spikes
from mufe_fenicsx.report.motion import draw_arrows
from mufe_fenicsx.report.parts import FIGURES
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.results.scans import Beside
from tests.made_up_run import fake_history, write_history, write_whole_run
from tests.report.test_report_stages import STAGED, staged_history, write_staged_run

#: Figures without a legend.
NO_LEGEND = {
    "stress-3d",
    "stress-cut",
    "chosen-grains",
    "force-chains",
    "displacement-arrows",
    "localisation",
    "time-by-parts",
}
#: Those of grains that break, which are looked at where some do.
OF_CRACKS = {"breakage", "fragments"}


@pytest.fixture
def look():
    with matplotlib.rc_context(style.RC):
        yield


@pytest.fixture
def blank(monkeypatch):
    """Pictures of bodies are white: legends are beside them whatever they show."""

    def white(layers, camera, size, outline=None):
        return np.full((*size[::-1], 3), 255, np.uint8)

    monkeypatch.setattr(motion, "render", white)


def draw(folder, history, figure):
    write_history(folder, history)
    drawing = figure(Source(folder))
    drawing.figure.draw_without_rendering()
    return drawing.figure.axes


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """A test that lacks nothing, dynamic at first, and two by stages; one shears, with a tool."""
    names = "whole", "staged", "sheared"
    whole, staged, sheared = (tmp_path_factory.mktemp(name) for name in names)
    history = write_whole_run(whole, n=2)
    history["kinetic"] = np.where(history["strain"] < 0.03, 50, 1) * history["kinetic"]
    write_history(whole, history)
    write_staged_run(staged, staged_history(), [0, 0, 0])
    history_of_shear = staged_history()
    shear = {"gamma_xz": history_of_shear["strain"], "shear_xz": 0.3 * history_of_shear["stress"]}
    of_tool = [f"{what}_blade_{axis}" for what in ("turn", "force", "torque") for axis in "xyz"]
    shear |= {name: 1e-3 * history_of_shear["strain"] for name in of_tool}
    columns = (*COLUMNS, *STAGED, *shear)
    write_staged_run(sheared, history_of_shear | shear, [0, 0, 0], columns=columns)
    found = Source(whole), Source(staged), Source(sheared)
    for source in found:
        source.no_pictures = None  # there is nothing to be tried, see `blank`
    return found


@pytest.mark.parametrize(
    "name", [name for name, _, draw in FIGURES if draw and name not in NO_LEGEND | OF_CRACKS]
)
def test_no_legend_lies_on_an_axis(look, blank, sources, name):
    """Legends are beside all axes and inside of the picture, whatever is drawn there."""
    draw = next(draw for known, _, draw in FIGURES if known == name)
    drawn = 0
    for source in sources:
        try:
            drawn += legends_beside_axes(draw(source).figure)
        except InputError:
            continue  # not of this test
    assert drawn


def legends_beside_axes(figure):
    """Number of legends of a figure, none of which lies on an axis or beyond the picture."""
    figure.draw_without_rendering()
    found = [*figure.legends, *(a.get_legend() for a in figure.axes if a.get_legend())]
    for box in (legend.get_window_extent() for legend in found):
        for axis in figure.axes:
            words = axis.xaxis.get_tightbbox() or axis.get_window_extent()
            assert not box.overlaps(axis.get_window_extent()) and not box.overlaps(words)
        low, high = figure.bbox.min - 1, figure.bbox.max + 1  # a pixel
        assert (box.min >= low).all() and (box.max <= high).all()
    return len(found)


def test_a_single_value_does_not_flatten_the_rest(look, tmp_path):
    history = fake_history()
    history["stress"][120] = 50 * history["stress"].max()
    largest = np.delete(history["stress"], 120).max()
    axis = draw(tmp_path, history, curves.draw_stress_strain)[0]
    factor, _ = style.unit_of(history["stress"], "Pa")
    assert axis.get_ylim()[1] * factor < 1.3 * largest
    said = axis.get_title(loc="right")
    assert said.startswith("1 value beyond: ") and f"{history['stress'][120] / factor:.3g}" in said


def test_an_animation_is_a_film_too_where_ffmpeg_is(tmp_path, monkeypatch):
    """A program of that name that keeps what it is given: even sizes, three bytes a pixel."""
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do :; done\ncat > "$last"\n')
    program.chmod(0o755)
    frames = [np.full((5, 8, 3), k, np.uint8) for k in range(3)]
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    path = tmp_path / "animation.mp4"
    assert _write_mp4(frames, path) == path
    assert path.read_bytes() == b"".join(bytes([k]) * 4 * 8 * 3 for k in range(3))
    program.write_text("#!/bin/sh\nexit 1\n")
    assert _write_mp4(frames, path) is None and not path.exists()
    program.unlink()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert _write_mp4(frames, path) is None


def test_what_rises_steeply_is_no_spike(look):
    _, axis = style.new_figure()
    x = np.linspace(0, 1, 200)
    for y in (np.exp(5 * x), x, np.zeros(200), np.where(x > 0.9, 1.0, 0.0), x[:3]):
        assert not without_spikes(axis, x[: len(y)], y)
    y = x.copy()
    y[[50, 150]] = 9.0, -7.0
    assert without_spikes(axis, x, y)
    low, high = axis.get_ylim()
    assert -0.1 < low < 0.0 and 1.0 < high < 1.1
    assert axis.get_title(loc="right").startswith("2 values beyond, up to: 9 at 0.251")


def test_arrows_of_displacement_end_inside_their_axes(look, sources):
    """A grain at the side that moves outwards, by a tenth of its size, while others rest."""
    source = copy(sources[0])
    motion, end = source.motion, source.end
    moved = motion.translation.copy()
    box = end.box(source.start)
    middle = 0.5 * (box[0, 1] + box[1, 1])
    away = motion.centre[:, 0] - 1e3 * np.abs(motion.centre[:, 1] - middle)
    moved[away.argmax(), 0] += 0.5 * (box[1, 0] - motion.centre[away.argmax(), 0])
    source.__dict__["motion"] = replace(motion, translation=moved)
    figure = draw_arrows(source).figure
    for axis in figure.axes[:2]:
        (arrows,) = (c for c in axis.collections if isinstance(c, Quiver))
        x, z = arrows.X + arrows.U, arrows.Y + arrows.V
        for values, (low, high) in ((x, axis.get_xlim()), (z, axis.get_ylim())):
            assert (values > low - 1e-9).all() and (values < high + 1e-9).all()
    # Clipped, where they begin outside of the frame.
    assert all(c.get_clip_on() for axis in figure.axes[:2] for c in axis.collections)


def test_figures_beside_scans(look):
    """Of twenty grains, and of four whose rotations and strains nobody knows."""
    rng = np.random.default_rng(1)
    for num in (20, 4):
        names = [f"{name}_{a}" for name in ("center", "displacement", "rotation") for a in "xyz"]
        names += [f"run_{name}" for name in names[3:]]
        table = pandas.DataFrame(1e-4 * rng.random((num, len(names))), columns=names)
        table = table.assign(grain=np.arange(num), volume=1e-13, displacement_difference=1e-6)
        if num == 20:
            table = table.assign(dice=rng.random(num), rotation_difference=rng.random(num))
            strains = ("strain_zz", "strain_deviator", "run_strain_zz", "run_strain_deviator")
            table = table.assign(**{name: rng.random(num) for name in strains})
        else:
            table.loc[:, [f"rotation_{a}" for a in "xyz"]] = np.nan
            table["rotation_difference"] = np.nan
        found = Beside(table, {}, None, np.zeros((20, 24, 22), np.int32))
        found.run_labels[4:9, 6:12, 4:12] = 1
        drawn = [draw(found, "scan", 1e-5) for draw in scans.FIGURES]
        drawn.append(scans.draw_slices(found, "scan", 1e-5, found.run_labels))
        assert [legends_beside_axes(drawing.figure) for drawing in drawn] == [1, 0, 0, 0]
        panels = [sum(bool(a.get_title(loc="left")) for a in d.figure.axes) for d in drawn]
        assert panels == ([3, 6, 3, 3] if num == 20 else [3, 3, 1, 3])


def test_ticks_of_monitors_are_shares_and_do_not_run_together(look, tmp_path):
    """Of values alike, which a decade and a half shows, and of values over five decades."""
    for decades in (0.0, 5.0):
        history = fake_history()
        fall = 10.0 ** -np.linspace(0, decades, len(history["step"]))
        history["kinetic"] = 0.04 * fall * (history["elastic"] + history["plastic"])
        for axis in draw(tmp_path, history, curves.draw_monitors):
            labels = [t for t in axis.yaxis.get_ticklabels(which="both") if t.get_text()]
            assert all(label.get_text().endswith(" %") for label in labels)
            low, high = axis.yaxis.get_view_interval()
            boxes = [t.get_window_extent() for t in labels if low <= t.get_position()[1] <= high]
            ends = sorted((box.y0, box.y1) for box in boxes)
            assert len(ends) >= 2
            assert all(top < bottom for (_, top), (bottom, _) in pairwise(ends))
