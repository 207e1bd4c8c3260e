"""Echoes through antennas with patterns: any model, weighted by the directions of its legs."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.antenna import Antenna
from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.polarization import unit
from rtradar.scatter.common.poses import ChirpPoses, EchoModel, account_of, chirp_poses


def specular_points(at: ChirpPoses) -> NDArray[np.float64]:
    """Points (chirp, rx, part, 3) whose normals bisect Tx and Rx, as seen from the centres [m].

    The specular point but for terms of the part's size over its distance, and what is seen of a
    part lies about it.
    """
    tx, rx = (
        unit(antenna - at.centres[:, None]) for antenna in (at.tx[:, None, None], at.rx[:, :, None])
    )
    normal = np.einsum("tpji,trpj->trpi", at.frames, tx + rx) * at.semi_axes
    # A normal of a unit sphere that is stretched to the ellipsoid.
    local = at.semi_axes * unit(normal)
    return np.asarray(at.centres[:, None] + np.einsum("tpij,trpj->trpi", at.frames, local))


def leg_gain(radar: Radar, at: ChirpPoses) -> NDArray[np.float64]:
    """Amplitude (chirp, rx, part) that both antennas leave, relative to their patterns' peaks.

    The square root of the power pattern of the Tx in the direction of the part, times that of the
    Rx.
    """
    points = specular_points(at)
    gain = np.ones(points.shape[:-1])
    for antenna, place in (
        (radar.tx_antenna, at.tx[:, None, None]),
        (radar.rx_antenna, at.rx[:, :, None]),
    ):
        if antenna is not None:
            gain *= np.sqrt(antenna.relative(points - place, radar.polarization))
    return gain


def through_antennas(model: EchoModel, radar: Radar, body: Body) -> EchoModel:
    """Wrap the model by the patterns of the antennas, unless these are isotropic."""
    shaped = is_shaped(radar.tx_antenna) or is_shaped(radar.rx_antenna)
    return _ThroughAntennas(model, radar, body) if shaped else model


def is_shaped(antenna: Antenna | None) -> bool:
    """Whether the antenna looks more into some directions than into others."""
    return antenna is not None and antenna.pattern != "isotropic"


class _ThroughAntennas:
    """Echoes of several bounces are given the directions of the part they bounce off last."""

    def __init__(self, model: EchoModel, radar: Radar, body: Body) -> None:
        self._model, self._radar, self._body = model, radar, body
        self.variant = model.variant

    def account(self) -> dict[str, Any] | None:
        """Report what the model did."""
        return account_of(self._model)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        echoes = self._model.echoes(chirps)
        gain = leg_gain(self._radar, chirp_poses(self._radar, self._body, chirps))
        return dataclasses.replace(echoes, amplitude=echoes.amplitude * gain[..., echoes.part])
