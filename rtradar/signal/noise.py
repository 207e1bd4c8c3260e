"""Receiver noise: white, complex, Gaussian, of a power that follows from the asked SNR."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.gaussian_noise import add_noise
from rtradar.radar import Radar
from rtradar.system.seeds import check_seed, stream
from rtradar.system.threads import thread_map

_CYCLES_AT_ONCE = 16
"""Cycles of one task of a thread, because a return to Python waits for the other threads there."""


@dataclass(frozen=True)
class Noise:
    """White complex Gaussian noise that does not depend on how the capture is cut into blocks.

    Parameters
    ----------
    power : float
        Mean noise power of one complex sample [m^2]; 0 is no noise.
    seed : int
        Seed of the random numbers; the same seed gives the same noise.

    Raises
    ------
    InputError
        Where the seed is not allowed.
    """

    power: float
    seed: int = 0

    def __post_init__(self) -> None:
        check_seed("noise: ", self.seed)

    @classmethod
    def for_snr(cls, signal_power: float, snr_db: float, seed: int = 0) -> Noise:
        """Noise whose power per sample is ``snr_db`` below ``signal_power`` (:eq:`snr`).

        Parameters
        ----------
        signal_power : float
            Power of the person's visible echoes, the capture average of the sum of
            ``|amplitude|^2`` [m^2].
        snr_db : float
            Signal-to-noise ratio of one sample [dB]; infinity gives no noise.
        seed : int
            Seed of the random numbers.

        Returns
        -------
        Noise
        """
        silent = math.isinf(snr_db) and snr_db > 0
        return cls(0.0 if silent else signal_power / 10 ** (snr_db / 10), seed)

    def add(self, samples: NDArray[np.complex64], radar: Radar, first_chirp: int) -> None:
        """Add noise in place to a block of what was received.

        Each cycle has a random stream of its own, made from the seed and its number.

        Parameters
        ----------
        samples : (row, rx, sample) complex64
            Received samples, changed in place [m]. A row is a chirp, and under DDM, where all Tx
            share one receiver, a cycle.
        radar : Radar
            Radar that received the samples.
        first_chirp : int
            Number of the first chirp in the capture; a cycle starts with it.

        Raises
        ------
        ValueError
            Where the block does not start with a cycle.
        """
        if first_chirp % radar.n_tx:
            raise ValueError(
                f"Noise.add: the block starts at chirp {first_chirp}; it must start with a cycle"
            )
        if self.power == 0:
            return
        rows = 1 if radar.multiplexing == "ddm" else radar.n_tx
        first_cycle = first_chirp // radar.n_tx
        sigma = np.float32(math.sqrt(self.power / 2))

        def fill(first: int) -> None:
            part = samples[first : first + _CYCLES_AT_ONCE * rows]
            begin = first_cycle + first // rows
            numbers = range(begin, begin + -(-len(part) // rows))
            add_noise(np.array([_stream(self.seed, n) for n in numbers]), rows, sigma, part)

        thread_map(fill, range(0, len(samples), _CYCLES_AT_ONCE * rows))


def _stream(seed: int, cycle: int) -> NDArray[np.uint64]:
    """State (4,) of the random bits of a cycle."""
    # From plain numbers NumPy would make a sequence of seeds first, which takes longer.
    return np.asarray(np.random.SFC64(stream(seed, cycle)).state["state"]["state"])
