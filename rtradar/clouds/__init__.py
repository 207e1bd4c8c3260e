"""Point clouds from detections."""

from rtradar.clouds.collection import Collection
from rtradar.clouds.dataset_store import Sample
from rtradar.clouds.files import RDT_AXES, RDT_UNITS, save_cloud_npz, save_ply
from rtradar.clouds.rdt import (
    RdtCloud,
    RdtCloudResult,
    UniformSample,
    rdt_isosurface,
    sample_centres,
)
from rtradar.clouds.spatial import SpatialCloud, save_spatial_npz, spatial_points

__all__ = [
    "RDT_AXES",
    "RDT_UNITS",
    "Collection",
    "RdtCloud",
    "RdtCloudResult",
    "Sample",
    "SpatialCloud",
    "UniformSample",
    "rdt_isosurface",
    "sample_centres",
    "save_cloud_npz",
    "save_ply",
    "save_spatial_npz",
    "spatial_points",
]
