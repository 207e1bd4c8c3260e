"""Where the FFTs are done: on a GPU only where it was just found to do the same in less time, its transfers included."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import ValidityWarning
from rtradar.process.power_maps import power_map
from rtradar.process.spectra import range_spectrum
from rtradar.radar import Radar
from rtradar.system.gpu import first_line, gpu_for_ffts, has_nvidia_gpu

_CHIRPS = 512
"""Transformed in range to see who is faster: as many of 8 receivers and 256 samples as a run takes at once."""

_REPEATS = 3

_LARGEST_DIFFERENCE = 1e-5
"""Of the peak; both compute in float32, and differ by some 1e-7."""

_WORTH_S = 10.0
"""Of FFTs on the CPU: to import torch and to begin with a GPU takes some seconds."""


class FftDevices(NamedTuple):
    """Devices of the FFTs over fast time and over slow time: ``cpu``, or as torch names a GPU."""

    range: str = "cpu"
    doppler: str = "cpu"


def fastest_fft_devices(radar: Radar, n_chirps: int, n_windows: int) -> FftDevices:
    """The faster of CPU and GPU, for either kind of FFT, as this machine was measured to do them for this radar.

    Without an NVIDIA GPU nothing is measured; without a torch that can use it, or for captures whose FFTs take the CPU no more
    than seconds, nothing slow is imported.

    Parameters
    ----------
    radar : Radar
        Gives the lengths.
    n_chirps, n_windows : int
        Of the capture.

    Returns
    -------
    FftDevices

    Warns
    -----
    ValidityWarning
        Where the GPU fails, or gives something else.
    """
    if not has_nvidia_gpu():
        return FftDevices()
    on_cpu = _seconds(radar, "cpu")
    if on_cpu.range * n_chirps / _CHIRPS + on_cpu.doppler * n_windows < _WORTH_S:
        return FftDevices()
    gpu, _ = gpu_for_ffts()
    if gpu is None:
        return FftDevices()
    try:
        _compare(radar, gpu)
        on_gpu = _seconds(radar, gpu)
    except Exception as error:  # torch says in many ways that memory, or a driver, will not do
        warnings.warn(
            f"the GPU fails at FFTs ({first_line(error)}); the CPU does them",
            ValidityWarning,
            stacklevel=2,
        )
        return FftDevices()
    return FftDevices(*(gpu if on_gpu[kind] < on_cpu[kind] else "cpu" for kind in range(2)))


def with_cpu_fallback(transform: Callable[..., NDArray[Any]], device: str) -> NDArray[Any]:
    """Transform on a device; on the CPU where that fails, for others may fill a GPU's memory while a run lasts.

    Parameters
    ----------
    transform : callable
        ``transform(device=device)``, which leaves what it is given as it is.
    device : str
        ``cpu``, or as torch names it.

    Returns
    -------
    array
        Of ``transform``.

    Warns
    -----
    ValidityWarning
        Where the device fails.
    """
    if device != "cpu":
        try:
            return transform(device=device)
        except RuntimeError as error:
            words = f"the GPU fails at FFTs ({first_line(error)}); the CPU does them where it does"
            warnings.warn(words, ValidityWarning, stacklevel=2)
    return transform(device="cpu")


class _Seconds(NamedTuple):
    """Of `_CHIRPS` range spectra, and of the map of one window."""

    range: float
    doppler: float


@lru_cache(maxsize=16)
def _seconds(radar: Radar, device: str) -> _Seconds:
    chirps, window = _noise(radar)
    return _Seconds(
        range=_best_s(partial(range_spectrum, chirps, radar, device=device)),
        doppler=_best_s(partial(power_map, window, radar, device=device)),
    )


def _compare(radar: Radar, gpu: str) -> None:
    chirps, window = _noise(radar)
    # One channel: where Doppler is divided, a map of all has thresholds in it.
    for transform in (
        partial(range_spectrum, chirps, radar),
        partial(power_map, window, radar, channel=0),
    ):
        ours, theirs = transform(device="cpu"), transform(device=gpu)
        difference = float(np.abs(theirs - ours).max() / np.abs(ours).max())
        if not difference <= _LARGEST_DIFFERENCE:
            raise RuntimeError(f"results differ by {difference:.1e} of the peak")


def _noise(radar: Radar) -> tuple[NDArray[np.complex64], NDArray[np.complex64]]:
    random = np.random.default_rng(0)

    def complex_noise(*shape: int) -> NDArray[np.complex64]:
        return random.standard_normal((*shape, 2), dtype=np.float32).view(np.complex64)[..., 0]

    return (
        complex_noise(_CHIRPS, radar.n_rx, radar.samples_per_chirp),
        complex_noise(radar.cycles_per_frame, radar.n_tx, radar.n_rx, radar.samples_per_chirp),
    )


def _best_s(work: Callable[[], Any]) -> float:
    work()  # which also compiles, and loads, what it needs
    taken = []
    for _ in range(_REPEATS):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return min(taken)
