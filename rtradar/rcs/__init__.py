"""Closed forms of scattering, the reference. Nothing here uses rays, meshes or echo models."""

from rtradar.rcs.ellipsoid import ellipsoid, ellipsoid_radii
from rtradar.rcs.sphere import sphere

__all__ = ["ellipsoid", "ellipsoid_radii", "sphere"]
