"""A specification to begin with, which explains itself and can be built as it is."""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path

from rtradar.errors import InputError
from rtradar.system.files import atomic_file


def write_template(path: Path) -> None:
    """Write the specification of a small data set, with comments on what else there is.

    Parameters
    ----------
    path : path
        New TOML file.

    Raises
    ------
    InputError
        If the file exists already or cannot be written.
    """
    if os.path.lexists(path):
        raise InputError(f"'{path}' is there already; give another name, or move it away")
    template = resources.files("rtradar.campaign") / "template.toml"
    with atomic_file(path) as file:
        file.write(template.read_bytes())
