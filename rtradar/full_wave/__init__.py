"""Full-wave scattering: Maxwell's equations without optics, which judges the echo models."""

from rtradar.full_wave.revolution import BodiesOfRevolution, Sampling
from rtradar.full_wave.revolution_rings import Spheroid
from rtradar.full_wave.surfaces import ConductingSurface
from rtradar.full_wave.surfaces_mesh import ClosedMesh

__all__ = ["BodiesOfRevolution", "ClosedMesh", "ConductingSurface", "Sampling", "Spheroid"]
