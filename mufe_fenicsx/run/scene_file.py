"""The scene file of a test, for all ranks."""

from ..machine.ranks import on_first_rank
from ..scene import load_scene


def read_scene(comm, path, changes=None):
    """The scene in the file ``path``, read by rank 0 alone. Collective.

    Args:
        comm: MPI communicator.
        path, changes: As of `load_scene`.

    Raises:
        InputError: The file cannot be read, or holds what a scene must not, or names measured
            curves that cannot be read.
    """
    return comm.bcast(on_first_rank(comm, lambda: _read(path, changes)))


def _read(path, changes):
    """The scene; curves that it names are read, so that a report does not fail over them."""
    scene = load_scene(path, changes)
    for reference in scene.references:
        from ..results.reference_curves import read_reference  # only where there are some

        read_reference(reference)
    return scene
