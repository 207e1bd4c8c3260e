"""Where the search for specular points begins: at those of one pair of antennas, known at anchors 10 ms apart."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.radar import Radar
from rtradar.scatter.common.keyframe_cache import FirstCome
from rtradar.scatter.common.poses import anchor_step, chirp_poses
from rtradar.scatter.specular_point.solver import mirror

_KEPT_ANCHORS, _PASSING = 2048, 32
"""The first 20 s of a recording, which is gone through twice, in 1 MB; and of what comes later a block of chirps."""


class MirrorStarts:
    """Starting points of a moving body over a capture, from which three steps lead to a specular point.

    Parameters
    ----------
    radar : Radar
    body : Body
    """

    def __init__(self, radar: Radar, body: Body) -> None:
        self._radar, self._body = radar, body
        self._step = anchor_step(radar)
        self._anchors: FirstCome[int, NDArray[np.float64]] = FirstCome(_KEPT_ANCHORS, _PASSING)

    def at(
        self, chirps: NDArray[np.int64], parts: NDArray[np.int64] | None = None
    ) -> NDArray[np.float64]:
        """Specular points at the anchors before some chirps, in the axes of the parts.

        Parameters
        ----------
        chirps : (chirp,) int64
            Numbered from the start of the capture.
        parts : (part,) int64, optional
            Which are wanted; all if left out.

        Returns
        -------
        (chirp, part, 3) float64
            [m].
        """
        numbers, place = np.unique(
            np.asarray(chirps, dtype=np.int64) // self._step, return_inverse=True
        )
        points = np.stack(
            [self._anchors.get(number, partial(self._find, number)) for number in numbers.tolist()]
        )
        return (points if parts is None else points[:, parts])[place]

    def _find(self, number: int) -> NDArray[np.float64]:
        at = chirp_poses(self._radar, self._body, np.array([number * self._step]))
        _, _, points = mirror(at.tx, at.rx[:, :1], at.centres, at.frames, at.semi_axes, points=True)
        return np.einsum("pji,pj->pi", at.frames[0], points[0, 0] - at.centres[0])
