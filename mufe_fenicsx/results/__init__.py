"""A run folder as arrays and tables, for analyses of one's own."""

from .run import Run
from .state import State

__all__ = ["Run", "State"]
