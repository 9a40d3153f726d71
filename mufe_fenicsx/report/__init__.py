"""Figures and one HTML page from a finished run."""

from mufe_fenicsx.report.write import write_report

__all__ = ["write_report"]
