"""Signal: from `Echoes` to samples of the intermediate frequency, and noise."""

from rtradar.signal.multiplexing import receive, separate
from rtradar.signal.noise import Noise
from rtradar.signal.synthesis import in_band, synthesize

__all__ = ["Noise", "in_band", "receive", "separate", "synthesize"]
