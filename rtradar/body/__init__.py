"""A person as 21 posed ellipsoids, and their meshes."""

from rtradar.body.body import PART_NAMES, Body, Ellipsoids, Poses, ellipsoid_meshes, unit_sphere

__all__ = ["PART_NAMES", "Body", "Ellipsoids", "Poses", "ellipsoid_meshes", "unit_sphere"]
