"""Forces of contacts of known networks."""

import numpy as np
import pytest

from mufe_fenicsx.analysis import contact_forces as forces
from mufe_fenicsx.errors import InputError

ROUND_OFF = 1e-12


def test_distribution_of_exponential_forces():
    """Quantiles of P(x) = exp(-x): each bin holds its share, to one force in 20 000."""
    n = 20000
    f = -7.0 * np.log(1 - (np.arange(n) + 0.5) / n)
    found = forces.force_distribution(f, 10, largest=3.0)
    share = -np.diff(np.exp(-found.edges))
    width = np.diff(found.edges)
    # The mean of these quantiles is short of 7 by less than 7/n.
    assert found.mean == pytest.approx(7, rel=1e-4)
    assert np.abs(found.density * width - share).max() < 2e-4
    whole = forces.force_distribution(f, 10)
    assert whole.edges[-1] == f.max() / found.mean and whole.count.sum() == n
    assert whole.density @ np.diff(whole.edges) == pytest.approx(1, rel=ROUND_OFF)
    none = forces.force_distribution([], 5)
    assert np.isnan(none.mean) and none.edges.size == 6 and np.isnan(none.density).sum() == 5


def test_mobilised_friction():
    force = np.array([[0.0, 0.2, 1.0], [0.1, 0.0, 2.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    friction = force * [1, 1, 0]
    found = forces.mobilised_friction(force, friction, 0.2)
    assert found[:3] == pytest.approx([1.0, 0.25, 0.0], rel=ROUND_OFF)
    assert np.isnan(found[3])
    assert forces.sliding_fraction(found) == pytest.approx(1 / 3)
    assert np.isnan(forces.sliding_fraction(forces.mobilised_friction(force, friction, 0.0)))


def test_active_contacts_of_a_chain_with_a_rattler():
    count = forces.active_contacts([0, 1, 2], [1, 2, 3], 5)
    assert count.tolist() == [1, 2, 2, 1, 0]
    assert forces.mechanical_coordination(count) == 2.0
    assert np.isnan(forces.mechanical_coordination([0, 1]))


def test_stress_of_a_ball_from_its_contacts():
    """Squeezed by ±F at its poles: σ = 2 F R / V; a wall on the one side, a grain on the other."""
    F, R, V = 3.0, 0.5, 0.7
    centre = np.array([[0.0, 0.0, R], [0.0, 0.0, 3 * R]])
    found = forces.contact_stress_of_grains(
        np.array([0, 0]), np.array([-1, 1]),
        np.array([[0, 0, F], [0, 0, -F]]), np.array([[0, 0, 0.0], [0, 0, 2 * R]]),
        centre, np.array([V, V]),
    )  # fmt: skip
    assert found[0] == pytest.approx(np.diag([0, 0, 2 * F * R / V]), abs=ROUND_OFF)
    assert found[1] == pytest.approx(np.diag([0, 0, F * R / V]), abs=ROUND_OFF)


def column(num, x=0.0):
    """Centres of balls of 0.2 mm on top of each other, x in diameters."""
    return 2e-4 * np.column_stack([np.full(num, x), np.zeros(num), np.arange(num)])


def test_a_loaded_column_is_a_force_chain():
    """Five loaded balls in a column; a loaded pair, and a weak ball beside each, are none."""
    centre = np.concatenate([column(5), column(2, 5.0), column(5, 1.0)])
    stress = np.zeros((12, 3, 3))
    stress[:7, 2, 2], stress[7:, 2, 2] = 10.0, 0.1
    first = np.array([0, 1, 2, 3, 5, 0, 1, 2, 3, 4])
    second = np.array([1, 2, 3, 4, 6, 7, 8, 9, 10, 11])
    found = forces.force_chains(stress, centre, first, second)
    assert found.num_chains == 1
    assert found.chain.tolist() == [0] * 5 + [-1] * 7
    assert found.links.tolist() == [True] * 4 + [False] * 6
    assert found.major[:7] == pytest.approx(10) and np.abs(found.direction[:7, 2]).min() == 1
    # What counts is the force: across the line between centres none is passed on.
    across = np.tile([1.0, 0.0, 0.0], (10, 1))
    assert forces.force_chains(stress, centre, first, second, force=across).num_chains == 0
    with pytest.raises(InputError, match="angle of force chains"):
        forces.force_chains(stress, centre, first, second, angle=0)


@pytest.mark.parametrize(("tilt", "chains"), [(44.0, 2), (46.0, 0)])
def test_chains_end_where_stress_turns_away(tilt, chains):
    """Two columns whose stress is tilted against the line of centres by less, and more, than 45°.

    And the middle ball of a third has its stress across: both halves are too short.
    """
    centre = np.concatenate([column(4), column(3, 5.0), column(5, 9.0), column(9, 20.0)])
    c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    stress = np.zeros((21, 3, 3))
    stress[:12] = 5.0 * np.outer([s, 0, c], [s, 0, c])
    stress[9] = np.diag([5.0, 0, 0])
    links = np.array([0, 1, 2, 4, 5, 7, 8, 9, 10, *range(12, 20)])
    found = forces.force_chains(stress, centre, links, links + 1)
    assert found.num_chains == chains
    wanted = [0] * 4 + [1] * 3 + [-1] * 14 if chains else [-1] * 21
    assert found.chain.tolist() == wanted
