"""Weight: a body that falls and lands, a column under its own weight, a term of one's own."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.tools import Tool
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.auto import Auto
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.scene import load_scene, scene_to_toml
from mufe_fenicsx.state import ForceTerm
from tests.bodies import sphere
from tests.run.test_run import small_scene

COMM = MPI.COMM_SELF
ROCK = Elastic(1e9, 0.0, 2500.0)
RADIUS = 1e-3
#: So large that a fall takes few steps [m/s²].
G = np.array([0.0, 0.0, -2e5])


def ball(material, gap, **options):
    points, cells = sphere(RADIUS, 0.5 * RADIUS)
    floor = Wall("floor", np.zeros(3), np.array([0.0, 0.0, 1.0]))
    body = (points + np.array([0.0, 0.0, RADIUS + gap]), cells)
    return build(COMM, [body], material, (0, 0, 0), (0, 0, 0), "", walls=[floor], **options)


def height(s):
    """Of the centre of mass [m]."""
    s.complete()
    return s.solid.mass @ s.state.x[:, 2] / s.solid.mass.sum()


@pytest.mark.parametrize(
    "material", [ROCK, Rigid(1e9, 0.0, 2500.0), Auto(1e9, 0.0, 2500.0, ((0.0, 1e9), (1.0, 2e9)))]
)
@pytest.mark.parametrize("factor", [None, 4.0])
def test_all_bodies_fall_alike(material, factor):
    """z = g t²/2, which central differences follow to rounding; a mass factor makes it slower."""
    more = {}
    s = ball(material, 1.0, gravity=G)
    if factor is not None:
        more["mass_factor"] = np.full(s.mesh.num_nodes, factor)
        s = ball(material, 1.0, gravity=G, **more)
    first = height(s)
    for _ in range(40):
        s.step(everywhere=False)
    fallen = first - height(s)
    assert fallen == pytest.approx(-0.5 * G[2] * s.state.t**2 / (factor or 1.0), rel=1e-9)
    e = s.energies()
    mass = s.solid.mass.sum() / (factor or 1.0)
    assert e["energy_gravity"] == pytest.approx(mass * G[2] * fallen, rel=1e-9)
    assert abs(e["residual"]) < 1e-9 * e["kinetic"]
    np.testing.assert_allclose(s.unbalanced_force(), mass * G, rtol=1e-12)


@pytest.mark.parametrize("material", [ROCK, Rigid(1e9, 0.0, 2500.0)])
def test_forces_from_outside_are_those_on_the_sample(material):
    """Of a ball and a tool that nothing touches the weight of the ball alone, whatever is asked."""
    points, cells = box((RADIUS, RADIUS, RADIUS), (1, 1, 1), (3 * RADIUS, 0.0, RADIUS))
    s = ball(material, RADIUS, gravity=G, tools=[Tool("block", points, cells)])
    s.step()
    of_ball = s.solid.mass[s.mesh.grain_of_node == 0].sum()
    before, energies = s.rigid.force.copy(), s.energies()
    for _ in range(2):
        np.testing.assert_allclose(s.unbalanced_force(), of_ball * G, rtol=1e-12)
    # Looking changes nothing.
    np.testing.assert_array_equal(s.rigid.force, before)
    assert s.energies() == energies


def test_a_fall_ends_as_a_blow_of_its_speed():
    """Landing after a fall, and thrown at that speed: the same force; weight is little of it."""
    gap = 0.5 * RADIUS
    speed = math.sqrt(-2.0 * G[2] * gap)
    largest = []
    for options, start in (
        ({"gravity": G}, gap),
        ({"velocity": lambda x, grain: np.tile([0.0, 0.0, -speed], (len(x), 1))}, 1e-9),
    ):
        s, most = ball(ROCK, start, **options), 0.0
        weight = s.solid.mass.sum() * -G[2]
        while s.state.t < gap / speed * 4 and (most == 0.0 or s.wall_forces()[0] > 0.0):
            s.step()
            most = max(most, s.wall_forces()[0])
        # That of the scheme, (ω dt)² of the contact's frequency, whose period has 40 steps.
        blow = 0.5 * s.solid.mass.sum() * speed**2
        assert abs(s.energies()["residual"]) < 3e-3 * blow
        largest.append(most)
    assert weight < 0.1 * largest[1]
    # The weight adds to the force itself, and its work on the way of the contact to the energy.
    assert 0.0 < largest[0] - largest[1] < 2.5 * weight


def column(increment, **options):
    """A block of 1 x 1 x 4 mm, free along its sides, on a smooth floor."""
    size = np.array([1e-3, 1e-3, 4e-3])
    points, cells = box(size, (2, 2, 8))
    floor = Wall("floor", np.zeros(3), np.array([0.0, 0.0, 1.0]))
    low, high = np.zeros(3), size
    s = build(
        COMM, [(points, cells)], ROCK, low, high, "", walls=[floor], increment=increment,
        gravity=G, **options,
    )  # fmt: skip
    return s, size


@pytest.mark.parametrize("increment", [1e-4, None])
def test_a_column_under_its_own_weight(increment):
    """σ = ρ g (H - z), w = ρ g (z² - 2 H z)/2E; by increments, and by damped time steps."""
    transit = 4e-3 / math.sqrt(ROCK.E / ROCK.rho)
    options = {"damping": 2.0 / transit} if increment is None else {}
    s, size = column(increment, **options)
    weight = s.solid.mass.sum() * -G[2]
    for _ in range(3):
        s.step()
    while increment is None and s.state.t < 15 * transit:
        s.step(everywhere=False)
    s.complete()
    pull = ROCK.rho * -G[2]
    assert s.wall_forces()[0] == pytest.approx(weight, rel=1e-4)
    # Five tetrahedra a brick give uneven weights to nodes: means of layers are compared.
    layer = np.rint(s.mesh.x[:, 2] / 5e-4).astype(int)
    mass = s.solid.mass
    w = np.bincount(layer, mass * s.state.u[:, 2]) / np.bincount(layer, mass)
    z = 5e-4 * np.arange(w.size)
    exact = pull * (z**2 - 2.0 * size[2] * z) / (2.0 * ROCK.E)
    # The lowest layer goes down by what contact gives way; 0.5 % were measured, 0.1 with half h.
    assert np.abs(w - w[0] - exact).max() < 0.01 * np.abs(exact).max()
    stress = s.solid.stress(s.state)[:, 2]
    middle = s.mesh.x[s.mesh.cells].mean(axis=1)[:, 2]
    # A tetrahedron has one stress: that of its middle but for half of its height.
    assert np.abs(stress + pull * (size[2] - middle)).max() < 0.5 * 5e-4 * pull
    e = s.energies()
    assert e["elastic"] == pytest.approx(
        pull**2 * size[0] * size[1] * size[2] ** 3 / (6.0 * ROCK.E), rel=0.02
    )
    # Steps of the limit of stability do not resolve the waves of a weight that comes at once.
    assert abs(e["residual"]) < 5e-3 * -e["energy_gravity"]


def test_gravity_stands_in_a_scene(tmp_path):
    scene = replace(small_scene(), gravity=(0.0, 0.0, -9.81))
    path = tmp_path / "scene.toml"
    path.write_text(scene_to_toml(scene), encoding="utf-8")
    assert load_scene(path).gravity == (0.0, 0.0, -9.81)
    text = path.read_text(encoding="utf-8")
    for given, said in (
        ("-9.81", "gravity = -9.81, expected a list of 3 numbers"),
        ("[0, 0]", r"gravity = \[0, 0\], expected a list of 3 numbers"),
        ('[0, 0, "9.81 m/s"]', r"gravity\[2\] = .*, expected an acceleration"),
        ("[0, 0, nan]", r"gravity\[2\] = nan, expected an acceleration"),
    ):
        path.write_text(text.replace("[0.0, 0.0, -9.81]", given), encoding="utf-8")
        with pytest.raises(InputError, match=said):
            load_scene(path)


class Ground(ForceTerm):
    """Springs between all nodes and their first places."""

    name = "ground"

    def __init__(self, x, k):
        self.x, self.k = x.copy(), k

    def add_forces(self, f, state, dt):
        f -= self.k * (state.x - self.x)

    def energy(self, state):
        return 0.5 * self.k * float(((state.x - self.x) ** 2).sum())

    def stiffness(self, state):
        n = np.arange(len(self.x))
        return n, n, np.tile(self.k * np.eye(3), (n.size, 1, 1))


@pytest.mark.parametrize("increment", [1e-4, None])
def test_a_term_of_ones_own_counts_everywhere(increment):
    """Its stiffness in the time step and in the tangent, its energy in the balance."""
    # Short steps, for a weight that comes at once sends waves: the balance is that of the scheme.
    options = {} if increment else {"time_step_factor": 0.2}
    s = column(increment, **options)[0]
    free = s.dt
    mass = s.solid.mass
    k = 4.0 * float(mass.min()) * (0.4 / free) ** 2 if increment is None else 1e5
    s.add_term(Ground(s.mesh.x, k))
    with pytest.raises(InputError, match='name of a force term = "ground", expected one'):
        s.add_term(Ground(s.mesh.x, k))
    if increment is None:
        assert s.dt < 0.9 * free
        for _ in range(200):
            s.step()
        e = s.energies()
        assert abs(e["residual"]) < 1e-2 * (abs(e["energy_gravity"]) + e["energy_ground"])
    else:
        for _ in range(2):
            s.step()
        assert len(s.report) == 2 and max(row[2] for row in s.report) <= 4
        pull = float((mass[:, None] * G).sum(axis=0)[2])
        held = -k * s.state.u[:, 2].sum()
        assert held + s.wall_forces()[0] == pytest.approx(-pull, rel=1e-5)


def test_what_a_term_must_not_be():
    s = ball(Rigid(1e9, 0.0, 2500.0), 1.0)
    for term, said in (
        (Ground(s.mesh.x, 1.0), "force term ground has no act_on_rigid, expected one where"),
        (lambda f, state, dt: None, "force term = <function .*, expected a state.ForceTerm"),
    ):
        with pytest.raises(InputError, match=said):
            s.add_term(term)
    with pytest.raises(InputError, match='option of a simulation = "frction", expected friction'):
        ball(ROCK, 1.0, frction=0.3)
