"""Point clouds from detections, their files, and data sets of labelled clouds."""

from rtradar.clouds.dataset_store import Collection, Sample
from rtradar.clouds.files import RDT_AXES, RDT_UNITS, save_cloud_npz, save_ply, save_spatial_npz
from rtradar.clouds.rdt import RdtCloud, RdtCloudResult, UniformSample, rdt_isosurface
from rtradar.clouds.spatial import SpatialCloud, spatial_points

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
    "save_cloud_npz",
    "save_ply",
    "save_spatial_npz",
    "spatial_points",
]
