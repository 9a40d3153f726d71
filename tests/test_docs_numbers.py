"""Numbers of the how-to are those of the stored table that it is about."""

import re

import pytest

from mufe_fenicsx.analysis.evidence import read_points
from tests.docs_pages import ROOT

HOWTO = ROOT / "docs" / "howto" / "choose_a_model.md"

#: Parameter of the mesh of a table, and of each case its other parameters, by words in its head.
TABLES = {
    "yielding ball": ("elements_per_radius", (("hertz", {}), ("plastic-sphere", {}))),
    "yielding grains": (
        "elements_per_diameter", (("sample", {}), ("sample", {"fidelity": "elastic"})),
    ),
    "cylinder wall": ("elements_per_radius", (("cylinder-wall", {}), ("tool", {}))),
    "edges at the platens": ("ends_over_t", (("membrane", {}),)),
    "half the distance of grains": (
        "element_size", (("jammed", {"added_mass": "0.05", "loading": "2"}),),
    ),
}  # fmt: skip


def rows():
    """(case, parameters, error, time) of each row and case of the tables."""
    found, table = [], None
    for line in HOWTO.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not re.fullmatch(r"[\d.]+", cells[0]):
            table = next((t for words, t in TABLES.items() if words in line), table)
            continue
        size, cases = table
        for (case, more), error, time in zip(cases, cells[1::2], cells[2::2], strict=True):
            found.append((case, {size: cells[0], **more}, error, time))
    return found


def shown(text):
    """Value of a number with its unit, and half of its last digit."""
    number, unit = text.split()
    half = 0.5 * 10.0 ** -len(number.partition(".")[2])
    scale = {"%": 0.01, "s": 1.0}[unit]
    return float(number) * scale, 1.02 * half * scale


@pytest.mark.parametrize("row", rows(), ids=lambda row: f"{row[0]} {row[1]}")
def test_a_row_says_what_the_table_says(row):
    """Within the last digit that the page gives."""
    case, wanted, error, time = row
    (point,) = (p for p in read_points() if p.case == case and p.parameters == wanted)
    for value, text in ((point.error, error), (point.seconds, time)):
        given, half = shown(text)
        assert abs(value - given) <= half, f"{wanted}: the page has {text}, the table {value:g}"


def test_rows_are_found():
    """A page that is written anew shall not slip through."""
    assert len(rows()) == 2 * (5 + 4 + 2) + 2 + 4
