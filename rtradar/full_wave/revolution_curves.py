"""Generating curves: rings on the surface of spheroids, and rings of sources beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spheroid:
    """A body of revolution about the z axis.

    Parameters
    ----------
    radius : float
        Semi-axis across the axis of revolution [m].
    half_length : float
        Semi-axis along it [m].
    height : float
        Position of the centre on the axis, z [m].
    """

    radius: float
    half_length: float
    height: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.height) and 0 < min(self.radius, self.half_length) < np.inf):
            raise InputError(
                f"Spheroid: semi-axes of {self.radius} and {self.half_length} m at {self.height} "
                "m; the semi-axes must be positive, and all finite [m]"
            )

    @property
    def span(self) -> tuple[float, float]:
        """Least and largest z of the surface [m]."""
        return self.height - self.half_length, self.height + self.half_length

    def rings(self, count: int, shift: float = 0.0) -> Rings:
        """Place rings on the surface, or on a confocal spheroid beside it.

        Parameters
        ----------
        count : int
            Number of rings, even in the eccentric angle.
        shift : float
            Difference of the elliptic coordinate ln((radius + half length) / m) from that of the
            surface; negative inside. A spheroid inside exists down to minus `innermost`.

        Returns
        -------
        Rings
        """
        a, c = self.radius, self.half_length
        # With s = a + c and a^2 - c^2 kept by confocal spheroids, s alone gives both semi-axes.
        total = (a + c) * np.exp(shift)
        difference = (a - c) * (a + c) / total
        a, c = (total + difference) / 2, (total - difference) / 2
        angle = (np.arange(count) + 0.5) * np.pi / count
        sine, cosine = np.sin(angle), np.cos(angle)
        stretch = np.hypot(a * cosine, c * sine)
        return Rings(
            radius=a * sine,
            height=self.height + c * cosine,
            tangent=np.stack([a * cosine, -c * sine], axis=1) / stretch[:, None],
            area=2 * np.pi * a * sine * stretch * np.pi / count,
        )

    def image_depth(self, distance: float) -> float:
        """Compute the depth of the image of a point before the tip.

        Parameters
        ----------
        distance : float
            Distance of the point from the tip, on the axis [m].

        Returns
        -------
        float
            Depth of its image in the sphere that osculates the tip [m].
        """
        curvature = self.radius**2 / self.half_length
        return curvature * distance / (curvature + distance)

    @property
    def innermost(self) -> float:
        """Depth at which the confocal spheroids end in the line or the disc between the foci."""
        a, c = self.radius, self.half_length
        return float(np.log((a + c) / np.sqrt(abs(a - c) * (a + c)))) if a != c else np.inf


@dataclass(frozen=True)
class Rings:
    """Rings about the z axis, on one surface or on several.

    Parameters
    ----------
    radius, height : (ring,) float64
        Distance from the axis, and position along it, z [m].
    tangent : (ring, 2) float64
        Unit vector along the generating curve, its components away from the axis and along z. The
        outward normal is (-tangent z, tangent radius).
    area : (ring,) float64
        Area of surface that each ring stands for [m^2].
    """

    radius: Array
    height: Array
    tangent: Array
    area: Array

    def __len__(self) -> int:
        return len(self.radius)

    @classmethod
    def joined(cls, some: list[Rings]) -> Rings:
        """Put rings of several surfaces one after another.

        Parameters
        ----------
        some : list of Rings
            Rings of each surface.

        Returns
        -------
        Rings
        """
        names = ("radius", "height", "tangent", "area")
        return cls(*(np.concatenate([getattr(rings, name) for rings in some]) for name in names))

    def points(self, count: int) -> tuple[Array, Array, Array]:
        """Place points on every ring, evenly from the x axis on.

        Parameters
        ----------
        count : int
            Number of points of a ring.

        Returns
        -------
        position, tangent, around : (ring, point, 3) float64
            Position [m], the unit vector along the generating curve, and that along the ring.
        """
        angle = 2 * np.pi * np.arange(count) / count
        cosine, sine = np.cos(angle), np.sin(angle)

        def turned(across: Array, along: Array) -> Array:
            parts = (across[:, None] * cosine, across[:, None] * sine, along[:, None])
            return np.stack(np.broadcast_arrays(*parts), axis=-1)

        around = np.stack([-sine, cosine, np.zeros(count)], axis=-1)
        shape = (len(self), count, 3)
        return (
            turned(self.radius, self.height),
            turned(*self.tangent.T),
            np.broadcast_to(around, shape),
        )
