"""Pictures and pages of results."""

from rtradar.report.run_page import write_report

__all__ = ["write_report"]
