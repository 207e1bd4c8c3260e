"""What works on this machine, what is missing, and all levels compiled before the first run."""

from rtradar.doctor.examination import DoctorReport, examine, report, report_text

__all__ = ["DoctorReport", "examine", "report", "report_text"]
