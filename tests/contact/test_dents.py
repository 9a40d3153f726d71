"""Dents: bodies that yield under a contact smaller than an element."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.surface.bulges import XI
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.kernels.contact_law import over_stiffness
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.run.from_bodies import simulate
from tests.bodies import RADIUS, packed_spheres

COMM = MPI.COMM_WORLD
#: Largest pressure under a flat round punch over the yield stress (Shield 1955), and the strain
#: that stands for a round contact over its radius over that of the body (Tabor 1951).
PUNCH, TABOR = 3.6, 0.2
Y = 1e6
PERFECT, HARDENING = ((0.0, Y),), ((0.0, Y), (0.05, 4 * Y))


def pressed(axis, tables, comm=COMM, speed=0.4, **options):
    """Three balls along x between two planes across ``axis``, which come in.

    Along x and y a ball ends in a facet, along z in a node.
    """
    mesh = packed_spheres(comm, (3, 1, 1))
    along = np.eye(3)[axis]
    size = 6 * RADIUS if axis == 0 else 2 * RADIUS
    walls = [
        Wall(name, place * along, side * along, velocity=side * speed * along)
        for name, place, side in (("low", 0.0, 1.0), ("top", size, -1.0))
    ]
    materials = [J2(1e9, 0.15, 2650.0, tables[g % len(tables)]) for g in mesh.grains]
    return simulate(mesh, materials, walls, damping=5e4, **options)


def run(s, duration):
    end = s.state.t + duration
    while s.state.t < end:
        s.step()


def yield_stress(strain, table):
    return np.interp(strain, *np.transpose(table))


def largest(softer):
    """Largest dent h²/4R, where m = XI h²/R."""
    return softer / (4 * XI)


def limit(dent, softer, facet_area, table):
    """Pressure at which a dent deepens: its circle has the radius √(2 R b)."""
    h = np.sqrt(4 / np.sqrt(3) * facet_area)
    return PUNCH * yield_stress(TABOR * np.sqrt(8 * dent * largest(softer)) / h, table)


@pytest.mark.mpi
@pytest.mark.parametrize("table", [PERFECT, HARDENING])
def test_points_on_walls_carry_what_their_dents_bear(table):
    """Never more, and just that while a dent deepens; what it takes is plastic work."""
    s = pressed(1, [table])
    run(s, 1.5e-4)
    p, points = s.walls.pairs, s.contact.points
    area = points.area[p.node]
    bears = area * limit(p.dent, p.softer, points.facet_area[p.node], table)
    dented = p.dent > 0
    assert COMM.allreduce(np.count_nonzero(dented)) >= 4
    assert (p.dent <= largest(p.softer)).all() and p.dent.max(initial=1e-3) > 1e-4 * RADIUS
    # Where friction is none; tolerance: of the false position, 1e-14, times rounding of areas.
    assert (p.normal_force[dented] <= bears[dented] * (1 + 1e-9)).all()
    loading = dented & p.closed & (p.normal_force > 0.999999 * bears)
    assert COMM.allreduce(np.count_nonzero(loading)) >= 4
    e = s.energies()
    assert abs(e["residual"]) < 1e-3 * e["work"]
    # Plastic work of dents: the force while they deepened, in closed form without hardening.
    taken = COMM.allreduce(s.contact.dissipation.flowed)
    assert taken > 0.05 * e["work"]
    if table is PERFECT:  # a dent begins within a step, of 1 % of it
        assert taken == pytest.approx(COMM.allreduce(bears @ p.dent), rel=0.01)


@pytest.mark.mpi
def test_unloading_is_elastic_and_a_dent_remains():
    """Dents do not heal, and forces are those of the law over the dented surface."""
    s = pressed(1, [PERFECT])
    run(s, 1.5e-4)
    s.walls.velocity[:] *= -0.05
    run(s, 6e-6)  # until what moved in has turned round
    p = s.walls.pairs
    dent, force = p.dent.copy(), p.normal_force.copy()
    run(s, 5e-6)
    assert s.walls.pairs is p
    assert (p.dent >= dent).all()
    on = p.closed & (dent > 0)
    assert COMM.allreduce(np.count_nonzero(on)) >= 4
    assert COMM.allreduce(p.normal_force.sum()) < 0.9 * COMM.allreduce(force.sum())
    depth = p.offset - p.gap
    law = zip(p.stiffness, depth, p.softer, strict=True)
    elastic = np.array([k * over_stiffness(d, m) for k, d, m in law])
    np.testing.assert_allclose(p.normal_force[on], elastic[on], rtol=1e-12)


def of_points(s):
    """Dents of the points on walls; no point meets both here."""
    return np.bincount(s.walls.pairs.node, s.walls.pairs.dent, s.contact.points.num_points)


@pytest.mark.mpi
def test_reloading_meets_the_dent():
    """Static increments down, a little back and down; tolerance: the bulk flows on by as much."""
    s = pressed(1, [PERFECT], speed=0.06 * RADIUS, increment=1.0, tolerance=1e-9)
    s.step()
    dent, forces, work = of_points(s), s.wall_forces(), s.energies()["plastic"]
    s.walls.velocity[:] *= -0.005
    s.step()
    assert s.wall_forces().min() < 0.8 * forces.min()
    s.walls.velocity[:] *= -1.0
    s.step()
    assert COMM.allreduce(dent.max(initial=0.0), op=MPI.MAX) > 1e-4 * RADIUS
    np.testing.assert_allclose(of_points(s), dent, rtol=1e-3)
    np.testing.assert_allclose(s.wall_forces(), forces, rtol=1e-3)
    assert s.energies()["plastic"] == pytest.approx(work, rel=1e-3)


@pytest.mark.mpi
def test_between_grains_the_weaker_one_yields():
    """Both surfaces carry points, which bear what the weaker body does on their shares."""
    s = pressed(0, [PERFECT, ((0.0, 3 * Y),)])
    run(s, 2.6e-4)
    p = s.contact.pairs
    at = np.flatnonzero(p.closed & (p.dent > 0))
    bears = s.contact.areas(at) * PUNCH * Y
    # Along the gap; tolerance: yield depths are of single precision.
    force = p.normal_force[at] * np.einsum("pi,pi->p", p.facing[at], p.normal[at])
    assert (force <= (1 + 1e-6) * bears).all()
    assert COMM.allreduce(np.count_nonzero(force > 0.999 * bears)) >= 2
    assert (p.dent[at] <= 1.000001 * largest(p.softer[at])).all()
    e = s.energies()
    assert abs(e["residual"]) < 1e-3 * e["work"]


@pytest.mark.mpi
@pytest.mark.parametrize("axis", [0, 1])
def test_all_ranks_and_one_find_the_same(axis):
    """Tolerance: sums in another order, over some hundred steps."""
    found = []
    for comm in (COMM, MPI.COMM_SELF):
        s = pressed(axis, [HARDENING], comm=comm)
        run(s, 1.5e-4)
        found.append([*s.wall_forces(), comm.allreduce(s.contact.dissipation.flowed)])
    assert found[0][-1] > 0.0
    np.testing.assert_allclose(found[0], found[1], rtol=1e-8)
