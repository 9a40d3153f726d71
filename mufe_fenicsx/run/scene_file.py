"""The scene file of a test, for all ranks."""

from ..machine.ranks import on_first_rank
from ..scene import load_scene


def read_scene(comm, path, changes=None):
    """The scene in the file ``path``, read by rank 0 alone. Collective.

    Args:
        comm: MPI communicator.
        path, changes: As of `load_scene`.

    Raises:
        InputError: The file cannot be read, or holds what a scene must not.
    """
    return comm.bcast(on_first_rank(comm, lambda: load_scene(path, changes)))
