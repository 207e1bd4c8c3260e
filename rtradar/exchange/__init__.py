"""Exchange of IF samples (DCA1000, MATLAB, xarray, NumPy, Zarr) and point clouds."""

from rtradar.clouds.files import CloudTable
from rtradar.exchange.dca1000 import Dca1000Layout
from rtradar.exchange.export import (
    CLOUD_FORMATS,
    IF_FORMATS,
    export,
    open_samples,
    read_cloud,
    read_if,
)
from rtradar.exchange.recording import IF_AXES, IfCube, SampleFile

__all__ = [
    "CLOUD_FORMATS",
    "IF_AXES",
    "IF_FORMATS",
    "CloudTable",
    "Dca1000Layout",
    "IfCube",
    "SampleFile",
    "export",
    "open_samples",
    "read_cloud",
    "read_if",
]
