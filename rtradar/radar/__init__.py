"""The radar and every limit that follows from its fields (the paper's Tables 1 and 2)."""

from __future__ import annotations

from collections.abc import Callable

from rtradar.radar.radar import PRESETS, Radar, register_radar
from rtradar.system.files import shipped_folder

__all__ = ["PRESETS", "Radar", "register_radar"]


def paper_12ghz() -> Radar:
    """Make the radar of the paper's Table 1."""
    return Radar(start_frequency_hz=12e9, chirp_duration_s=62.5e-6)


def paper_77ghz() -> Radar:
    """Make the paper's radar at 77 GHz, whose chirps are five times shorter."""
    return Radar(start_frequency_hz=77e9, chirp_duration_s=12.5e-6)


def _shipped(name: str) -> Callable[[], Radar]:
    """Return a function that reads the radar of that name from its file, which has its sources."""
    return lambda: Radar.load(shipped_folder("radars") / f"{name}.toml")


iwr1443, iwr1642, iwr1843 = map(_shipped, ("iwr1443", "iwr1642", "iwr1843"))
awr1642, awr1843, awr2243, awr2944 = map(_shipped, ("awr1642", "awr1843", "awr2243", "awr2944"))
iwr6843, iwr6843ods, iwr6843aop = map(_shipped, ("iwr6843", "iwr6843ods", "iwr6843aop"))
iwrl6432, awr2243_cascade = map(_shipped, ("iwrl6432", "awr2243-cascade"))
radhar, mars = map(_shipped, ("radhar", "mars"))
