"""What is simulated, as tables of people, radar, scene and settings, and the run file of it."""

from rtradar.description.read import Parts, parts_of, with_value
from rtradar.description.run_file import check_files, read_run_file, write_run_file
from rtradar.description.tables import table_of

__all__ = [
    "Parts",
    "check_files",
    "parts_of",
    "read_run_file",
    "table_of",
    "with_value",
    "write_run_file",
]
