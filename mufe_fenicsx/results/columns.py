"""Columns of tables: how they are named, read and checked."""

import numpy as np
import pandas

from ..errors import InputError
from ..output.quantities import unit_and_sign

STRESS = ("xx", "yy", "zz", "xy", "yz", "xz")


def exact_csv(path):
    """A CSV file as a DataFrame, each number the double that is nearest to its text.

    ``pandas.read_csv`` by itself is off by a last bit here and there before pandas 3.1, which
    deprecates the option that cures it. Columns are int64, float64 (blank: NaN) or text.

    Raises:
        OSError, ValueError: those of ``pandas.read_csv``.
    """
    return pandas.read_csv(path, dtype=str).apply(_numbers)


def _numbers(column):
    texts = column.to_numpy(dtype=object)
    for kind in (np.int64, np.float64):
        try:
            return pandas.Series(texts.astype(kind), column.index)
        except ValueError:
            continue
    return column


def check_finite(name, table):
    """See that all numbers of a table that a run wrote are such.

    Args:
        name: Of its file.
        table: DataFrame; columns of text are left out.

    Raises:
        InputError: One is nan or infinite: a fault of the run.
    """
    numbers = table.select_dtypes("number")
    wrong = ~np.isfinite(numbers.to_numpy(dtype=float))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise InputError(
            f"fault: {name} has {wrong.sum()} values that are not numbers, the first of column "
            f"{numbers.columns[column]} in line {row + 2}"
        )


def described(table, method):
    """The table with ``attrs``: ``units`` and ``signs`` by column, of those that have one.

    Args:
        table: DataFrame.
        method: Of `Run` that gives it.
    """
    about = {name: unit_and_sign(name, method) for name in table}
    numbers = [name for name in table if table[name].dtype.kind in "biuf"]
    table.attrs["units"] = {name: about[name][0] for name in numbers}
    table.attrs["signs"] = {name: about[name][1] for name in numbers if about[name][1]}
    return table


def vectors(table, name):
    """Columns name_x, name_y, name_z of a table, shape (num_rows, 3)."""
    return table[[f"{name}_{axis}" for axis in "xyz"]].to_numpy(dtype=float)


def columns_of(name, values, ends="xyz"):
    """Columns name_x, name_y, … of an array with one for each end, dict name -> array."""
    return {f"{name}_{end}": column for end, column in zip(ends, values.T, strict=True)}
