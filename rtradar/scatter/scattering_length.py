"""`scattering_length`: one target, any antennas, one number for each pair of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.scatter.echo_models import models_that, refuse_options
from rtradar.scatter.full_wave import FULL_WAVE, full_wave_scattering
from rtradar.scatter.models.analytic import far_field_echo
from rtradar.scatter.target import target_geometry
from rtradar.scatter.validity import warn_of_small_radii
from rtradar.system.registries import MODELS

if TYPE_CHECKING:
    import trimesh


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
        Target. Its parts occlude each other where the model traces, and of parts that fill the same
        place one counts. Meshes, of perfect conductors, are for ``physical-optics``, ``reference``
        (the same here, where nothing is interpolated) and ``rays``; an open mesh is a thin sheet.
        ``full-wave`` takes ellipsoids of revolution about one common axis, which do not overlap,
        and closed meshes of up to some 17 000 edges of an eighth of a wavelength.
    tx, rx : (n, 3) array_like
        Antennas, pair by pair, in the coordinates of the target [m]. One may be a single (3,).
    frequency : float or (n,) array_like
        Frequency of the wave, for all pairs or for each [Hz].
    fidelity : {"analytic", "specular", "physical-optics", "reference", "rays", "full-wave"}
        Name of the model; ``full-wave`` solves Maxwell's equations, and is here alone.
    polarization : {"v", "h"}
        v is world z projected across the line of sight, h is across both.
    **model_options
        Settings of that model: ``variant`` ("auto", "cpu", "llvm", "scalar", "cuda") of all that
        trace, ``visibility`` of ``specular``, ``facets`` of ``physical-optics`` and ``reference``,
        ``rays_per_wavelength`` and ``bounces`` of ``rays``, and ``material`` of ``full-wave``, the
        name of a material such as ``skin`` that fills the target.

    Returns
    -------
    (n,) complex128
        Scattering length [m] for exp(+j omega t): the scattered field times ``|tx - origin| |rx -
        origin|``, its phase relative to the path over the origin of the coordinates. Far away
        ``|.|^2`` is the radar cross-section.

    Raises
    ------
    InputError
        Where shapes do not fit, an antenna is inside the target, a mesh cannot be used
        (`rtradar.scatter.target`), or the model or an option is unknown.

    Notes
    -----
    Equation :eq:`scattering-length` of the theory page. `physical-optics` and `reference` are for
    any angle between Tx and Rx, above 0.25 rad by :eq:`po-bistatic`, which is not reciprocal.
    Beyond some 60 degrees what their currents radiate from the edge of the lit side is off by 1 to
    4 dB in h, beyond 120 degrees also in v, until forward scatter is right again
    (``validation/closed_forms/bistatic.py``). Other models of optics return nothing straight
    through.

    Examples
    --------
    The specular echo of a conducting sphere of radius a is sqrt(pi) a:

    >>> import numpy as np
    >>> import rtradar as rt
    >>> sphere = rt.Ellipsoids(
    ...     centres=np.zeros((1, 3)), frames=np.eye(3)[None], semi_axes=np.full((1, 3), 0.1)
    ... )
    >>> radar = [[100.0, 0.0, 0.0]]
    >>> length = rt.scattering_length(sphere, radar, radar, 12e9)
    >>> np.round(abs(length) / (np.sqrt(np.pi) * 0.1), 2)
    array([1.])
    """
    tx_array, rx_array, frequencies = _pairs(tx, rx, frequency)
    if polarization not in ("v", "h"):
        raise InputError(
            f"scattering_length: polarization {polarization!r} is unknown; allowed: v, h"
        )
    scattering, traces = _method_for(target, fidelity, model_options)
    if isinstance(target, Ellipsoids):
        for name, antennas in (("tx", tx_array), ("rx", rx_array)):
            _refuse_inside(target, name, antennas)
    if isinstance(target, Ellipsoids) and traces:
        target = target.without_repeats()
    if isinstance(target, Ellipsoids) and len(tx_array) and fidelity != FULL_WAVE:
        _, amplitude = far_field_echo(target_geometry(target, tx_array, rx_array))
        wavenumber = 2 * np.pi * frequencies / SPEED_OF_LIGHT_MPS
        warn_of_small_radii(target, tx_array, rx_array, wavenumber, amplitude[:, 0], stacklevel=2)
    pairs = tx_array, rx_array, frequencies
    return np.asarray(scattering(target, *pairs, polarization=polarization, **model_options))


def _method_for(
    target: object, fidelity: str, options: Iterable[str]
) -> tuple[Callable[..., NDArray[np.complex128]], bool]:
    """Function of a model that knows such targets and options, and whether it traces."""
    what = f"scattering_length: '{fidelity}'"
    if fidelity == FULL_WAVE:
        refuse_options(what, full_wave_scattering, options, _COMMON)
        return full_wave_scattering, True
    MODELS.refuse_gone(fidelity)
    if fidelity not in (allowed := [*models_that("scattering"), FULL_WAVE]):
        raise InputError(
            f"scattering_length: fidelity '{fidelity}' is unknown; allowed: {', '.join(allowed)}"
        )
    model: Any = MODELS[fidelity]
    if not isinstance(target, Ellipsoids) and not model.accepts_meshes:
        raise InputError(
            f"{what} takes rt.Ellipsoids, not {type(target).__name__}: it "
            "needs curvature in closed form"
        )
    refuse_options(what, model.scattering, options, _COMMON)
    return model.scattering, model.traces


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
    counts = {len(tx_array), len(rx_array), *frequencies.shape} - {1}
    triples = tx_array.shape[1:] == rx_array.shape[1:] == (3,)
    if not triples or frequencies.ndim > 1 or len(counts) > 1:
        raise InputError(
            f"scattering_length: shapes tx {tx_array.shape}, rx {rx_array.shape}, frequency "
            f"{frequencies.shape}; they must be (n, 3), (n, 3), (n,), or one for all"
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
            f"scattering_length: {name}[{antenna}] is inside ellipsoid {part}; antennas must stand "
            "outside the target"
        )
