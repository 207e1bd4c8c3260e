"""The second term of geometric optics in powers of 1/k, for conducting ellipsoids.

The first term is that of a curved mirror. The second has two parts. One is of the shape: the area
of an ellipsoid's section at the depth z below its specular point grows as z (1 - z / 2p), where p
is the distance of the tangent plane from the centre. The other is of the currents, which are other
where the surface bends more along the electric field than across it.

Where Tx and Rx stand apart, with i half the angle between them as the part sees them, the first
part is (1 - tan^2 i) / cos i times as much for a field across their plane and (1 + tan^2 i) / cos i
times for one in it: exactly so for a sphere, by the series of Mie.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.kernels.elementary import smoothstep
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.scatter.common.polarization import Polarization, antenna_field, unit
from rtradar.scatter.common.poses import ChirpPoses

Array = NDArray[np.float64]

_FADES_DEG = (90.0, 120.0)
"""Angles between Tx and Rx from which and to which the term fades. From 60 degrees to the first,
spheres of ka 10 to 40 are nearer to the series of Mie with it, in rms over the angles, for both
fields (`validation/closed_forms/sphere.py`)."""


def check_terms(terms: int) -> None:
    """Raise InputError unless one term of geometric optics is asked for, or two."""
    if terms not in (1, 2):
        raise InputError(
            f"specular: terms = {terms!r}; it must be 1, for geometric optics, or 2 for the next "
            "term in powers of 1/k as well"
        )


def with_second_term(
    at: Geometry | ChirpPoses, points: Array, polarization: Polarization, wavenumber: Array
) -> NDArray[np.complex128]:
    """Both terms over the first, for specular points (chirp, rx, part, 3), world [m].

    The result (chirp, rx, part) is that of scattering lengths, for exp(+j omega t); ``wavenumber``
    [rad/m] is one for all, or (chirp, 1, 1). Equation :eq:`second-term` of the
    theory page. Where Tx and Rx are over 120 degrees apart, as a part sees them, it is 1.
    """
    ways = [unit(a - points) for a in (at.tx[:, None, None], at.rx[:, :, None])]
    turned = np.swapaxes(at.frames, -1, -2)[:, None]

    def in_axes(vectors: Array) -> Array:
        return np.asarray((turned @ vectors[..., None])[..., 0])

    inverse_squares = 1 / at.semi_axes**2
    gradient = in_axes(points - at.centres[:, None]) * inverse_squares
    # One over the distance of the tangent plane; at the centre, where there is no echo, it is 0.
    size, normal = np.linalg.norm(gradient, axis=-1), unit(gradient)
    field = in_axes(antenna_field(ways[0], polarization))
    along = unit(field - np.sum(field * normal, axis=-1, keepdims=True) * normal)
    bends = [
        np.sum(direction**2 * inverse_squares, axis=-1) / np.maximum(size, 1e-12)
        for direction in (along, np.cross(normal, along))
    ]
    cosine = np.sum(in_axes(ways[0] + ways[1]) * normal, axis=-1) / 2
    # Antennas in one direction have no plane, and no need of one.
    across = in_axes(unit(np.cross(ways[0], ways[1])))
    tangent = (1 - cosine**2) / np.maximum(cosine, 1e-12) ** 2
    turned_by = 1 + tangent * (1 - 2 * np.sum(field * across, axis=-1) ** 2)
    shape = size * turned_by / np.maximum(cosine, 1e-12)
    apart = np.degrees(2 * np.arccos(np.clip(cosine, 0.0, 1.0)))
    first, last = _FADES_DEG
    left = 1 - smoothstep(np.clip((apart - first) / (last - first), 0.0, 1.0))
    return np.asarray(1 + 1j * left * (shape + bends[0] - bends[1]) / (2 * wavenumber))
