"""`scattering_length`: one target, any antennas, one number for each pair of them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError, ValidityWarning
from rtradar.full_wave import BodiesOfRevolution, ClosedMesh, ConductingSurface, Spheroid
from rtradar.scatter.echo_models import models_that, refuse_options
from rtradar.scatter.models.analytic import far_field_echo
from rtradar.scatter.target import target_geometry, target_mesh
from rtradar.scatter.validity import warn_of_small_radii
from rtradar.scene import material as material_of
from rtradar.scene.mesh_files import Triangles
from rtradar.system.registries import MODELS

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

# -- full wave -------------------------------------------------------------------------------------


FULL_WAVE = "full-wave"

_ALIKE = 1e-6
"""Relative difference of two semi-axes, and sine between two axes, that counts as none."""

_POOR = 1e-3
"""Residual of the boundary condition above which a warning is given: some 0.01 dB of the field."""


def full_wave_scattering(
    target: Ellipsoids | trimesh.Trimesh,
    tx: Array,
    rx: Array,
    frequency: Array,
    *,
    polarization: Literal["v", "h"],
    material: str = "perfect-conductor",
) -> NDArray[np.complex128]:
    """Co-polar scattering length (n,) of a target by a full-wave method.

    Parameters, returns and errors are those of `scattering_length`; ``material`` is the name of
    what fills the target, a perfect conductor by default.
    """
    out = np.empty(len(tx), dtype=np.complex128)
    # A system of equations serves all pairs of one frequency.
    for one in np.unique(frequency).tolist():
        own = np.flatnonzero(frequency == one)
        antennas = tx[own], rx[own]
        eta = complex(material_of(material).eta(one))
        permittivity = eta if np.isfinite(eta) else None  # None for a perfect conductor
        if not isinstance(target, Ellipsoids):
            surface = _surface(target_mesh(target, *antennas), one, permittivity)
            out[own] = surface.scattering_length(*antennas, polarization)
            continue
        bodies = coaxial_bodies(target, one, permittivity)
        out[own], residual = bodies.solve(*antennas, polarization)
        if (worst := residual.max(initial=0.0)) > _POOR:
            warnings.warn(
                f"scattering_length: '{FULL_WAVE}' leaves {worst:.1%} of the incident field on the "
                "surface; an antenna or another body is too near for these sources",
                ValidityWarning,
                stacklevel=3,
            )
    return out


def _surface(
    mesh: Triangles, frequency_hz: float, permittivity: complex | None
) -> ConductingSurface:
    """Make the problem of closed conducting meshes."""
    if not mesh.closed:
        raise InputError(
            f"scattering_length: the mesh is open; '{FULL_WAVE}' takes closed meshes: close its "
            "holes, or give a sheet a thickness"
        )
    if permittivity is not None:
        raise InputError(
            f"scattering_length: '{FULL_WAVE}' takes meshes of perfect conductors alone; leave "
            "material out, or take ellipsoids of revolution"
        )
    return ConductingSurface(ClosedMesh(mesh.vertices, mesh.faces), frequency_hz)


def coaxial_bodies(
    target: Ellipsoids, frequency_hz: float, permittivity: complex | None = None
) -> BodiesOfRevolution:
    """Find the common axis of ellipsoids of revolution, and make the problem of them.

    Parameters
    ----------
    target : Ellipsoids
        Ellipsoids with two equal semi-axes, on one axis.
    frequency_hz : float
        Frequency of the wave [Hz].
    permittivity : complex, optional
        Relative permittivity of all of them; None: perfect conductors.

    Returns
    -------
    BodiesOfRevolution

    Raises
    ------
    InputError
        Where an ellipsoid has three different semi-axes, they have no common axis, or the bodies
        overlap or are too large.
    """
    # The common axis: through the centres if there are several, else that of a body that is no
    # sphere. Spheres fit any axis.
    own = [_own_axis(*one) for one in zip(target.frames, target.semi_axes, strict=True)]
    away = target.centres - target.centres[0]
    farthest = away[np.argmax(np.linalg.norm(away, axis=1))]
    candidates = [farthest] if farthest.any() else []
    candidates += [frame[:, 2] for frame, radius, half in own if radius != half]
    axis = np.array(candidates[0] if candidates else [0.0, 0.0, 1.0])
    axis = axis / np.linalg.norm(axis)
    # Every body has to be on that axis, and turned along it.
    scale = float(target.semi_axes.max())
    for part, (frame, radius, half) in enumerate(own):
        tilted = radius != half and np.linalg.norm(np.cross(frame[:, 2], axis)) > _ALIKE
        if tilted or np.linalg.norm(np.cross(away[part], axis)) > _ALIKE * scale:
            raise InputError(
                f"scattering_length: ellipsoid {part} is not on the axis of the others; "
                f"'{FULL_WAVE}' takes ellipsoids of revolution about one common axis"
            )
    spheroids = tuple(
        Spheroid(radius, half, float(offset @ axis))
        for (_, radius, half), offset in zip(own, away, strict=True)
    )
    # Any two axes across the common one complete the frame.
    across = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(axis, across), axis], axis=1)
    return BodiesOfRevolution(
        spheroids, frequency_hz, target.centres[0], frame, permittivity=permittivity
    )


def _own_axis(frame: Array, semi_axes: Array) -> tuple[Array, float, float]:
    """Frame whose third column is the axis of revolution, and the semi-axes across and along."""
    # Which two semi-axes are equal; a sphere's third is made exactly equal to them.
    for last in (2, 0, 1):
        first, second = (last + 1) % 3, (last + 2) % 3
        radius = float(semi_axes[first] + semi_axes[second]) / 2
        if abs(semi_axes[first] - semi_axes[second]) <= _ALIKE * radius:
            half = float(semi_axes[last])
            half = radius if abs(half - radius) <= _ALIKE * radius else half
            return frame[:, [first, second, last]], radius, half
    raise InputError(
        f"scattering_length: an ellipsoid has semi-axes of {semi_axes.tolist()} m; '{FULL_WAVE}' "
        "takes ellipsoids of revolution: make two of them equal"
    )


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
    pairs = tx_array, rx_array, frequencies
    if isinstance(target, Ellipsoids):
        for name, antennas in (("tx", tx_array), ("rx", rx_array)):
            _refuse_inside(target, name, antennas)
        target = target.without_repeats() if traces else target
        # Whoever asks for optics is warned where much of the echo comes from radii that are too
        # small.
        if len(tx_array) and fidelity != FULL_WAVE:
            _, amplitude = far_field_echo(target_geometry(target, tx_array, rx_array))
            wavenumber = 2 * np.pi * frequencies / SPEED_OF_LIGHT_MPS
            given = target, tx_array, rx_array, wavenumber, amplitude[:, 0]
            warn_of_small_radii(*given, stacklevel=2)
    return np.asarray(scattering(target, *pairs, polarization=polarization, **model_options))


def _method_for(
    target: object, fidelity: str, options: Iterable[str]
) -> tuple[Callable[..., NDArray[np.complex128]], bool]:
    """Return the function of a model that takes such targets and options, and whether it traces."""
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
    # All lengths must be the same, or 1, which stands for all pairs.
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
    # In the axes where each ellipsoid is the unit sphere.
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
