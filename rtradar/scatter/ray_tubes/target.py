"""Scattering length of any target by shooting and bouncing rays."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.ray_tubes.footprints import radiate
from rtradar.scatter.ray_tubes.shooting import Shooter, exits
from rtradar.scatter.ray_tubes.tubes import EllipsoidGrid, Grid, MeshGrid
from rtradar.scatter.target import target_mesh
from rtradar.scene.mesh_files import Triangles
from rtradar.trace.backend import select, use
from rtradar.trace.body_tracer import BodyTracer
from rtradar.trace.mesh_tracer import MeshTracer
from rtradar.trace.rays import Surfaces

if TYPE_CHECKING:
    import trimesh

RAYS_PER_WAVELENGTH = 3.0
BOUNCES_OF_TARGET = 3

Array = NDArray[np.float64]


def rays_scattering(
    target: Ellipsoids | trimesh.Trimesh,
    tx: Array,
    rx: Array,
    frequency: Array,
    *,
    polarization: Literal["v", "h"] = "v",
    variant: str = "auto",
    rays_per_wavelength: float = RAYS_PER_WAVELENGTH,
    bounces: int = BOUNCES_OF_TARGET,
) -> NDArray[np.complex128]:
    """Co-polar scattering length (n,) of a perfect conductor by shooting and bouncing rays.

    Parameters, returns and errors are those of `scattering_length`; the edge of a tube's facet is
    the shortest wavelength over ``rays_per_wavelength``, ``bounces`` the most reflections on the
    way. An `InputError` is raised, too, where these would take too many tubes.
    """
    check_options(rays_per_wavelength, bounces)
    solid = target if isinstance(target, Ellipsoids) else target_mesh(target, tx, rx)
    field = np.zeros(len(tx), dtype=np.complex128)
    if len(tx) == 0:
        return field
    mi = use(select(variant))
    wavenumber = 2 * np.pi * np.asarray(frequency, dtype=np.float64) / SPEED_OF_LIGHT_MPS
    sent = Polarization(polarization)
    surfaces, grid = _scene(mi, solid, 2 * np.pi / wavenumber.max() / rays_per_wavelength)
    shooter = Shooter(
        surfaces=surfaces,
        grid=grid,
        bounces=bounces,
        wavenumber=float(wavenumber.max()),
        polarization=sent,
        two_sided=not (isinstance(solid, Ellipsoids) or solid.closed),
    )
    for transmitter, of_tx in _alike(tx):
        shots = shooter.shoot(transmitter)
        for receiver, of_rx in _alike(rx[of_tx]):
            own = of_tx[of_rx]
            length = np.full((1, 1), np.linalg.norm(transmitter) + np.linalg.norm(receiver))
            for order, each in enumerate(shots):
                to = exits(surfaces, each, receiver[None]), receiver[None], wavenumber[own], length
                tapered = order > 0 and not surfaces.flat
                sums = radiate(each, *to, polarization=sent, tapered=tapered)
                field[own] += sums[:, 0, 0]
            field[own] *= np.linalg.norm(transmitter) * np.linalg.norm(receiver)
    return field


def _scene(mi: Any, solid: Ellipsoids | Triangles, edge: float) -> tuple[Surfaces, Grid]:
    """What rays meet, and facets with edges of this length [m] at which they are aimed."""
    if isinstance(solid, Ellipsoids):
        surfaces = BodyTracer(mi, solid.semi_axes)
        surfaces.pose(solid.centres, solid.frames)
        return surfaces, replace(EllipsoidGrid.cover(solid.semi_axes, edge), pose=solid)
    grid = MeshGrid.cut(solid.corners, MeshGrid.divisions(solid.corners, edge))
    return MeshTracer(mi, solid.corners), grid


def check_options(rays_per_wavelength: float, bounces: int) -> None:
    """Raise an `InputError` where an option is out of range."""
    if not 0.1 <= rays_per_wavelength <= 100:
        raise InputError(
            f"rays: rays_per_wavelength = {rays_per_wavelength}; allowed are 0.1 to 100"
        )
    if not (isinstance(bounces, int) and 1 <= bounces <= 10):
        raise InputError(f"rays: bounces = {bounces}; allowed are 1 to 10")


def _alike(points: Array) -> list[tuple[Array, NDArray[np.int64]]]:
    """Each point that occurs, with the rows where it does."""
    unique, inverse = np.unique(points, axis=0, return_inverse=True)
    return [(point, np.flatnonzero(inverse.ravel() == index)) for index, point in enumerate(unique)]
