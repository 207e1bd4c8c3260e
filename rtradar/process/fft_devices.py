"""Where the FFTs are done: on a GPU only where it was just found to do the same in less time, its transfers included."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from functools import lru_cache
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import ValidityWarning
from rtradar.gpu import has_nvidia_gpu
from rtradar.process.power_maps import power_map
from rtradar.process.spectra import range_spectrum
from rtradar.radar import Radar

_CHIRPS = 512
"""Transformed in range to see who is faster: about as many as come at once."""

_REPEATS = 3

_LARGEST_DIFFERENCE = 1e-5
"""Of the peak; both compute in float32, and differ by some 1e-7."""


class FftDevices(NamedTuple):
    """Devices of the FFTs over fast time and over slow time: ``cpu``, or as torch names a GPU."""

    range: str = "cpu"
    doppler: str = "cpu"


def fastest_fft_devices(radar: Radar) -> FftDevices:
    """The faster of CPU and GPU, for either kind of FFT, as this machine was measured to do them for this radar.

    Without an NVIDIA GPU, or a torch that can use it, nothing is measured, and nothing slow is imported.

    Parameters
    ----------
    radar : Radar
        Gives the lengths.

    Returns
    -------
    FftDevices

    Warns
    -----
    ValidityWarning
        Where the GPU fails, or gives something else.
    """
    gpu, _ = gpu_for_ffts()
    return FftDevices() if gpu is None else _measured(radar, gpu)


def gpu_for_ffts() -> tuple[str | None, str]:
    """Look for a GPU.

    Returns
    -------
    device : str or None
        As torch names it.
    words : str
        What there is, or what is missing, in a few words.
    """
    if not has_nvidia_gpu():
        return None, "no NVIDIA driver, or no GPU"
    if find_spec("torch") is None:
        return None, "a GPU, but no torch; install it: pip install 'rtradar[learn]'"
    import torch

    if not torch.cuda.is_available():
        return None, f"a GPU, which torch {torch.__version__} cannot use; install a CUDA build of torch"
    return "cuda", f"{torch.cuda.get_device_name()}, wherever it is found to be faster"


@lru_cache(maxsize=8)
def _measured(radar: Radar, gpu: str) -> FftDevices:
    random = np.random.default_rng(0)

    def complex_noise(*shape: int) -> NDArray[np.complex64]:
        return random.standard_normal((*shape, 2), dtype=np.float32).view(np.complex64)[..., 0]

    chirps = complex_noise(_CHIRPS, radar.n_rx, radar.samples_per_chirp)
    window = complex_noise(radar.cycles_per_frame, radar.n_tx, radar.n_rx, radar.samples_per_chirp)
    try:
        return FftDevices(
            range=_faster(lambda device: range_spectrum(chirps, radar, device=device), gpu),
            doppler=_faster(lambda device: power_map(window, radar, device=device), gpu),
        )
    except RuntimeError as error:  # as torch says that memory, or a driver, will not do
        warnings.warn(f"the GPU fails at FFTs ({str(error).splitlines()[0]}); the CPU does them", ValidityWarning, stacklevel=3)
        return FftDevices()


def _faster(transform: Callable[[str], NDArray[Any]], gpu: str) -> str:
    on_cpu, on_gpu = transform("cpu"), transform(gpu)  # which also compiles, and loads, what they need
    difference = float(np.abs(on_gpu - on_cpu).max() / np.abs(on_cpu).max())
    if not difference <= _LARGEST_DIFFERENCE:
        raise RuntimeError(f"results differ by {difference:.1e} of the peak")
    return gpu if _best_s(transform, gpu) < _best_s(transform, "cpu") else "cpu"


def _best_s(transform: Callable[[str], NDArray[Any]], device: str) -> float:
    taken = []
    for _ in range(_REPEATS):
        began = time.perf_counter()
        transform(device)
        taken.append(time.perf_counter() - began)
    return min(taken)
