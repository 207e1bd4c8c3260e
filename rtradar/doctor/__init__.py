"""What works on this machine, and what is missing."""

from rtradar.doctor.examination import DoctorReport, examine, report, report_text

__all__ = ["DoctorReport", "examine", "report", "report_text"]
