"""The fidelity ladder: from a posed body to `Echoes`, one module a rung."""

from rtradar.scatter.common.poses import Accountable, Rung, chirp_poses, one_echo_a_part
from rtradar.scatter.echo_models import RUNGS, build_rung, register_rung, takes_backend
from rtradar.scatter.scattering_length import scattering_length

__all__ = [
    "RUNGS",
    "Accountable",
    "Rung",
    "build_rung",
    "chirp_poses",
    "one_echo_a_part",
    "register_rung",
    "scattering_length",
    "takes_backend",
]
