"""3D pictures without a screen: parallel projection, so that a scale bar is exact."""

import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import pyvista

#: Draws a sphere with VTK alone, which loads in a third of the time of pyvista.
PROBE = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer
from vtkmodules.vtkRenderingCore import vtkRenderWindow, vtkWindowToImageFilter
mapper = vtkPolyDataMapper()
source = vtkSphereSource()
mapper.SetInputConnection(source.GetOutputPort())
actor = vtkActor()
actor.SetMapper(mapper)
renderer = vtkRenderer()
renderer.AddActor(actor)
window = vtkRenderWindow()
window.OffScreenRenderingOn()
window.SetSize(32, 32)
window.AddRenderer(renderer)
window.Render()
picture = vtkWindowToImageFilter()
picture.SetInput(window)
picture.Update()
low, high = picture.GetOutput().GetScalarRange()
raise SystemExit(0 if low < high else 3)
"""


def start_probe():
    """Start to try whether 3D pictures can be drawn here; :func:`cannot_render` asks it.

    In a process of its own, since graphics drivers may abort or hang it.
    """
    return subprocess.Popen(  # noqa: S603  words of our own, no shell
        [sys.executable, "-c", PROBE],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def cannot_render(probe=None):
    """Why 3D pictures cannot be drawn here, or None if they can.

    Args:
        probe: What :func:`start_probe` returned; None: starts one.
    """
    probe = probe or start_probe()
    try:
        stderr = probe.communicate(timeout=120)[1]
    except subprocess.TimeoutExpired:
        probe.kill()
        probe.communicate()
        return "off-screen rendering did not answer within 120 s"
    if probe.returncode == 0:
        return None
    lines = [line.strip() for line in stderr.splitlines() if line.strip()]
    why = lines[-1] if lines else f"the renderer ended with status {probe.returncode}"
    return f"off-screen rendering does not work on this machine ({why})"


@contextmanager
def quiet():
    """VTK's warnings about absent screens switched off."""
    from vtkmodules.vtkCommonCore import vtkObject

    before = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkObject.SetGlobalWarningDisplay(before)


@dataclass(frozen=True)
class Camera:
    """Where a picture is seen from.

    The view is centred on ``focus``; ``half_height`` [m] is half of what it shows from
    top to bottom.
    """

    focus: np.ndarray
    direction: np.ndarray  #: from the focus to the eye
    up: tuple
    half_height: float

    @classmethod
    def around(cls, points, direction, aspect, up=(0, 0, 1), margin=1.04):
        """A camera that sees all the points in a window of a given width/height."""
        direction = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
        right = np.cross(up, direction)
        right /= np.linalg.norm(right)
        true_up = np.cross(direction, right)
        x, y = points @ right, points @ true_up
        middle = 0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max())
        depth = points @ direction
        focus = middle[0] * right + middle[1] * true_up
        focus = focus + 0.5 * (depth.min() + depth.max()) * direction
        half = 0.5 * max(np.ptp(y), np.ptp(x) / aspect) * margin
        return cls(focus, direction, up, float(half))


@dataclass
class Layer:
    """A body of a picture: in one colour, or coloured by data with a map and its limits."""

    mesh: object  #: pyvista.PolyData
    colour: str | None = None
    scalars: str | None = None
    colours: object = None  #: matplotlib colour map
    limits: tuple = (0.0, 1.0)
    edges: bool = False  #: draw the edges of the facets
    options: dict = field(default_factory=dict)  #: more for pyvista's add_mesh


@cache
def _plotter():
    """The one window, off the screen, of all pictures: making one takes longer than a picture."""
    plotter = pyvista.Plotter(off_screen=True, lighting="none")
    # Pictures are averaged anyway; eight samples of each of their pixels would double the time.
    plotter.disable_anti_aliasing()
    plotter.set_background("white")
    return plotter


def render(layers, camera, size, outline=None, headlight=False):
    """Picture of bodies.

    Args:
        layers: List of :class:`Layer`.
        camera: Camera.
        size: Width and height [pixels]. It is drawn at twice the size and averaged.
        outline: Lines that are drawn dark, pyvista.PolyData, or None.
        headlight: Light from the eye, which darkens the rims of bodies, instead of two lamps.

    Returns:
        RGB image, uint8, shape (height, width, 3).
    """
    with quiet():
        plotter = _plotter()
        window = [2 * s for s in size]
        if list(plotter.window_size) != window:  # to set it draws a picture of nothing
            plotter.window_size = window
        for layer in layers:
            look = {"color": layer.colour}
            if layer.scalars:
                look = {"scalars": layer.scalars, "cmap": layer.colours, "clim": layer.limits}
            if layer.edges:
                look |= {"show_edges": True, "edge_color": "#404040"}
                look |= {"edge_opacity": 0.35, "line_width": 1.2}
            look |= {"ambient": 0.5, "diffuse": 0.6, "specular": 0.0, "smooth_shading": False}
            look |= {"show_scalar_bar": False, "render": False, "reset_camera": False}
            plotter.add_mesh(layer.mesh, **(look | layer.options))
        if outline is not None:
            plotter.add_mesh(
                outline,
                color="#303030",
                line_width=6e-3 * size[1],
                lighting=False,
                render=False,
                reset_camera=False,
            )
        _look(plotter, camera, headlight)
        plotter.render()
        image = plotter.screenshot(return_img=True)[..., :3]
        plotter.clear()
    return _halved(image)


def _halved(image):
    """An image of half the size, each pixel the mean of four, uint8."""
    height, width = (n // 2 * 2 for n in image.shape[:2])
    wide = image[:height, :width].astype(np.uint16)
    four = wide[::2, ::2] + wide[1::2, ::2] + wide[::2, 1::2] + wide[1::2, 1::2]
    return ((four + 2) // 4).astype(np.uint8)


def over(front, back, fade=0.0):
    """A picture on white laid over another one that fades towards white by a part 0 to 1."""
    empty = (front == 255).all(axis=2, keepdims=True)
    pale = back + fade * (255.0 - back)
    return np.where(empty, pale.round().astype(np.uint8), front)


def _look(plotter, camera, headlight):
    """Place the camera, a light above its left shoulder and a weaker one at its right."""
    distance = 20 * camera.half_height
    eye = camera.focus + distance * camera.direction
    right = np.cross(camera.up, camera.direction)
    right /= np.linalg.norm(right)
    up = np.cross(camera.direction, right)
    lamps = ((0.0, 0.0, 0.9),) if headlight else ((-0.5, 0.7, 0.75), (0.8, 0.1, 0.35))
    for side, above, strength in lamps:
        place = eye + distance * (side * right + above * up)
        light = pyvista.Light(
            position=place, focal_point=camera.focus, intensity=strength, light_type="scene light"
        )
        light.positional = False
        plotter.add_light(light)
    plotter.camera.position = eye
    plotter.camera.focal_point = camera.focus
    plotter.camera.up = camera.up
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = camera.half_height
    plotter.reset_camera_clipping_range()
