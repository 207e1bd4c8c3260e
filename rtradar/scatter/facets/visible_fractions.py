"""What occluders leave of the returns of a moving body's parts, by physical optics over facets.

The visible fraction of a part is the sum over its facets with traced shadows over the same sum
without them. It changes slowly, and is found at keyframes, as the envelope of `physical-optics`:
10 ms apart, and closer where an edge crosses a part.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayNodes
from rtradar.scatter.facets.array_envelope import ArrayEnvelope
from rtradar.scatter.facets.body import FacetBody
from rtradar.scatter.facets.surfaces import edge_facets

Array = NDArray[np.float64]

_ANCHOR_S, _PLACES, _BEND, _UNEVENNESS = 10e-3, 16, 0.05, 0.02
"""Time between keyframes [s], its parts where it is divided the most, and the changes in time and
over the array that ask for more, as `ArrayEnvelope` has them. In 20 ms a limb at 4 m/s may pass
unseen (``validation/other_methods/visible_fractions.py``)."""

_WIDE = 0.1
"""Bandwidth over centre frequency above which fractions differ over the sweep: what an edge
diffracts takes another path than the return of the specular point."""


class VisibleFractions:
    """Visible fractions of the parts of a moving body over a capture.

    They are found at some ``frequency (node,)`` [Hz]: three where the sweep is wide, else one.
    ``variant`` and ``spreading`` are those of a model.
    """

    def __init__(self, radar: Radar, body: Body, *, variant: str, spreading: bool) -> None:
        wavenumber = 2 * np.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS
        self._surface = FacetBody(
            radar,
            body,
            variant=variant,
            spreading=spreading,
            facets=edge_facets(body.semi_axes, wavenumber),
            nodes=3 if radar.bandwidth_hz > _WIDE * radar.centre_frequency_hz else 1,
        )
        self.frequency = self._surface.frequency
        self._envelope = ArrayEnvelope(
            radar,
            body,
            self._surface.carriers,
            self._ratio,
            anchor_s=_ANCHOR_S,
            tolerance=_BEND,
            unevenness=_UNEVENNESS,
            places=_PLACES,
        )

    def _ratio(
        self,
        time: float,
        pose: Poses,
        nodes: ArrayNodes,
        length: Array,
        _strength: Array,
        parts: NDArray[np.int64],
    ) -> NDArray[np.complex128]:
        return self._surface.visible(time, pose, nodes, length, parts)

    def times(
        self, chirps: NDArray[np.int64], tx: NDArray[np.int64], strength: Array
    ) -> NDArray[np.complex128]:
        """Multiply the ``strength (chirp, rx, part)`` of echoes at chirps, which ``tx`` send.

        The result (node, chirp, rx, part) is in the phase convention of `Echoes`.
        """
        return self._envelope.times(chirps, tx, strength, len(self.frequency))
