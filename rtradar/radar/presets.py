"""Radars that have a name, and radars from TOML files.

A new radar with a name is a function that returns a `Radar`: one of another package is an entry
point of the group ``rtradar.radars``, one of a running program goes to `register_radar`. A TOML
file with the fields of `Radar` as its keys needs no code.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from rtradar.errors import InputError
from rtradar.radar.radar import Radar
from rtradar.system.checks import check_keys, printable, read_toml
from rtradar.system.registry import Registry

PRESETS = Registry(
    "rtradar.radars",
    "radar",
    {
        "paper-12ghz": "rtradar.radar.presets:paper_12ghz",
        "paper-77ghz": "rtradar.radar.presets:paper_77ghz",
    },
)
"""Radars that have a name: each is made by a function without arguments."""

register_radar = PRESETS.register


def paper_12ghz() -> Radar:
    """Make the radar of the paper's Table 1."""
    return Radar(start_frequency_hz=12e9, chirp_duration_s=62.5e-6)


def paper_77ghz() -> Radar:
    """Make the paper's radar at 77 GHz, whose chirps are five times shorter."""
    return Radar(start_frequency_hz=77e9, chirp_duration_s=12.5e-6)


def make_preset(name: str) -> Radar:
    """Make the preset of a name (`Radar.preset`)."""
    make = PRESETS.find(name, instead=", or the path of a TOML file")
    with PRESETS.guarded(name):
        radar = make()
    if not isinstance(radar, Radar):
        raise PRESETS.refuse(name, f"gave a {type(radar).__name__}, not a Radar")
    return dataclasses.replace(radar, name=name)


def load_radar(source: str | Path) -> Radar:
    """Make a preset by its name, or read a TOML file (`Radar.load`)."""
    path = Path(source)
    if str(source) in PRESETS or path.suffix != ".toml":
        return make_preset(str(source))
    table = read_toml(path, "radar", f"give a TOML file or one of: {', '.join(PRESETS)}")
    keys = tuple(sorted(field.name for field in dataclasses.fields(Radar)))
    try:
        check_keys("", table, (), keys)
        return Radar(**{"name": printable(path.stem), **table})
    except InputError as error:
        raise InputError(f"radar file '{path}': {error}") from None
