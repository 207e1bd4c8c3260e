"""People as posed ellipsoids, 21 each, and as meshes."""

from rtradar.body.body import PART_NAMES, Body, Ellipsoids, Poses, ellipsoid_meshes, unit_sphere
from rtradar.body.human import HumanMesh
from rtradar.body.people import Bodies, Person

__all__ = [
    "PART_NAMES",
    "Bodies",
    "Body",
    "Ellipsoids",
    "HumanMesh",
    "Person",
    "Poses",
    "ellipsoid_meshes",
    "unit_sphere",
]
