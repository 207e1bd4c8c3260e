"""Point clouds from detections."""

from rtradar.clouds.files import RDT_AXES, RDT_UNITS, atomic_file, save_cloud_npz, save_ply
from rtradar.clouds.rdt import RdtCloud, RdtCloudResult, rdt_isosurface, sample_centres

__all__ = [
    "RDT_AXES",
    "RDT_UNITS",
    "RdtCloud",
    "RdtCloudResult",
    "atomic_file",
    "rdt_isosurface",
    "sample_centres",
    "save_cloud_npz",
    "save_ply",
]
