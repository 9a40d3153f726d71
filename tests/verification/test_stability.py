"""Sharp ones of the limits of the stability map, and that the program notices what is beyond."""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import math

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.laws import COMPLIANCE
from mufe_fenicsx.theory import stability as theory
from mufe_fenicsx.verification.pressed import AXIS, FRAME, Body, Pressed
from mufe_fenicsx.verification.stability import (
    close_contacts,
    edge,
    friction,
    inversion,
    newton,
    resting,
    sleeve,
    slivers,
    time_step,
    tunnelling,
    unequal,
)
from mufe_fenicsx.verification.stability.limits import (
    Snapshot,
    bisect,
    free_block,
    growth,
    highest_frequency,
    pressed_block,
)

COMM = MPI.COMM_SELF


@pytest.mark.parametrize("body", [free_block, pressed_block])
def test_central_differences_are_stable_up_to_two_over_omega(body):
    """A cube of plain tetrahedra, free and stuck between platens by its contact springs."""
    s = body(COMM)
    exact = 2.0 / highest_frequency(s, springs=body is pressed_block)
    start = Snapshot(s)
    measured = bisect(lambda factor: growth(s, start, factor * exact)[1], 0.5, 1.5, 9)
    # Bisection to 0.1 %; noise needs 1e-4 beyond the limit to grow in 600 steps.
    assert measured == pytest.approx(1.0, abs=0.02)
    # A linear system, but others of its modes grow nearly as fast, and noise begins with all.
    assert growth(s, start, 1.2 * exact)[0] == pytest.approx(theory.growth_per_step(2.4), rel=0.03)


def test_a_tip_that_meets_a_spring_leaves_it_as_the_discrete_mass_does():
    """At (ω Δt)² = 1 with its speed, at 1.5 up to a quarter faster, beyond 2 without bound."""
    omega_dt = np.sqrt([1.0, 1.5, 2.5])
    speed, _ = time_step.rebounds(COMM, omega_dt, 8)
    expected = theory.rebound_speed(omega_dt[:, None], (1 + np.arange(8)) / 8)
    # The tetrahedron behind the tip pulls by √(compliance), 0.3 %, in each of some steps.
    np.testing.assert_allclose(speed, expected, atol=0.02)
    assert expected.max(axis=1) == pytest.approx([1.0, 1.25, 1.5])


def test_a_flat_element_costs_the_root_of_its_altitude():
    rows, _ = slivers.sliver_map(COMM, (1e-4, 1e-2), trials=8)
    for row in rows:
        assert row.measured == pytest.approx(row.exact, rel=0.02)
        # What the elements around add falls with the root of the altitude.
        assert row.exact == pytest.approx(row.theory, rel=0.02 + math.sqrt(row.part))
    assert rows[0].element / rows[1].element == pytest.approx(0.01, rel=0.02)


def test_a_mesh_with_a_flat_or_turned_element_is_refused():
    said = slivers.messages(COMM)
    assert "grain 1" in said["no volume"] and "mesh that grain anew" in said["no volume"]
    assert "lie inside out or in each other" in said["tangled"]


def test_bodies_that_pass_through_each_other_are_noticed():
    """Two bars at 1.6 times the speed of waves; at a tenth of it they bounce, unnoticed."""
    fast = tunnelling.meet(COMM, 1.6, (2, 2, 6))
    assert "contact no longer keeps them apart" in fast.message
    slow = tunnelling.meet(COMM, 0.1, (2, 2, 6))
    # Nodes of a plane of tetrahedra differ in mass: 0.03 more is left in vibrations, and 0.013 with
    # half the edges.
    expected = rebound_of_chains(0.1, 6, 0.5, slow.simulation.contact.edge / tunnelling.SIZE)
    assert not slow.message and slow.after == pytest.approx(expected, abs=0.04)
    assert expected == pytest.approx(-0.967, abs=1e-3)  # 3 % are left behind the front


def rebound_of_chains(speed, num, h, edge):
    """Speed afterwards over that before of two chains of masses that meet; E, ρ and c are 1."""
    mass = np.full(num + 1, h)
    mass[[0, -1]] *= 0.5
    u, v, gap, dt, t = np.zeros(num + 1), np.full(num + 1, 0.5 * speed), 1e-3, 0.02 * h, 0.0
    layer = 2 * COMPLIANCE * edge / tunnelling.MATERIAL.contact_modulus * tunnelling.E
    while t < gap / speed + 2.5 * num * h:
        p = theory.uniaxial_strain(1.0 + np.diff(u) / h)
        v[1:] += dt * p / mass[1:]
        v[:-1] -= dt * p / mass[:-1]
        v[-1] -= dt * max(2 * u[-1] - gap, 0.0) / layer / mass[-1]
        u += dt * v
        t += dt
    return mass @ v / mass.sum() / (0.5 * speed)


@pytest.mark.parametrize("compliance", [pytest.param(0.25, marks=pytest.mark.slow), 1.0])
def test_bars_between_mirrors_sink_into_each_other_where_fronts_outdo_the_layers(compliance):
    """Plane waves: 5 % to both sides of the speed at which they are half an edge deep."""
    speed = tunnelling.stops_theory(compliance)
    long = {"divisions": tunnelling.LONG, "compliance": compliance, "travel": 1.9}
    assert not tunnelling.meet(COMM, 0.95 * speed, **long).message
    assert (
        "contact no longer keeps them apart" in tunnelling.meet(COMM, 1.05 * speed, **long).message
    )


def test_a_grain_swallowed_by_a_far_larger_neighbour_is_noticed():
    """7 % to both sides of the ratio at which its corners are half of their edges deep."""
    ratio = unequal.limit_theory(COMM, 1e-2)
    assert "deep in grain 1" in unequal.press(COMM, 1.07 * ratio, 1e-2).message
    assert not unequal.press(COMM, 0.93 * ratio, 1e-2).message


@pytest.mark.slow
def test_a_sliding_block_flutters_at_the_rate_of_its_eigenvalues():
    """Stick springs across the slip relax: without that the rate would be 4 % higher."""
    (row,), _ = friction.flutter(COMM, (0.25,))
    # The state about which it flutters still changes by 1e-4.
    assert row.drag == pytest.approx(0.25, rel=1e-5)
    assert row.measured == pytest.approx(row.theory, rel=0.01)


def test_static_increments_slide_at_a_friction_of_2():
    """Drag = μ N once all of the face slides, which a cube would not; no increment is cut."""
    s = friction.sliding_statically(COMM, 2.0)
    forces = s.walls.force[0]
    # Nodes that slip aslant still turn: 5e-7.
    assert forces[0] == pytest.approx(2.0 * forces[2], rel=1e-5) and forces[2] < 0
    assert len(s.report) == 21


@pytest.mark.slow
def test_a_packing_at_rest_stays_at_rest():
    """Energies and forces wander by rounding: less than ε a step, and some ε E h per wall."""
    found = resting.rest(COMM, 1000, 10)
    assert found.num_contacts > 20 and found.change_of_contacts == 0
    assert np.abs(found.energy).max() < 1000 * resting.EPS
    assert found.force.max() < 1e-8 and found.kinetic.max() < 1e-16


@pytest.mark.slow
def test_a_strut_locks_where_theory_says():
    """Static increments: it slips below the critical friction and sticks for good above."""
    critical = newton.Strut(COMM, 0.3, -1.0).critical
    below = newton.Strut(COMM, 0.9 * critical, -1.0).draw(way=300.0)
    above = newton.Strut(COMM, 1.1 * critical, -1.0).draw(way=300.0)
    assert below.sliding and not above.sliding
    # Strains of 1e-3 beside linear elasticity, times the 10 of the pole.
    assert below.normal == pytest.approx(below.theory, rel=0.05)


@pytest.mark.slow
def test_a_soft_tetrahedron_inverts_where_its_motion_has_the_energy_of_its_volume():
    (row,), _ = inversion.inversion_map(COMM, (0.3,), trials=5)
    # Bisection to 3 %, flow of a yield stress of 1e-6 E.
    assert row.measured == pytest.approx(row.theory, rel=0.05)


@pytest.mark.slow
def test_a_sleeve_becomes_oval_at_the_pressure_of_a_thin_ring():
    """By meshes whose edges halve; by one layer of a scene's edges, 4.6 times as late."""
    coarse, fine = (sleeve.buckling(COMM, *mesh)[0] for mesh in ((1, 2.0), (2, 1.0)))
    # (t/R)² is 1 %; the next two meshes extrapolate to 1.7 % more.
    assert sleeve.extrapolated(coarse, fine) == pytest.approx(1.0, abs=0.03)
    assert coarse.limit == pytest.approx(4.6, rel=0.02)


@pytest.mark.slow
def test_a_light_sleeve_sets_the_step_of_the_program():
    """With the root of its density, below that at which both bodies allow the same step."""
    density = sleeve.density_theory(COMM)
    light, just, latex = sleeve.steps_over_density(COMM, [0.25 * density, 1.01 * density, 950.0])
    # The estimate is within 1e-3 of 2/ω.
    assert light / latex == pytest.approx(0.5, rel=5e-3) and just == pytest.approx(latex, rel=5e-3)
    assert sleeve.density_limit(COMM, 5) == pytest.approx(density, rel=0.03)  # five bisections


def test_the_force_of_three_contacts_is_that_of_hertz_and_boussinesq():
    """At the approach 1 with E* = R = 1: what Hertz leaves is 2 P/(π s)."""
    s, alone = 3.0, 4 / 3
    force = alone * theory.force_of_three(s)
    assert (0.75 * force) ** (2 / 3) + 2 * force / (math.pi * s) == pytest.approx(1.0, abs=1e-12)
    # With its share of the motion the force is 5 % larger, as asked for.
    share = theory.apart_for(0.05, s, 1.0)
    larger = theory.force_of_three(s, share) / theory.force_of_three(s)
    assert larger == pytest.approx(1.05, abs=1e-12)
    assert theory.force_by_edge(theory.from_edge_for(0.05)) == pytest.approx(0.95, abs=1e-12)


def test_uneven_gaps_scatter_forces_as_independent_points_do():
    """Σ w g of points with random gaps g of 1 and the weights w of Hertz's pressure."""
    n, rng = 3.0, np.random.default_rng(1)
    count = round(8 * np.pi / math.sqrt(3) * n**2)  # of facets with the edge 1/n on both sides
    weight = np.sqrt(1 - (np.arange(count) + 0.5) / count)  # even in r²
    weight /= weight.sum()
    sums = rng.standard_normal((20000, count)) @ weight
    # An unevenness n² s of gaps that are 1 deep is s.
    found = theory.scatter_of_rough_force(n**2, n, 1.0)
    assert found == pytest.approx(1.5 * sums.std(), rel=0.02)  # 4 of 1/√(2 × 20000)
    limit = theory.conformity_for(0.05, 0.01, n)
    assert theory.scatter_of_rough_force(0.01, n, limit) == pytest.approx(0.05, rel=1e-12)


def share_of_forces_at_points(h):
    """What :func:`close_contacts.share_of_interplay` finds, of the mesh under the tips alone."""
    body = Body(*close_contacts.under(h), 60 * close_contacts.A, close_contacts.SOFT)
    s = Pressed(COMM, [body]).simulation
    facets = s.contact.own.nodes[s.contact.own.facets]
    places = (s.mesh.x @ FRAME)[facets]
    facets, places = (a[np.abs(places[..., 2]).max(axis=1) < 1e-9] for a in (facets, places))
    places[..., 2] = 1.0
    loads = np.zeros((3, len(s.mesh.x)))
    for load, corner in zip(loads, close_contacts.corners(), strict=True):
        weights = np.linalg.solve(places.swapaxes(1, 2), np.append(corner, 1.0)[:, None])[..., 0]
        within = weights.min(axis=1).argmax()
        load[facets[within]] = weights[within]
    moved = np.array([loads @ (s.response(load[:, None] * AXIS) @ AXIS) for load in loads])
    modulus = close_contacts.SOFT.contact_modulus
    law = 1 / (math.pi * modulus * close_contacts.APART * close_contacts.A)
    return (moved.sum() - moved.trace()) / 6 / law


@pytest.mark.slow
def test_contacts_on_one_facet_move_each_other_less_than_those_of_several():
    """Tips 0.3 and 2 edges apart; on one facet they share what its nodes yield."""
    (near, h), (far, _) = (
        (close_contacts.share_of_interplay(COMM, h, np.zeros(2))[0], h)
        for h in close_contacts.APART * close_contacts.A / np.array([0.3, 2.0])
    )
    # Tips press on discs as wide as a third of their distance, not on points.
    assert near == pytest.approx(share_of_forces_at_points(h), abs=0.05)
    # Places on the mesh scatter by 0.025.
    assert far == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_an_edge_takes_half_of_a_contact_from_coarse_meshes_too():
    fine, coarse = (edge.forces(COMM, 0.0, n)[0][0] for n in (2.5, 1.0))
    within = edge.forces(COMM, edge.WITHIN, 2.5)[0][0]
    # Half of the pressure is missing, and the approach of the other half is less: 0.548, recorded
    # with 4 elements per radius. Meshes of 2.5 scatter by 0.4 %, and each is within 2 %.
    assert fine / within == pytest.approx(0.548, rel=0.02)
    assert coarse == pytest.approx(fine, rel=0.05)
