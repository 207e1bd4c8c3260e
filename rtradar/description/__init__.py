"""What is simulated, as tables of people, radar, scene and settings, and the run file of it."""

from rtradar.description.given import Movers, Moving, given_parts
from rtradar.description.read import Parts, parts_of, with_value
from rtradar.description.run_file import (
    check_files,
    in_words,
    read_run_file,
    refuse_another,
    write_run_file,
)
from rtradar.description.tables import person_table, table_of

__all__ = [
    "Movers",
    "Moving",
    "Parts",
    "check_files",
    "given_parts",
    "in_words",
    "parts_of",
    "person_table",
    "read_run_file",
    "refuse_another",
    "table_of",
    "with_value",
    "write_run_file",
]
