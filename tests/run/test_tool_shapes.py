"""Tools of the usual shapes, made as the page on tools makes them: vane, funnel, rough platen."""

from contextlib import chdir

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.tools import Tool
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.geometry.bodies.shapes import box, sphere
from mufe_fenicsx.geometry.bodies.tool_body import read_tool
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.run.from_bodies import build
from tests.docs_pages import ROOT

COMM = MPI.COMM_SELF
MM = 1e-3
HARD = Rigid(1e9, 0.2, 2500.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Surfaces that the program of the page writes."""
    path = tmp_path_factory.mktemp("shapes")
    text = (ROOT / "docs/howto/tools.md").read_text(encoding="utf-8")
    program = text.split("## Shapes")[1].split("```python\n")[1].split("```")[0]
    with chdir(path):
        exec(compile(program, "tools.md", "exec"), {})
    return path


def body(folder, name, thickness=None):
    return read_tool(folder / f"{name}.stl", MM, thickness)


def ball(radius, centre, h=0.5):
    points, cells = sphere(radius, h * radius)
    return points + np.asarray(centre), cells


def balls_of(s):
    """Rigid grains that are no tools."""
    return slice(s.rigid.num_grains - s.tools.rows.size)


def test_the_torque_of_a_vane_leads_balls_against_damping(folder):
    """Between blades and a smooth side balls go around as one with it: M = c ω Σ (m r² + J)."""
    radius, omega, damping, away = 0.35 * MM, 2000.0, 1e5, 0.6 * MM
    places = [(away * x, away * y, MM) for x in (-1, 1) for y in (-1, 1)]
    vane = Tool("vane", *body(folder, "vane"), angular_velocity=(0, 0, omega), point=(0, 0, 0))
    side = Wall("side", np.zeros(3), np.eye(3)[2], radius=1.25 * MM)
    s = build(
        COMM, [ball(radius, place) for place in places], HARD, (0, 0, 0), (MM, MM, MM), "",
        walls=[side], tools=[vane], damping=damping,
    )  # fmt: skip
    work, torques = 0.0, [0.0]
    while omega * s.state.t < 1.0:
        s.step()
        torques.append(s.tools.forces()[0, 5])
        work -= 0.5 * (torques[-2] + torques[-1]) * omega * s.state.dt
    assert s.tools.places()[0, 5] == pytest.approx(omega * s.state.t, rel=1e-6)
    energies = s.energies()
    assert energies["work"] == pytest.approx(work, rel=1e-6)
    assert abs(energies["residual"]) < 1e-3 * energies["work"]
    own, r = balls_of(s), s.rigid
    moment = r.mass[own] * (r.centre[own, :2] ** 2).sum(axis=1) + r.inertia[own, 2]
    late = -np.mean(torques[int(0.7 * len(torques)) :])
    # They still settle along the blades: radii change by parts of a hundredth.
    assert late == pytest.approx(damping * omega * np.sum(moment), rel=2e-2)


def test_grains_pass_a_funnel(folder):
    """Balls that are smaller than its neck fall through it, and none through its side."""
    radius, g = 0.25 * MM, 1e4
    places = [(0.7 * MM * x, 0.7 * MM * y, 2.2 * MM) for x in (-1, 1) for y in (-1, 1)]
    funnel = Tool("funnel", *body(folder, "funnel", 0.2 * MM), friction=0.1)
    s = build(
        COMM, [ball(radius, place) for place in places], HARD, (0, 0, 0), (MM, MM, MM), "",
        tools=[funnel], gravity=(0, 0, -g), damping=2e3,
    )  # fmt: skip
    fallen, own = False, balls_of(s)
    while not fallen and s.state.t < 4e-3:
        for _ in range(100):
            s.step()
        x, y, z = s.rigid.centre[own].T / MM
        side = np.interp(z, [0.0, 0.5, 2.5], [0.6, 0.6, 2.0])
        through = np.sum((np.hypot(x, y) > side) & (z > 0.0))
        assert not through
        fallen = np.sum(z > -0.25) == 0
    assert fallen
    energies, carried = s.energies(), s.tools.forces()[0, 2]
    assert abs(energies["residual"]) < 1e-3 * abs(energies["energy_gravity"])
    assert carried == 0.0, "the funnel is empty"
    # Springs lose and gain energy where points pass edges of the funnel.
    lost = sum(energies[name] for name in ("kinetic", "damping", "friction", "switching"))
    assert lost == pytest.approx(-energies["energy_gravity"], rel=1e-3)


@pytest.mark.parametrize("name", ["rough", "smooth"])
def test_a_rough_platen_holds_by_its_form(folder, name):
    """Without friction a flank of 30 degrees pushes a ball with tan 30 of its weight, or drags.

    Weight and the damping of its rise at the speed v tan 30 load the flank; a plane pushes nothing.
    """
    radius, v, g, damping, slope = 0.4 * MM, 0.05, 1e5, 1e4, np.tan(np.pi / 6)
    if name == "smooth":
        points, cells = box((4 * MM, 4 * MM, 0.3 * MM), (1, 1, 1), (0.0, 0.0, -0.3 * MM))
        height, slope = radius, 0.0
    else:
        points, cells = body(folder, "rough", 0.3 * MM)
        height = radius * np.sqrt(1 + slope**2)
    place = np.array([1.0 * MM, 2 * MM, 1.001 * height])
    stop = Wall("stop", place + radius * np.eye(3)[0], -np.eye(3)[0])
    s = build(
        COMM, [ball(radius, place)], HARD, (0, 0, 0), (MM, MM, MM), "", walls=[stop],
        tools=[Tool("platen", points, cells, velocity=(v, 0, 0))], gravity=(0, 0, -g),
        damping=damping,
    )  # fmt: skip
    pushed = []
    while s.state.t < 2e-3:
        s.step()
        if s.state.t > 1e-3:
            pushed.append(s.tools.forces()[0, [0, 2]])
    along, down = -np.mean(pushed, axis=0)
    weight = np.sum(s.rigid.mass[balls_of(s)]) * (g + damping * v * slope)
    # The ball rocks from facet to facet, by 1e-2 of its weight at a time.
    assert down == pytest.approx(weight, rel=1e-2)
    assert along == pytest.approx(slope * weight, abs=1e-2 * weight)
