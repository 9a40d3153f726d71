"""3D pictures without a screen: parallel projection, so that a scale bar is exact."""

import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import pyvista

PROBE = """
import pyvista
pyvista.OFF_SCREEN = True
plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32))
plotter.add_mesh(pyvista.Sphere())
image = plotter.screenshot(return_img=True)
raise SystemExit(0 if image.min() < image.max() else 3)
"""


def cannot_render():
    """Why 3D pictures cannot be drawn here, or None if they can.

    Tried in a process of its own, since graphics drivers may abort or hang it.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-c", PROBE], capture_output=True, text=True, timeout=120
        )
    except subprocess.TimeoutExpired:
        return "off-screen rendering did not answer within 120 s"
    if done.returncode == 0:
        return None
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    why = lines[-1] if lines else f"the renderer ended with status {done.returncode}"
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


def render(surface, scalars, colours, limits, camera, size, box=None, edges=False):
    """Picture of a surface.

    Args:
        surface: pyvista.PolyData.
        scalars: Name of the data that colour it.
        colours: A matplotlib colour map.
        limits: Values at both ends of the map.
        camera: Camera.
        size: Width and height [pixels].
        box: Corners of a box whose edges are drawn [m], shape (2, 3), or None.
        edges: Draw the edges of the facets.

    Returns:
        RGB image, uint8, shape (height, width, 3).
    """
    with quiet():
        plotter = pyvista.Plotter(off_screen=True, window_size=size, lighting="none")
        plotter.set_background("white")
        plotter.add_mesh(
            surface,
            scalars=scalars,
            cmap=colours,
            clim=limits,
            show_scalar_bar=False,
            smooth_shading=False,
            ambient=0.5,
            diffuse=0.6,
            specular=0.0,
            show_edges=edges,
            edge_color="#404040",
            edge_opacity=0.35,
            line_width=0.6,
        )
        if box is not None:
            bounds = np.asarray(box).T.ravel()
            plotter.add_mesh(
                pyvista.Box(bounds).extract_feature_edges(),
                color="#303030",
                line_width=2.5,
                lighting=False,
            )
        _look(plotter, camera)
        plotter.enable_anti_aliasing("ssaa")
        image = plotter.screenshot(return_img=True)
        plotter.close()
    return image[..., :3]


def _look(plotter, camera):
    """Place the camera, a light above its left shoulder and a weaker one at its right."""
    distance = 20 * camera.half_height
    eye = camera.focus + distance * camera.direction
    right = np.cross(camera.up, camera.direction)
    right /= np.linalg.norm(right)
    up = np.cross(camera.direction, right)
    for side, above, strength in ((-0.5, 0.7, 0.75), (0.8, 0.1, 0.35)):
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
