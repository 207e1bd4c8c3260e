"""The radar: waveform, array, schedule of its Tx, and every limit that follows from them (the paper's Tables 1 and 2)."""

from rtradar.radar.radar import PRESETS, Radar, register_radar

__all__ = ["PRESETS", "Radar", "register_radar"]
