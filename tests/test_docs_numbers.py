"""Numbers of two pages are those of the stored table that they are about."""

import re

import pytest

from mufe_fenicsx.analysis.evidence import read_points
from tests.docs_pages import ROOT

PAGE = ROOT / "docs" / "record" / "2026-11-choices.md"
HOWTO = ROOT / "docs" / "howto" / "choose_a_model.md"
ROW = re.compile(
    r"\| (averaged pressure|the seed's method)?[^|`:]*(?:`([^`]+)`)?[^|`:]*: "
    r"([\d.]+(?:, [\d.]+)*)[^|;]*\| ([^|;]+) \| ([^|;]+) \|"
)


def rows():
    """(case, parameters, element counts, errors, times) of rows with one choice of model."""
    case, found = None, []
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        header = re.search(r"`mufe verify (\S+)-point --set", line)
        if header and line.startswith("|"):
            case = header.group(1)
        elif not line.startswith("|"):
            case = None
        elif case and (row := ROW.fullmatch(line)):
            name, choice, *lists = row.groups()
            if name == "the seed's method":
                choice = "element=p1 time_step=element"
            if case != "jammed":  # its rows count edges, not elements
                parameters = dict(word.split("=") for word in (choice or "").split())
                found.append((case, parameters, *(text.split(", ") for text in lists)))
    return found


#: Cases and parameter of the mesh of a table of the how-to, by words in its head.
TABLES = {
    "yielding ball": (("hertz", "plastic-sphere"), "elements_per_radius", {}),
    "cylinder wall": (("cylinder-wall", "tool"), "elements_per_radius", {}),
    "edges at the platens": (("membrane",), "ends_over_t", {}),
    "mean error of the stress": (
        ("jammed",), "element_size", {"added_mass": "0.05", "loading": "2"},
    ),
}  # fmt: skip


def rows_of_howto():
    """The same of the tables of the how-to: of each case an error and a time."""
    found, table = [], None
    for line in HOWTO.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not re.fullmatch(r"[\d.]+", cells[0]):
            table = next((t for words, t in TABLES.items() if words in line), table)
            continue
        cases, size, more = table
        for case, error, time in zip(cases, cells[1::2], cells[2::2], strict=True):
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
    case, parameters, counts, errors, times = row
    points = [p for p in read_points() if p.case == case]
    assert len(counts) == len(errors) == len(times)
    for count, error, seconds in zip(counts, errors, times, strict=True):
        wanted = parameters | {"elements_per_radius": count}
        (point,) = (p for p in points if p.parameters == wanted)
        for value, text in ((point.error, error), (point.seconds, seconds)):
            given, half = shown(text)
            assert abs(value - given) <= half, f"{wanted}: the page has {text}, the table {value:g}"


@pytest.mark.parametrize("row", rows_of_howto(), ids=lambda row: f"{row[0]} {row[1]}")
def test_a_row_of_the_howto_says_what_the_table_says(row):
    case, wanted, error, time = row
    (point,) = (p for p in read_points() if p.case == case and p.parameters == wanted)
    for value, text in ((point.error, error), (point.seconds, time)):
        given, half = shown(text)
        assert abs(value - given) <= half, f"{wanted}: the page has {text}, the table {value:g}"


def test_rows_are_found():
    """A page that is written anew shall not slip through."""
    assert len(rows()) >= 20
    assert len(rows_of_howto()) == 16
