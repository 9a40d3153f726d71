"""Forms of DOLFINx, which it compiles with a C compiler at their first use."""

import re
import time
from pathlib import Path

from cffi import VerificationError
from dolfinx import fem

from ...errors import InputError

#: A source that is older and has no library was left by a program that was killed meanwhile [s].
LEFT = 120.0


def compiled_form(expression):
    """``dolfinx.fem.form``; what a killed program left half-made in the cache is made anew.

    Collective.

    Args:
        expression: UFL form, or a list of them.

    Returns:
        The compiled form.

    Raises:
        InputError: It is not in the cache and cannot be compiled; on all ranks.
    """
    try:
        return fem.form(expression)
    except (TimeoutError, RuntimeError) as error:  # on several ranks it is the latter, on all
        _remove_left(str(error))
    except VerificationError as error:
        raise _refusal(error) from error
    try:
        return fem.form(expression)
    except (TimeoutError, RuntimeError, VerificationError) as error:
        raise _refusal(error) from error


def _remove_left(message):
    """Remove the source that FFCx waited for in vain, if it is an old one."""
    named = re.search(r"remove (\S+\.c)\)", message)
    if named is None:
        return
    source = Path(named[1])
    try:
        if time.time() - source.stat().st_mtime > LEFT:
            source.unlink()
    except OSError:  # another program was quicker, or it is not ours: said at the second try
        pass


def _refusal(error):
    why = " ".join(str(error).split())[-300:]
    return InputError(
        f"a form of DOLFINx cannot be compiled ({why}), expected a C compiler, GCC or clang, in "
        "PATH or in the variable CC"
    )
