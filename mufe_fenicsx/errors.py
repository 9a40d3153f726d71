"""The two ways in which a run ends early."""


class InputError(ValueError):
    """Something the user gave cannot be used.

    The message is one line: the quantity, its value, what was expected.
    """


class SolverError(RuntimeError):
    """A computation went wrong while running: what happened and what to change."""
