"""The radar and every limit that follows from its fields (the paper's Tables 1 and 2)."""

from rtradar.radar.radar import PRESETS, Radar, register_radar

__all__ = ["PRESETS", "Radar", "register_radar"]
