"""Options of PETSc that a scene may state: types of solvers, tolerances, and what they are made of.

PETSc has options that write files, load libraries and run code, for every object it knows. A scene
is data, so it has those of :data:`OPTIONS` alone, with the values given there; so has the command
line of PETSc, the variable PETSC_OPTIONS, unless it says ``-mufe_trust``.
"""

import math
import re
import shlex
from dataclasses import dataclass

from ..errors import InputError, shown

#: On the command line of PETSc: whoever wrote it takes any option.
TRUST = "trust"


@dataclass(frozen=True)
class Number:
    """A number between two bounds, which are allowed too."""

    low: float
    high: float
    whole: bool = False

    def allows(self, text):
        """Whether a text is such a number."""
        try:
            value = int(text) if self.whole else float(text)
        except (TypeError, ValueError):
            return False
        return math.isfinite(value) and self.low <= value <= self.high

    def __str__(self):
        return f"a {'whole ' if self.whole else ''}number from {self.low:g} to {self.high:g}"


@dataclass(frozen=True)
class OneOf:
    """One of some words."""

    words: tuple[str, ...]

    def allows(self, text):
        """Whether a text is one of them."""
        return text in self.words

    def __str__(self):
        return " or ".join(self.words)


@dataclass(frozen=True)
class Switch:
    """Nothing, or yes or no."""

    def allows(self, text):
        """Whether a text is that."""
        return text in (None, "true", "false", "1", "0", "yes", "no")

    def __str__(self):
        return "nothing, true or false"


@dataclass(frozen=True)
class Alone:
    """No value: what would follow is the name of a file."""

    def allows(self, text):
        """Whether there is none."""
        return text is None

    def __str__(self):
        return "no value"


def _whole(low, high):
    return Number(low, high, whole=True)


def _one_of(words):
    return OneOf(tuple(words.split()))


#: Name without the prefix -> values. Each may stand behind :data:`LEVELS`.
OPTIONS = {
    "ksp_type": _one_of(
        "preonly richardson chebyshev cg fcg minres gmres fgmres lgmres bcgs bcgsl fbcgs tfqmr gcr"
    ),
    "ksp_rtol": Number(1e-16, 0.99),
    "ksp_atol": Number(0.0, 1e30),
    "ksp_divtol": Number(1.0, 1e30),
    "ksp_max_it": _whole(1, 1_000_000),
    "ksp_gmres_restart": _whole(1, 1000),
    "ksp_norm_type": _one_of("none preconditioned unpreconditioned natural"),
    "ksp_pc_side": _one_of("left right symmetric"),
    "ksp_monitor": Alone(),
    "ksp_converged_reason": Alone(),
    "mat_type": _one_of("aij baij"),
    "mat_mumps_icntl_14": _whole(0, 1000),
    "pc_type": _one_of(
        "none jacobi pbjacobi bjacobi asm sor eisenstat ilu icc lu cholesky gamg mg hypre"
    ),
    "pc_asm_overlap": _whole(0, 10),
    "pc_factor_fill": Number(1.0, 100.0),
    "pc_factor_levels": _whole(0, 10),
    "pc_factor_mat_ordering_type": _one_of("natural nd 1wd rcm qmd amd"),
    "pc_factor_mat_solver_type": _one_of("petsc mumps superlu superlu_dist umfpack"),
    "pc_factor_shift_type": _one_of("none nonzero positive_definite inblocks"),
    "pc_gamg_agg_nsmooths": _whole(0, 10),
    "pc_gamg_coarse_eq_limit": _whole(1, 1_000_000),
    "pc_gamg_reuse_interpolation": Switch(),
    "pc_gamg_threshold": Number(-1.0, 1.0),
    "pc_mg_cycle_type": _one_of("v w"),
    "pc_mg_type": _one_of("additive multiplicative full kaskade"),
    "pc_sor_its": _whole(1, 100),
    "pc_sor_omega": Number(0.01, 1.99),
    "snes_type": _one_of("newtonls newtontr"),
    "snes_linesearch_type": _one_of("none basic bt l2 secant cp nleqerr"),
    "snes_linesearch_damping": Number(0.01, 1.0),
    "snes_linesearch_max_it": _whole(1, 1000),
    "snes_ksp_ew": Switch(),
    "snes_lag_preconditioner": _whole(1, 1000),
    "snes_lag_preconditioner_persists": Switch(),
    "snes_max_it": _whole(1, 1000),
    "snes_monitor": Alone(),
    "snes_converged_reason": Alone(),
}
#: What may stand before a name: the levels of a multigrid, and the blocks of a preconditioner.
LEVELS = ("mg_levels_", "mg_levels_N_", "mg_coarse_", "sub_")
_LEVELS = re.compile("(?:mg_levels_(?:[0-9]{1,2}_)?|mg_coarse_|sub_){0,3}")


def parse(text):
    """Options of a text as on a command line, as a dict name -> text or None.

    Raises:
        InputError: They are none, or not of :data:`OPTIONS`.
    """
    try:
        words, found = shlex.split(text), {}
    except ValueError as error:  # a quote that is not closed
        raise InputError(
            f"petsc = {shown(text)} has {str(error).lower()}, expected options like "
            '"-ksp_rtol 1e-8"'
        ) from None
    while words:
        name = words.pop(0)
        if not name.startswith("-") or len(name) < 2:
            raise InputError(f'petsc = {shown(text)}, expected options like "-ksp_rtol 1e-8"')
        has_value = words and not (words[0].startswith("-") and words[0][1:2].isalpha())
        found[name[1:]] = words.pop(0) if has_value else None
    check(found, "petsc")
    return found


def check(options, where):
    """Raise InputError unless all options, a dict, are of :data:`OPTIONS`.

    Args:
        options: Name without the prefix -> text or None.
        where: What messages call them.
    """
    for name, value in options.items():
        allowed = OPTIONS.get(_LEVELS.sub("", name, count=1))
        if allowed is None:
            raise InputError(
                f"{where} has {shown('-' + name)}, expected one of -" + ", -".join(OPTIONS)
            )
        if not allowed.allows(value):
            given = "no value" if value is None else shown(value)
            raise InputError(f"{where} has -{name} with {given}, expected {allowed}")


def check_command_line(options, prefix):
    """Raise InputError unless options of PETSc's command line are of :data:`OPTIONS`, or trusted.

    Args:
        options: Name without the prefix -> text or None.
        prefix: Of their names.
    """
    given = dict(options)
    if TRUST in given:
        return
    try:
        check(given, "PETSC_OPTIONS")
    except InputError as error:
        raise InputError(
            f"{error} (names without {prefix}), or -{prefix}{TRUST} for any option"
        ) from None
