"""`scattering_length`: one target, any antennas, one number each; what validation and users reach for alone."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.scatter.echo_models import MODELS
from rtradar.scatter.models.analytic import far_field_echo
from rtradar.scatter.validity import warn_of_small_radii

if TYPE_CHECKING:
    import trimesh


Field = Callable[..., NDArray[np.complex128]]


class _Home(NamedTuple):
    """Where the field of a model is computed: module and function within this package."""

    module: str
    function: str


_HOMES = {
    "analytic": _Home("scattering_length", "_analytic_field"),
    "specular": _Home("scattering_length", "_specular_field"),
    "fresnel": _Home("models.fresnel", "fresnel_scattering"),
    "physical-optics": _Home("facets.target", "facet_scattering"),
    "reference": _Home("facets.target", "facet_scattering"),
    "rays": _Home("ray_tubes.target", "rays_scattering"),
}
_COMMON = ("target", "tx", "rx", "frequency", "polarization")


def scattering_length(
    target: Ellipsoids | trimesh.Trimesh,
    tx: ArrayLike,
    rx: ArrayLike,
    frequency: ArrayLike,
    fidelity: str = "specular",
    polarization: Literal["v", "h"] = "v",
    **model_options: Any,
) -> NDArray[np.complex128]:
    """Co-polar scattering length of a target between each Tx and Rx.

    Parameters
    ----------
    target : Ellipsoids or trimesh.Trimesh
        Its parts hide each other where the model traces, and of parts that fill the same place one counts. Meshes, of perfect
        conductors, are for ``physical-optics``, ``reference`` (the same here, where nothing is interpolated) and ``rays``; an
        open mesh is a thin sheet.
    tx, rx : (n, 3) array_like
        Antennas, pair by pair [m], in the coordinates of the target. One of them may be a single (3,).
    frequency : float or (n,) array_like
        Frequency of the wave, for all pairs or for each [Hz].
    fidelity : {"analytic", "specular", "fresnel", "physical-optics", "reference", "rays"}
        The model.
    polarization : {"v", "h"}
        v is world z projected across the line of sight, h is across both.
    **model_options
        Settings of that model: ``variant`` ("auto", "cpu", "llvm", "scalar", "cuda") of all that
        trace, ``shadow_rays`` of ``fresnel``, ``facets`` of ``physical-optics`` and ``reference``,
        ``rays_per_wavelength`` and ``bounces`` of ``rays``.

    Returns
    -------
    (n,) complex128
        Scattering length [m] for exp(+j omega t): the scattered field times ``|tx - origin| |rx - origin|``, its phase
        relative to the path over the origin of the coordinates. Far away ``|.|^2`` is the radar cross-section.

    Raises
    ------
    InputError
        Where shapes do not fit, an antenna is inside the target, a mesh cannot be used (`rtradar.scatter.target_mesh`), or the
        model or an option is unknown.

    Notes
    -----
    Equation :eq:`scattering-length` of the theory page.
    """
    tx_array, rx_array, frequencies = _pairs(tx, rx, frequency)
    if polarization not in ("v", "h"):
        raise InputError(
            f"scattering_length: polarization {polarization!r} is unknown; allowed: v, h"
        )
    if fidelity not in _HOMES:
        raise InputError(
            f"scattering_length: fidelity '{fidelity}' is unknown; allowed: {', '.join(_HOMES)}"
        )
    home, model = _HOMES[fidelity], MODELS[fidelity]
    if isinstance(target, Ellipsoids):
        for name, antennas in (("tx", tx_array), ("rx", rx_array)):
            _refuse_inside(target, name, antennas)
    elif not model.accepts_meshes:  # type: ignore[attr-defined]
        raise InputError(
            f"scattering_length: '{fidelity}' takes rt.Ellipsoids, not {type(target).__name__}: it needs curvature in closed form"
        )
    # On use: what traces brings Mitsuba.
    field: Field = getattr(import_module(f"rtradar.scatter.{home.module}"), home.function)
    known = [name for name in inspect.signature(field).parameters if name not in _COMMON]
    for option in model_options:
        if option not in known:
            allowed = ", ".join(known) or "none"
            raise InputError(
                f"scattering_length: '{fidelity}' has no option '{option}'; it has: {allowed}"
            )
    if isinstance(target, Ellipsoids) and model.traces:  # type: ignore[attr-defined]
        target = target.without_repeats()
    if isinstance(target, Ellipsoids) and len(tx_array):
        _, amplitude = far_field_echo(
            Geometry(tx_array, rx_array[:, None], *_poses(target, len(tx_array)))
        )
        wavenumber = 2 * np.pi * frequencies / SPEED_OF_LIGHT_MPS
        warn_of_small_radii(target, tx_array, rx_array, wavenumber, amplitude[:, 0], stacklevel=2)
    return field(
        target, tx_array, rx_array, frequencies, polarization=polarization, **model_options
    )


def _analytic_field(
    target: Ellipsoids,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    frequency: NDArray[np.float64],
    polarization: Literal["v", "h"],
) -> NDArray[np.complex128]:
    length, amplitude = far_field_echo(Geometry(tx, rx[:, None], *_poses(target, len(tx))))
    return _sum(length, amplitude, tx, rx, frequency)


def _specular_field(
    target: Ellipsoids,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    frequency: NDArray[np.float64],
    polarization: Literal["v", "h"],
    variant: str = "auto",
) -> NDArray[np.complex128]:
    from rtradar.scatter.specular_point.solver import solve_specular_points
    from rtradar.scatter.specular_point.visibility import unobstructed
    from rtradar.trace.backends.backend import select, use
    from rtradar.trace.body_tracer import BodyTracer

    length, amplitude, points = solve_specular_points(
        Geometry(tx, rx[:, None], *_poses(target, len(tx))), polarization=polarization, points=True
    )
    tracer = BodyTracer(use(select(variant)), target.semi_axes)
    tracer.pose(target.centres, target.frames)
    return _sum(
        length, amplitude * unobstructed(tracer, tx, rx[:, None], points), tx, rx, frequency
    )


def _poses(
    target: Ellipsoids, pairs: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The pose repeated for every pair, and the semi-axes."""
    centres, frames = (
        np.broadcast_to(array, (pairs, *array.shape)) for array in (target.centres, target.frames)
    )
    return centres, frames, target.semi_axes


def _sum(
    length: NDArray[np.float64],
    amplitude: NDArray[np.generic],
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    frequency: NDArray[np.float64],
) -> NDArray[np.complex128]:
    """Echoes (pair, 1, part) with 1 / (R1 R2) in them to one field a pair, relative to the path over the origin."""
    range_tx, range_rx = np.linalg.norm(tx, axis=1), np.linalg.norm(rx, axis=1)
    excess = length[:, 0] - (range_tx + range_rx)[:, None]
    phase = np.exp(-2j * np.pi * frequency[:, None] / SPEED_OF_LIGHT_MPS * excess)
    return np.asarray((amplitude[:, 0] * phase).sum(axis=1) * range_tx * range_rx)


def _pairs(
    tx: ArrayLike, rx: ArrayLike, frequency: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Antennas (n, 3) twice and frequencies (n,)."""
    try:
        tx_array, rx_array = (
            np.atleast_2d(np.asarray(antenna, dtype=np.float64)) for antenna in (tx, rx)
        )
        frequencies = np.asarray(frequency, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(
            "scattering_length: tx, rx [m] and frequency [Hz] must be numbers"
        ) from None
    shapes = f"tx {tx_array.shape}, rx {rx_array.shape}, frequency {frequencies.shape}"
    counts = {len(tx_array), len(rx_array), *frequencies.shape} - {1}
    if (
        tx_array.shape[1:] != (3,)
        or rx_array.shape[1:] != (3,)
        or frequencies.ndim > 1
        or len(counts) > 1
    ):
        raise InputError(
            f"scattering_length: shapes {shapes}; they must be (n, 3), (n, 3), (n,), or one for all"
        )
    if not (np.isfinite(tx_array).all() and np.isfinite(rx_array).all()):
        raise InputError("scattering_length: tx and rx must be finite [m]")
    if not (np.isfinite(frequencies) & (frequencies > 0)).all():
        raise InputError("scattering_length: frequency must be positive and finite [Hz]")
    n = counts.pop() if counts else 1
    return (
        np.broadcast_to(tx_array, (n, 3)),
        np.broadcast_to(rx_array, (n, 3)),
        np.broadcast_to(frequencies, (n,)),
    )


def _refuse_inside(target: Ellipsoids, name: str, antennas: NDArray[np.float64]) -> None:
    local = (
        np.einsum("pji,npj->npi", target.frames, antennas[:, None] - target.centres)
        / target.semi_axes
    )
    inside = np.argwhere((local**2).sum(axis=-1) <= 1)
    if len(inside):
        antenna, part = inside[0]
        raise InputError(
            f"scattering_length: {name}[{antenna}] is inside ellipsoid {part}; antennas must stand outside the target"
        )
