"""The least that each stage of a run could take, from the work it must do and what this machine was just measured to do.

A floor counts what a stage cannot avoid: bytes that it must read and write once, at the rate of a copy by all cores; FFTs, by
all cores in blocks that stay in the cache; random words; multiply-adds, at the rate of a matrix product. The largest of
these is the floor, as if all else went on beside it. Stages whose work cannot be told from the size of a run have none.
"""

from __future__ import annotations

from dataclasses import dataclass

from rtradar.bench.times import ELSEWHERE
from rtradar.process import SPECTROGRAM_CYCLES, angle_grid, measures_angle
from rtradar.radar import Radar

_SAMPLE = 8  # bytes of a complex64
_ECHO = 24  # bytes of a float64 length and a complex128 amplitude
_MULTIPLY_ADDS = (
    2  # of a complex amplitude times a complex power, which is another's conjugate, added up
)


@dataclass(frozen=True)
class Rates:
    """What this machine does a second, all cores together.

    Parameters
    ----------
    copied_bytes : float
        Read and written, in a copy much larger than the caches.
    random_words : float
        64-bit random words drawn.
    multiply_adds : float
        float32, in a matrix product.
    range_ffts, doppler_ffts, spectrogram_ffts, angle_ffts : float
        complex64 transforms of the radar's lengths: samples a chirp, cycles a frame, cycles of a spectrogram's window, and
        directions of a line; over the cycles of a frame by the library, or as fast as the multiply-adds of our own would go.
    """

    copied_bytes: float
    random_words: float
    multiply_adds: float
    range_ffts: float
    doppler_ffts: float
    spectrogram_ffts: float
    angle_ffts: float


@dataclass(frozen=True)
class Work:
    """The size of a run.

    Parameters
    ----------
    chirps, rx, samples : int
        Shape of its IF.
    echoes : int
        Number of echoes of one chirp at one receiver.
    windows, cycles, channels : int
        Processing windows, TDM cycles in each, virtual channels.
    detections : int
        Cells that CFAR marked, in all windows.
    lines : int
        Lines of the array that tell an angle.
    """

    chirps: int
    rx: int
    samples: int
    echoes: int
    windows: int
    cycles: int
    channels: int
    detections: int
    lines: int

    @classmethod
    def of(cls, radar: Radar, *, chirps: int, windows: int, echoes: int, detections: int) -> Work:
        """Of a run by this radar."""
        lines = (radar.tx_y * radar.rx_y > 1) + (radar.tx_z * radar.rx_z > 1)
        shape = (radar.n_rx, radar.samples_per_chirp)
        return cls(
            chirps,
            *shape,
            echoes,
            windows,
            radar.cycles_per_frame,
            radar.n_channels,
            detections,
            lines,
        )

    @property
    def if_samples(self) -> int:
        """IF samples of the whole run."""
        return self.chirps * self.rx * self.samples

    @property
    def cells(self) -> int:
        """Cells of all range-Doppler maps."""
        return self.windows * self.samples * self.cycles

    @property
    def spectrogram_columns(self) -> int:
        """Windows of one channel's spectrogram, which starts one every twentieth of its window."""
        tdm_cycles = self.chirps * self.rx // self.channels
        return max(0, (tdm_cycles - SPECTROGRAM_CYCLES) // max(1, SPECTROGRAM_CYCLES // 20) + 1)


@dataclass(frozen=True)
class Floor:
    """The least that a stage could take.

    Parameters
    ----------
    seconds : float
    rule : str
        What it is made of, in words.
    """

    seconds: float
    rule: str


def direction_count(radar: Radar) -> int:
    """Directions that each line of the array is steered to; 0 without a line."""
    return len(angle_grid(radar)) if measures_angle(radar) else 0


def floors(work: Work, rates: Rates) -> dict[str, Floor]:
    """Floor of each stage that has one.

    Parameters
    ----------
    work : Work
    rates : Rates
        Rates of this machine for the transforms of the radar that was run.

    Returns
    -------
    dict of str to Floor
        By the names of ``stages`` in the summary of a run, and `ELSEWHERE`.
    """

    def copied(count: float) -> float:
        return count / rates.copied_bytes

    samples, echoes = work.if_samples, work.chirps * work.rx * work.echoes
    tones = max(
        _MULTIPLY_ADDS * samples * work.echoes / rates.multiply_adds, copied(_SAMPLE * samples)
    )
    spectra = _SAMPLE * work.windows * work.cycles * work.channels * work.samples
    doppler = max(work.windows * work.channels * work.samples / rates.doppler_ffts, copied(spectra))
    return {
        ELSEWHERE: Floor(copied(2 * _SAMPLE * samples), "spectra kept for the windows"),
        "scatter": Floor(copied(_ECHO * echoes), "lengths and amplitudes written"),
        "signal": Floor(tones, "two multiply-adds an echo and sample, or samples written"),
        "noise": Floor(
            max(samples / rates.random_words, copied(2 * _SAMPLE * samples)),
            "a random word a sample",
        ),
        "range": Floor(
            max(samples / work.samples / rates.range_ffts, copied(2 * _SAMPLE * samples)),
            "an FFT a chirp and receiver",
        ),
        "spectrogram": Floor(
            work.spectrogram_columns * work.samples / rates.spectrogram_ffts,
            "an FFT a column and range bin",
        ),
        "doppler": Floor(doppler, "an FFT a window, channel and range bin, or spectra read"),
        "cfar": Floor(copied(5 * work.cells), "power read, mask written"),
        "cloud": Floor(copied(work.cells), "masks read"),
        "angle": Floor(
            work.detections * work.lines / rates.angle_ffts,
            "an FFT a detection and line, zero-padded to the directions",
        ),
    }
