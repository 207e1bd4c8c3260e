"""Signal: from `Echoes` to samples of the intermediate frequency, and noise."""

from rtradar.signal.multiplexing import receive, separate
from rtradar.signal.noise import Noise
from rtradar.signal.receiver import Effect, Expected, ReceiverStage
from rtradar.signal.synthesis import in_band, synthesize

__all__ = [
    "Effect",
    "Expected",
    "Noise",
    "ReceiverStage",
    "in_band",
    "receive",
    "separate",
    "synthesize",
]
