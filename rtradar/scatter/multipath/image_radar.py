"""A radar as a body sees it over the walls of a path: Tx and Rx at their images."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar
from rtradar.scatter.multipath.image_paths import Leg, WallPath, images


@dataclass(frozen=True, kw_only=True, repr=False)
class ImageRadar(Radar):
    """A radar whose Tx stand at their images over one leg, and whose Rx at those over another.

    What mirrors do to polarisation and to the patterns of antennas belongs to the legs: here
    antennas are isotropic, and turned as those of the radar are.
    """

    out: Leg = ()
    back: Leg = ()

    @classmethod
    def over(cls, radar: Radar, path: WallPath) -> Radar:
        """Return the radar as it is seen over a path: itself, if that is the direct one."""
        if path.order == 0:
            return radar
        given = {field.name: getattr(radar, field.name) for field in dataclasses.fields(radar)}
        isotropic = {"tx_antenna": None, "rx_antenna": None}
        return cls(**{**given, **isotropic}, out=path.out, back=path.back)

    def __post_init__(self) -> None:
        """Check nothing: the radar was checked, and its legs are no fields of a radar."""

    @cached_property
    def tx(self) -> NDArray[np.float64]:
        """Images of the transmitters (tx, 3) [m], world."""
        return images(self.out, self._in_world(self.tx_m))

    @cached_property
    def rx(self) -> NDArray[np.float64]:
        """Images of the receivers (rx, 3) [m], world."""
        return images(self.back, self._in_world(self.rx_m))
