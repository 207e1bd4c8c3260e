"""Several bounces on a thin sheet that moves: a corner reflector on a cart.

At knots in time tubes of rays are shot at the sheet, as `rtradar.scatter.clutter.furniture` does
for one that stands, from every Tx to its Rx. Their fields are shared between echoes of fixed
spacing about the path over the object's point of reference, which is exact at every chirp; between
knots run polynomials. Past furniture, other objects and people, the field is that of the fractions
of the sheet that both antennas see.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.clutter.furniture import SHEET_BOUNCES
from rtradar.scatter.common.keyframes import KeyframeCache
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.ray_tubes.footprints import Footprints, radiate
from rtradar.scatter.ray_tubes.shooting import Shooter, exits
from rtradar.scatter.ray_tubes.tubes import MeshGrid
from rtradar.scatter.rigid.polynomials import PolynomialsInTime
from rtradar.trace.mesh_tracer import MeshTracer

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_KEPT_KNOTS, _PASSING = 128, 32


class SheetBounces:
    """Echoes of two bounces and more on a sheet, for any chirps.

    Mitsuba, ``mi``, has its variant set. ``pose(times)`` gives rotations (time, 3, 3) and the point
    of reference (time, 3), world [m], of ``triangles`` and their facets ``grid``, both about that
    point; ``open_at(time)`` the fractions (tx,) and (rx,) of the sheet that antennas see past
    others, times the gain of the antennas. Echoes are ``step`` [m] apart in length.
    """

    def __init__(
        self,
        mi: Any,
        radar: Radar,
        triangles: Array,
        grid: MeshGrid,
        *,
        pose: Callable[[Array], tuple[Array, Array]],
        open_at: Callable[[float], tuple[Array, Array]],
        frequency: Array,
        step: float,
        knot_s: float,
        spreading: bool,
    ) -> None:
        self._mi, self._radar, self._triangles, self._grid = mi, radar, triangles, grid
        self._pose, self._open_at, self._spreading = pose, open_at, spreading
        self._wavenumber = 2 * np.pi * frequency / SPEED_OF_LIGHT_MPS
        self._step, self._knot_s = step, knot_s
        radius = float(np.linalg.norm(triangles, axis=-1).max())
        self._half = int(np.ceil((SHEET_BOUNCES + 1) * radius / step)) + 1
        self._count = 2 * self._half + 2
        self._orders = np.arange(2, SHEET_BOUNCES + 1)
        self._knots: KeyframeCache[int, NDArray[np.complex128]] = KeyframeCache(
            _KEPT_KNOTS, _PASSING
        )

    def echoes(
        self, times: Array, tx: Indices, *, whole: bool
    ) -> tuple[Array, NDArray[np.complex64], Indices]:
        """Lengths (echo,) [m] beyond the path over the point of reference, amplitudes, bounces.

        Amplitudes (node, chirp, rx, echo) are as of `Echoes` [m], for the Tx ``tx (chirp,)``. All
        echoes are there if ``whole``, else those that are not 0.
        """
        knots = PolynomialsInTime(times, self._knot_s)
        field = np.stack(
            [self._knots.get(own, partial(self._knot, own)) for own in knots.numbers.tolist()]
        )
        used = field.any(axis=(0, 1, 2, 3)) | whole
        out = knots.between(field[..., used], tx)
        beyond = np.arange(-self._half, self._half + 2) * self._step
        bounces = np.repeat(self._orders, self._count).astype(np.int64)
        return np.tile(beyond, len(self._orders))[used], out, bounces[used]

    def _knot(self, number: int) -> NDArray[np.complex128]:
        """Amplitudes (tx, rx, node, echo) at one knot, the echoes of each number of bounces."""
        time_s = number * self._knot_s
        radar, ((rotation,), (at,)) = self._radar.at(time_s), self._pose(np.array([time_s]))
        polarization = Polarization(radar.polarization, radar.axes)
        surfaces = MeshTracer(self._mi, self._triangles @ rotation.T + at)
        shooter = Shooter(
            surfaces=surfaces,
            grid=MeshGrid(self._grid.corners @ rotation.T + at, self._grid.face),
            bounces=SHEET_BOUNCES,
            wavenumber=float(self._wavenumber.max()),
            polarization=polarization,
            spreading=self._spreading,
            two_sided=True,
        )
        shape = radar.n_tx, len(self._orders), len(self._wavenumber), radar.n_rx, self._count
        out = np.zeros(shape, dtype=np.complex128)
        open_tx, open_rx = self._open_at(time_s)
        for index, tx in enumerate(radar.tx):
            rx = radar.rx[radar.rx_of_tx[index]]
            over = np.linalg.norm(tx - at) + np.linalg.norm(rx - at, axis=1)
            for order, footprints in enumerate(shooter.shoot(tx)[1:]):
                if len(footprints):
                    visible = exits(surfaces, footprints, rx)
                    given = footprints, visible, rx, over, polarization
                    out[index, order] = self._shared(*given)
            out[index] *= open_tx[index] * open_rx[radar.rx_of_tx[index]][:, None]
        out = np.moveaxis(out.conj(), 1, 3)
        return out.reshape(*out.shape[:1], len(self._wavenumber), radar.n_rx, -1).swapaxes(1, 2)

    def _shared(
        self,
        footprints: Footprints,
        visible: NDArray[np.bool_],
        rx: Array,
        over: Array,
        polarization: Polarization,
    ) -> NDArray[np.complex128]:
        """Field (node, rx, echo) of footprints, shared between the two echoes next to each."""
        middle = rx.mean(axis=0)
        path = footprints.path[:, 3] + np.linalg.norm(footprints.places[:, 3] - middle, axis=1)
        place = (path - over.mean()) / self._step + self._half
        cell = np.clip(np.floor(place), 0, self._count - 2).astype(np.int64)
        fraction = np.clip(place - cell, 0.0, 1.0)
        after = fraction**2 * (3 - 2 * fraction)
        lengths = over[:, None] + (np.arange(self._count) - self._half) * self._step
        total = np.zeros((len(self._wavenumber), *lengths.shape), complex)
        for own, share in ((cell, 1 - after), (cell + 1, after)):
            lit = replace(footprints, field=footprints.field * share[:, None], surface=own)
            total += radiate(
                lit,
                visible,
                rx,
                self._wavenumber,
                lengths,
                polarization=polarization,
                spreading=self._spreading,
            )
        return total
