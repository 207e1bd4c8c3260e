"""Noise of the receiver, and phase noise of its oscillator.

Noise of the receiver is white, complex and Gaussian, of a power that follows from the asked SNR.

The phase noise of the oscillator is in the echo and in the signal with which it is mixed, so part
of it cancels. In an echo of delay tau the IF keeps phi(t) - phi(t - tau), whose spectrum is that of
the oscillator times 4 sin^2(pi f tau) (:eq:`range-correlation`). It is small, so an echo x becomes
x + j (phi(t) - phi(t - tau)) x. For still echoes (phi(t) - phi(t - tau)) / tau is interpolated
between some delays, and the echoes are summed once for each of them. All moving echoes share one
delay, their mean weighted by power, cycle by cycle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.front_end import Receiver
from rtradar.kernels.receiver import add_noise
from rtradar.radar import Radar
from rtradar.signal.synthesis import synthesize
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
        # As many rows a cycle as are received: the noise of a cycle depends on its number and not
        # on the block.
        rows = 1 if radar.multiplexing == "ddm" else radar.n_tx
        first_cycle = first_chirp // radar.n_tx
        # Half the power in each of the two parts of a complex sample.
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


# -- phase noise -----------------------------------------------------------------------------------

_Array = NDArray[np.float64]

_STREAM = 7
"""Number of these random streams, which differ from those of the noise of a cycle."""

_TOLERANCE = 0.02
"""Error of the interpolation over delays, as a fraction of the noise's amplitude: 0.2 dB."""

_PHASE_CYCLES_AT_ONCE = 8
"""Cycles of one task of a thread, because a return to Python waits for the other threads there."""

_CYCLES_A_SEED = 16
"""Cycles whose random streams come from one seed, which takes longer to make than their noise."""

_LANES = 16
"""Most rows that an FFT takes at once, in vector lanes."""

_MOST_RAD = 0.3
"""Largest deviation of a phase whose square is left out."""

_DELAYS = 256
"""Steps of delay in which the power of still echoes is added up for their level."""


def density_of(receiver: Receiver, frequency: _Array) -> _Array:
    """Spectral density of the oscillator's phase on either side of the carrier [rad^2/Hz]."""
    offsets = np.log10(np.maximum(frequency, 1e-3))
    points = np.log10(np.array(receiver.phase_noise_hz))
    return np.asarray(10 ** (np.interp(offsets, points, receiver.phase_noise_dbc_hz) / 10))


class PhaseNoise:
    """Residual phase noise of echoes, from a random stream for each cycle.

    ``still`` are the echoes of one cycle that do not move, ``moving_s`` the delay of those that do.
    """

    def __init__(
        self, radar: Radar, receiver: Receiver, seed: int, still: Sequence[Echoes], moving_s: float
    ) -> None:
        self._radar, self._seed = radar, seed
        self._rows = 1 if radar.at_once else radar.n_tx
        # The density at the frequencies of an FFT over one chirp, and the amplitude of its bins.
        n, rate = radar.samples_per_chirp, radar.sample_rate_hz
        self._frequency: _Array = np.arange(n // 2 + 1, dtype=np.float64) * (rate / n)
        self._density = density_of(receiver, self._frequency)
        self._scale = np.sqrt(n * rate * self._density / 2).astype(np.float32)
        self._still = still
        # The longest delay has the most residual noise. More than this would no longer be small.
        longest = max((one.length.max() for one in still if one.length.size), default=0.0)
        self._longest_s = longest / SPEED_OF_LIGHT_MPS
        most_s = max(self._longest_s, moving_s)
        of_all = self._density * self._filter(most_s)
        deviation = math.sqrt(2 * float(of_all.sum()) * rate / n)
        if deviation > _MOST_RAD:
            raise InputError(
                f"receiver: phase_noise_dbc_hz leaves {deviation:.2g} rad in an echo after "
                f"{most_s:.2g} s; up to {_MOST_RAD} rad are modelled, as noise beside an echo, so "
                "give a lower level"
            )
        self._nodes_s = self._nodes() if still else np.zeros(0)

    def _filter(self, delay_s: float) -> _Array:
        return np.asarray(4 * np.sin(np.pi * self._frequency * delay_s) ** 2)

    def _nodes(self) -> _Array:
        """Chebyshev nodes from 0 to the longest delay, as many as the tolerance asks for."""
        # The bound of the error of interpolation at Chebyshev nodes, for a phase that turns with
        # the delay at half the sample rate.
        half, count = math.pi * self._radar.sample_rate_hz * self._longest_s / 2, 1
        while 2 * (half / 2) ** count / math.factorial(count) > _TOLERANCE:
            count += 1
        places = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        return np.asarray(self._longest_s * (1 + places) / 2)

    def fields(self) -> NDArray[np.complex64]:
        """IF of the still echoes (tx, rx, node, sample), which noise at the nodes multiplies."""
        radar, nodes = self._radar, self._nodes_s
        shape = radar.n_tx, radar.n_rx, len(nodes), radar.samples_per_chirp
        found, times = np.zeros(shape, np.complex64), radar.chirp_times(radar.n_tx)
        # Each still echo is shared among the nodes by Lagrange's polynomials in its delay, which is
        # what interpolating its phase noise amounts to; the factor delay / node is there because
        # the phase over the delay is interpolated.
        for echoes in self._still:
            delay = echoes.length / SPEED_OF_LIGHT_MPS
            for number, node in enumerate(nodes):
                others = np.delete(nodes, number)
                weight = delay / node * np.prod([(delay - x) / (node - x) for x in others], axis=0)
                weighted = replace(echoes, amplitude=echoes.amplitude * weight)
                found[:, :, number] += synthesize(weighted, radar, times, dtype=np.complex64)
        return found

    def level_m2(self, moving_m2: float, moving_s: float) -> float:
        """Power per sample of white noise as dense as the residual noise is where it is densest."""
        total = self._filter(moving_s) * moving_m2
        # Still echoes are added up by their delay, because the filter depends on nothing else.
        for echoes in self._still:
            power = (np.abs(echoes.amplitude[0]) ** 2).mean(axis=(0, 1))
            delay = echoes.length.mean(axis=(0, 1)) / SPEED_OF_LIGHT_MPS
            sums, edges = np.histogram(
                delay, _DELAYS, (0, max(self._longest_s, 1e-15)), weights=power
            )
            for one, middle in zip(sums, (edges[1:] + edges[:-1]) / 2, strict=True):
                if one > 0:
                    total = total + one * self._filter(middle)
        return float((total * self._density).max() * self._radar.sample_rate_hz)

    def phases(self, first: int, moving_s: _Array) -> NDArray[np.float32]:
        """Residual phase noise (chirp, 1 + node, sample) [rad] of chirps from ``first`` on.

        The first is that of echoes with the delays ``moving_s (chirp,)``, the others are those at
        the nodes.
        """
        radar, n = self._radar, self._radar.samples_per_chirp
        n_tx, n_nodes = radar.n_tx, len(self._nodes_s)
        out = np.empty((len(moving_s) // n_tx, n_tx, 1 + n_nodes, n), np.float32)
        # The filter 1 - exp(-j 2 pi f tau): once for the moving echoes, with the mean delay of each
        # cycle, and once for each node.
        half_turn = (np.pi * self._frequency).astype(np.float32)
        at_nodes = _residue(half_turn * self._nodes_s[:, None].astype(np.float32))
        of_moving = moving_s.reshape(-1, n_tx).mean(axis=1).astype(np.float32)
        states = self._states(first // n_tx, len(out))

        def fill(begin: int) -> None:
            own = slice(begin, begin + _PHASE_CYCLES_AT_ONCE)
            cycles, bins = len(out[own]), len(half_turn)
            filters = np.empty((cycles, 1, 1 + n_nodes, bins), np.complex64)
            filters[:, 0, 0] = _residue(of_moving[own, None] * half_turn)
            filters[:, 0, 1:] = at_nodes
            # One spectrum of white noise a row, shaped by the oscillator's density, which all
            # delays share.
            random = np.zeros((cycles * self._rows, 1, bins), np.complex64)
            add_noise(states[own], self._rows, np.float32(1), random)
            random *= self._scale
            # Rows go through the FFT in vector lanes; those left over may round otherwise.
            count = len(random) * (1 + n_nodes)
            spectra = np.zeros((-(-count // _LANES) * _LANES, bins), np.complex64)
            product = spectra[:count].reshape(cycles, self._rows, 1 + n_nodes, bins)
            np.multiply(random.reshape(cycles, -1, 1, bins), filters, out=product)
            phases = scipy.fft.irfft(spectra, n, axis=-1)[:count]
            # Tx that transmit at once have one oscillator.
            out[own] = phases.reshape(*product.shape[:3], n)

        thread_map(fill, range(0, len(out), _PHASE_CYCLES_AT_ONCE))
        return out.reshape(len(moving_s), 1 + n_nodes, n)

    def _states(self, first: int, count: int) -> NDArray[np.uint64]:
        """States (cycle, 4) of the random bits of some cycles, from a seed for each few of them."""
        groups = range(first // _CYCLES_A_SEED, (first + count - 1) // _CYCLES_A_SEED + 1)
        seeds = [
            stream(self._seed, group, _STREAM).generate_state(3 * _CYCLES_A_SEED, np.uint64)
            for group in groups
        ]
        # Of SFC64 three words are random, and the last counts.
        words = np.reshape(seeds, (-1, 3))[first - groups.start * _CYCLES_A_SEED :][:count]
        return np.insert(words, 3, 1, axis=1)


def _residue(half: NDArray[np.float32]) -> NDArray[np.complex64]:
    """1 - exp(-2j half), to as many digits where it is small."""
    sine, out = np.sin(half), np.empty(half.shape, np.complex64)
    out.real, out.imag = 2 * sine * sine, 2 * sine * np.cos(half)
    return out


def mean_delays(echoes: Echoes) -> _Array:
    """Mean delay (chirp,) [s] of echoes by their power, at the first receiver."""
    power = np.abs(echoes.amplitude[0, :, 0]) ** 2
    total = np.maximum(power.sum(axis=-1), np.finfo(np.float64).tiny)
    return np.asarray((power * echoes.length[:, 0]).sum(axis=-1) / total / SPEED_OF_LIGHT_MPS)
