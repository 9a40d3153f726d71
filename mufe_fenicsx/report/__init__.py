"""Figures and one HTML page from a run, or from several."""

from mufe_fenicsx.report.figure import list_figures
from mufe_fenicsx.report.write import write_report

__all__ = ["list_figures", "write_report"]
