"""Age of contacts: since when each has been active, as far as stored states tell."""

import numpy as np


def active_since(states):
    """First state of the unbroken row of states in which a contact has been active.

    Args:
        states: For each state in order of time, its active contacts as pairs of whole numbers that
            name both bodies, in an order that does not change, int, shape (num_contacts, 2).

    Returns:
        For each state, positions in ``states``, int, shape (num_contacts,). A contact of the first
        state may be older than that.
    """
    if not states:
        return []
    sizes = [len(pairs) for pairs in states]
    pairs = np.concatenate([np.reshape(pairs, (-1, 2)) for pairs in states]).astype(np.int64)
    _, names = np.unique(pairs, axis=0, return_inverse=True)
    since, last = np.zeros((2, names.max(initial=-1) + 1), dtype=np.int64)
    last[:] = -2  # never
    found = []
    for k, name in enumerate(np.split(names.reshape(-1), np.cumsum(sizes)[:-1])):
        begun = name[last[name] != k - 1]
        since[begun] = k
        last[name] = k
        found.append(since[name])
    return found
