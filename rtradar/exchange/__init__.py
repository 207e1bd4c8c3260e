"""Exchange of IF samples (MATLAB, xarray, int16) and point clouds with other tools."""

from rtradar.clouds.files import CloudTable
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
