"""Fixtures of the tests of reports."""

from pathlib import Path

import pytest
from matplotlib.figure import Figure


@pytest.fixture
def unpainted(monkeypatch):
    """Figures are made, but their pictures stay empty: for what the page, the lists and data say.

    `test_report` draws all pictures of one run.
    """
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **options: Path(path).touch())
