"""Data sets of many recordings, radars, scenes and echo models, built on Dask and resumable.

To build one needs the extra ``campaign``.
"""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path

from rtradar.campaign.build import build_dataset, in_words
from rtradar.campaign.export import export_dataset
from rtradar.errors import InputError
from rtradar.system.files import atomic_file

__all__ = ["build_dataset", "export_dataset", "in_words", "write_template"]


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
