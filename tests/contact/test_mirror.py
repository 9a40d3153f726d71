"""Planes of symmetry: a part of a symmetric body moves as that part of the whole one."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial import cKDTree

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.mirror_image import with_image
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.run.from_bodies import distribute, simulate
from mufe_fenicsx.scene import load_scene, scene_to_toml
from mufe_fenicsx.verification.case import on_first_ranks
from mufe_fenicsx.verification.pressed import FRAME
from tests.bodies import half_ball, simulation_of, sphere
from tests.scene.scene_files import SMALLEST, scene_file

COMM = MPI.COMM_WORLD
RADIUS, APPROACH = 1e-3, 2e-5
#: Yields in the contact.
SAND = J2(100e9, 0.15, 2650.0, ((0.0, 200e6), (0.05, 400e6)))
X, Y, Z = np.eye(3)


def quarter(h=0.14):
    """A quarter of a half ball, its base in z = 0, its pole up: x >= 0, y <= 0."""
    return half_ball(RADIUS, h * RADIUS, 0.5, tuple(Z), 0.2 * RADIUS, 0.4 * RADIUS, quarter=True)


def whole(body):
    """What the quarter is one of."""
    return with_image(*with_image(*body, X), Y)


def upside_down(body):
    """The quarter on its pole, which lies at the origin of the other's pole."""
    points, cells = body
    return points * [1, 1, -1] + 2 * points[:, 2].max() * Z, cells[:, [1, 0, 2, 3]]


def cut(bodies, part, walls, comm, **options):
    """A simulation of the quarters or of the whole, turned so that nothing lies along axes."""
    mirrors = [("x", np.zeros(3), X), ("y", np.zeros(3), -Y)] if part else []
    bodies = [body if part else whole(body) for body in bodies]
    mesh = distribute(comm, [(points @ FRAME.T, cells) for points, cells in bodies])
    walls = [Wall(name, FRAME @ at, FRAME @ n, mirror=True) for name, at, n in mirrors] + walls
    if "increment" in options and not part:
        # Nothing else keeps the whole where it is; by symmetry these carry nothing.
        local = mesh.x @ FRAME
        options["held"] = [
            (np.flatnonzero(np.abs(local[:, i]) < 1e-9 * RADIUS), FRAME[:, i]) for i in (0, 1)
        ]
    return simulate(mesh, [SAND] * mesh.num_grains, walls, **options)


def forces(s):
    """On all walls along x, y, z of the bodies [N], by name. Collective."""
    force, _ = s.walls.loads(s.comm)
    return dict(zip(s.walls.names, force @ FRAME, strict=True))


def pressed_ball(part, **options):
    """A half ball, its base on a mirror, under a plane that comes down."""
    body = quarter()
    top = float(body[0][:, 2].max())
    walls = [
        Wall("base", np.zeros(3), FRAME @ Z, mirror=True),
        Wall("plane", FRAME @ (top * Z), FRAME @ -Z),
    ]
    return cut([body], part, walls, MPI.COMM_SELF, **options)


def step_explicitly(s, name, speed, num_steps, dt):
    """Steps of a given length: that of the whole ball is its own."""
    s.walls.velocity[s.walls.names.index(name)] = -speed * FRAME[:, 2]
    s.dt, s.update_time_step = dt, lambda **_: None
    for _ in range(num_steps):
        s.step()


def check_displacements(part, all_of_it, tolerance):
    """Those of the quarter's nodes are those of the same nodes of the whole."""
    off, same = cKDTree(all_of_it.mesh.x).query(part.mesh.x)
    assert off.max() < 1e-9 * RADIUS and np.unique(same).size == same.size
    error = np.abs(part.state.u - all_of_it.state.u[same]).max()
    assert error < tolerance * np.abs(part.state.u).max()


@pytest.mark.parametrize("points", ["facets", "nodes"])
def test_time_steps_of_a_quarter_are_those_of_the_ball(points):
    """Nodes move alike and walls carry a quarter; tolerance: rounding over 200 steps."""
    part, ball = (pressed_ball(one, points=points, friction=0.3) for one in (True, False))
    dt = 0.9 * min(part.dt, ball.dt)
    for s in (part, ball):
        step_explicitly(s, "plane", APPROACH / (200 * dt), 200, dt)
    of_part, of_ball = forces(part), forces(ball)
    assert of_ball["plane"][2] > 0.1
    for name in ("plane", "base"):
        np.testing.assert_allclose(4 * of_part[name][2], of_ball[name][2], rtol=1e-9)
    check_displacements(part, ball, 1e-9)
    # What the cut faces carry, along their normals alone.
    assert min(abs(of_part["x"][0]), abs(of_part["y"][1])) > 0.01 * of_part["plane"][2]
    assert np.abs(of_part["x"][1:]).max() < 1e-12 * abs(of_part["x"][0])
    held = part.specimen.mirrors
    on = held.node[held.wall == part.walls.names.index("x")]
    assert np.abs(part.state.x[on] @ FRAME[:, 0]).max() < 1e-15 * RADIUS * 200
    assert part.state.plastic_strain.max() > 1e-4
    e = part.energies()
    # Steps at 0.9 of the limit or less; mirrors do no work.
    assert abs(e["residual"]) < 2e-3 * e["work"]


def test_static_increments_of_a_quarter_are_those_of_the_ball():
    """The same at rest, to the single precision of surfaces between nodes.

    It is 6e-8 of heights that are some times as large as displacements.
    """
    options = {"increment": 1.0, "tolerance": 1e-10, "stabilisation": 0.0}
    part, ball = (pressed_ball(one, **options) for one in (True, False))
    for s in (part, ball):
        s.walls.velocity[s.walls.names.index("plane")] = -0.5 * APPROACH * FRAME[:, 2]
        for _ in range(2):
            s.step()
        assert s.num_failed == 0
    of_part, of_ball = forces(part), forces(ball)
    scale = of_ball["plane"][2]
    np.testing.assert_allclose(4 * of_part["plane"][2], scale, rtol=5e-7)
    np.testing.assert_allclose(of_ball["base"][2], -scale, rtol=5e-7)
    check_displacements(part, ball, 5e-7)
    # All that holds the quarter, the cut faces too, is in balance.
    np.testing.assert_allclose(sum(of_part.values()), 0.0, atol=5e-7 * scale)


def test_two_balls_cut_by_mirrors_press_as_a_quarter_of_them():
    """Facets meet facets beside the mirrors; the upper base is glued to a platen and cut as well.

    Tolerance: rounding over 200 steps of contacts that open and close.
    """

    def run(comm):
        # Other meshes, of which no node meets one of the other.
        low, high = quarter(0.14), upside_down(quarter(0.17))
        found = []
        for part in (True, False):
            top = 2 * low[0][:, 2].max()
            walls = [
                Wall("base", np.zeros(3), FRAME @ Z, mirror=True),
                Wall("platen", FRAME @ (high[0][:, 2].max() * Z), FRAME @ -Z, bonded=True),
            ]
            assert high[0][:, 2].max() < 1.01 * top
            found.append(cut([low, high], part, walls, comm, friction=0.3))
        dt = 0.9 * min(s.dt for s in found)
        for s in found:
            step_explicitly(s, "platen", APPROACH / (200 * dt), 200, dt)
        return [forces(s) for s in found]

    of_part, of_balls = on_first_ranks(COMM, 2, run)
    assert of_balls["base"][2] < -0.1
    for name in ("platen", "base"):
        np.testing.assert_allclose(4 * of_part[name][2], of_balls[name][2], rtol=1e-7)


def test_a_quarter_and_its_images_are_the_ball():
    """Volumes add up to rounding, faces of the cut are shared, and both planes are exact."""
    points, cells = quarter()
    assert points[:, 0].min() == 0.0 and points[:, 1].max() == 0.0 and points[:, 2].min() == 0.0
    for i in range(3):
        assert (points[:, i] == 0.0).sum() > 10

    def volume(points, cells):
        return np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) / 6

    all_points, all_cells = whole((points, cells))
    part, ball = volume(points, cells), volume(all_points, all_cells)
    assert part.min() > 0 and ball.min() > 0
    assert ball.sum() == pytest.approx(4 * part.sum(), rel=1e-12)
    # Facets enclose the volume of the half ball, but for the next order of h up to 0.4 R.
    assert ball.sum() == pytest.approx(2 / 3 * np.pi * RADIUS**3, rel=0.03)
    assert len(np.unique(np.round(all_points / RADIUS, 9), axis=0)) == len(all_points)
    with pytest.raises(InputError, match="both sides"):
        with_image(all_points, all_cells, X)


def test_mirrors_that_cannot_be():
    with pytest.raises(InputError, match=r"friction of the mirror x = 0\.1"):
        Wall("x", np.zeros(3), X, friction=0.1, mirror=True)
    with pytest.raises(InputError, match="velocity of the mirror x"):
        Wall("x", np.zeros(3), X, velocity=X, mirror=True)
    mesh = distribute(MPI.COMM_SELF, [sphere(RADIUS, 0.5 * RADIUS)])
    aside = Wall("x", -1.5 * RADIUS * X, X, mirror=True)
    with pytest.raises(InputError, match="nodes on the mirror x = 0, expected at least 3"):
        simulation_of(mesh, SAND, [aside])
    mesh = distribute(MPI.COMM_SELF, [quarter(0.3)])
    base = Wall("base", np.zeros(3), Z, mirror=True)
    with pytest.raises(InputError, match="rigid grains on mirrors"):
        simulation_of(mesh, Rigid(100e9, 0.15, 2650.0), [base])
    with pytest.raises(InputError, match="kinematic"):
        simulation_of(mesh, SAND, [base], law="kinematic")
    slanted = Wall("slanted", np.zeros(3), np.sqrt(0.5) * (X + Z), mirror=True)
    with pytest.raises(InputError, match="mirrors base and slanted meet at 45 degrees"):
        simulation_of(mesh, SAND, [base, slanted])
    s = simulation_of(mesh, SAND, [base])
    s.walls.velocity[0] = Z
    with pytest.raises(InputError, match="velocity of the mirror base"):
        s.step()


MIRROR = SMALLEST + "[walls.x_min]\nmirror = true\n"


def test_a_scene_with_a_mirror(tmp_path):
    """It comes back as it is written, smooth whatever the other walls are."""
    text = MIRROR.replace("0.23", "0.23\nwall_friction = 0.1") + "[sample]\nseparation = false\n"
    scene = load_scene(scene_file(tmp_path, text))
    assert scene.walls["x_min"].mirror and scene.walls["x_min"].friction == 0.0
    assert scene.walls["x_max"].friction == 0.1
    written = scene_to_toml(scene)
    assert load_scene(scene_file(tmp_path, written)) == scene


@pytest.mark.parametrize(
    "text, expected",
    [
        (MIRROR, "sample.separation = true, expected false with walls.x_min.mirror"),
        (MIRROR + "friction = 0.1\n", "walls.x_min.friction = 0.1, expected none of a mirror"),
        (MIRROR + "velocity = 1\n", "walls.x_min.velocity = 1"),
        (MIRROR.replace("x_min", "z_max"), "walls.z_max.mirror = true, expected none"),
        (MIRROR.replace("[oed", 'law = "kinematic"\n[oed'), 'contact.law = "kinematic"'),
        (SMALLEST + "[implicit]\ngap_tolerance = 1e-3\n", "implicit.gap_tolerance = 0.001 is no "),
    ],
)
def test_scenes_that_are_refused(tmp_path, text, expected):
    with pytest.raises(InputError) as caught:
        load_scene(scene_file(tmp_path, text))
    assert expected in str(caught.value) and "\n" not in str(caught.value)
