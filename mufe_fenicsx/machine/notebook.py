"""What notebooks show of an object that stands last in a cell: a short table."""

from collections.abc import Iterable
from html import escape


def html_table(title: str, rows: Iterable[tuple[str, object]]) -> str:
    """A title above a table of names and values, as HTML.

    Args:
        title: Text of any kind: what HTML would read is escaped, here and in the rows.
        rows: (name, value) pairs; a value that is empty or None leaves its row out.
    """
    cells = (
        f'<tr><th style="text-align: left">{escape(str(name))}</th>'
        f'<td style="text-align: left">{escape(str(value))}</td></tr>'
        for name, value in rows
        if value is not None and str(value)
    )
    return f"<table><caption><b>{escape(title)}</b></caption>{''.join(cells)}</table>"
