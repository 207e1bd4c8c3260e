"""Helpers that several scripts share: decibels, root mean squares, simple bodies, a patch antenna.

None of them uses what the scripts judge. A script imports them after this folder has joined
``sys.path``, because each runs by hand from any folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body.body import Poses

Array = NDArray[np.float64]


def power_db(ratio: Any) -> Any:
    """Ratio of powers in decibels."""
    return 10 * np.log10(ratio)


def field_db(ratio: Any) -> Any:
    """Ratio of complex fields or amplitudes in decibels."""
    return 20 * np.log10(np.abs(ratio))


def rms(values: Any) -> float:
    """Root mean square of real or complex values."""
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def one_ellipsoid(
    axes: Any, frame: Array | None = None, centre: Array | None = None
) -> rt.Ellipsoids:
    """One ellipsoid of given semi-axes [m], at the origin and along its axes by default."""
    at = np.zeros(3) if centre is None else centre
    return rt.Ellipsoids([at], [np.eye(3) if frame is None else frame], [axes])


@dataclass(frozen=True)
class MovingEllipsoid:
    """A body of one ellipsoid in straight motion, with all that a model needs of a body."""

    centre: tuple[float, float, float]  # at 0 s [m]
    axes: tuple[float, float, float]  # semi-axes [m]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m/s]
    frame: Array | None = None  # columns are the axes; None: those of the world
    duration_s: float = 1.0
    part_names: tuple[str, ...] = ("ellipsoid",)
    names: tuple[str, ...] = ("somebody",)
    material: str = "perfect-conductor"
    people: tuple[()] = ()  # none of them has a mesh

    @property
    def owner(self) -> NDArray[np.int64]:
        return np.zeros(1, dtype=np.int64)

    @property
    def materials(self) -> tuple[str, ...]:
        return (self.material,)

    @property
    def semi_axes(self) -> Array:
        return np.array([self.axes])

    def at(self, times: Array) -> Poses:
        times = np.atleast_1d(times)
        frame = np.eye(3) if self.frame is None else self.frame
        centres = np.array(self.centre) + times[:, None, None] * np.array(self.velocity)
        return Poses(centres, np.broadcast_to(frame, (len(times), 1, 3, 3)), self.semi_axes)


def patch_antenna() -> rt.Antenna:
    """A rectangular microstrip patch in vertical polarisation, on a ground plane of some size.

    Cavity model of C. A. Balanis, Antenna Theory (3rd ed.), eqs. 14-43 to 14-45, on a substrate of
    a relative permittivity of 2.2, its thickness neglected: the patch is L = 0.337 and W = 0.395
    wavelengths long and wide (eqs. 14-6 and 14-7). In elevation, the E-plane, the field falls as
    cos(pi L sin theta), in azimuth, the H-plane, as cos(theta) sinc(W sin theta). A finite ground
    plane lets a little through to the back, 20 dB less than ahead, which the model has not. The
    gain is that of the pattern without losses.
    """
    length, width, back_db = 0.337, 0.395, -20.0
    degrees = np.arange(-180.0, 181.0, 5.0)
    angle, high = np.radians(degrees), np.abs(degrees) <= 90  # elevation ends at the zenith
    sine, ahead = np.sin(angle), np.maximum(np.cos(angle), 0.0)
    azimuth = np.maximum(field_db((ahead * np.sinc(width * sine)).clip(1e-9)), back_db)
    elevation = field_db(np.cos(np.pi * length * sine[high]))
    # Power through the unit sphere, of which 1 would be isotropic; solid angle is cos(e) de da.
    over_e = np.cos(angle[high]) * 10 ** (elevation / 10)
    whole = np.outer(10 ** (azimuth[:-1] / 10), over_e).sum() * np.radians(5.0) ** 2
    return rt.Antenna(
        pattern="table",
        gain_dbi=power_db(4 * np.pi / whole),
        azimuth_deg=tuple(degrees),
        azimuth_db=tuple(azimuth),
        elevation_deg=tuple(degrees[high]),
        elevation_db=tuple(elevation),
    )
