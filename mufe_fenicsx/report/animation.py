"""The test as a moving picture: the deformed grains beside the stress-strain curve."""

import shutil
import subprocess

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from PIL import Image

from mufe_fenicsx.analysis.rows import branches
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.machine.files import replacing
from mufe_fenicsx.report import style
from mufe_fenicsx.report.curves import STRAIN, STRESS, draw_branches
from mufe_fenicsx.report.figure import Picture, save_tables
from mufe_fenicsx.report.render import Camera, Layer, render
from mufe_fenicsx.report.sample import state_at
from mufe_fenicsx.report.views import FROM, VON_MISES, colour_bar, stress_limit

NAME = "animation"
#: Pictures a second, the number of pictures at most, and pixels an inch.
RATE, MOST, DPI = 4, 24, 110
#: Width and height of the picture of the sample [pixels].
PIXELS = 340
#: Colours of a GIF, and how long its last picture stays [ms].
COLOURS, LAST = 240, 1500


def draw_animation(source, folder):
    """Write ``animation.gif``, and ``animation.mp4`` where the program ffmpeg is there.

    Args:
        source: :class:`mufe_fenicsx.report.source.Source`.
        folder: Of the figures.

    Returns:
        :class:`mufe_fenicsx.report.figure.Picture`.

    Raises:
        InputError: There are less than two states, or nothing can be rendered.
    """
    listed = source.run.stored_states
    if len(listed) < 2:
        raise InputError(f"{len(listed)} stored states, expected 2 or more for an animation")
    source.need_rendering()
    chosen = np.unique(np.linspace(0, len(listed) - 1, min(len(listed), MOST)).round().astype(int))
    listed = [listed[i] for i in chosen]
    try:
        history = source.loading
    except InputError:
        history = None
    limit = stress_limit(source.states)
    corners = [state.corners(source.start) for state in (source.start, source.end)]
    camera = Camera.around(np.concatenate(corners), FROM, 1.0)
    scene = _Scene(history, limit)
    frames = []
    for state in listed:
        now = state_at(source.run, state, history, source.end)
        layer = Layer(now.surface(), None, "von_mises", style.STRESS_MAP, (0, limit))
        image = render([layer], camera, (PIXELS, PIXELS), now.outline(source.start))
        frames.append(scene.picture(image, now))
    path = folder / f"{NAME}.gif"
    _write_gif(frames, path)
    columns = {
        "picture": np.arange(len(listed)),
        "state": [s["index"] for s in listed],
        "time [s]": [s["time"] for s in listed],
        "strain [-]": [s["strain"] for s in listed],
    }
    return Picture(
        NAME,
        f"Von Mises stress in the course of the test, {len(frames)} stored states",
        "The scale is that of the figures of the sample; the dot in the curve is the state shown.",
        "wide",
        path,
        None,
        save_tables(NAME, {"": columns}, folder),
        _write_mp4(frames, folder / f"{NAME}.mp4"),
    )


class _Scene:
    """The figure of which each picture is one state; it is laid out once."""

    def __init__(self, history, limit):
        self.history = history
        ratios = [1.25, 1.0] if history is not None else [1.0]
        width = style.PAGE if history is not None else 1.2 * style.COLUMN
        self.figure, axes = style.new_figure(
            width, 3.0, ncols=len(ratios), width_ratios=ratios, squeeze=False
        )
        axis = axes[0, 0]
        self.image = axis.imshow(np.full((PIXELS, PIXELS, 3), 255, dtype=np.uint8))
        axis.set_axis_off()
        self.title = axis.set_title("strain", fontsize=8)
        colour_bar(self.figure, [axis], limit, style.STRESS_MAP, VON_MISES, "Pa", "max")
        if history is not None:
            curve = axes[0, 1]
            self.factor, unit = style.unit_of(history["stress"], "Pa")
            stress = history["stress"] / self.factor
            draw_branches(curve, history["strain"], stress, branches(history))
            (self.dot,) = curve.plot([], [], "o", color=style.RED, markersize=5)
            curve.set(xlabel=STRAIN, ylabel=f"{STRESS}: {unit}")
        self.figure.set_dpi(DPI)
        self.changing = [self.image, self.title]
        self.changing += [self.dot] if history is not None else []
        for artist in self.changing:
            artist.set_animated(True)  # left out of what is drawn once
        self.figure.canvas.draw()
        self.still = self.figure.canvas.copy_from_bbox(self.figure.bbox)

    def picture(self, image, state):
        """RGB, shape (height, width, 3)."""
        self.image.set_data(image)
        self.title.set_text(rf"$\varepsilon$ = {style.strain(state.strain)}")
        if self.history is not None:
            now = np.interp(state.time, self.history["time"], self.history["stress"])
            self.dot.set_data([state.strain], [now / self.factor])
        canvas = self.figure.canvas
        canvas.restore_region(self.still)
        for artist in self.changing:
            artist.axes.draw_artist(artist)
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _write_gif(frames, path):
    """One set of colours for all pictures, so that nothing flickers."""
    some = [*frames[:: max(1, len(frames) // 5)], frames[-1]]
    # Enough of what is small, the dot and the colour bar, and of the background, to keep colours.
    bar = colormaps[style.STRESS_MAP](np.linspace(0, 1, 32))[:, :3]
    kept = np.concatenate([np.repeat([to_rgb(style.RED), (1, 1, 1)], 40, axis=0), bar])[:, None]
    kept = np.broadcast_to((255 * kept).astype(np.uint8), (len(kept), frames[0].shape[1], 3))
    strip = Image.fromarray(np.concatenate([*some, kept]))
    palette = strip.quantize(COLOURS, dither=Image.Dither.NONE)
    images = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    times = [1000 // RATE] * (len(images) - 1) + [LAST]
    with replacing(path) as part:
        images[0].save(part, "GIF", save_all=True, append_images=images[1:], duration=times, loop=0)


def _write_mp4(frames, path):
    """The pictures as MP4; None where there is no ffmpeg, or it cannot."""
    program = shutil.which("ffmpeg")
    if program is None:
        return None
    height, width = (n // 2 * 2 for n in frames[0].shape[:2])  # H.264 takes even numbers
    command = [program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{width}x{height}", "-r", str(RATE), "-i", "-"]
    command += ["-pix_fmt", "yuv420p", "-f", "mp4"]
    data = b"".join(np.ascontiguousarray(f[:height, :width]).tobytes() for f in frames)
    try:
        with replacing(path) as part:
            subprocess.run(  # noqa: S603  words of our own, no shell
                [*command, str(part)], input=data, capture_output=True, check=True
            )
    except subprocess.CalledProcessError:
        path.unlink(missing_ok=True)  # of earlier pictures
        return None
    return path
