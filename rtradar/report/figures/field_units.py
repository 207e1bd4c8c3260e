"""Units of the field for pictures, which nobody reads in the square metres of the maps.

Maps hold abs(amplitude)^2 [m^2] with the loss over distance, 1 / (R1^2 R2^2), left in it (`rtradar.conventions`). Read as a
cross-section, a person of 1 m^2 four metres away has 24 dB too little. Pictures therefore show one of three units:

``dBm``
    Received power, where the radar states its transmit power.
``dBsm``
    Radar cross-section over 1 m^2, elsewhere: the loss is taken out at the range R of the cell, R^4 times the map. An echo on
    the boresight reads its own cross-section, less what windows lose between two bins (1.4 dB at most in range and as much in
    velocity for Hann windows). Noise reads as the cross-section that would return as much, and so rises with range. Where
    amplitudes hold no loss, nothing is taken out.
``dB re maximum``
    Decibels below the strongest value that is shown, where a value sums over ranges, of a spectrogram or of all parts of a
    body: there is no one loss to take out. Taking it out range by range before the sum would let the farthest bins, whose noise
    then counts most, hide the person in the middle; a level over the noise means nothing in runs without noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.radar import Radar

VELOCITY_LABEL = "Velocity [m/s] (positive: receding)"
"""Of every velocity axis."""

HANN_BINS = 1.5
"""Bins of a Hann-windowed spectrum that the power of one echo fills: sums over bins are divided by it to read the echo's."""

_QUANTITIES = {"dBm": "Received power", "dBsm": "RCS", "dB re maximum": "Power"}


@dataclass(frozen=True, eq=False)
class FieldUnit:
    """A unit of pictures, from `field_unit`.

    Parameters
    ----------
    name : {"dBm", "dBsm", "dB re maximum"}
    scale : float or array of float
        Factor from power in m^2 to the linear unit, of a shape that powers can be multiplied by.
    """

    name: str
    scale: float | NDArray[np.float64]

    def level(self, power_m2: ArrayLike) -> NDArray[np.float64]:
        """Powers in this unit.

        Parameters
        ----------
        power_m2 : array of float
            As maps hold them [m^2].

        Returns
        -------
        array of float64
            Decibels; some -380 dB for 0.
        """
        linear = np.asarray(power_m2, dtype=np.float64) * self.scale
        return np.asarray(10 * np.log10(np.maximum(linear, np.finfo(np.float32).tiny)))

    def label(self, of: str = "") -> str:
        """Label of an axis or a colour bar.

        Parameters
        ----------
        of : str
            What the power is of, such as ``mean of channels``.

        Returns
        -------
        str
            Such as ``RCS, mean of channels [dBsm]``.
        """
        return f"{_QUANTITIES[self.name]}{', ' if of else ''}{of} [{self.name}]"


def field_unit(
    radar: Radar,
    *,
    spreading: bool = True,
    range_m: ArrayLike | None = None,
    strongest_m2: float = 1.0,
) -> FieldUnit:
    """The unit in which pictures of a run show powers, as told at the head of this module.

    Parameters
    ----------
    radar : Radar
        Of the run.
    spreading : bool
        Whether amplitudes of the run hold the loss over distance.
    range_m : array of float, optional
        Range of each power [m], of a shape that powers can be multiplied by; left out where a power is a sum over ranges.
    strongest_m2 : float
        The power [m^2] that ``dB re maximum`` refers to.

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
