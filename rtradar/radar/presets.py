"""Radars that have a name: each is made by a function without arguments (`PRESETS`)."""

from __future__ import annotations

from rtradar.radar.radar import Radar


def paper_12ghz() -> Radar:
    """Make the radar of the paper's Table 1."""
    return Radar(start_frequency_hz=12e9, chirp_duration_s=62.5e-6)


def paper_77ghz() -> Radar:
    """Make the paper's radar at 77 GHz, whose chirps are five times shorter."""
    return Radar(start_frequency_hz=77e9, chirp_duration_s=12.5e-6)
