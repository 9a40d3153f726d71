"""Curves of the report can be seen: legends beside them, single values that do not flatten them."""

import matplotlib
import numpy as np
import pytest

from mufe_fenicsx.report import curves, style
from mufe_fenicsx.report.animation import _write_mp4
from mufe_fenicsx.report.axes import covered, legend, without_spikes
from mufe_fenicsx.report.source import Source
from tests.made_up_run import fake_history, write_history


@pytest.fixture
def look():
    with matplotlib.rc_context(style.RC):
        yield


def draw(folder, history, figure):
    write_history(folder, history)
    drawing = figure(Source(folder))
    drawing.figure.draw_without_rendering()
    return drawing.figure.axes


@pytest.mark.parametrize("figure", [curves.draw_stress_strain, curves.draw_dissipation])
def test_legends_lie_on_no_curve(look, tmp_path, figure):
    """A sample that is stiff first: what rises at once is where legends used to be."""
    history = fake_history()
    early = 1 - np.exp(-np.maximum(history["strain"], 0) / 0.002)
    history["stress"] = 4e7 * early
    history["plastic"] = history["work"].max() * early
    history["friction"] = 0.9 * history["plastic"]
    axis = draw(tmp_path, history, figure)[0]
    assert axis.get_legend() is not None and not covered(axis, axis.get_legend())


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_an_axis_without_a_free_place_gets_higher(look, scale):
    figure, axis = style.new_figure()
    x = np.linspace(0, 1, 2000)
    axis.plot(x, 1.0 + 9.0 * (np.arange(2000) % 2), label="all over it")
    axis.set_yscale(scale)
    box = legend(axis)
    figure.draw_without_rendering()
    assert not covered(axis, box) and axis.get_ylim()[1] > 10.5


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
