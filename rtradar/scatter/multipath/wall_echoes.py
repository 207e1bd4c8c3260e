"""Lengths and returns of echoes over walls, as if conductors stood alone before the images of the antennas."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.scatter.nearby_points import Ellipsoids, Images, Nearby, nearby_echoes
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.array_ends import ArrayEnds
from rtradar.scatter.common.poses import ChirpPoses
from rtradar.scatter.models.analytic import far_field_echo
from rtradar.scatter.multipath.image_paths import WallPath, images

Array = NDArray[np.float64]


class WallEchoes:
    """Geometric optics, or the far-field formula, of many echoes over walls.

    Parameters
    ----------
    radar : Radar
    paths : sequence of WallPath
        Paths that the echoes may follow.
    far_field : bool
        Whether the formula of the model `analytic` is taken.
    """

    def __init__(self, radar: Radar, paths: Sequence[WallPath], *, far_field: bool) -> None:
        self._radar, self._far_field = radar, far_field
        ends = ArrayEnds.of(radar)
        legs = list(dict.fromkeys(leg for path in paths for leg in (path.out, path.back)))
        self._out = np.array([legs.index(path.out) for path in paths])
        self._back = np.array([legs.index(path.back) for path in paths])
        # By leg: the antennas do not move, nor do their images.
        self._tx = np.array([images(leg, radar.tx) for leg in legs])
        self._rx = np.array([images(leg, radar.rx[radar.rx_of_tx]) for leg in legs])
        self._rx_in_lanes = np.ascontiguousarray(np.swapaxes(self._rx, 2, 3))
        self._rx_middle = np.array([images(leg, ends.rx_middle[ends.line_of_tx]) for leg in legs])

    def at(
        self, path: NDArray[np.int64], part: NDArray[np.int64], poses: ChirpPoses, near: Nearby
    ) -> tuple[Array, Array]:
        """Lengths and returns.

        Parameters
        ----------
        path, part : (echo,) int64
            Path and body part of each echo.
        poses : ChirpPoses
        near : Nearby
            Where specular points are expected. Those not wanted return nothing. The formula needs neither, and does all.

        Returns
        -------
        length, amplitude : (chirp, rx, echo) float64
            [m]; without regard to polarisation, which is a matter of the legs.
        """
        shape = (*poses.rx.shape[:2], len(path))
        length, amplitude = np.empty(shape), np.empty(shape)
        out, back = self._out[path], self._back[path]
        if not self._far_field:
            images = Images(self._tx, self._rx_in_lanes, self._rx_middle, out, back, part)
            nearby_echoes(images, poses.tx_index, Ellipsoids(*poses[3:]), near, length, amplitude)
            return length, amplitude
        for number in np.unique(path):
            own = path == number
            antennas = (
                self._tx[self._out[number], poses.tx_index],
                self._rx[self._back[number], poses.tx_index],
            )
            parts = part[own]
            bodies = poses.centres[:, parts], poses.frames[:, parts], poses.semi_axes[parts]
            length[..., own], amplitude[..., own] = far_field_echo(Geometry(*antennas, *bodies))
        return length, amplitude
