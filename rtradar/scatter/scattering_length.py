"""`scattering_length`: one target, any antennas, one number each; what validation and users reach for alone."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.scatter.analytic import far_field_echo


def scattering_length(
    target: Ellipsoids,
    tx: ArrayLike,
    rx: ArrayLike,
    frequency: ArrayLike,
    fidelity: str = "specular",
    polarization: Literal["v", "h"] = "v",
    **dials: Any,
) -> NDArray[np.complex128]:
    """Co-polar scattering length of a target between each Tx and Rx.

    Parameters
    ----------
    target : Ellipsoids
        Where its parts hide each other, `specular` sees it.
    tx, rx : (n, 3) array_like
        Antennas, pair by pair [m], in the coordinates of the target. One of them may be a single (3,).
    frequency : float or (n,) array_like
        [Hz].
    fidelity : {"specular", "analytic"}
        The rung.
    polarization : {"v", "h"}
        v is world z projected across the line of sight, h is across both.
    **dials
        Of the rung: ``variant`` ("auto", "llvm", "scalar", "cuda") for `specular`.

    Returns
    -------
    (n,) complex128
        Scattering length [m] for exp(+j omega t): the scattered field times |tx - origin| |rx - origin|, its phase
        relative to the path over the origin of the coordinates. Far away ``|.|^2`` is the radar cross-section.

    Raises
    ------
    InputError
        Where shapes do not fit, an antenna is inside the target, or the rung or a dial is unknown.
    """
    tx_array, rx_array, wavenumber = _pairs(tx, rx, frequency)
    if polarization not in ("v", "h"):
        raise InputError(f"scattering_length: polarization {polarization!r} is unknown; allowed: v, h")
    known = {"analytic": (), "specular": ("variant",)}
    if fidelity not in known:
        raise InputError(f"scattering_length: fidelity '{fidelity}' is unknown; allowed: {', '.join(known)}")
    for dial in dials:
        if dial not in known[fidelity]:
            allowed = ", ".join(known[fidelity]) or "none"
            raise InputError(f"scattering_length: '{fidelity}' has no dial '{dial}'; it has: {allowed}")
    if not isinstance(target, Ellipsoids):
        raise InputError(
            f"scattering_length: '{fidelity}' takes rt.Ellipsoids, not {type(target).__name__}: it needs curvature in closed form"
        )
    for name, antennas in (("tx", tx_array), ("rx", rx_array)):
        _refuse_inside(target, name, antennas)
    pairs = len(tx_array)
    poses = (
        np.broadcast_to(target.centres, (pairs, *target.centres.shape)),
        np.broadcast_to(target.frames, (pairs, *target.frames.shape)),
        target.semi_axes,
    )
    if fidelity == "analytic":
        length, amplitude = far_field_echo(tx_array, rx_array[:, None], *poses)
    else:
        length, amplitude = _specular(target, tx_array, rx_array, poses, polarization, **dials)
    range_tx, range_rx = np.linalg.norm(tx_array, axis=1), np.linalg.norm(rx_array, axis=1)
    phase = np.exp(-1j * wavenumber[:, None] * (length[:, 0] - (range_tx + range_rx)[:, None]))
    return np.asarray((amplitude[:, 0] * phase).sum(axis=1) * range_tx * range_rx)


def _pairs(
    tx: ArrayLike, rx: ArrayLike, frequency: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Antennas (n, 3) twice and wavenumbers (n,)."""
    try:
        tx_array, rx_array = (np.atleast_2d(np.asarray(antenna, dtype=np.float64)) for antenna in (tx, rx))
        wavenumber = 2 * np.pi * np.asarray(frequency, dtype=np.float64) / SPEED_OF_LIGHT_MPS
    except (TypeError, ValueError):
        raise InputError("scattering_length: tx, rx [m] and frequency [Hz] must be numbers") from None
    shapes = f"tx {tx_array.shape}, rx {rx_array.shape}, frequency {wavenumber.shape}"
    counts = {len(tx_array), len(rx_array), *wavenumber.shape} - {1}
    if tx_array.shape[1:] != (3,) or rx_array.shape[1:] != (3,) or wavenumber.ndim > 1 or len(counts) > 1:
        raise InputError(f"scattering_length: shapes {shapes}; they must be (n, 3), (n, 3), (n,), or one for all")
    if not (np.isfinite(tx_array).all() and np.isfinite(rx_array).all()):
        raise InputError("scattering_length: tx and rx must be finite [m]")
    if not (np.isfinite(wavenumber) & (wavenumber > 0)).all():
        raise InputError("scattering_length: frequency must be positive and finite [Hz]")
    n = counts.pop() if counts else 1
    return np.broadcast_to(tx_array, (n, 3)), np.broadcast_to(rx_array, (n, 3)), np.broadcast_to(wavenumber, (n,))


def _specular(
    target: Ellipsoids,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    poses: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    polarization: Literal["v", "h"],
    variant: str = "auto",
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    # On use: these bring numba and Mitsuba.
    from rtradar.scatter.mirror import mirror
    from rtradar.scatter.occlusion import unobstructed
    from rtradar.trace.backend import select, use
    from rtradar.trace.body_tracer import BodyTracer

    length, amplitude, points = mirror(tx, rx[:, None], *poses, polarization=polarization, points=True)
    tracer = BodyTracer(use(select(variant)), target.semi_axes)
    tracer.pose(target.centres, target.frames)
    return length, amplitude * unobstructed(tracer, tx, rx[:, None], points)


def _refuse_inside(target: Ellipsoids, name: str, antennas: NDArray[np.float64]) -> None:
    local = np.einsum("pji,npj->npi", target.frames, antennas[:, None] - target.centres) / target.semi_axes
    inside = np.argwhere((local**2).sum(axis=-1) <= 1)
    if len(inside):
        antenna, part = inside[0]
        raise InputError(
            f"scattering_length: {name}[{antenna}] is inside ellipsoid {part}; antennas must stand outside the target"
        )
