"""The echo model `rays`: shooting and bouncing rays by Mitsuba, on targets and on moving people."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.kernels.elementary import cubic_weights
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import interpolation_weights, sweep_nodes
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.common.poses import (
    BuiltInModel,
    KeyframeCache,
    check_option,
    chirp_poses,
    has_mesh,
    keyframe_before,
    keyframe_step,
    keyframe_time,
)
from rtradar.scatter.facets.radiation import one_after_the_other
from rtradar.scatter.facets.skin import Skin, skin_of
from rtradar.scatter.ray_tubes import Shooter, exits, radiate
from rtradar.scatter.specular_points import solve_specular_points
from rtradar.scatter.target import EllipsoidGrid, Grid, MeshGrid, target_mesh
from rtradar.scene.mesh_files import Triangles
from rtradar.trace.backend import select, use
from rtradar.trace.tracers import BodyTracer, MeshTracer, Surfaces

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

RAYS_PER_WAVELENGTH = 3.0
BOUNCES_OF_TARGET = 3


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
    # Facets are as small as the shortest wavelength asks for.
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
    # Rays are shot once for each Tx, and summed for each Rx.
    for transmitter, of_tx in _alike(tx):
        shots = shooter.shoot(transmitter)
        for receiver, of_rx in _alike(rx[of_tx]):
            own = of_tx[of_rx]
            # All footprints are one sum, whose phase is relative to the path over the origin.
            length = np.full((1, 1), np.linalg.norm(transmitter) + np.linalg.norm(receiver))
            for order, each in enumerate(shots):
                to = exits(surfaces, each, receiver[None]), receiver[None], wavenumber[own], length
                # The integral is tapered where light comes over another part of a curved body, and
                # not for one bounce.
                tapered = order > 0 and not surfaces.flat
                sums = radiate(each, *to, polarization=sent, tapered=tapered)
                field[own] += sums[:, 0, 0]
            # Scattering lengths are without the spreading to the origin.
            field[own] *= np.linalg.norm(transmitter) * np.linalg.norm(receiver)
    return field


def _scene(mi: Any, solid: Ellipsoids | Triangles, edge: float) -> tuple[Surfaces, Grid]:
    """Return what rays meet, and facets with edges of this length [m] at which they are aimed."""
    if isinstance(solid, Ellipsoids):
        return _Ellipsoids(mi, solid.semi_axes, edge).posed(solid)
    grid = MeshGrid.cut(solid.corners, MeshGrid.divisions(solid.corners, edge))
    return MeshTracer(mi, solid.corners), grid


class _Ellipsoids:
    """Ellipsoids with facets whose edges are ``edge`` long [m].

    ``part (surface,)`` is the part of each surface that rays meet.
    """

    def __init__(self, mi: Any, semi_axes: Array, edge: float) -> None:
        self._tracer, self.part = BodyTracer(mi, semi_axes), np.arange(len(semi_axes))
        self._grid = EllipsoidGrid.cover(semi_axes, edge)

    def posed(self, pose: Ellipsoids, _time_s: float = 0.0) -> tuple[Surfaces, Grid]:
        """Return what rays meet in a pose, and the facets at which they are aimed."""
        self._tracer.pose(pose.centres, pose.frames)
        return self._tracer, replace(self._grid, pose=pose)


def check_options(rays_per_wavelength: float, bounces: int) -> None:
    """Raise an `InputError` where an option is out of range."""
    fine = 0.1 <= rays_per_wavelength <= 100
    check_option("rays", "rays_per_wavelength", rays_per_wavelength, fine, "from 0.1 to 100")
    fine = isinstance(bounces, int) and 1 <= bounces <= 10
    check_option("rays", "bounces", bounces, fine, "a whole number from 1 to 10")


def _alike(points: Array) -> list[tuple[Array, NDArray[np.int64]]]:
    """List each point that occurs, with the rows where it does."""
    unique, inverse = np.unique(points, axis=0, return_inverse=True)
    return [(point, np.flatnonzero(inverse.ravel() == index)) for index, point in enumerate(unique)]


# -- people ----------------------------------------------------------------------------------------


ANCHOR_S = 10e-3
"""Time between keyframes of people of ellipsoids [s]."""

_OF_MESHES_MPS = 4.3
"""Wavelength over the time between keyframes of people with a mesh [m/s]. Several places of one
part send there, each past the part's path at a speed of its own: 10 ms would leave an error of
-16 dB at 12 GHz (``validation/other_methods/human_mesh.py``)."""

_SAME = 1e-5
"""Fraction of the people's extent: what is met nearer to a face than that is the face."""

_KEPT_SHOTS = 1024
"""Shots remembered: a second of 12 Tx and 10 ms; one with 13 nodes, 8 Rx, 42 echoes has 70 kB."""
BOUNCES_OF_BODY = 1
_NODES_PER_HZ = (1e-9, 3e-9)
"""Frequency nodes beyond three: for paths over one part, and for several bounces in one echo."""


class Rays(BuiltInModel):
    """`rays`: ray tubes, with bounces.

    Tubes go from each Tx to facets fixed to the body, and are summed at each Rx as vectors.

    Occlusion: at every bounce. Each ray is asked which part it meets, every 10 ms.

    The path over the specular point of each part is exact at every chirp; for a mesh it is that of
    its ellipsoids. Rays are shot at keyframes, and the amplitude on that path, which varies slowly,
    is interpolated by cubics over four of them. For several bounces the mean path is interpolated,
    too.

    Parameters
    ----------
    rays_per_wavelength : float
        Wavelength at the sweep centre over the edge of a tube's facet, 0.1 to 100.
    bounces : int
        Largest number of reflections on the way, 1 to 10. Two bounces on a body of ellipsoids go
        partly over the creases where two of them touch, which no real body has, and add 0.9 dB to
        the power of a walker: one is the default.
    anchor_s : float, optional
        Time between keyframes [s], below 1; 0 shoots at every chirp; None: 10 ms, and where
        somebody has a mesh 5 ms at 12 GHz and 0.9 ms at 77 GHz, proportional to the wavelength.

    Raises
    ------
    InputError
        Where an option is out of range, or would take too many tubes.
    """

    accepts_meshes = True
    scattering = staticmethod(rays_scattering)
    relative_cost = 100.0

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        rays_per_wavelength: float = RAYS_PER_WAVELENGTH,
        bounces: int = BOUNCES_OF_BODY,
        anchor_s: float | None = None,
    ) -> None:
        check_options(rays_per_wavelength, bounces)
        if anchor_s is None:
            anchor_s = radar.wavelength_m / _OF_MESHES_MPS if has_mesh(body) else ANCHOR_S
        fine = 0 <= anchor_s < 1
        check_option("rays", "anchor_s", anchor_s, fine, "from 0 (every chirp) to 1 s")
        self._radar, self._body, self._spreading, self._bounces = radar, body, spreading, bounces
        self._stop_hz = radar.start_frequency_hz + radar.bandwidth_hz
        self._step = keyframe_step(radar, anchor_s)
        backend, edge = select(variant), radar.wavelength_m / rays_per_wavelength
        self.variant: str | None = backend.kind
        mi = use(backend)
        self._target: _Ellipsoids | _Skins = (
            _Skins(mi, radar, body, edge)
            if has_mesh(body)
            else _Ellipsoids(mi, body.semi_axes, edge)
        )
        self._posed: tuple[int, Surfaces, Grid] | None = None
        self._shots: KeyframeCache[tuple[int, int], _Shot] = KeyframeCache(0, _KEPT_SHOTS)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps: one for each number of bounces and part that was met last."""
        at = chirp_poses(self._radar, self._body, chirps)
        parts, orders = len(at.semi_axes), self._bounces
        frequency = self._nodes(orders > 1)
        length = np.zeros((len(at.tx), at.rx.shape[1], orders * parts))
        amplitude = np.zeros((len(frequency), *length.shape), dtype=np.complex128)
        # Cubics over the four keyframes about each chirp, with the shot of the Tx that is on.
        intervals, rest = keyframe_before(self._radar, chirps, self._step)
        places = zip(intervals, cubic_weights(rest / self._step), at.tx_index, strict=True)
        for index, (before, weights, tx) in enumerate(places):
            for place, weight in enumerate(weights, start=int(before) - 1):
                # Before the start of the capture the first keyframe stands for the earlier one.
                if weight != 0:
                    shot = self._shot(max(place, 0) * self._step, int(tx))
                    length[index] += weight * shot.length
                    amplitude[:, index] += weight * shot.amplitude
        # Echoes of one bounce have the exact path of their specular point.
        length[:, :, :parts] = solve_specular_points(at)[0]
        return Echoes(
            length=length,
            amplitude=amplitude,
            frequency=frequency,
            tx=at.tx_index,
            part=np.tile(np.arange(parts), orders),
            bounces=np.repeat(np.arange(1, orders + 1), parts),
        )

    def _shot(self, chirp: int, tx: int) -> _Shot:
        """Return what every Rx receives from one Tx in the pose of that chirp."""
        return self._shots.get((chirp, tx), partial(self._shoot, chirp, tx))

    def _shoot(self, chirp: int, tx: int) -> _Shot:
        time_s = keyframe_time(self._radar, self._body, chirp)
        radar, (centres, frames, axes) = self._radar.at(time_s), self._body.at([time_s])
        # All Tx of one keyframe share the posed body.
        if self._posed is None or self._posed[0] != chirp:
            pose = Ellipsoids(centres[0], frames[0], axes)
            self._posed = chirp, *self._target.posed(pose, time_s)
        _, surfaces, grid = self._posed
        sent = Polarization(radar.polarization, radar.axes)
        shooter = Shooter(
            surfaces=surfaces,
            grid=grid,
            bounces=self._bounces,
            wavenumber=2 * np.pi * self._stop_hz / SPEED_OF_LIGHT_MPS,
            polarization=sent,
            spreading=self._spreading,
        )
        # Lengths of single reflections are those of the specular points.
        place, rx = radar.tx[tx], radar.rx[radar.rx_of_tx[tx]]
        antennas = place[None], rx[None]
        specular = solve_specular_points(Geometry(*antennas, centres, frames, axes))[0][0]
        frequency = self._nodes(self._bounces > 1)
        lengths, amplitudes = [], []
        # Each number of bounces has an echo for each part that was met last, at the mean path of
        # its tubes.
        for order, footprints in enumerate(shooter.shoot(place)):
            free = exits(surfaces, footprints, rx)
            own = replace(footprints, surface=self._target.part[footprints.surface])
            lengths.append(own.mean_paths(own.surface, rx, specular) if order else specular)
            # One bounce needs fewer frequencies: it is brought to the nodes of the others.
            nodes = self._nodes(order > 0)
            sums = radiate(
                own,
                free,
                rx,
                2 * np.pi * nodes / SPEED_OF_LIGHT_MPS,
                lengths[-1],
                polarization=sent,
                spreading=self._spreading,
                tapered=order > 0 and not surfaces.flat,
            )
            amplitudes.append(
                sums
                if len(nodes) == len(frequency)
                else np.tensordot(interpolation_weights(nodes, frequency), sums, axes=1)
            )
        return _Shot(np.concatenate(lengths, axis=-1), np.concatenate(amplitudes, axis=-1).conj())

    def _nodes(self, several_bounces: bool) -> Array:
        """Frequencies (node,) at the zeros of a Chebyshev polynomial over the sweep [Hz]."""
        per_hz = _NODES_PER_HZ[several_bounces]
        return sweep_nodes(self._radar, 3 + min(17, math.ceil(per_hz * self._radar.bandwidth_hz)))


class _Skins:
    """People of whom some have a mesh: their skins, cut into facets as those of `_Ellipsoids`.

    A skin scatters by the flat triangles that `physical-optics` sums, however they are cut.
    """

    def __init__(self, mi: Any, radar: Radar, body: Body, edge: float) -> None:
        self._mi, stop_hz = mi, radar.start_frequency_hz + radar.bandwidth_hz
        self._skins: list[Skin] = [skin_of(person, stop_hz) for person in body.people]
        counts = [len(person.semi_axes) for person in body.people]
        self.part = np.repeat(one_after_the_other([own.part for own in self._skins], counts), 4)
        # Cut as at the start of the recording, so that each facet keeps its place in the material.
        self._divisions = MeshGrid.divisions(self._corners(0.0), edge, by_area=True)

    def posed(self, _pose: Ellipsoids, time_s: float) -> tuple[Surfaces, Grid]:
        corners = self._corners(time_s)
        tracer = MeshTracer(self._mi, corners, same=_SAME)
        return tracer, MeshGrid.cut(corners, self._divisions)

    def _corners(self, time_s: float) -> Array:
        return np.concatenate([skin.posed(time_s)[1][skin.fine] for skin in self._skins])


class _Shot(NamedTuple):
    """``length (rx, echo)`` [m] and ``amplitude (node, rx, echo)`` of one Tx in one pose."""

    length: Array
    amplitude: NDArray[np.complex128]
