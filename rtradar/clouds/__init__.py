"""Point clouds from detections, their files, and data sets of labelled clouds."""

from rtradar.clouds.dataset_store import Collection, Sample
from rtradar.clouds.files import save_cloud_npz, save_ply, save_spatial_npz
from rtradar.clouds.rdt import RdtCloud, RdtCloudResult
from rtradar.clouds.spatial import SpatialCloud, spatial_points

__all__ = [
    "Collection",
    "RdtCloud",
    "RdtCloudResult",
    "Sample",
    "SpatialCloud",
    "save_cloud_npz",
    "save_ply",
    "save_spatial_npz",
    "spatial_points",
]
