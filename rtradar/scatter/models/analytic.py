"""The echo model `analytic`: closed-form cross-sections at specular ranges, without occlusion."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, Ellipsoids
from rtradar.echoes import Echoes
from rtradar.kernels.scatter.specular_point import Geometry, far_field
from rtradar.radar import Radar
from rtradar.rcs import ellipsoid
from rtradar.scatter.common.polarization import unit
from rtradar.scatter.common.poses import BuiltInModel, chirp_poses, one_echo_a_part
from rtradar.scatter.target import sum_of_echoes, target_geometry
from rtradar.system.threads import in_threads


def far_field_echo(
    at: Geometry, *, spreading: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Echo of each ellipsoid by its far-field cross-section along the bisector of both antennas.

    The bisector is that of the directions of Tx and Rx from the centre. Returned are the lengths
    (chirp, rx, part) of the path over the surface point whose normal is that bisector [m], and the
    square roots of the cross-sections (chirp, rx, part), over R1 R2 with ``spreading`` [m]; 0 where
    Tx and Rx are exactly opposite.

    Equations :eq:`specular-point-far` and :eq:`rcs-ellipsoid` of the theory page.
    """
    at = Geometry.of(at)
    shape = (*at.rx.shape[:2], at.centres.shape[1])
    length, amplitude = np.empty(shape), np.empty(shape)
    in_threads(far_field, len(length), at, spreading, length, amplitude)
    return length, amplitude


def plane_wave_echo(
    at: Geometry,
    places: tuple[NDArray[np.float64], NDArray[np.float64]],
    *,
    spreading: bool = True,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Echo of each ellipsoid as the paper has it (eqs 8 to 11).

    The range is that of the centre, and waves are plane over the array, with the middles of all Tx
    and of all Rx at ``places (chirp, 3)``. Other parameters and returns are those of
    `far_field_echo`. The cross-section is the right one, not that of the paper's code. Where walls
    mirror Tx and Rx differently, it is the one for the direction half-way between both arrays.
    """
    distances, sights = [], []
    # Distances and directions of all centres from the middle of the Tx, and from that of the Rx.
    for place in places:
        sight = at.centres - place[:, None]
        distances.append(np.linalg.norm(sight, axis=-1))
        sights.append(sight / distances[-1][..., None])
    # A plane wave reaches an antenna earlier by its offset along the line of sight.
    lead = np.einsum("ci,cpi->cp", at.tx - places[0], sights[0])[:, None]
    lead = lead + np.einsum("cri,cpi->crp", at.rx - places[1][:, None], sights[1])
    # The direction half-way between both arrays, as seen from the centre, in the axes of each part.
    normal = np.einsum("cpji,cpj->cpi", at.frames, -unit(sights[0] + sights[1]))
    theta = np.arccos(np.clip(normal[..., 2], -1, 1))
    phi = np.arctan2(normal[..., 1], normal[..., 0])
    a, b, c = at.semi_axes.T
    amplitude = np.sqrt(ellipsoid(a, b, c, theta, phi))
    if spreading:
        amplitude = amplitude / (distances[0] * distances[1])
    length = (distances[0] + distances[1])[:, None] - lead
    return length, np.broadcast_to(amplitude[:, None], lead.shape)


def _scattering_length(
    target: Ellipsoids,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    frequency: NDArray[np.float64],
    polarization: Literal["v", "h"],
) -> NDArray[np.complex128]:
    """Scattering length of one target, alike in both polarisations."""
    at = target_geometry(target, tx, rx)
    return sum_of_echoes(*far_field_echo(at), at, frequency)


class Analytic(BuiltInModel):
    """`analytic`: closed-form cross-section at the specular range of each antenna.

    One formula for a conductor, `conductor_echo`, gives the echoes in free space, and in rooms the
    direct echoes and those over walls.
    """

    traces = False
    fast_over_walls = True
    relative_cost = 1.0
    scattering: ClassVar[Callable[..., NDArray[np.complex128]] | None] = staticmethod(
        _scattering_length
    )

    def __init__(self, radar: Radar, body: Body, *, spreading: bool = True) -> None:
        self._radar, self._body, self._spreading = radar, body, spreading
        self.variant: str | None = None

    def conductor_echo(self, at: Geometry) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Compute the echo of each part, as if it were a perfect conductor, before given antennas.

        Parameters
        ----------
        at : Geometry
            Antennas and ellipsoids, chirp by chirp. In rooms the antennas may be images of those of
            the radar over walls, and the ellipsoids only some of the body's.

        Returns
        -------
        length : (chirp, rx, part) float64
            Length of the path from Tx to Rx [m].
        amplitude : (chirp, rx, part) float64
            Scattering length, over R1 R2 with ``spreading`` [m].
        """
        return far_field_echo(at, spreading=self._spreading)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        at = chirp_poses(self._radar, self._body, chirps)
        length, amplitude = self.conductor_echo(Geometry.of(at))
        return one_echo_a_part(at.tx_index, length, amplitude, self._radar.centre_frequency_hz)


class AnalyticPaper(Analytic):
    """`analytic-paper`: range of the centre and plane waves over the array, as in the paper."""

    fast_over_walls = False
    scattering = None

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        radar, at = self._radar, chirp_poses(self._radar, self._body, chirps)
        # The middles of all Tx and of all Rx, wherever the radar is at that time.
        tx, rx = radar.antennas_at(np.minimum(radar.centres_of(chirps), self._body.duration_s))
        middles = tx.mean(axis=1), rx.mean(axis=1)
        length, amplitude = plane_wave_echo(Geometry.of(at), middles, spreading=self._spreading)
        return one_echo_a_part(at.tx_index, length, amplitude, radar.centre_frequency_hz)
