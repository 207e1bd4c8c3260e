"""What a run left, for other tools and back: IF samples for MATLAB, xarray and int16 readers, clouds for viewers."""

from rtradar.exchange.clouds import CloudTable
from rtradar.exchange.export import CLOUD_FORMATS, IF_FORMATS, export, read_cloud, read_if
from rtradar.exchange.recording import IF_AXES, IfCube

__all__ = [
    "CLOUD_FORMATS",
    "IF_AXES",
    "IF_FORMATS",
    "CloudTable",
    "IfCube",
    "export",
    "read_cloud",
    "read_if",
]
