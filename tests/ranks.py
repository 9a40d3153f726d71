"""What the first rank of a test does alone."""


def on_first(comm, action):
    """What ``action()`` gives on rank 0, on all ranks; where it fails there, all fail. Collective.

    Else the other ranks would wait for rank 0 in the next collective call.
    """
    found, failure = None, None
    if comm.rank == 0:
        try:
            found = action()
        except Exception as error:
            failure = f"{type(error).__name__} on rank 0: {error}"
    found, failure = comm.bcast((found, failure))
    assert failure is None, failure
    return found
