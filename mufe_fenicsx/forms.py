"""Forms of DOLFINx, which it compiles with a C compiler at their first use."""

from cffi import VerificationError
from dolfinx import fem

from .errors import InputError


def compiled_form(expression):
    """``dolfinx.fem.form``, without the compiler's own words where there is none. Collective.

    Args:
        expression: UFL form, or a list of them.

    Returns:
        The compiled form.

    Raises:
        InputError: It is not in the cache and cannot be compiled.
    """
    try:
        return fem.form(expression)
    except (VerificationError, RuntimeError) as error:  # on several ranks it is the latter
        why = " ".join(str(error).split())[-300:]
        raise InputError(
            f"a form of DOLFINx cannot be compiled ({why}), expected a C compiler, GCC or clang, "
            "in PATH or in the variable CC"
        ) from error
