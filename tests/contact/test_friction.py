"""Coulomb's law, stuck and sliding, along prescribed motion: forces and work are known exactly."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.contact import Contact
from mufe_fenicsx.contact.settings import ContactGrains, ContactSettings
from mufe_fenicsx.contact.walls import Wall, Walls, rotation_of
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.run.from_bodies import distribute
from tests.bodies import half_ball

STATIC, KINETIC = 0.5, 0.3
MODULUS, NU, SIZE = 1e9, 0.2, 1e-3
DEPTH = 1e-6
FRAME = rotation_of(np.array([0.3, -0.5, 0.8]))
ALONG, ACROSS, UP = FRAME
E3, CENTRE = np.eye(3)[2], np.array([0.6 * SIZE, 0.5 * SIZE, 0.0])
COMM = MPI.COMM_SELF


class Mover:
    """A block that is moved rigidly over a plane or over another block; nothing deforms."""

    def __init__(self, on_block, static, kinetic=None, body=None):
        # Nodes of a block are all at one depth; on a ball contact is at facets, as by default.
        points = "nodes" if body is None else "facets"
        side = 0.3 * SIZE
        body = (
            box((side, side, side), (3, 3, 3), (0.31 * SIZE, 0.33 * SIZE, 0.0))
            if (body is None)
            else body
        )
        bodies = [body]
        walls = []
        if on_block:
            bodies.append(box((2 * SIZE, SIZE, 0.2 * SIZE), (47, 23, 2), (0, 0, -0.2 * SIZE)))
        else:
            walls = [Wall("plane", np.zeros(3), UP, static, friction_kinetic=kinetic)]
        bodies = [(points @ FRAME, cells) for points, cells in bodies]
        mesh = distribute(COMM, bodies)
        self.walls = Walls(walls)
        modulus, ratio = np.full(mesh.num_grains, MODULUS), 2 * (1 - NU) / (2 - NU)
        self.contact = Contact(
            mesh,
            mesh.x,
            self.walls,
            ContactGrains(modulus, np.full(mesh.num_grains, ratio)),
            ContactSettings(static, points, "matched", 0.15, kinetic),
        )
        self.pairs = self.contact.pairs if on_block else self.walls.pairs
        self.on_block, self.ratio = on_block, ratio
        self.moving = mesh.grains[mesh.grain_of_node] == 0
        self.x0, self.x = mesh.x.copy(), mesh.x.copy()
        self.f = np.zeros_like(self.x)
        self.place = np.zeros(3)
        self.work = 0.0  #: done on the block against contact
        self.go(np.zeros(3))

    def go(self, place):
        """Put the block ``place`` from its start; returns the force on it along, across, up."""
        before = self.force
        move = place - self.place
        self.x[self.moving] = self.x0[self.moving] + place
        self.place = place
        self.f[:] = 0.0
        self.contact.begin_step(self.x)
        self.contact.add_forces(self.f, self.x)
        self.work -= 0.5 * (before + self.force) @ move
        return FRAME @ self.force

    @property
    def force(self):
        return self.f[self.moving].sum(axis=0)

    def balance(self):
        """Work less what is stored, rubbed and lost at edges of facets, over the work."""
        return self.residual() / self.work

    def residual(self):
        """The same in [J]."""
        c = self.contact
        return self.work - c.energy()[0] - c.dissipation.total - c.dissipation.switched

    def stiffness(self):
        """Of all tangential springs [N/m]."""
        kind = self.contact.pairs if self.on_block else self.walls.pairs
        on = kind.closed
        if self.on_block:
            return self.ratio * kind.stiffness[on].sum()
        node = kind.node[on]
        return self.ratio * (self.contact.points.area[node] / self.contact.points.layer[node]).sum()


@pytest.mark.parametrize("on_block", [False, True])
def test_sticks_below_the_limit_and_slides_at_it(on_block):
    """T = k s below μN, exactly; the threshold is μN; back and forth through all states."""
    m = Mover(on_block, STATIC)
    m.go(-DEPTH * UP)
    normal = (FRAME @ m.force)[2]
    reach = STATIC * normal / m.stiffness()
    for part in (0.3, 0.6, 0.999):
        along, across, up = m.go(-DEPTH * UP + part * reach * ALONG)
        # Only round-off: springs of equal limit over stiffness, for the depth is even.
        assert along == pytest.approx(-part * STATIC * normal, rel=1e-9)
        assert abs(across) < 1e-9 * normal and up == pytest.approx(normal, rel=1e-9)
    assert m.contact.dissipation.total < 1e-20 * normal * reach
    assert m.go(-DEPTH * UP)[0] == pytest.approx(0.0, abs=1e-9 * normal)
    for way in (1.5, 3.0, 10.0):
        assert m.go(-DEPTH * UP + way * reach * ALONG)[0] == pytest.approx(-STATIC * normal)
    # Back by less than twice the elastic way it sticks; then it slides the other way.
    assert m.go(-DEPTH * UP + 8.5 * reach * ALONG)[0] == pytest.approx(0.5 * STATIC * normal)
    assert m.go(-DEPTH * UP + 5 * reach * ALONG)[0] == pytest.approx(STATIC * normal)
    # Slid in reaches, each step at the mean of the forces before and after it.
    slid = 0.5 * 0.5 + 1.5 + 7 + 0.75 * 3
    assert m.contact.dissipation.total == pytest.approx(STATIC * normal * reach * slid, rel=1e-9)
    assert abs(m.balance()) < 1e-9


@pytest.mark.parametrize("on_block", [False, True])
def test_friction_takes_its_work_where_it_turns_and_where_a_contact_opens(on_block):
    """Trapezoids of the force vector: across the last friction, and on the way of the last step."""
    m = Mover(on_block, STATIC)
    m.go(-DEPTH * UP)
    reach = STATIC * (FRAME @ m.force)[2] / m.stiffness()
    m.go(-DEPTH * UP + 0.9 * reach * ALONG)
    m.go(-DEPTH * UP + 0.9 * reach * ALONG + 2 * reach * ACROSS)
    # It opens, and springs back by half on the way; the normal force ends with its depth.
    m.go(-DEPTH * UP + 0.9 * reach * ALONG + 0.5 * reach * ACROSS)
    m.go(1e-12 * DEPTH * UP + 0.9 * reach * ALONG + 1.0 * reach * ACROSS)
    assert m.contact.energy()[0] == 0.0
    assert abs(m.balance()) < 1e-9


@pytest.mark.parametrize("on_block", [False, True])
def test_kinetic_friction_holds_while_a_contact_slips(on_block):
    """It has to overcome μs N, slips at μk N, and sticks up to μs N again after a stop."""
    m = Mover(on_block, STATIC, KINETIC)
    m.go(-DEPTH * UP)
    normal = (FRAME @ m.force)[2]
    reach = STATIC * normal / m.stiffness()

    def go(way):
        return -m.go(-DEPTH * UP + way * reach * ALONG)[0] / normal

    assert go(0.99) == pytest.approx(0.99 * STATIC)
    assert go(1.01) == pytest.approx(KINETIC)
    for way in (1.1, 1.5, 3.0):
        assert go(way) == pytest.approx(KINETIC)
    assert go(2.9) == pytest.approx(KINETIC - 0.1 * STATIC)
    assert go(3.3) == pytest.approx(KINETIC + 0.3 * STATIC)
    assert go(3.5) == pytest.approx(KINETIC)
    # Trapezoids of the force of each step, also of the one in which it drops.
    assert abs(m.balance()) < 1e-9


def test_friction_work_across_many_facets():
    """A ball over a block, along a bend: μ ∫ N ds within half a per cent, none of it lost.

    Nodes of either side enter and leave at no pressure, and slip over edges and corners.
    """
    direction = -UP @ rotation_of(np.array([0.0, 0.0, 0.2]))
    ball = half_ball(SIZE, 0.03 * SIZE, 0.3, tuple(direction), height=0.3 * SIZE)
    m = Mover(True, STATIC, body=(ball[0] @ FRAME.T + SIZE * (1 + 1e-4) * E3 + CENTRE, ball[1]))
    for k in range(20):
        m.go(-4e-3 * SIZE * (k + 1) / 20 * UP)
    start, rubbed, residual = m.place, m.contact.dissipation.total, m.residual()
    num_steps, step = 4000, 1e-4 * SIZE
    angle, place, expected, crossed, facet = 0.3, np.zeros(2), 0.0, 0, None
    normal = (FRAME @ m.force)[2]
    for k in range(num_steps):
        angle += 3.0 / num_steps * np.sin(2 * np.pi * k / num_steps)
        place += step * np.array([np.cos(angle), np.sin(angle)])
        along, across, up = m.go(start + place[0] * ALONG + place[1] * ACROSS)
        expected += STATIC * 0.5 * (normal + up) * step
        normal = up
        p = m.contact.pairs
        now = dict(zip(p.node[p.closed], p.candidate[p.closest[p.closed]], strict=True))
        crossed += 0 if facet is None else sum(facet.get(n, f) != f for n, f in now.items())
        facet = now
    assert crossed > 100
    assert np.hypot(along, across) == pytest.approx(STATIC * normal, rel=5e-3)
    assert m.contact.dissipation.total - rubbed == pytest.approx(expected, rel=5e-3)
    # Springs gain 0.09 of their energy where points pass to other facets: all of it is in the
    # account, up to the second order. Four times the step leaves 1.6e-6.
    assert m.contact.dissipation.switched < -0.05 * m.contact.energy()[0]
    assert abs(m.residual() - residual) < 1e-6 * m.contact.energy()[0]


@pytest.mark.parametrize("friction", [0.0, STATIC])
def test_energy_of_points_that_come_under_an_edge_or_leave_it_is_in_the_account(friction):
    """Whatever the step: a seventh of the stored energy goes, and the rest is work."""
    side, gap = 0.3 * SIZE, 1e-5 * SIZE
    accounts = []
    for num_steps in (20, 200):
        block = box((side, side, side), (3, 3, 3), (0.31 * SIZE, 0.33 * SIZE, gap))
        m = Mover(True, friction, body=block)
        for k in range(4):
            m.go(-(gap + 5e-4 * SIZE * (k + 1) / 4) * UP)
        start, residual = m.place, m.residual()
        for k in range(num_steps):
            way = 0.2 * SIZE * (k + 1) / num_steps
            m.go(start + way * (0.8 * ALONG + 0.6 * ACROSS))
        stored = m.contact.energy()[0]
        accounts.append(m.contact.dissipation.switched / stored)
        # Rounding of sums of thousands of pairs.
        assert abs(m.residual() - residual) < 1e-10 * stored
    assert accounts[0] == pytest.approx(accounts[1], rel=1e-9) and abs(accounts[0]) > 0.1


def test_kinetic_friction_above_the_static_is_refused():
    with pytest.raises(InputError, match="kinetic friction of wall low"):
        Wall("low", np.zeros(3), UP, 0.5, friction_kinetic=0.6)
    with pytest.raises(InputError, match=r"friction = -0\.1"):
        Mover(True, -0.1)
