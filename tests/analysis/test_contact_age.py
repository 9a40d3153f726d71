"""Age of contacts: states that are written down, with the answer in sight."""

import numpy as np

from mufe_fenicsx.analysis.contact_age import active_since


def test_a_contact_that_opens_begins_anew():
    states = [
        [(1, 2), (2, 3), (4, -1)],
        [(2, 3), (1, 2), (5, 6)],
        [(5, 6), (2, 3)],
        [],
        [(5, 6)],
        [(1, 2), (5, 6)],
    ]
    found = active_since([np.array(pairs) for pairs in states])
    assert [one.tolist() for one in found] == [[0, 0, 0], [0, 0, 1], [1, 0], [], [4], [5, 4]]


def test_nothing_has_no_age():
    assert active_since([]) == []
    assert [one.size for one in active_since([np.empty((0, 2)), np.empty((0, 2))])] == [0, 0]
