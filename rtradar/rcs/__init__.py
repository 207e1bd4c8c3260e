"""Closed forms of scattering: the judge. Nothing here knows of rays, meshes or the echo models."""

from rtradar.rcs.ellipsoid import ellipsoid, ellipsoid_radii
from rtradar.rcs.sphere import sphere

__all__ = ["ellipsoid", "ellipsoid_radii", "sphere"]
