"""What the classifier asks of a folder of clouds, whoever keeps it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class Clouds(Protocol):
    """Labelled clouds in a fixed order; `rtradar.clouds.collection.Collection` is the one of the data sets."""

    def __len__(self) -> int:
        """Number of clouds."""

    def points(self, index: int) -> NDArray[np.float64]:
        """One RDT cloud, (point, 3): time [s], range [m], velocity [m/s]."""

    def spatial(self, index: int) -> NDArray[np.float64]:
        """The spatial cloud of the same capture, (point, 3) [m]; it may be empty."""

    @property
    def labels(self) -> NDArray[np.str_]:
        """Activity of each cloud, (cloud,)."""

    def column(self, name: str) -> NDArray[Any]:
        """An entry of the provenance of each cloud, (cloud,)."""
