"""Units of power in pictures, in place of the square metres of the maps.

Maps hold abs(amplitude)^2 [m^2] including the spreading loss 1 / (R1^2 R2^2)
(`rtradar.conventions`). Read as a cross-section, a person of 1 m^2 at 4 m would be 24 dB too low.
Pictures therefore use one of three units:

``dBm``
    Received power, if the radar states its transmit power.
``dBsm``
    Radar cross-section relative to 1 m^2, otherwise. The loss is removed with the range R of the
    cell: R^4 times the map. An echo on boresight shows its own cross-section, less the scalloping
    loss between two bins (at most 1.4 dB in range and as much in velocity for Hann windows). Noise
    shows as the cross-section of equal power, and so rises with range. Nothing is removed if
    amplitudes do not include the loss.
``dB re maximum``
    Decibels below the strongest value shown, for sums over ranges, as in a spectrogram or over all
    body parts, which have no single loss to remove. If the loss were removed before the sum, the
    noise of the farthest bins would dominate and hide the person. A level above the noise would
    have no meaning in runs without noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.radar import Radar

VELOCITY_LABEL = "Velocity [m/s] (positive: receding)"
"""Label of every velocity axis."""

HANN_BINS = 1.5
"""Noise bandwidth of a Hann window [bins]; a sum over bins divided by it is the echo's power."""

_QUANTITIES = {"dBm": "Received power", "dBsm": "RCS", "dB re maximum": "Power"}


@dataclass(frozen=True, eq=False)
class FieldUnit:
    """Unit of power in pictures, made by `field_unit`.

    Parameters
    ----------
    name : {"dBm", "dBsm", "dB re maximum"}
        Name of the unit.
    scale : float or array of float
        Factor from power [m^2] to the linear unit, of a shape that broadcasts with the powers.
    """

    name: str
    scale: float | NDArray[np.float64]

    def level(self, power_m2: ArrayLike) -> NDArray[np.float64]:
        """Convert powers to this unit.

        Parameters
        ----------
        power_m2 : array of float
            Powers as in the maps [m^2].

        Returns
        -------
        array of float64
            Levels [dB], about -380 dB for a power of 0.
        """
        linear = np.asarray(power_m2, dtype=np.float64) * self.scale
        return np.asarray(10 * np.log10(np.maximum(linear, np.finfo(np.float32).tiny)))

    def label(self, of: str = "") -> str:
        """Return the label of an axis or a colour bar.

        Parameters
        ----------
        of : str
            Qualifier of the power, such as ``mean of channels``.

        Returns
        -------
        str
            Label such as ``RCS, mean of channels [dBsm]``.
        """
        return f"{_QUANTITIES[self.name]}{', ' if of else ''}{of} [{self.name}]"


def field_unit(
    radar: Radar,
    *,
    spreading: bool = True,
    range_m: ArrayLike | None = None,
    strongest_m2: float = 1.0,
) -> FieldUnit:
    """Choose the unit of power in the pictures of a run, as this module's docstring explains.

    Parameters
    ----------
    radar : Radar
        Radar of the run.
    spreading : bool
        Whether amplitudes of the run include the spreading loss.
    range_m : array of float, optional
        Range of each power [m], of a shape that broadcasts with the powers; None for sums over
        ranges.
    strongest_m2 : float
        Reference power of ``dB re maximum`` [m^2].

    Returns
    -------
    FieldUnit
    """
    if not spreading:
        return FieldUnit("dBsm", 1.0)
    if radar.transmit_power_dbm is not None:
        return FieldUnit("dBm", 1e3 * radar.watts_per_m2)
    if range_m is None:
        return FieldUnit("dB re maximum", 1 / max(strongest_m2, float(np.finfo(np.float32).tiny)))
    # The first bin begins at the antennas.
    return FieldUnit(
        "dBsm", np.maximum(np.asarray(range_m, dtype=np.float64), radar.range_bin_m / 2) ** 4
    )
