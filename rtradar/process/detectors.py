"""Detectors by their names: of power alone, and of all channels, which give directions too."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.process.window_functions import DEFAULT_WINDOWS, WindowFunctions
from rtradar.radar import Radar
from rtradar.system.registries import DETECTORS

Detector = Callable[[NDArray[np.floating]], NDArray[np.bool_]]
"""Power (range, velocity) in, mask of the same shape out."""

PointDetector = Callable[
    [NDArray[np.complexfloating]], tuple[NDArray[np.bool_], NDArray[np.float64]]
]
"""Range spectra (cycle, tx, rx, range) in; mask (range, velocity) out, and for each cell of it, in
the order of ``np.argwhere``, the sines (cell, 2) of its direction along y and z, NaN where one is
not measured."""

register_detector = DETECTORS.register

_GIVEN = ("power", "cube", "radar", "pfa", "looks", "window_functions")
"""Parameters that are no options."""


def build_detector(
    name: str, *, pfa: float, looks: int, options: Mapping[str, Any] | None = None
) -> Detector:
    """Detector of a name, for a false-alarm rate and a number of looks.

    Parameters
    ----------
    name : str
        Name in `DETECTORS`.
    pfa : float
        Asked false-alarm rate of each cell.
    looks : int
        Channels summed in the power.
    options : mapping, optional
        Further keywords of the detector, such as ``guard`` of ``os-cfar``.

    Returns
    -------
    callable
        From power (range, velocity) to a bool mask of the same shape.

    Raises
    ------
    InputError
        Where there is no such detector, it has no such option, or it takes all channels.
    ExtensionError
        Where it comes from another package, and fails; also when it is called.
    """
    find = _found(name, options or {})
    if takes_channels(name):
        raise InputError(f"detector '{name}' takes all channels of a frame, not their power alone")

    def detect(power: NDArray[np.floating]) -> NDArray[np.bool_]:
        with DETECTORS.guarded(name):
            mask = np.asarray(find(power, pfa=pfa, looks=looks, **(options or {})))
        if mask.dtype != np.bool_ or mask.shape != power.shape:
            raise DETECTORS.refuse(
                name, f"gave {mask.dtype} of shape {mask.shape}, not bool of shape {power.shape}"
            )
        return mask

    return detect


def build_point_detector(
    name: str,
    radar: Radar,
    *,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
    options: Mapping[str, Any] | None = None,
) -> PointDetector:
    """Detector of a name that takes all channels and gives the direction of each cell.

    Parameters
    ----------
    name : str
        Name in `DETECTORS`, of a detector that `takes_channels`.
    radar : Radar
        Radar that received the frames.
    window_functions : WindowFunctions
        Window functions of the maps.
    options : mapping, optional
        Further keywords of the detector, such as ``max_points`` of ``ti-oob``.

    Returns
    -------
    callable
        From range spectra (cycle, tx, rx, range) to a mask (range, velocity) and sines (cell, 2).

    Raises
    ------
    InputError
        Where there is no such detector, or it has no such option.
    ExtensionError
        Where it comes from another package, and fails; also when it is called.
    """
    find = _found(name, options or {})

    def detect(
        cube: NDArray[np.complexfloating],
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        with DETECTORS.guarded(name):
            found = find(cube, radar, window_functions=window_functions, **(options or {}))
            mask, sines = (np.asarray(values) for values in found)
        shape = cube.shape[3], cube.shape[0]
        wanted = int(np.count_nonzero(mask)), 2
        if mask.dtype != np.bool_ or mask.shape != shape or sines.shape != wanted:
            raise DETECTORS.refuse(
                name,
                f"gave {mask.dtype} of shape {mask.shape} and sines of shape {sines.shape}, not "
                f"bool of shape {shape} and sines of shape {wanted}",
            )
        return mask, sines.astype(np.float64)

    return detect


def takes_channels(name: str) -> bool:
    """Tell whether a detector takes all channels, as ``cube``, in place of ``power``.

    Parameters
    ----------
    name : str
        Name in `DETECTORS`.

    Returns
    -------
    bool

    Raises
    ------
    InputError, ExtensionError
        Where there is no such detector, or it cannot be loaded.
    """
    return "cube" in _parameters(DETECTORS.find(name))


def _found(name: str, options: Mapping[str, Any]) -> Callable[..., Any]:
    """Find a detector; InputError if it has not all of these options."""
    find = DETECTORS.find(name)
    allowed = [key for key in _parameters(find) if key not in _GIVEN]
    for option in options:
        if option not in allowed:
            raise InputError(
                f"detector '{name}' has no option '{option}'; "
                f"allowed: {', '.join(allowed) or 'none'} (--detector-option)"
            )
    return find


def _parameters(find: Callable[..., Any]) -> list[str]:
    try:
        return list(inspect.signature(find).parameters)
    except (TypeError, ValueError):  # of some compiled functions
        return []
