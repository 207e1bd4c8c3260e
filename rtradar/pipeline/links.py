"""Several radars that see the same people, and what one sends and another receives."""

from __future__ import annotations

import dataclasses
import itertools
import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError, ValidityWarning
from rtradar.front_end import rotation
from rtradar.radar import Radar
from rtradar.radar.array import UsualPlace
from rtradar.scene import Scene

_UPRIGHT = 1e-4  # of the cosine between both axes that point up

LINKS = ("own", "all")
"""What is received: what each radar has sent itself, or what each of them has sent."""

_SHARED = (
    "start_frequency_hz", "bandwidth_hz", "chirp_duration_s", "samples_per_chirp", "adc_start_s",
    "adc_rate_hz", "idle_s", "frame_period_s", "cycle_period_s", "multiplexing", "carrier_step_hz",
    "doppler_bands", "polarization",
)  # fmt: skip
"""Fields in which the sender and the receiver of a link must agree."""


def links_of(radars: Sequence[Radar], scene: Scene, links: str) -> dict[str, Radar]:
    """Return the radar of each link by its name, at its place in the scene.

    Parameters
    ----------
    radars : sequence of Radar
        At least one, each with a name of its own.
    scene : Scene
        Scene, whose place for a radar only one of them may take.
    links : {"own", "all"}
        See `LINKS`; a link of two radars is named ``a>b``, of the sender and the receiver.

    Returns
    -------
    dict
        Radars by name, in the order given, and then the links of two.

    Raises
    ------
    InputError
        Where names or places are not told apart, or the chirps of a link do not fit together.
    """
    if links not in LINKS:
        raise InputError(f"links = {links!r}; allowed: {', '.join(LINKS)}")
    if not radars:
        raise InputError("radars: give at least one")
    names = [radar.name for radar in radars]
    for name in names:
        if names.count(name) > 1 or not name or set(name) & set("/\\>"):
            raise InputError(
                f"radars: name = {name!r}; each must have a name of its own, without / or >, as "
                "folders and links have"
            )
    unplaced = [radar.name for radar in radars if isinstance(radar.position_m, UsualPlace)]
    if len(unplaced) > 1:
        raise InputError(
            f"radars {' and '.join(unplaced)} have no place of their own, a scene has one; give "
            "them places (position_m)"
        )
    placed = [scene.place(radar) for radar in radars]
    found = dict(zip(names, placed, strict=True))
    for sender, receiver in itertools.permutations(placed, 2) if links == "all" else ():
        found[f"{sender.name}>{receiver.name}"] = link_of(sender, receiver)
    return found


def link_of(sender: Radar, receiver: Radar) -> Radar:
    """Return the radar whose Tx are those of one radar, and all else that of another.

    Its axes, place and chirps are those of the receiver, which mixes what it receives with its own
    chirp; both clocks agree. Ranges are half of the path from Tx to Rx.

    Parameters
    ----------
    sender, receiver : Radar
        Radars at their places.

    Returns
    -------
    Radar
        With places of all its antennas.

    Raises
    ------
    InputError
        Where their chirps do not fit together, or one of them moves.
    """
    name = f"{sender.name}>{receiver.name}"
    for field in _SHARED:
        own, other = (getattr(radar, field) for radar in (sender, receiver))
        if own != other:
            raise InputError(
                f"link '{name}': {field} = {own} and {other}; a link needs radars with the same "
                "chirps, or take links = 'own'"
            )
    if sender.n_tx != receiver.n_tx:
        raise InputError(
            f"link '{name}': {sender.n_tx} and {receiver.n_tx} Tx; a link needs as many, whose "
            "chirps come at the same times"
        )
    if sender.in_frames and sender.chirps_per_frame != receiver.chirps_per_frame:
        raise InputError(
            f"link '{name}': chirps_per_frame = {sender.chirps_per_frame} and "
            f"{receiver.chirps_per_frame}; frames of a link must be alike"
        )
    if sender.receiver is not None or receiver.receiver is not None:
        raise InputError(
            f"link '{name}': leakage and phase noise of a [receiver] are those of one board; leave "
            "it out, or take links = 'own'"
        )
    if sender.is_moving or receiver.is_moving:
        raise InputError(f"link '{name}': a radar that moves has no links; take links = 'own'")
    places = (sender.tx - receiver.position_m) @ receiver.axes
    # The pattern of the sender's antennas, which look along the sender's axes.
    antenna, turned = sender.tx_antenna, receiver.axes.T @ sender.axes
    if antenna is not None and not np.allclose(turned, np.eye(3), atol=1e-12):
        own = turned @ rotation(np.array(antenna.angles_deg))
        yaw, pitch, roll = Rotation.from_matrix(own).as_euler("ZYX", degrees=True).tolist()
        antenna = dataclasses.replace(antenna, angles_deg=(yaw, -pitch, roll))
    if abs(turned[2, 2] - 1) > _UPRIGHT:
        warnings.warn(
            f"link '{name}': up is another direction for its sender than for its receiver; the "
            "polarisation of what is sent is taken in the receiver's axes",
            ValidityWarning,
            stacklevel=2,
        )
    return dataclasses.replace(
        receiver,
        name=name,
        tx_positions_m=_listed(places),
        rx_positions_m=_listed(receiver.rx_m),
        tx_order=None,
        channels="all",
        tx_antenna=antenna,
        transmit_power_dbm=sender.transmit_power_dbm,
    )


def _listed(places: NDArray[np.float64]) -> tuple[tuple[float, float, float], ...]:
    return tuple((x, y, z) for x, y, z in places.tolist())
