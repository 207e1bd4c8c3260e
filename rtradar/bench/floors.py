"""Lower bounds of the time of each stage, from its work and what this machine was measured to do.

A bound counts what a stage cannot avoid: bytes that it must read and write once, at the rate of a
copy by all cores; FFTs, by all cores in blocks that stay in the cache; random words; multiply-adds,
at the rate of a matrix product. The largest of these is the bound, as if all else were done
meanwhile. Stages whose work does not follow from the size of a run have none.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from rtradar.bench.runs import ELSEWHERE
from rtradar.kernels.prime_factor_dft import prime_factor_dft
from rtradar.process import angle_grid, measured_angles, window_cycles
from rtradar.radar import Radar

_SAMPLE = 8  # bytes of a complex64
_ECHO = 24  # bytes of a float64 length and a complex128 amplitude
_MULTIPLY_ADDS = 2  # of a complex amplitude times a complex power that another one shares

_CORES = os.cpu_count() or 1
_REPEATS, _LEAST_S = 5, 0.3
_COPIED_BYTES = 1 << 28  # of each of two arrays, more than caches hold
_CACHED_BYTES = 1 << 20  # for each core
_WORDS = 1 << 16  # at once, for each core
_MATRIX = 1536


class Rates(NamedTuple):
    """What this machine does in a second, all cores together.

    FFTs are of complex64, over the samples of a chirp, the cycles of a frame, those of a window of
    the spectrogram, and the directions of a line. Over the cycles of a frame they are by the
    library, or as fast as the multiply-adds of our own would be.
    """

    copied_bytes: float  # read and written, in a copy much larger than the caches
    random_words: float  # of 64 bits
    multiply_adds: float  # in float32, in a matrix product
    range_ffts: float
    doppler_ffts: float
    spectrogram_ffts: float
    angle_ffts: float


def measure_rates(radar: Radar) -> Rates:
    """Measure all, the best of some, with the lengths of this radar's transforms; takes seconds."""
    multiply_adds, dft = _multiply_adds(), prime_factor_dft(radar.cycles_per_frame)
    own_ffts = multiply_adds / dft.multiply_adds if dft is not None else 0.0
    directions = len(angle_grid(radar)) if measured_angles(radar) else 1
    return Rates(
        copied_bytes=_copied_bytes(),
        random_words=_random_words(),
        multiply_adds=multiply_adds,
        range_ffts=_ffts(radar.samples_per_chirp),
        doppler_ffts=max(_ffts(radar.cycles_per_frame), own_ffts),
        spectrogram_ffts=_ffts(window_cycles(radar)),
        angle_ffts=_ffts(directions),
    )


def best_s(work: Callable[[], object], least_s: float = _LEAST_S) -> float:
    """Best of some repeats after one to warm up, over at least some seconds of work [s]."""
    work()
    seconds: list[float] = []
    while len(seconds) < _REPEATS or sum(seconds) < least_s:
        began = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - began)
    return min(seconds)


def _copied_bytes() -> float:
    arrays = [np.array_split(np.ones(_COPIED_BYTES // 8), _CORES) for _ in range(2)]
    with ThreadPoolExecutor(_CORES) as pool:
        return 2 * _COPIED_BYTES / best_s(lambda: list(pool.map(np.copyto, *arrays)))


def _random_words() -> float:
    streams = [np.random.SFC64(seed) for seed in range(_CORES)]

    def draw(stream: np.random.SFC64) -> None:
        for _ in range(8):
            stream.random_raw(_WORDS)

    with ThreadPoolExecutor(_CORES) as pool:
        return 8 * _WORDS * _CORES / best_s(lambda: list(pool.map(draw, streams)))


def _multiply_adds() -> float:
    a, b, out = (np.ones((_MATRIX, _MATRIX), dtype=np.float32) for _ in range(3))
    return _MATRIX**3 / best_s(lambda: np.matmul(a, b, out=out))


def _ffts(length: int) -> float:
    """Transforms per second, in whichever layout they are faster."""
    count = max(16, _CACHED_BYTES * _CORES // (8 * length))
    noise = np.random.default_rng(0).standard_normal((2, length, count), dtype=np.float32)
    columns = noise[0] + 1j * noise[1]
    rows = np.ascontiguousarray(columns.T)

    def seconds(block: NDArray[np.complex64], axis: int) -> float:
        # Unitary, so that it can be repeated in place.
        options = {"norm": "ortho", "overwrite_x": True, "workers": -1}
        return best_s(lambda: scipy.fft.fft(block, axis=axis, **options))

    return count / min(seconds(columns, 0), seconds(rows, 1))


class Work(NamedTuple):
    """The size of a run."""

    chirps: int
    rx: int
    samples: int
    echoes: int  # of one chirp at one receiver
    windows: int  # frames
    cycles: int  # TDM cycles in each frame
    channels: int  # virtual ones
    detections: int  # cells that CFAR marked, in all frames
    lines: int  # of the array that measure an angle
    spectrogram_cycles: int  # TDM cycles in a window of the spectrogram

    @classmethod
    def of(cls, radar: Radar, summary: Mapping[str, Any]) -> Work:
        """Size of a run with this radar, by its summary."""
        return cls(
            chirps=summary["chirps"],
            rx=radar.n_rx,
            samples=radar.samples_per_chirp,
            echoes=len(summary["part_power_m2"]),
            windows=summary["windows"],
            cycles=radar.cycles_per_frame,
            channels=radar.n_channels,
            detections=summary["detections"],
            lines=len(measured_angles(radar)),
            spectrogram_cycles=window_cycles(radar),
        )

    @property
    def if_samples(self) -> int:
        """IF samples of the whole run."""
        return self.chirps * self.rx * self.samples

    @property
    def spectrogram_columns(self) -> int:
        """Windows of one channel's spectrogram; one starts every twentieth of its length."""
        tdm_cycles = self.chirps * self.rx // self.channels
        window = self.spectrogram_cycles
        return max(0, (tdm_cycles - window) // max(1, window // 20) + 1)


def floors(work: Work, rates: Rates) -> dict[str, dict[str, Any]]:
    """Bound of each stage that has one, by the names of ``stages`` in a summary and `ELSEWHERE`.

    ``floor`` is the time [s], and ``rule`` says what it consists of.
    """
    samples, echoes = work.if_samples, work.chirps * work.rx * work.echoes
    passed = 2 * _SAMPLE * samples / rates.copied_bytes  # read and written
    tones = _MULTIPLY_ADDS * samples * work.echoes / rates.multiply_adds
    range_ffts = samples / work.samples / rates.range_ffts
    transforms = work.windows * work.channels * work.samples
    doppler_ffts = transforms / rates.doppler_ffts
    spectra = _SAMPLE * work.cycles * transforms / rates.copied_bytes
    columns = work.spectrogram_columns * work.samples / rates.spectrogram_ffts
    angles = work.detections * work.lines / rates.angle_ffts
    cells = work.windows * work.samples * work.cycles / rates.copied_bytes  # a byte of each
    found = {
        ELSEWHERE: (passed, "spectra kept for the windows"),
        "scatter": (_ECHO * echoes / rates.copied_bytes, "lengths and amplitudes written"),
        "signal": (
            max(tones, passed / 2),
            "two multiply-adds an echo and sample, or samples written",
        ),
        "noise": (max(samples / rates.random_words, passed), "a random word a sample"),
        "range": (max(range_ffts, passed), "an FFT a chirp and receiver"),
        "spectrogram": (columns, "an FFT a column and range bin"),
        "doppler": (
            max(doppler_ffts, spectra),
            "an FFT a window, channel and range bin, or spectra read",
        ),
        "cfar": (5 * cells, "power read, mask written"),
        "cloud": (cells, "masks read"),
        "angle": (angles, "an FFT a detection and line, zero-padded to the directions"),
    }
    return {name: {"floor": seconds, "rule": rule} for name, (seconds, rule) in found.items()}
