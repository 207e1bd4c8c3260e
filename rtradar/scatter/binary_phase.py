"""The echoes of all Tx at each chirp, as binary phase modulation transmits them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.echo_sets import together
from rtradar.scatter.common.poses import EchoModel


class BinaryPhaseModel:
    """The echoes of every Tx at every chirp, with their signs (:eq:`bpm`).

    Each of as many models as there are Tx answers for a radar under TDM whose order of Tx begins
    with another one, so that at any chirp each of them has another Tx. They are given by ``build``.
    """

    def __init__(self, radar: Radar, build: Callable[[Radar], EchoModel]) -> None:
        self._radar = radar
        order = range(radar.n_tx) if radar.tx_order is None else radar.tx_order
        orders = [np.roll(order, -shift).tolist() for shift in range(radar.n_tx)]
        self._models = [
            build(dataclasses.replace(radar, multiplexing="tdm", tx_order=own)) for own in orders
        ]
        self.variant = self._models[0].variant

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps, those of all Tx one after the other."""
        slot, found = self._radar.tx_of_chirp(chirps), []
        for shift, model in enumerate(self._models):
            own = model.echoes(chirps)
            sign = self._radar.tx_signs[slot, (slot + shift) % self._radar.n_tx]
            amplitude = own.amplitude * sign.astype(own.amplitude.real.dtype)[:, None, None]
            found.append(dataclasses.replace(own, amplitude=amplitude))
        return together(found)
