"""Several bounces on a thin sheet that moves: a corner reflector on a cart.

At knots in time tubes of rays are shot at the sheet, from every Tx to its Rx, as
`rtradar.scatter.clutter.furniture` does for a sheet that stands. Their fields are shared between
echoes of fixed spacing about the path over the object's point of reference, which is exact at every
chirp; polynomials run between the knots. Furniture, other objects and people scale the field by the
fractions of the sheet that both antennas see.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.clutter.furniture import SHEET_BOUNCES
from rtradar.scatter.common.interpolation import together
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.common.poses import KeyframeCache
from rtradar.scatter.ray_tubes import Footprints, Shooter, exits, radiate
from rtradar.scatter.rigid_echoes import PolynomialsInTime, RigidEchoes, far_apart
from rtradar.scatter.target import MeshGrid
from rtradar.scene import Object
from rtradar.trace.occluders import Occluders
from rtradar.trace.tracers import MeshTracer

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_KEPT_KNOTS, _PASSING = 128, 32


class RigidSheet(RigidEchoes):
    """Echoes of a sheet that moves: those of one bounce, then those of two bounces and more.

    Parameters and errors are those of `RigidEchoes`, the path is direct. Echoes of several bounces
    are as far apart in length as those of one.
    """

    def __init__(
        self, radar: Radar, moving: Object, duration_s: float, past: Occluders, **options: Any
    ) -> None:
        super().__init__(radar, moving, duration_s, past, **options)
        self._mi = past.mi
        # With several bounces a path may cross the sheet once more for each of them.
        radius = float(np.linalg.norm(self._corners, axis=-1).max())
        self._half = int(np.ceil((SHEET_BOUNCES + 1) * radius / self._grid.step)) + 1
        self._orders = np.arange(2, SHEET_BOUNCES + 1)
        self._shots: KeyframeCache[int, NDArray[np.complex128]] = KeyframeCache(
            _KEPT_KNOTS, _PASSING
        )

    def echoes(self, chirps: Indices) -> Echoes:
        """Echoes of the sheet at these chirps; see `RigidEchoes.echoes`."""
        times, tx = self._radar.centres_of(chirps), self._radar.tx_of_chirp(chirps)
        # Knots twice as close as for one bounce.
        knots = PolynomialsInTime(times, self._knot_s / 2)
        field = np.stack(
            [self._shots.get(own, partial(self._shot, own)) for own in knots.numbers.tolist()]
        )
        # Lengths at which nothing is seen are left out, unless all are asked for.
        used = field.any(axis=(0, 1, 2, 3)) | far_apart(chirps)
        beyond = np.arange(-self._half, self._half + 2) * self._grid.step
        steps = np.tile(beyond, len(self._orders))[used]
        several = Echoes(
            length=self._over_reference(times, tx)[..., None] + self._longer_m + steps,
            amplitude=knots.between(field[..., used], tx),
            frequency=self.frequency,
            tx=tx,
            part=np.zeros(len(steps), dtype=np.int64),
            bounces=np.repeat(self._orders, len(beyond))[used].astype(np.int64),
        )
        return together([super().echoes(chirps), several])

    def _shot(self, number: int) -> NDArray[np.complex128]:
        """Amplitudes (tx, rx, node, echo) at one knot, the echoes of each number of bounces."""
        time_s = number * self._knot_s / 2
        radar, ((rotation,), (at,)) = self._radar.at(time_s), self._pose(np.array([time_s]))
        polarization = Polarization(radar.polarization, radar.axes)
        # The sheet as it stands at this knot, as rays meet it.
        surfaces = MeshTracer(self._mi, self._corners @ rotation.T + at)
        shooter = Shooter(
            surfaces=surfaces,
            grid=MeshGrid(self._small.corners @ rotation.T + at, self._small.face),
            bounces=SHEET_BOUNCES,
            wavenumber=float(self._grid.wavenumber.max()),
            polarization=polarization,
            spreading=self._spreading,
            two_sided=True,
        )
        nodes, count = len(self.frequency), 2 * self._half + 2
        shape = radar.n_tx, len(self._orders), nodes, radar.n_rx, count
        out = np.zeros(shape, dtype=np.complex128)
        # Other things do not occlude single rays: the whole field is scaled.
        open_tx, open_rx = self._open_at(time_s)
        # From every Tx to the Rx that are kept with it, each number of bounces by itself.
        for index, tx in enumerate(radar.tx):
            rx = radar.rx[radar.rx_of_tx[index]]
            over = np.linalg.norm(tx - at) + np.linalg.norm(rx - at, axis=1)
            for order, footprints in enumerate(shooter.shoot(tx)[1:]):
                if len(footprints):
                    visible = exits(surfaces, footprints, rx)
                    given = footprints, visible, rx, over, polarization
                    out[index, order] = self._shared(*given)
            out[index] *= open_tx[index] * open_rx[radar.rx_of_tx[index]][:, None]
        # Amplitudes are conjugates of scattering lengths; the echoes of all numbers of bounces
        # follow one another.
        out = np.moveaxis(out.conj(), 1, 3)
        return out.reshape(*out.shape[:1], nodes, radar.n_rx, -1).swapaxes(1, 2)

    def _open_at(self, time_s: float) -> tuple[Array, Array]:
        """Fractions of the facets that Tx (tx,) and Rx (rx,) see past others, times what is left.

        That is the root of what walls and patterns of antennas leave of both legs.
        """
        # The fraction of the facets that each place of the array sees.
        legs, middles, _ = self._facets_at(time_s)
        asked = np.ones((len(legs.places), len(middles)), dtype=bool)
        clear = legs.seen(time_s, middles, asked, but=self.moving).mean(axis=1)
        at = self._pose(np.array([time_s]))[1]
        left = legs.factor(at, np.eye(3)[:1], self.moving.material, self._longer_m)
        root = np.sqrt(np.abs(left[len(left) // 2, 0]))
        return legs.tx_weight @ clear * root, legs.rx_weight @ clear * root

    def _shared(
        self,
        footprints: Footprints,
        visible: NDArray[np.bool_],
        rx: Array,
        over: Array,
        polarization: Polarization,
    ) -> NDArray[np.complex128]:
        """Field (node, rx, echo) of footprints, shared between the two echoes next to each."""
        # The path of each footprint, for the middle of the receivers, in steps of length.
        middle = rx.mean(axis=0)
        path = footprints.path[:, 3] + np.linalg.norm(footprints.places[:, 3] - middle, axis=1)
        place = (path - over.mean()) / self._grid.step + self._half
        count = 2 * self._half + 2
        cell = np.clip(np.floor(place), 0, count - 2).astype(np.int64)
        fraction = np.clip(place - cell, 0.0, 1.0)
        # The shares of the two nearest echoes add up to 1 and change smoothly.
        after = fraction**2 * (3 - 2 * fraction)
        lengths = over[:, None] + (np.arange(count) - self._half) * self._grid.step
        total = np.zeros((len(self._grid.wavenumber), *lengths.shape), complex)
        # `radiate` turns each share back to the length of its echo.
        for own, share in ((cell, 1 - after), (cell + 1, after)):
            lit = replace(footprints, field=footprints.field * share[:, None], surface=own)
            total += radiate(
                lit,
                visible,
                rx,
                self._grid.wavenumber,
                lengths,
                polarization=polarization,
                spreading=self._spreading,
            )
        return total
