"""What one rank does for all."""

from ..errors import InputError, raise_together


def on_first_rank(comm, action):
    """Do something on rank 0 that may raise an InputError, which all ranks raise then. Collective.

    Returns:
        What it returned, on rank 0.
    """
    found, message = None, None
    if comm.rank == 0:
        try:
            found = action()
        except (InputError, OSError) as error:
            message = str(error)
    raise_together(comm, message)
    return found
