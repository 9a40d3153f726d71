"""Force terms of a user's own, tried before they act: whatever they raise is named as theirs."""

import numpy as np

from ..errors import InputError, finite_array


def try_term(term, state):
    """Forces [N], shape (num_nodes, 3), and energy [J], nan for none, of a term as of now. Local.

    Raises:
        InputError: It fails; its forces or energy are not finite; its stiffness names nodes that
            there are not.
    """
    forces = np.zeros_like(state.x)
    try:
        term.add_forces(forces, state, 0.0)
        energy = term.energy(state)
        energy = np.nan if energy is None else float(finite_array("energy", energy, ()))
        _check_stiffness(term.stiffness(state), len(state.x))
    except Exception as error:  # whatever a user's own code raises
        raise InputError(words_of_failure(term, error)) from error
    if not np.isfinite(forces).all():
        raise InputError(f"force term {term.name} adds forces that are not finite")
    return forces, energy


def words_of_failure(term, error):
    """The line that names a force term as the place of an error."""
    said = error if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
    return (
        f"force term {term.name} ({type(term).__name__}) fails: {' '.join(str(said).split())}, "
        "expected forces, energy and stiffness at the nodes of the simulation"
    )


def _check_stiffness(given, num_nodes):
    """Raise InputError unless the stiffness of a term names nodes that there are."""
    if given is None:
        return
    rows, columns, blocks = (np.asarray(part) for part in given)
    for nodes in (rows, columns):
        inside = not nodes.size or (
            nodes.dtype.kind in "iu" and 0 <= nodes.min() and nodes.max() < num_nodes
        )
        if nodes.ndim != 1 or not inside or blocks.shape != (len(nodes), 3, 3):
            raise InputError(
                f"nodes of its stiffness of shape {nodes.shape} with blocks {blocks.shape}, "
                f"expected numbers below {num_nodes} and a block (3, 3) for each"
            )
