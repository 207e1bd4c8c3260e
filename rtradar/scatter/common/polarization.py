"""Polarisation of antennas, and what a surface does to it: one TE and one TM coefficient."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEEP = 1e-9
"""Sine of the angle from the vertical below which v has no direction of its own."""
_NORMAL_INCIDENCE = 1e-9
"""Sine of incidence below which the plane of incidence has no direction of its own."""


def antenna_field(
    directions: Array, polarization: Literal["v", "h"], *, x_for_steep: bool = False
) -> Array:
    """Polarisation of the field that an antenna sends in some directions.

    Parameters
    ----------
    directions : (..., 3) float64
        Unit vectors.
    polarization : {"v", "h"}
        v is world z projected across the direction, h is across both.
    x_for_steep : bool
        Whether x is used in place of z straight above and below; else the field is 0 there.

    Returns
    -------
    (..., 3) float64
        Unit vectors, or 0.
    """
    up = np.array([0.0, 0.0, 1.0])
    if x_for_steep:
        steep = np.hypot(directions[..., 0], directions[..., 1]) < STEEP
        up = np.where(steep[..., None], [1.0, 0.0, 0.0], up)
    along = np.sum(up * directions, axis=-1, keepdims=True)
    field = up - along * directions if polarization == "v" else np.cross(directions, up)
    return _unit_or_0(field)


def bisector(to_tx: Array, to_rx: Array) -> Array:
    """Normals of a surface that reflects Tx into Rx.

    Parameters
    ----------
    to_tx, to_rx : (..., 3) float64
        Unit vectors from the surface to the antennas.

    Returns
    -------
    (..., 3) float64
        Unit vectors; 0 where the antennas are exactly opposite.
    """
    return _unit_or_0(to_tx + to_rx)


def _unit_or_0(vectors: Array) -> Array:
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.where(size > 1e-12, vectors / np.where(size > 1e-12, size, 1.0), 0.0))


def apply_te_tm(
    field: NDArray[Any],
    arriving: Array,
    leaving: Array,
    normal: Array,
    te: NDArray[Any],
    tm: NDArray[Any],
) -> NDArray[Any]:
    """Multiply the TE and the TM part of a plane wave by a coefficient each.

    Parameters
    ----------
    field : (node, ..., 3) complex or float
        Electric field of the incident wave, transverse to ``arriving``.
    arriving, leaving : (..., 3) float64
        Unit vectors along which the incident and the outgoing wave travel.
    normal : (3,) or (..., 3) float64
        Unit normal of the surface.
    te, tm : (node, ...) complex or float
        Coefficients.

    Returns
    -------
    (node, ..., 3) complex or float
        Electric field of the outgoing wave.
    """
    across = np.cross(arriving, normal)
    sine = np.linalg.norm(across, axis=-1, keepdims=True)
    # At normal incidence both coefficients do the same: any direction across the ray serves.
    spare = _unit_or_0(np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=-1)]))
    across = np.where(sine > _NORMAL_INCIDENCE, across / np.where(sine > 0, sine, 1.0), spare)
    in_te = (field * across).sum(axis=-1) * te
    in_tm = (field * np.cross(across, arriving)).sum(axis=-1) * tm
    return np.asarray(in_te[..., None] * across + in_tm[..., None] * np.cross(across, leaving))


def copolar(to_tx: Array, to_rx: Array, polarization: Literal["v", "h"]) -> Array:
    """Co-polar fraction of the field that a conductor reflects from Tx to Rx, its normal their bisector.

    Parameters
    ----------
    to_tx, to_rx : (..., 3) float64
        Vectors from the target to the antennas, of any length, world axes.
    polarization : {"v", "h"}
        v is world z projected across each line of sight, h is across both.

    Returns
    -------
    (...) float64
        E_r = 2 (n.E) n - E_i between unit vectors of polarisation; 1 where Tx and Rx are one,
        where they are exactly opposite, and where v has no direction.

    Notes
    -----
    On that surface the current of physical optics, 2 n x H, radiates just this times the scalar
    with the mean of n.s_T and n.s_R, once averaged with its own reciprocal.

    Equation :eq:`polarization` of the theory page.
    """
    tx, rx = (way / np.linalg.norm(way, axis=-1, keepdims=True) for way in (to_tx, to_rx))
    normal = bisector(tx, rx)
    sent, received = antenna_field(tx, polarization), antenna_field(rx, polarization)
    fraction = np.sum(sent * received, axis=-1) - 2 * np.sum(sent * normal, axis=-1) * np.sum(
        received * normal, axis=-1
    )
    known = sent.any(axis=-1) & received.any(axis=-1) & normal.any(axis=-1)
    return np.asarray(np.where(known, fraction, 1.0))
