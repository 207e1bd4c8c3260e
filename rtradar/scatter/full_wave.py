"""Targets of ``fidelity="full-wave"``: which method of `rtradar.full_wave` takes them."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.errors import InputError, ValidityWarning
from rtradar.full_wave import BodiesOfRevolution, ClosedMesh, ConductingSurface, Spheroid
from rtradar.scatter.target import target_mesh
from rtradar.scene import material as material_of

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

FULL_WAVE = "full-wave"

_ALIKE = 1e-6
"""Relative difference of two semi-axes, and sine between two axes, that counts as none."""

_POOR = 1e-3
"""Residual of the boundary condition above which the field is warned of: some 0.01 dB."""


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
    for one in np.unique(frequency):
        own = np.flatnonzero(frequency == one)
        permittivity = _permittivity(material, float(one))
        given = float(one), permittivity, (tx[own], rx[own]), polarization
        if isinstance(target, Ellipsoids):
            out[own] = _of_ellipsoids(target, *given)
        else:
            out[own] = _of_mesh(target, *given)
    return out


def _permittivity(material: str, frequency_hz: float) -> complex | None:
    """Relative permittivity of a material; None for a perfect conductor."""
    eta = complex(material_of(material).eta(frequency_hz))
    return eta if np.isfinite(eta) else None


def _of_ellipsoids(
    target: Ellipsoids,
    frequency_hz: float,
    permittivity: complex | None,
    antennas: tuple[Array, Array],
    polarization: Literal["v", "h"],
) -> NDArray[np.complex128]:
    """Field of coaxial ellipsoids of revolution, at one frequency."""
    bodies = coaxial_bodies(target, frequency_hz, permittivity)
    length, residual = bodies.solve(*antennas, polarization)
    if (worst := residual.max(initial=0.0)) > _POOR:
        warnings.warn(
            f"scattering_length: '{FULL_WAVE}' leaves {worst:.1%} of the incident field on the "
            "surface; an antenna or another body is too near for these sources",
            ValidityWarning,
            stacklevel=4,
        )
    return length


def _of_mesh(
    target: object,
    frequency_hz: float,
    permittivity: complex | None,
    antennas: tuple[Array, Array],
    polarization: Literal["v", "h"],
) -> NDArray[np.complex128]:
    """Field of closed conducting meshes, at one frequency."""
    mesh = target_mesh(target, *antennas)
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
    surface = ConductingSurface(ClosedMesh(mesh.vertices, mesh.faces), frequency_hz)
    return surface.scattering_length(*antennas, polarization)


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
    own = [_own_axis(*one) for one in zip(target.frames, target.semi_axes, strict=True)]
    away = target.centres - target.centres[0]
    farthest = away[np.argmax(np.linalg.norm(away, axis=1))]
    candidates = [farthest] if farthest.any() else []
    candidates += [frame[:, 2] for frame, radius, half in own if radius != half]
    axis = np.array(candidates[0] if candidates else [0.0, 0.0, 1.0])
    axis = axis / np.linalg.norm(axis)
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
    across = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(axis, across), axis], axis=1)
    return BodiesOfRevolution(
        spheroids, frequency_hz, target.centres[0], frame, permittivity=permittivity
    )


def _own_axis(frame: Array, semi_axes: Array) -> tuple[Array, float, float]:
    """Frame whose third column is the axis of revolution, and the semi-axes across and along."""
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
