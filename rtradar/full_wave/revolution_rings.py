"""Rings on spheroids, rings of sources beside them, and the fields of these, mode by mode.

A source is an electric current ``x`` (times the wave impedance) along a ring or along the
generating curve, together with the magnetic current ``s n x x``, with ``n`` the outward normal and
``s`` plus or minus one: Huygens' source, which radiates to one side. The source of the other
direction has the same field with E and H exchanged, so that H needs no integrals of its own. The
fields are those of :eq:`huygens-source`.
"""

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
        # The length of the curve for each step of the eccentric angle.
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


# -- azimuthal modes -------------------------------------------------------------------------------

Field = NDArray[np.complex128]


@dataclass(frozen=True)
class Medium:
    """Waves between rings.

    Parameters
    ----------
    wavenumber : complex
        Wavenumber [rad/m]; its imaginary part is negative where waves are absorbed.
    side : int
        1 where the sources radiate along their outward normals, -1 against them.
    modes : int
        Number of azimuthal modes, from 0 on.
    azimuths : int
        Number of points around a ring of sources, even.
    """

    wavenumber: complex
    side: int
    modes: int
    azimuths: int

    def transform(self) -> tuple[Array, Array]:
        """Weights (azimuth, mode) of the even and of the odd integrals over half a ring."""
        # Both halves of a ring are alike up to a sign: the integral is over one half, by the
        # trapezoidal rule, with the even or the odd part of exp(j m phi).
        half = self.azimuths // 2 + 1
        angle = 2 * np.pi * np.arange(half) / self.azimuths
        weight = np.full(half, 2.0 / self.azimuths)
        weight[[0, -1]] /= 2
        turned = angle[:, None] * np.arange(self.modes)
        return weight[:, None] * np.cos(turned), weight[:, None] * np.sin(turned)

    def electric(self, surface: Rings, sources: Rings) -> Field:
        """Compute the tangential electric field of every source, mode by mode.

        Parameters
        ----------
        surface, sources : Rings
            Rings at which the field is wanted, and rings of the sources.

        Returns
        -------
        (mode, component, ring, component, source) complex128
            Components along the generating curve (0) and around the axis (1), of the field and of
            the current; each for a current whose integral over the ring's azimuth is one.
        """
        even, odd = self.transform()
        azimuth = 2 * np.pi * np.arange(len(even)) / self.azimuths
        out = np.empty((self.modes, 2, len(surface), 2, len(sources)), dtype=np.complex128)
        # The current along the curve and the field along it are even in the azimuth, those around
        # the axis odd.
        for ring in range(len(surface)):
            tt, tp, pt, pp = self._fields_of_ring(surface, ring, sources, azimuth)
            out[:, 0, ring, 0] = _integrated(tt, even).T
            out[:, 0, ring, 1] = 1j * _integrated(tp, odd).T
            out[:, 1, ring, 0] = 1j * _integrated(pt, odd).T
            out[:, 1, ring, 1] = _integrated(pp, even).T
        return out

    def _fields_of_ring(
        self, surface: Rings, ring: int, sources: Rings, azimuth: Array
    ) -> tuple[Field, Field, Field, Field]:
        """Fields (source, azimuth) at one point of a ring of the surface.

        First the component along the generating curve, of a current along the curve and of one
        around the axis; then the component around the axis, of the same two.
        """
        cosine, sine = np.cos(azimuth), np.sin(azimuth)
        across, along = sources.tangent[:, :1], sources.tangent[:, 1:]
        # The vector from every point of a source's ring to the point at azimuth 0 of the surface's
        # ring.
        x = surface.radius[ring] - sources.radius[:, None] * cosine
        y = -sources.radius[:, None] * sine
        z = surface.height[ring] - sources.height[:, None]
        own_across, own_along = surface.tangent[ring]
        # The electric current's part along the current and along the vector, with the near field,
        # and the curl of the magnetic current.
        distance = np.sqrt(x**2 + y**2 + z**2)
        k = self.wavenumber
        inverse = 1 / (k * distance)
        green = np.exp(-1j * k * distance) / (4 * np.pi * distance)
        direct = -1j * k * green * (1 - 1j * inverse - inverse**2)
        radial = 1j * k * green * (1 - 3j * inverse - 3 * inverse**2) / distance**2
        curl = self.side * (1j * k + 1 / distance) * green / distance
        # Products of the vector from the source with the tangents at both of its ends.
        to_t, to_p = own_across * x + own_along * z, y
        from_t = across * (x * cosine + y * sine) + along * z
        from_p = y * cosine - x * sine
        # u . (R x v) for the tangents u at the point, and v at the source.
        t_p = own_across * (-z * cosine) + own_along * (x * cosine + y * sine)
        p_p = -z * sine
        t_t = own_across * (y * along - z * across * sine) + own_along * across * (
            x * sine - y * cosine
        )
        p_t = z * across * cosine - x * along
        return (
            direct * (own_across * across * cosine + own_along * along)
            + radial * to_t * from_t
            + curl * t_p,
            direct * (-own_across * sine) + radial * to_t * from_p - curl * t_t,
            direct * across * sine + radial * to_p * from_t + curl * p_p,
            direct * cosine + radial * to_p * from_p - curl * p_t,
        )

    def magnetic(self, electric: Field) -> Field:
        """Derive the magnetic field, times the wave impedance of the medium, from the electric one.

        Parameters
        ----------
        electric : (mode, component, ring, component, source) complex128
            What `electric` gives.

        Returns
        -------
        (mode, component, ring, component, source) complex128
        """
        out = np.empty_like(electric)
        out[:, :, :, 0] = self.side * electric[:, :, :, 1]
        out[:, :, :, 1] = -self.side * electric[:, :, :, 0]
        return out


def _integrated(field: Field, weights: Array) -> Field:
    """Integrals (source, mode) of a field (source, azimuth); real weights save half of the work."""
    return field.real @ weights + 1j * (field.imag @ weights)
