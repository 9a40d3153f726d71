"""Cases with a known answer; tests and `mufe verify` call these same functions."""

from .cases import CASES, run_cases

__all__ = ["CASES", "run_cases"]
