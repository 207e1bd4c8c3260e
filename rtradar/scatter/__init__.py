"""The fidelity ladder: from a posed body to `Echoes`, one module a rung."""

from rtradar.scatter.ladder import RUNGS, build_rung
from rtradar.scatter.poses import Accountable, Rung
from rtradar.scatter.scattering_length import scattering_length

__all__ = ["RUNGS", "Accountable", "Rung", "build_rung", "scattering_length"]
