"""Full-wave scattering: Maxwell's equations without optics, which judges the echo models."""

from rtradar.full_wave.revolution import BodiesOfRevolution, Sampling
from rtradar.full_wave.revolution_curves import Spheroid

__all__ = ["BodiesOfRevolution", "Sampling", "Spheroid"]
