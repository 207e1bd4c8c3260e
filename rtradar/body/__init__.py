"""People as posed ellipsoids, 21 each, and their meshes."""

from rtradar.body.body import PART_NAMES, Body, Ellipsoids, Poses, ellipsoid_meshes, unit_sphere
from rtradar.body.people import Bodies, Person

__all__ = [
    "PART_NAMES",
    "Bodies",
    "Body",
    "Ellipsoids",
    "Person",
    "Poses",
    "ellipsoid_meshes",
    "unit_sphere",
]
