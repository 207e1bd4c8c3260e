"""Detectors by their names: what tells the cells of a range-Doppler map that hold an echo from those that hold noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rtradar.system.registry import Registry

Detector = Callable[[NDArray[np.floating]], NDArray[np.bool_]]
"""Power (range, velocity) in, mask of the same shape out."""

DETECTORS = Registry(
    "rtradar.detectors",
    "detector",
    {
        "os-cfar": "rtradar.process.detection.cfar:os_cfar",
        "ca-cfar": "rtradar.process.detection.cfar:ca_cfar",
    },
)
"""Functions of power (range, velocity), ``pfa`` and ``looks``, the number of channels summed in the power."""

register_detector = DETECTORS.register


def build_detector(name: str, *, pfa: float, looks: int) -> Detector:
    """The detector of that name, for this false-alarm rate and so many looks.

    Parameters
    ----------
    name : str
        One of `DETECTORS`.
    pfa : float
        False-alarm rate asked of it in each cell.
    looks : int
        Channels summed in the power.

    Returns
    -------
    callable
        From power (range, velocity) to a bool mask of the same shape.

    Raises
    ------
    InputError
        Where there is no such detector.
    ExtensionError
        Where it is of another package, and fails; also when it is called.
    """
    find = DETECTORS.find(name)

    def detect(power: NDArray[np.floating]) -> NDArray[np.bool_]:
        with DETECTORS.guarded(name):
            mask = np.asarray(find(power, pfa=pfa, looks=looks))
        if mask.dtype != np.bool_ or mask.shape != power.shape:
            raise DETECTORS.refuse(
                name, f"gave {mask.dtype} of shape {mask.shape}, not bool of shape {power.shape}"
            )
        return mask

    return detect
