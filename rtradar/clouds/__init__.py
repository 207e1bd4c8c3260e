"""Point clouds from detections, their files, and data sets of labelled clouds."""

from rtradar.clouds.collection import Collection
from rtradar.clouds.files import save_cloud_npz, save_ply, save_spatial_npz
from rtradar.clouds.rdt import RdtCloud, RdtCloudResult
from rtradar.clouds.sample_files import Sample
from rtradar.clouds.spatial import SpatialCloud, points_of_sines, spatial_points

__all__ = [
    "Collection",
    "RdtCloud",
    "RdtCloudResult",
    "Sample",
    "SpatialCloud",
    "points_of_sines",
    "save_cloud_npz",
    "save_ply",
    "save_spatial_npz",
    "spatial_points",
]
