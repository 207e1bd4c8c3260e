"""Pictures and pages of results."""

from rtradar.report.pages.run_page import write_report

__all__ = ["write_report"]
