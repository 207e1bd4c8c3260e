"""What this machine does a second: copies, FFTs, random words, multiply-adds."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import scipy.fft

from rtradar.bench.floors import Rates, direction_count
from rtradar.kernels.prime_factor_dft import prime_factor_dft
from rtradar.process import SPECTROGRAM_CYCLES
from rtradar.radar import Radar

_REPEATS, _LEAST_S = 5, 0.3
_COPIED_BYTES = 1 << 28  # of each of two arrays, more than caches hold
_CACHED_BYTES = 1 << 20  # for each core
_WORDS = 1 << 16  # at once, for each core
_MATRIX = 1536


def measure_rates(radar: Radar) -> Rates:
    """Measure all, the best of some, with the lengths of this radar's transforms; takes a few seconds."""
    multiply_adds = _multiply_adds()
    return Rates(
        copied_bytes=_copied_bytes(),
        random_words=_random_words(),
        multiply_adds=multiply_adds,
        range_ffts=_ffts(radar.samples_per_chirp),
        doppler_ffts=_doppler_ffts(radar.cycles_per_frame, multiply_adds),
        spectrogram_ffts=_ffts(SPECTROGRAM_CYCLES),
        angle_ffts=_ffts(max(1, direction_count(radar))),
    )


def _cores() -> int:
    return os.cpu_count() or 1


def best_s(work: Callable[[], object], least_s: float = _LEAST_S) -> float:
    """Best of some repeats after one to warm up, over ``least_s`` at least, so that a disturbance does not last [s]."""
    work()
    seconds: list[float] = []
    while len(seconds) < _REPEATS or sum(seconds) < least_s:
        began = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - began)
    return min(seconds)


def _copied_bytes() -> float:
    source, target = (np.ones(_COPIED_BYTES // 8) for _ in range(2))
    parts = list(
        zip(np.array_split(target, _cores()), np.array_split(source, _cores()), strict=True)
    )
    with ThreadPoolExecutor(_cores()) as pool:
        return (
            2 * _COPIED_BYTES / best_s(lambda: list(pool.map(lambda pair: np.copyto(*pair), parts)))
        )


def _random_words() -> float:
    streams = [np.random.SFC64(seed) for seed in range(_cores())]

    def draw(stream: np.random.SFC64) -> None:
        for _ in range(8):
            stream.random_raw(_WORDS)

    with ThreadPoolExecutor(_cores()) as pool:
        return 8 * _WORDS * _cores() / best_s(lambda: list(pool.map(draw, streams)))


def _multiply_adds() -> float:
    a, b, out = (np.ones((_MATRIX, _MATRIX), dtype=np.float32) for _ in range(3))
    return _MATRIX**3 / best_s(lambda: np.matmul(a, b, out=out))


def _doppler_ffts(cycles: int, multiply_adds: float) -> float:
    """Transforms a second by the library, or by our own sums if these are fewer multiply-adds."""
    dft = prime_factor_dft(cycles)
    return max(_ffts(cycles), multiply_adds / dft.multiply_adds if dft is not None else 0)


def _ffts(length: int) -> float:
    """Transforms a second, in whichever layout they are faster."""
    count = max(16, _CACHED_BYTES * _cores() // (8 * length))
    noise = np.random.default_rng(0).standard_normal((2, length, count), dtype=np.float32)
    columns = noise[0] + 1j * noise[1]
    rows = np.ascontiguousarray(columns.T)

    def seconds(block: np.ndarray[tuple[int, ...], np.dtype[np.complex64]], axis: int) -> float:
        # Unitary, so that it can be done again and again in place.
        return best_s(
            lambda: scipy.fft.fft(block, axis=axis, norm="ortho", overwrite_x=True, workers=-1)
        )

    return count / min(seconds(columns, 0), seconds(rows, 1))
