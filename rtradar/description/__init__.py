"""What is simulated, as tables of people, radar, scene and settings, and the run file of it."""

from rtradar.description.given import Movers, Moving, given_parts, load_mover
from rtradar.description.read import Parts, parts_of, settings_of_table, with_value
from rtradar.description.run_file import (
    in_words,
    read_run_file,
    refuse_another,
    versions,
    write_run_file,
)
from rtradar.description.tables import table_of

__all__ = [
    "Movers",
    "Moving",
    "Parts",
    "given_parts",
    "in_words",
    "load_mover",
    "parts_of",
    "read_run_file",
    "refuse_another",
    "settings_of_table",
    "table_of",
    "versions",
    "with_value",
    "write_run_file",
]
