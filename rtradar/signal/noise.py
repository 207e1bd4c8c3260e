"""Receiver noise: white, complex, Gaussian, of a power that follows from the asked signal-to-noise ratio."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled
from rtradar.radar import Radar
from rtradar.system.seeds import check_seed, stream
from rtradar.system.threads import in_threads

_CYCLES_AT_ONCE = 16
"""By one thread: whoever comes back to Python more often waits for the other threads there."""


@dataclass(frozen=True)
class Noise:
    """White complex Gaussian noise that does not depend on how the capture is cut into blocks.

    Parameters
    ----------
    power : float
        Mean noise power of one complex sample [m^2]; 0 is no noise.
    seed : int
        The same seed, the same noise.

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
        """Noise whose power per sample is ``signal_power`` less ``snr_db``; infinite ``snr_db`` is none.

        Parameters
        ----------
        signal_power : float
            Power of the person's visible echoes, the capture average of the sum of
            ``|amplitude|^2`` [m^2].
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
        return cls(
            0.0 if math.isinf(snr_db) and snr_db > 0 else signal_power / 10 ** (snr_db / 10), seed
        )

    def add(self, samples: NDArray[np.complex64], radar: Radar, first_chirp: int) -> None:
        """Add noise in place to what was received.

        ``samples (row, rx, sample)`` are a block that starts at ``first_chirp``, a cycle's first. A row is a
        chirp, and under DDM a cycle, for there all Tx share one receiver. Each cycle has a stream of its own, made from the seed
        and its number.

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
            numbers = range(
                first_cycle + first // rows, first_cycle + -(-(first + len(part)) // rows)
            )
            _add(np.array([_stream(self.seed, number) for number in numbers]), rows, sigma, part)

        in_threads(fill, range(0, len(samples), _CYCLES_AT_ONCE * rows))


def _stream(seed: int, cycle: int) -> NDArray[np.uint64]:
    """State (4,) of the random bits of a cycle."""
    # Of plain numbers NumPy would make a sequence of seeds first, the long way.
    return np.asarray(np.random.SFC64(stream(seed, cycle)).state["state"]["state"])


# Compiled arithmetic stays in float32, and so in twice as many vector lanes, where every constant of it is one.
_ONE, _TWO, _HALF, _STEP = np.float32(1), np.float32(2), np.float32(0.5), np.float32(2.0**-31)
_LN_2, _HALF_TURNS = np.float32(math.log(2)), np.float32(math.pi * 2.0**-32)
_ROOT_HALF_BITS, _FRACTION_BITS, _FRACTION = np.int32(0x3F3504F3), 23, np.int32((1 << 23) - 1)
_L3, _L5, _L7, _L9 = (np.float32(2 / odd) for odd in (3, 5, 7, 9))
_S3, _S5, _S7, _S9, _S11 = (
    np.float32((-1) ** (n // 2) / math.factorial(n)) for n in (3, 5, 7, 9, 11)
)
_C2, _C4, _C6, _C8, _C10 = (
    np.float32((-1) ** (n // 2) / math.factorial(n)) for n in (2, 4, 6, 8, 10)
)


@compiled(fastmath={"contract"})
def _add(streams, rows, sigma, out):
    """Add complex normal numbers, of deviation sigma in either part, to ``out (chirp, rx, sample)``, from 64 random bits each.

    ``streams (cycle, 4)`` are states of SFC64 (Doty-Humphrey, PractRand), each for ``rows`` chirps: its steps, but for where its
    bits go, are those of NumPy's. In lanes of 32 bits then Box and Muller's transform (1958): sigma sqrt(-2 ln u) at the angle
    2 pi t. It takes a logarithm and a sine, but no branch. 31 bits make u, the middles of 2^31 equal steps, and 32 bits t; so
    nothing is farther out than 6.66 sigma, where a true tail has one sample in 4e9.
    """
    n_samples = out.shape[2]
    for_radius, for_angle = np.empty(n_samples, dtype=np.int32), np.empty(n_samples, dtype=np.int32)
    for cycle in range(len(streams)):
        a, b, c, counter = streams[cycle]
        for chirp in range(cycle * rows, min((cycle + 1) * rows, len(out))):
            for receiver in range(out.shape[1]):
                for sample in range(n_samples):
                    bits = a + b + counter
                    counter += np.uint64(1)
                    a, b = b ^ (b >> np.uint64(11)), c + (c << np.uint64(3))
                    c = ((c << np.uint64(24)) | (c >> np.uint64(40))) + bits
                    for_radius[sample], for_angle[sample] = (
                        np.int32(bits >> np.uint64(33)),
                        np.int32(np.uint32(bits)),
                    )
                samples = out[chirp, receiver]
                for sample in range(n_samples):
                    u = np.float32((np.float32(for_radius[sample]) + _HALF) * _STEP)
                    # u = 2^exponent m with m from sqrt(1/2) to sqrt(2), and ln m = 2 artanh((m - 1) / (m + 1)).
                    shifted = np.int32(np.float32(u).view(np.int32) - _ROOT_HALF_BITS)
                    m = np.int32((shifted & _FRACTION) + _ROOT_HALF_BITS).view(np.float32)
                    z = (m - _ONE) / (m + _ONE)
                    x = z * z
                    log = z * (_TWO + x * (_L3 + x * (_L5 + x * (_L7 + x * _L9))))
                    log += np.float32(np.int32(shifted >> _FRACTION_BITS)) * _LN_2
                    radius = sigma * np.sqrt(max(-_TWO * log, np.float32(0)))
                    # Half the angle, at most a right angle, by its Taylor series; then doubled.
                    half = np.float32(for_angle[sample]) * _HALF_TURNS
                    x = half * half
                    sine = half * (_ONE + x * (_S3 + x * (_S5 + x * (_S7 + x * (_S9 + x * _S11)))))
                    cosine = _ONE + x * (_C2 + x * (_C4 + x * (_C6 + x * (_C8 + x * _C10))))
                    samples[sample] += complex(
                        radius * (_ONE - _TWO * sine * sine), radius * _TWO * sine * cosine
                    )
