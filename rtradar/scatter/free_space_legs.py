"""Echoes over legs in free space: any model, through antenna patterns, off any material."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.polarization import (
    CONDUCTOR,
    Polarization,
    Surfaces,
    is_shaped,
    pattern_of,
    unit,
)
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
    points, polarization = specular_points(at), Polarization(radar.polarization, at.axes)
    sent = pattern_of(radar.tx_antenna, points - at.tx[:, None, None], polarization)
    return sent * pattern_of(radar.rx_antenna, points - at.rx[:, :, None], polarization)


def over_legs(
    model: EchoModel, radar: Radar, body: Body, materials: Sequence[str] = ()
) -> EchoModel:
    """Wrap the model of a conductor before isotropic antennas by what legs in free space do.

    These are the patterns of the antennas, and the reflection of the body's ``materials (part,)``,
    which are perfect conductors if they are left out.
    """
    surfaces = Surfaces(materials or (CONDUCTOR,) * len(body.part_names), radar)
    plain = not (is_shaped(radar.tx_antenna) or is_shaped(radar.rx_antenna))
    return model if plain and surfaces.conduct else _OverLegs(model, radar, body, surfaces)


class _OverLegs:
    """Echoes of several bounces are given the directions of the part they bounce off last.

    Each part reflects with one coefficient, that of the angle at its specular point: what comes
    from far beside it, and bounces at other angles, are approximated so.
    """

    def __init__(self, model: EchoModel, radar: Radar, body: Body, surfaces: Surfaces) -> None:
        self._model, self._radar, self._body, self._surfaces = model, radar, body, surfaces

    @property
    def variant(self) -> str | None:
        """Backend of the model."""
        return self._model.variant

    @property
    def traces(self) -> bool:
        """Whether the model traces rays, which it may not have done yet."""
        return bool(getattr(self._model, "traces", False))

    def account(self) -> dict[str, Any] | None:
        """Report what the model did."""
        return account_of(self._model)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        echoes = self._model.echoes(chirps)
        at = chirp_poses(self._radar, self._body, chirps)
        amplitude = echoes.amplitude
        if is_shaped(self._radar.tx_antenna) or is_shaped(self._radar.rx_antenna):
            amplitude = amplitude * leg_gain(self._radar, at)[..., echoes.part]
        if not self._surfaces.conduct:
            factor = self._surfaces.factor(at)[:, echoes.part] ** echoes.bounces
            amplitude = amplitude * factor[:, None]
        return dataclasses.replace(echoes, amplitude=amplitude)
