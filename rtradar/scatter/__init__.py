"""Echo models: from a posed body to `Echoes`."""

from rtradar.scatter.common.poses import EchoModel, account_of, chirp_poses, one_echo_a_part
from rtradar.scatter.echo_models import build_model, register_model, takes_backend
from rtradar.scatter.scattering_length import scattering_length
from rtradar.system.registries import MODELS

__all__ = [
    "MODELS",
    "EchoModel",
    "account_of",
    "build_model",
    "chirp_poses",
    "one_echo_a_part",
    "register_model",
    "scattering_length",
    "takes_backend",
]
