"""The echo model `analytic`: the closed-form cross-section of each ellipsoid at its specular range; nothing hides anything."""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.kernels.jit import compiled
from rtradar.radar import Radar
from rtradar.rcs import ellipsoid
from rtradar.scatter.common.body_material import Surface
from rtradar.scatter.common.poses import BuiltInModel, ChirpPoses, chirp_poses, one_echo_a_part

_NO_BISECTOR = 1e-24  # square of the sum of two opposite unit vectors, as rounding leaves it
_LANES = 8


def far_field_echo(
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    centres: NDArray[np.float64],
    frames: NDArray[np.float64],
    semi_axes: NDArray[np.float64],
    *,
    spreading: bool = True,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Echo of each ellipsoid by its far-field cross-section along the bisector of Tx and Rx as its centre sees them.

    Parameters
    ----------
    tx, rx : (chirp, 3), (chirp, rx, 3) float64
        [m].
    centres, frames, semi_axes : (chirp, part, 3), (chirp, part, 3, 3), (part, 3) float64
        Poses [m].
    spreading : bool
        Whether the amplitude is divided by R1 R2, normalised to 1 m.

    Returns
    -------
    length : (chirp, rx, part) float64
        Tx..Rx path over the surface point whose normal is that bisector [m].
    amplitude : (chirp, rx, part) float64
        Square root of the cross-section, over R1 R2 with ``spreading`` [m]; 0 where Tx and Rx are exactly opposite.

    Notes
    -----
    Equations :eq:`specular-point-far` and :eq:`rcs-ellipsoid` of the theory page.
    """
    tx, rx, centres, frames, semi_axes = (
        np.ascontiguousarray(a, dtype=np.float64) for a in (tx, rx, centres, frames, semi_axes)
    )
    shape = (*rx.shape[:2], centres.shape[1])
    length, amplitude = np.empty(shape), np.empty(shape)
    _far_field(tx, rx, centres, frames, semi_axes, spreading, length, amplitude)
    return length, amplitude


@compiled(parallel=True, fastmath={"contract"})
def _far_field(tx, rx, centres, frames, semi_axes, spreading, length, amplitude):
    chirps, receivers, parts = length.shape
    for chirp in prange(chirps):
        to_tx = np.empty(3)
        # Receivers side by side: to each of them in the axes of the part, then length and amplitude. One array of a size that is
        # known beforehand: of many the compiler would have to fear that they overlap.
        lanes = np.empty((5, _LANES))
        for part in range(parts):
            centre, frame = centres[chirp, part], frames[chirp, part]
            a, b, c = semi_axes[part, 0], semi_axes[part, 1], semi_axes[part, 2]
            for i in range(3):
                to_tx[i] = 0.0
                for j in range(3):
                    to_tx[i] += frame[j, i] * (tx[chirp, j] - centre[j])
            norm_tx = math.sqrt(to_tx[0] ** 2 + to_tx[1] ** 2 + to_tx[2] ** 2)
            t0, t1, t2 = to_tx[0], to_tx[1], to_tx[2]
            u0, u1, u2 = t0 / norm_tx, t1 / norm_tx, t2 / norm_tx
            root_volume = math.sqrt(math.pi) * a * b * c
            for first in range(0, receivers, _LANES):
                count = min(_LANES, receivers - first)
                for k in range(_LANES):
                    receiver = first + min(k, count - 1)
                    x, y, z = (
                        rx[chirp, receiver, 0] - centre[0],
                        rx[chirp, receiver, 1] - centre[1],
                        rx[chirp, receiver, 2] - centre[2],
                    )
                    for i in range(3):
                        lanes[i, k] = frame[0, i] * x + frame[1, i] * y + frame[2, i] * z
                for k in range(_LANES):
                    r0, r1, r2 = lanes[0, k], lanes[1, k], lanes[2, k]
                    norm = math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
                    inverse = 1 / norm
                    n0, n1, n2 = u0 + r0 * inverse, u1 + r1 * inverse, u2 + r2 * inverse
                    squared = n0 * n0 + n1 * n1 + n2 * n2
                    # |A n| for the unit normal n is the support function h; the surface point with that normal is A^2 n / h.
                    support = a * a * n0 * n0 + b * b * n1 * n1 + c * c * n2 * n2
                    scale = 1 / math.sqrt(support)
                    s0, s1, s2 = a * a * n0 * scale, b * b * n1 * scale, c * c * n2 * scale
                    range_tx = math.sqrt(
                        (t0 - s0) * (t0 - s0) + (t1 - s1) * (t1 - s1) + (t2 - s2) * (t2 - s2)
                    )
                    range_rx = math.sqrt(
                        (r0 - s0) * (r0 - s0) + (r1 - s1) * (r1 - s1) + (r2 - s2) * (r2 - s2)
                    )
                    # Square root of the cross-section, pi (abc)^2 / h^4: that of `rtradar.rcs.ellipsoid` without its angles.
                    root = root_volume * squared * (scale * scale)
                    # Straight through there is no bisector, and no reflection.
                    there = squared >= _NO_BISECTOR
                    lanes[3, k] = range_tx + range_rx if there else norm_tx + norm
                    lanes[4, k] = (
                        (root / (range_tx * range_rx) if spreading else root) if there else 0.0
                    )
                for k in range(count):
                    length[chirp, first + k, part], amplitude[chirp, first + k, part] = (
                        lanes[3, k],
                        lanes[4, k],
                    )


def plane_wave_echo(
    radar: Radar,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    centres: NDArray[np.float64],
    frames: NDArray[np.float64],
    semi_axes: NDArray[np.float64],
    *,
    spreading: bool = True,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Echo of each ellipsoid as the paper has it: range of the centre, plane waves over the array (eqs 8 to 11).

    Parameters and returns are those of `far_field_echo`. The cross-section is the right one, not the paper code's.
    """
    place = np.asarray(radar.position_m)
    sight = centres - place
    distance = np.linalg.norm(sight, axis=-1)
    sight = sight / distance[..., None]
    lead = np.einsum("ci,cpi->cp", tx - place, sight)[:, None] + np.einsum(
        "cri,cpi->crp", rx - place, sight
    )
    amplitude = np.sqrt(_cross_section(semi_axes, np.einsum("cpji,cpj->cpi", frames, -sight)))
    if spreading:
        amplitude = amplitude / distance**2
    return 2 * distance[:, None] - lead, np.broadcast_to(amplitude[:, None], lead.shape)


def _cross_section(
    semi_axes: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    theta, phi = (
        np.arccos(np.clip(normal[..., 2], -1, 1)),
        np.arctan2(normal[..., 1], normal[..., 0]),
    )
    return ellipsoid(semi_axes[:, 0], semi_axes[:, 1], semi_axes[:, 2], theta, phi)


class Analytic(BuiltInModel):
    """`analytic`: the specular range to each antenna, and the cross-section of each ellipsoid.

    Parameters
    ----------
    radar : Radar
        Radar, where it is in the scene.
    body : Body
        Body, which hides none of its own parts.
    spreading : bool
        Whether amplitudes hold 1 / (R1 R2).
    material : {"perfect-conductor", "skin"}
        Material of the body's surface.

    Raises
    ------
    InputError
        Where a body is not made of that, or it is not known over the sweep.
    """

    traces = False
    supports_rooms = True
    relative_cost = 1.0

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        spreading: bool = True,
        material: str = "perfect-conductor",
    ) -> None:
        self._radar, self._body, self._spreading = radar, body, spreading
        self._surface = Surface(material, radar)
        self.variant: str | None = None

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        at = chirp_poses(self._radar, self._body, chirps)
        length, amplitude = self._returns(at)
        echo = self._surface.echo(at, amplitude)
        return one_echo_a_part(at.tx_index, length, echo, self._radar.centre_frequency_hz)

    def _returns(self, at: ChirpPoses) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return far_field_echo(*at[1:], spreading=self._spreading)


class AnalyticPaper(Analytic):
    """`analytic-paper`: the range of each centre and plane waves over the array, as in the paper."""

    supports_rooms = False

    def _returns(self, at: ChirpPoses) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return plane_wave_echo(self._radar, *at[1:], spreading=self._spreading)
