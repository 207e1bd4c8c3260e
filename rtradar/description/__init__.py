"""What is simulated, as tables of people, radar, scene and settings, and the run file of it."""

from rtradar.description.read import (
    Movers,
    Moving,
    Parts,
    given_parts,
    load_mover,
    parts_of,
    settings_of_table,
    with_value,
)
from rtradar.description.run_file import (
    MOST_FILES,
    check_files,
    in_words,
    made_from,
    path_from,
    plain,
    read_run_file,
    refuse_another,
    table_of,
    versions,
    write_run_file,
)

__all__ = [
    "MOST_FILES",
    "Movers",
    "Moving",
    "Parts",
    "check_files",
    "given_parts",
    "in_words",
    "load_mover",
    "made_from",
    "parts_of",
    "path_from",
    "plain",
    "read_run_file",
    "refuse_another",
    "settings_of_table",
    "table_of",
    "versions",
    "with_value",
    "write_run_file",
]
