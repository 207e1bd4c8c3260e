"""Motion capture and synthetic actors: what a person does, at any time."""

from rtradar.motion.formats import load_motion, register_reader
from rtradar.motion.motion import Motion
from rtradar.motion.placement import cut, place
from rtradar.motion.synthetic import ACTIVITIES, synthetic_motion

__all__ = [
    "ACTIVITIES",
    "Motion",
    "cut",
    "load_motion",
    "place",
    "register_reader",
    "synthetic_motion",
]
