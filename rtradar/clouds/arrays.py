"""Arrays in the files of runs and data sets, listed in ``arrays.toml`` with all that files say."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib import resources
from typing import NamedTuple


class Array(NamedTuple):
    """Axes, meaning, unit and type of an array; a ``sparse`` one is mostly of one value."""

    dims: tuple[str, ...]
    meaning: str
    unit: str = "m2"
    dtype: str = "<f4"
    sparse: bool = False


_TEXT = resources.files("rtradar.clouds").joinpath("arrays.toml").read_text("utf-8")
TABLES: Mapping[str, Mapping[str, Array]] = {
    table: {name: Array(tuple(told.pop("dims")), **told) for name, told in entries.items()}
    for table, entries in tomllib.loads(_TEXT).items()
}
"""Tables of ``arrays.toml``, each with its arrays by name."""

_KEPT = ("spectrogram", "range_doppler", "range_azimuth")
_AXES = ("time", "range", "velocity", "azimuth", "spectrogram_time", "spectrogram_velocity")

ARRAYS: Mapping[str, Array] = {
    **TABLES["samples"],
    **{name: TABLES["maps"][name] for name in _KEPT},
    **{name: TABLES["axes"][name] for name in _AXES},
}
"""Arrays that the file of a sample may hold: clouds, maps, joints, and the axes of those.

``spatial_source`` is there where ``source_names`` of the provenance lists several people or
objects.
"""

KINDS = {
    "clouds": "points",
    "spatial": "spatial",
    "spectrograms": "spectrogram",
    "range_doppler": "range_doppler",
    "range_azimuth": "range_azimuth",
    "joints": "joints",
}
"""What a data set may hold of each sample, and the name of its array."""


def attributes(name: str) -> dict[str, str]:
    """Return the attributes of an array of a sample: ``units`` and ``long_name``."""
    return {"units": ARRAYS[name].unit, "long_name": ARRAYS[name].meaning}
