"""Reflection by a half-space, and reflection and transmission by a slab of one material.

Source: ITU-R P.2040-3, the half-space of its eqs. (31a, b) and its slab of a single layer. The time
factor is exp(+j omega t). The TE field is perpendicular to the plane of incidence, the TM field is
in it. The unit vectors of TM are e_TE x k, each wave with its own direction k, so that a perfect
conductor has -1 for TE and +1 for TM, and at normal incidence both reverse the field.
"""

from __future__ import annotations

from math import pi
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Polarization = Literal["te", "tm"]


def reflection(eta: ArrayLike, cos_incidence: ArrayLike, polarization: Polarization) -> Field:
    """Compute the Fresnel reflection of a plane wave in air by a half-space (:eq:`half-space`).

    Parameters
    ----------
    eta : (...) complex
        Relative permittivity, its imaginary part not positive; infinite for a perfect conductor.
    cos_incidence : (...) float
        Cosine between the wave and the normal, 0 to 1. Broadcasts with ``eta``.
    polarization : {"te", "tm"}
        Electric field across the plane of incidence, or in it.

    Returns
    -------
    (...) complex128
        Reflected over incident field, at the surface.

    Raises
    ------
    InputError
        Where a cosine, a permittivity or the polarisation has no meaning.
    """
    eta, cosine, conducts = _checked(eta, cos_incidence, polarization)
    return np.where(conducts, _perfect(polarization), _face(eta, cosine, polarization)[0])


def slab(
    eta: ArrayLike,
    thickness_m: ArrayLike,
    frequency_hz: ArrayLike,
    cos_incidence: ArrayLike,
    polarization: Polarization,
) -> tuple[Field, Field]:
    """Compute the reflection and transmission of a plane wave by a slab in air.

    All reflections inside the slab are summed (:eq:`slab`).

    Parameters
    ----------
    eta : (...) complex
        Relative permittivity, its imaginary part not positive; infinite for a perfect conductor.
    thickness_m : (...) float
        Thickness [m], positive.
    frequency_hz : (...) float
        Frequency [Hz].
    cos_incidence : (...) float
        Cosine between the wave and the normal, 0 to 1. All of these broadcast.
    polarization : {"te", "tm"}
        Electric field across the plane of incidence, or in it.

    Returns
    -------
    reflection : (...) complex128
        Reflected over incident field, at the face that the wave meets.
    transmission : (...) complex128
        Field behind the slab over the incident one, between points opposite each other on its
        faces. In place of the same thickness of air, as on a straight path from one antenna to the
        other, it is ``transmission * exp(+1j * k * thickness_m * cos_incidence)``.

    Raises
    ------
    InputError
        Where a value has no meaning.
    """
    eta, cosine, conducts = _checked(eta, cos_incidence, polarization)
    for key, values in (("thickness_m", thickness_m), ("frequency_hz", frequency_hz)):
        if not np.all((np.asarray(values) > 0) & np.isfinite(values)):
            raise InputError(f"slab: {key} must be positive and finite")
    # The reflection at one face, and the factor of one pass; the loop sums all passes as a
    # geometric series.
    face, inner = _face(eta, cosine, polarization)
    through = _through(inner, thickness_m, frequency_hz)
    loop = 1 - (face * through) ** 2
    # At exactly grazing incidence a lossless slab of whole half waves has 0 / 0: it is transparent,
    # as at other angles.
    window = loop == 0
    loop = np.where(window, 1.0, loop)
    reflected = np.where(window, 0.0, face * (1 - through**2) / loop)
    transmitted = np.where(window, through, (1 - face**2) * through / loop)
    reflected = np.where(conducts, _perfect(polarization), reflected)
    return reflected, np.where(conducts, 0.0, transmitted)


def slab_passes(
    eta: ArrayLike,
    thickness_m: ArrayLike,
    frequency_hz: ArrayLike,
    cos_incidence: ArrayLike,
    polarization: Polarization,
    passes: int,
    *,
    rest: bool = False,
) -> Field:
    """Compute the field that leaves a slab after some passes, a term of the series of `slab`.

    It is the field over the incident one, between points opposite each other on the faces: ``r``,
    then ``(1 - r^2) (-r)^(passes - 1) q^passes`` (:eq:`passes`). Even numbers of passes leave by
    the face that the wave meets, odd ones by the other. With ``rest`` the terms of two passes more,
    four more, and so on, are added. The other arguments are those of `slab`.
    """
    eta, cosine, conducts = _checked(eta, cos_incidence, polarization)
    face, inner = _face(eta, cosine, polarization)
    through = _through(inner, thickness_m, frequency_hz)
    # The reflection at the face itself is followed by the series that begins with two passes.
    number = passes or 2
    term = (1 - face**2) * (-face) ** (number - 1) * through**number
    if rest:
        loop = 1 - (face * through) ** 2
        # Exactly grazing, nothing enters.
        term = np.where(loop == 0, 0.0, term / np.where(loop == 0, 1.0, loop))
    # At once reflected, by the face itself, and with `rest` all even passes.
    if passes == 0:
        return np.where(conducts, _perfect(polarization), face + (term if rest else 0 * term))
    return np.where(conducts, 0.0, term)


def _checked(
    eta: ArrayLike, cos_incidence: ArrayLike, polarization: Polarization
) -> tuple[Field, Array, NDArray[np.bool_]]:
    if polarization not in ("te", "tm"):
        raise InputError(f"polarization = {polarization!r}; allowed: te, tm")
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    # Cosines come from dot products of unit vectors, which rounding may leave a little above 1.
    if not np.all((cosine >= 0) & (cosine <= 1 + 1e-12)):
        raise InputError(
            "cos_incidence must be from 0 to 1: take the side of the wall that the wave meets"
        )
    values = np.asarray(eta, dtype=np.complex128)
    conducts = np.isinf(values)
    values = np.where(conducts, 1.0, values)
    if not np.all((values.imag <= 0) & (np.abs(values) > 0)):
        raise InputError(
            "eta must not be 0 nor have a positive imaginary part: exp(+j omega t) is meant"
        )
    return values, np.minimum(cosine, 1.0), conducts


def _face(eta: Field, cosine: Array, polarization: Polarization) -> tuple[Field, Field]:
    """Reflection at a face, and the normal wave number behind it relative to that of free space.

    The latter is sqrt(eta - sin^2), the decaying root; ``cosine`` is that outside.
    """
    # The normal wave number behind the face, the root whose wave decays.
    root = np.sqrt((eta - 1) + cosine**2)
    inner = np.where(root.imag > 0, -root, root)
    outer = cosine if polarization == "te" else eta * cosine
    total = outer + inner
    # Both are 0 only for air at grazing incidence, which reflects nothing.
    return np.where(total == 0, 0.0, (outer - inner) / np.where(total == 0, 1.0, total)), inner


def _through(inner: Field, thickness_m: ArrayLike, frequency_hz: ArrayLike) -> Field:
    """Compute the factor of one pass through the slab."""
    k = 2 * pi * np.asarray(frequency_hz, dtype=np.float64) / SPEED_OF_LIGHT_MPS
    return np.asarray(np.exp(-1j * k * np.asarray(thickness_m, dtype=np.float64) * inner))


def _perfect(polarization: Polarization) -> float:
    return -1.0 if polarization == "te" else 1.0
