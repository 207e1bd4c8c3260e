"""Receiver noise: white, complex, Gaussian, of a power that follows from the asked signal-to-noise ratio."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rtradar.radar import Radar
from rtradar.threads import in_threads

_CYCLES_AT_ONCE = 4
"""By one thread: to hand out each by itself takes a tenth of its time."""


@dataclass(frozen=True)
class Noise:
    """White complex Gaussian noise that does not depend on how the capture is cut into blocks.

    Parameters
    ----------
    power : float
        Of one complex sample [m^2]; 0 is none.
    seed : int
        The same seed, the same noise.
    """

    power: float
    seed: int = 0

    @classmethod
    def for_snr(cls, signal_power: float, snr_db: float, seed: int = 0) -> Noise:
        """Noise whose power per sample is ``signal_power`` less ``snr_db``; infinite ``snr_db`` is none.

        Parameters
        ----------
        signal_power : float
            Of the person's visible echoes: sum of ``|amplitude|^2``, averaged over the capture [m^2].
        snr_db : float
            [dB].
        seed : int

        Returns
        -------
        Noise

        Notes
        -----
        Equation :eq:`snr` of the theory page.
        """
        return cls(0.0 if math.isinf(snr_db) and snr_db > 0 else signal_power / 10 ** (snr_db / 10), seed)

    def add(self, samples: NDArray[np.complex64], radar: Radar, first_chirp: int) -> None:
        """Add noise in place to a block of chirps ``(chirp, rx, sample)`` that starts at ``first_chirp``, a cycle's first.

        Each TDM cycle has a stream of its own, made from the seed and its number.

        Parameters
        ----------
        samples : (chirp, rx, sample) complex64
            Changed in place [m].
        radar : Radar
        first_chirp : int
            Number of the first of them in the capture.

        Raises
        ------
        ValueError
            Where the block does not start with a cycle.
        """
        if first_chirp % radar.n_tx:
            raise ValueError(f"Noise.add: the block starts at chirp {first_chirp}; it must start with a TDM cycle")
        if self.power == 0:
            return
        sigma = np.float32(math.sqrt(self.power / 2))

        def fill(first: int) -> None:
            for begin in range(first, min(first + _CYCLES_AT_ONCE * radar.n_tx, len(samples)), radar.n_tx):
                part = samples[begin : begin + radar.n_tx]
                stream = np.random.Generator(np.random.SFC64([self.seed, (first_chirp + begin) // radar.n_tx]))
                _add(stream.standard_normal((*part.shape, 2), dtype=np.float32), sigma, part)

        in_threads(fill, range(0, len(samples), _CYCLES_AT_ONCE * radar.n_tx))


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _add(values, scale, out):  # type: ignore[no-untyped-def]
    """Add values (chirp, rx, sample, 2), real and imaginary, times scale to ``out (chirp, rx, sample)``."""
    for chirp in range(out.shape[0]):
        for receiver in range(out.shape[1]):
            for sample in range(out.shape[2]):
                own = values[chirp, receiver, sample]
                out[chirp, receiver, sample] += complex(scale * own[0], scale * own[1])
