"""Parameters of many runs: lists, ranges, and tables of an outer loop.

A list ``0.1,0.23`` takes each value; a range ``50 GPa:70 GPa`` is sampled, evenly in its logarithm
with ``:log`` behind it. Runs are the product of all lists with the samples of all ranges. Values
are texts as ``--set`` of `mufe run` takes them.
"""

import re
from dataclasses import dataclass

import numpy as np

from ...errors import InputError, shown
from ...units import base_number

#: Most runs of a sweep.
MOST = 10_000
#: Columns of the tables that GrainLearning writes which are no parameters.
OF_BATCH = ("OMP_NUM_THREADS", "description", "key")


@dataclass(frozen=True)
class Range:
    """Values between two, even or even in their logarithm."""

    name: str
    low: str  #: as written
    high: str
    ends: tuple[float, float]  #: SI units
    log: bool

    def values(self, part):
        """Those at parts of the range from 0 to 1, shape (num_samples,), SI units."""
        low, high = self.ends
        if self.log:
            return low * (high / low) ** part
        return low + part * (high - low)


def stated(changes):
    """Lists and ranges of texts "name=values".

    Returns:
        dict name -> list of texts, and list of :class:`Range`.

    Raises:
        InputError: A text is none of these, or a name is stated twice.
    """
    lists, ranges = {}, []
    for text in changes:
        name, equals, values = (part.strip() for part in text.partition("="))
        if not (name and equals and values):
            raise InputError(f'--set "{text}", expected name=value,value or name=low:high')
        if name in lists or name in [r.name for r in ranges]:
            raise InputError(f"{name} is set twice, expected all its values behind one --set")
        found = _range(name, values)
        if found is not None:
            ranges.append(found)
            continue
        parts = [part.strip() for part in _split(values)]
        if not all(parts):
            raise InputError(f'--set "{text}" has an empty value, expected values between commas')
        if len(set(parts)) < len(parts):
            raise InputError(f'--set "{text}" has a value twice, expected different ones')
        lists[name] = parts
    return lists, ranges


def _split(text):
    """Parts between commas outside of quotes and brackets."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        else:
            depth += letter in "[{("
            depth -= letter in ")}]"
        if letter == "," and not quote and depth <= 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def _range(name, text):
    """The :class:`Range` that a text "low:high" or "low:high:log" is; None where it is none."""
    parts = [part.strip() for part in text.split(":")]
    log = len(parts) == 3 and parts[2] == "log"
    numbers = [base_number(part) for part in parts[:2]]
    if len(parts) != 2 + log or None in numbers:
        if len(parts) > 1 and numbers[0] is not None:
            raise InputError(f"{name} = {shown(text)}, expected low:high or low:high:log")
        return None  # such as meshes:twelve_grains
    low, high = numbers
    if not low < high:
        raise InputError(f"{name} = {shown(text)}, expected a range that grows")
    if log and low <= 0:
        raise InputError(f"{name} = {shown(text)}, expected a range above 0 for log")
    return Range(name, parts[0], parts[1], (low, high), log)


def hypercube(ranges, num_samples, seed):
    """Latin hypercube of ranges: one sample in each of ``num_samples`` equal parts of each range.

    Args:
        ranges: List of :class:`Range`.
        num_samples: Number of samples.
        seed: Of the random numbers.

    Returns:
        Rows, list of dicts name -> text; one row without names where there are no ranges.

    Source: M. D. McKay, R. J. Beckman & W. J. Conover, Technometrics 21, 1979, 239-245, by
    scipy.stats.qmc.LatinHypercube.
    """
    if not ranges:
        return [{}]
    from scipy.stats.qmc import LatinHypercube

    parts = LatinHypercube(len(ranges), rng=np.random.default_rng(seed)).random(num_samples)
    columns = [r.values(part) for r, part in zip(ranges, parts.T, strict=True)]
    return [
        {r.name: f"{value:.8g}" for r, value in zip(ranges, row, strict=True)}
        for row in zip(*columns, strict=True)
    ]


def product(*blocks):
    """Rows of each block with those of each other, in order; the last block changes fastest.

    Args:
        blocks: Lists of dicts name -> text.

    Raises:
        InputError: Two blocks have the same name, or there are more than :data:`MOST` rows.
    """
    rows = [{}]
    for block in blocks:
        twice = set(rows[0]) & set(block[0])
        if twice:
            raise InputError(f"{sorted(twice)[0]} is set twice, expected it once")
        if len(rows) * len(block) > MOST:
            raise InputError(f"runs = {len(rows) * len(block)}, expected at most {MOST}")
        rows = [row | more for row in rows for more in block]
    return rows


# --- tables of an outer loop -------------------------------------------------------------------


def read_parameters(path):
    """Rows of a table of parameters in one of the two forms of GrainLearning.

    The first line names the columns behind ``#``, or behind ``!`` as in tables of batches, whose
    columns of threads, description and key are no parameters. Numbers follow, SI units.

    Returns:
        Rows, list of dicts name -> text, and the descriptions of the rows or None.

    Raises:
        InputError: It cannot be read or is no such table.
    """
    from ...machine.files import reason, regular

    try:
        text = regular(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"table {path} cannot be read ({reason(error)})") from error
    lines = [(k, line) for k, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if not lines or lines[0][1].lstrip()[0] not in "#!":
        raise InputError(f'table {path} has no header, expected a first line "# name name"')
    header = re.findall(r"[^\s,]+", lines[0][1].strip().lstrip("#!"))
    names = [name for name in header if name not in OF_BATCH]
    if not names or len(set(header)) < len(header):
        raise InputError(f"table {path} names {', '.join(header)}, expected different parameters")
    rows, described = [], []
    for number, line in lines[1:]:
        if line.lstrip().startswith("#"):
            continue
        cells = re.findall(r"[^\s,]+", line)
        if len(cells) != len(header):
            raise InputError(
                f"table {path}, line {number} has {len(cells)} values, expected {len(header)}"
            )
        row = dict(zip(header, cells, strict=True))
        for name in names:
            if base_number(row[name]) is None:
                raise InputError(
                    f"table {path}, line {number}: {name} = {shown(row[name])}, expected a number"
                )
        rows.append({name: row[name] for name in names})
        described.append(row.get("description"))
    if not rows:
        raise InputError(f"table {path} has no rows, expected one a run")
    return rows, described if all(described) else None


def table_text(rows):
    """The same table of those parameters that are numbers; "" where there are none.

    Comments name the others, which such a table cannot hold.

    Args:
        rows: List of dicts name -> text.
    """
    numbers = {name: [base_number(row[name]) for row in rows] for name in rows[0]}
    kept = {name: values for name, values in numbers.items() if None not in values}
    if not kept:
        return ""
    lines = [f"# {' '.join(kept)}"]
    for name in (name for name in numbers if name not in kept):
        texts = dict.fromkeys(row[name] for row in rows)
        lines.append(f"# no number, to be given beside this table: --set {name}={','.join(texts)}")
    lines += [" ".join(map(repr, row)) for row in zip(*kept.values(), strict=True)]
    return "\n".join(lines) + "\n"
