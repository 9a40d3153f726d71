"""Forces on the planes of a deck from what CalculiX printed."""

import re
from pathlib import Path

import numpy as np

from ..errors import InputError
from .deck import UNITS

_TOTAL = re.compile(
    r"total force \(fx,fy,fz\) for set (\S+) and time\s+(\S+)\s+(\S+)\s+(\S+)\s+(\S+)"
)


def read_wall_forces(deck):
    """Forces of the grains on each plane.

    Args:
        deck: The deck that was run; ``ccx`` writes the .dat beside it.

    Returns:
        Times [s], shape (n,), and a dict of forces [N], shape (n, 3), by the names of the walls
        (z_max and so on).

    Raises:
        InputError: one of both files is not there or holds no forces, or a deck without units.
    """
    deck = Path(deck)
    data = deck.with_suffix(".dat")
    for path in (deck, data):
        if not path.is_file():
            raise InputError(f"no file {path}, expected a deck and the .dat that ccx wrote for it")
    with deck.open(encoding="utf-8", errors="replace") as file:
        head = [file.readline().strip() for _ in range(3)]
    names = {called: values for *values, called in UNITS.values()}
    called = head[2].removeprefix("** units: ")
    if called not in names:
        raise InputError(
            f'third line of {deck} is "{head[2]}", expected ** units: {", ".join(names)}'
        )
    length, stress, _ = names[called]
    found = {}
    for name, time, *force in _TOTAL.findall(data.read_text(encoding="utf-8", errors="replace")):
        found.setdefault(name, []).append([float(time), *(float(f) for f in force)])
    if not found:
        raise InputError(f"{data} holds no total forces, expected those of a run of {deck}")
    rows = {name.lower().removeprefix("wall_"): np.array(table) for name, table in found.items()}
    num = min(len(table) for table in rows.values())
    times = next(iter(rows.values()))[:num, 0]
    # The reaction is the force that holds the plane; grains push against it.
    scale = -stress * length**2
    return times, {name: scale * table[:num, 1:] for name, table in rows.items()}
