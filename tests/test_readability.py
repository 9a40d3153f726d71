"""README and the pages keep the limits of :mod:`tests.readability`, which finds what is beyond."""

import pytest

from tests import readability


def test_pages_keep_the_limits(capsys):
    assert readability.main() == 0, capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "lengths"),
    [
        ("One two. Three, e.g. four five: six.\n\n- Seven `a b c` eight.", [2, 5, 3]),
        ("| a | b |\n\n```sh\nnot read\n```\nRead $x + y$ here.", [3]),
    ],
)
def test_sentences(text, lengths):
    assert [s.num_words for s in readability.sentences(text)] == lengths


def test_sentences_run_on_over_equations_and_items_without_a_full_stop():
    text = "One, e.g. two:\n\n$$\na = b + c\n$$\n\nthree. Four:\n\n- five\n- six.\n- Seven\n# A"
    assert [s.num_words for s in readability.runs(text)] == [7, 3, 1]
    text = "One two\n\n$$\na = b .\n$$\n\nThree `x y`:\n```sh\nnot read\n```\nFour"
    assert [s.num_words for s in readability.runs(text)] == [4, 2, 1]


def test_items_of_lists_end():
    text = "It has\n\n- one thing,\n- a second\n  one. No more\n- *a third.*\n\nEnd\n1. four: `x`"
    found = [item for _, item in readability.open_items(text)]
    assert found == ["- one thing,", "- a second one. No more", "1. four: X"]


def test_cells_and_acronyms():
    assert [c for _, c in readability.crowded_cells("| 1.5 % | 2 to 3 | J2, `4 5` |")] == ["2 to 3"]
    assert readability.acronyms("TIFFs of MPI, not `XYZ`, A or Mp") == {"TIFF", "MPI"}
