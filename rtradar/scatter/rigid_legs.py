"""Both legs of a path between the array and an object that moves: what hides it, and what is left.

A leg is straight, through walls, or over walls from the image of its antenna. It carries the field
of its antenna as a vector to the middle of each facet, which reflects as a conductor does about the
bisector of both legs, times what the material leaves at the facet's own angle. By reciprocity a
receiver receives what it would send.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import shadow_nodes
from rtradar.scatter.common.polarization import (
    POLARIZATIONS,
    Polarization,
    antenna_field,
    bisector,
    unit,
)
from rtradar.scatter.multipath.image_paths import WallPath, images
from rtradar.scatter.multipath.slabs import Carried, WallResponse
from rtradar.scene import Material, Object, reflection
from rtradar.trace.occluders import Occluders

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Bools = NDArray[np.bool_]

_TOGETHER = 1.0
"""Range cells of path, c / bandwidth, by which waves of a slab may differ in delay and be one echo:
at half of it polynomials through three nodes err by 16 % of the wave that comes later."""


class RigidLegs:
    """The legs of one path of a radar at rest, with the walls as they answer at given frequencies.

    ``places (place, 3)`` are the images of those from which visibility is asked [m], with weights
    ``tx_weight (tx, place)`` and ``rx_weight (rx, place)``.
    """

    def __init__(
        self, radar: Radar, path: WallPath, walls: WallResponse, past: Occluders | None
    ) -> None:
        self.path, self._radar, self._walls, self._past = path, radar, walls, past
        self._polarization = Polarization(radar.polarization, radar.axes)
        self._real, self.tx_weight, self.rx_weight = shadow_nodes(radar)
        self._sends: Bools = np.any(self.tx_weight != 0, axis=0)
        self.places = np.where(
            self._sends[:, None], images(path.out, self._real), images(path.back, self._real)
        )

    def seen(
        self, time_s: float, points: Array, asked: Bools, *, but: Object | None = None
    ) -> Bools:
        """Which of the points (point, 3) [m] that are ``asked`` each place sees at a time [s].

        Both the result and ``asked`` are (place, point). All objects ``but`` one may hide points.
        """
        free = asked.copy()
        # Places of Tx are asked over the leg out, places of Rx over the leg back.
        for leg, own in ((self.path.out, self._sends), (self.path.back, ~self._sends)):
            places = np.flatnonzero(own)
            along, extent = self._walls.edges.leg(leg, self._real[places, None], points)
            open_ = free[places] & (extent != 0)
            # A point is free if no section of the leg to it is occluded.
            for origins, targets in pairwise(along):
                start, end, _ = np.broadcast_arrays(origins, targets, open_[..., None])
                if self._past is not None:
                    some = start[open_], end[open_]
                    open_[open_] = self._past.clear(*some, time_s, but=but)
            free[places] = open_
        return free

    def longer_m(self, point: Array) -> float:
        """Length that slabs add to the strongest wave over both legs to a point (3,) [m].

        A leg adds none where no wave comes to the point.
        """
        total = 0.0
        for leg in self._carried(point[None]):
            powers = [float((np.abs(wave.field) ** 2).sum()) for wave in leg.waves]
            if powers:
                total += float(leg.waves[int(np.argmax(powers))].extra_m[0])
        return total

    def factor(self, points: Array, normals: Array, made_of: Material, longer_m: float) -> Field:
        """Field of facets over that of a conductor between isotropic antennas, (node, facet).

        ``points`` are their middles and ``normals (facet, 3)`` unit vectors, world [m]. The phase
        of a length ``longer_m`` is taken out; waves that come much earlier or later are left out.
        """
        out, back = self._carried(points)
        # A conductor across the bisector of both legs reflects the one into the other.
        normal = bisector(-out.ways[-1], -back.ways[-1])
        radar = self._radar
        k = 2 * np.pi * self._walls.frequency[:, None] / SPEED_OF_LIGHT_MPS
        apart = _TOGETHER * SPEED_OF_LIGHT_MPS / radar.bandwidth_hz
        total = np.zeros((len(k), len(points)), dtype=np.complex128)
        # Every wave that arrives, with every wave that the receiver would send back.
        for sent in out.waves:
            field = sent.field
            turned = 2 * np.sum(field * normal, axis=-1, keepdims=True) * normal - field
            for received in back.waves:
                # Waves that are much earlier or later than the strongest belong to other range
                # cells.
                extra = sent.extra_m + received.extra_m - longer_m
                near = np.abs(extra) <= apart
                # A conductor at normal incidence counts as +1: that the field is reversed is in
                # the sign.
                total -= near * np.exp(-1j * k * extra) * np.sum(received.field * turned, axis=-1)
        if made_of.conducts:
            return total
        # What the material leaves of a conductor's field: the fraction of the field in TE follows
        # from the polarisation that arrives, and the coefficients from the facet's own angle.
        way = -normal
        cosine = np.clip(np.abs(np.sum(normals * way, axis=-1)), 0.0, 1.0)
        across = unit(np.cross(way, normals))
        te = np.sum(antenna_field(way, self._polarization) * across, axis=-1) ** 2
        eta = made_of.eta(np.array([radar.centre_frequency_hz]))
        in_te, in_tm = (reflection(eta, cosine, kind) for kind in POLARIZATIONS)
        # TE counts with minus its coefficient and TM with its own, so that a conductor has 1.
        return np.asarray(total * (in_tm - te * (in_te + in_tm)))

    def _carried(self, points: Array) -> list[Carried]:
        """Carry the field of the array's middle over both legs to points (point, 3) [m]."""
        given = np.array(self._radar.position_m), points
        sides = (self.path.out, self._radar.tx_antenna), (self.path.back, self._radar.rx_antenna)
        return [
            self._walls.carried(leg, *given, antenna, self._polarization) for leg, antenna in sides
        ]
