"""Rows of pairs: one declaration for C, NumPy and checkpoints."""

from mufe_fenicsx.kernels.build.pair_rows import FLAG, KEPT, LINE, PAIR, REAL, Row


def test_a_row_is_filled_up_to_whole_cache_lines():
    """A law that adds a field need not count bytes; rows that are whole stay as they are."""
    row = Row("some_row", ("gap", REAL, 1, KEPT), ("parted", FLAG, 1, KEPT))
    assert row.dtype.itemsize == LINE and row.kept == ("gap", "parted")
    assert row.in_c().splitlines()[3] == f"  uint8_t filling[{LINE - 9}];"
    rows = row.rows(3)
    row.view(rows, "parted")[:] = [False, True, False]
    assert row.view(rows, "parted").tolist() == [False, True, False]
    assert "filling" not in PAIR.in_c()
