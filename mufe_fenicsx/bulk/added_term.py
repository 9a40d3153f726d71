"""Force terms of a user's own, tried before they act: whatever they raise is named as theirs."""

import time
import traceback

import numpy as np
from mpi4py import MPI

from ..errors import InputError, finite_array

#: So long a rank whose term failed waits for the others to fail as well [s].
PATIENCE = 10.0
FAILED = 97  # tag of the messages by which they say so


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


def name_failure(term, comm, error):
    """Name a term of a user's own as the place of an error, which its caller raises then.

    Where it fails on some ranks alone, the others would wait for these for ever: all end.
    """
    error.add_note(words_of_failure(term, error))
    if not _all_fail(comm):
        traceback.print_exception(error)
        comm.Abort(1)


def _all_fail(comm):
    """Whether the other ranks come here too, before long.

    By messages: collective calls would meet those that the others wait in.
    """
    others = set(range(comm.size)) - {comm.rank}
    for rank in others:
        comm.isend(None, dest=rank, tag=FAILED)
    end = time.monotonic() + PATIENCE
    while others and time.monotonic() < end:
        status = MPI.Status()
        if comm.iprobe(tag=FAILED, status=status):
            comm.recv(source=status.source, tag=FAILED)
            others.discard(status.source)
        time.sleep(1e-3)
    return not others


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
