"""What a receiver adds to IF samples: each effect that rises above the noise, and a list of all.

In the order of the signal: phase noise, leakage, errors of the channels; then, of what one ADC
samples at once, after the noise, another radar, IQ errors, high-pass filters, DC and converter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.echoes import Echoes
from rtradar.front_end import Interferer
from rtradar.kernels.receiver import (
    add_ramps,
    add_still,
    convert,
    high_pass,
    mirror,
    turn_by_noise,
)
from rtradar.radar import Radar
from rtradar.signal.clutter import RoomIf
from rtradar.signal.multiplexing import chirps_together
from rtradar.signal.noise import PhaseNoise, mean_delays
from rtradar.signal.synthesis import synthesize
from rtradar.system.seeds import stream
from rtradar.system.threads import thread_map

LEFT_OUT_DB = -10.0
"""Level over the noise of a cell below which an effect is left out: it would add 0.4 dB at most."""

_ROWS_A_THREAD = 96
_ROWS_LOOKED_AT = 2000
_Samples = NDArray[np.complex64]


@dataclass(frozen=True)
class Effect:
    """An effect of the receiver, its level over the noise of a cell [dB], and whether it is kept.

    The level is None without noise, and where the effect never occurs.
    """

    name: str
    level_db: float | None
    modelled: bool
    note: str


class Mover(NamedTuple):
    """Echoes of who or what moves: their power, that at their peak [m^2], and mean delay [s]."""

    power_m2: float
    peak_m2: float
    delay_s: float


class Expected(NamedTuple):
    """What a receiver is expected to get, in the unit of IF samples.

    ``movers`` are people and everything else that moves. ``noise_m2`` is the noise of a sample,
    ``cell_m2`` that of a cell of a channel's map [m^2].
    """

    movers: tuple[Mover, ...]
    noise_m2: float
    cell_m2: float


class ReceiverStage:
    """Applies what a radar's receiver adds to blocks of IF samples, in place.

    ``room`` are its IF samples, if any; ``keep_all`` keeps also what is below the noise.
    ``effects`` lists what was given.
    """

    def __init__(
        self,
        radar: Radar,
        expected: Expected,
        *,
        n_chirps: int,
        seed: int = 0,
        room: RoomIf | None = None,
        keep_all: bool = False,
    ) -> None:
        assert radar.receiver is not None
        self._radar, self._receiver, self._expected = radar, radar.receiver, expected
        self._keep_all = keep_all
        self.effects: tuple[Effect, ...] = ()
        # Nothing is added until an effect is found to matter.
        shape = radar.n_tx, radar.n_rx, radar.samples_per_chirp
        self._still, self._gain = np.zeros(shape, np.complex64), np.ones(shape[:2], np.complex64)
        self._fields = np.zeros((*shape[:2], 0, shape[2]), np.complex64)
        self._noise: PhaseNoise | None = None
        # What is still, the leakage and the room, has the strongest cells that the other effects
        # are judged by.
        still = self._add_leakage()
        of_room = room.clutter_if(np.arange(radar.n_tx)) if room else np.zeros(shape, np.complex64)
        around = of_room + self._still
        profiles = _profiles(around)
        # The strongest cell may be still or may move.
        strongest = max(mover.power_m2 for mover in expected.movers)
        self._peak_m2 = max(float((np.abs(profiles) ** 2).max()), strongest)
        if self._receiver.phase_noise_hz:
            self._set_phase_noise(seed, ((*room.cycle,) if room else ()) + still)
        self._set_channels()
        self._steering = np.zeros(shape[:2], np.complex64)
        if self._receiver.interferer is not None:
            self._set_interferer(self._receiver.interferer, n_chirps)
        self._image = np.complex64(1), np.complex64(0)
        self._set_baseband(float(np.abs(around).max()), profiles)

    # -- which effects there are -------------------------------------------------------------------

    def _keep(self, name: str, power_m2: float, noise_m2: float, note: str) -> bool:
        """Note an effect of this power against this noise [m^2]; return whether it is modelled."""
        # Without noise, or where an effect never occurs, there is no ratio.
        level_db = None
        if power_m2 > 0 and noise_m2 > 0:
            level_db = 10 * math.log10(power_m2) - 10 * math.log10(noise_m2)
        loud = power_m2 > noise_m2 * 10 ** (LEFT_OUT_DB / 10)
        effect = Effect(name, level_db, bool(loud or self._keep_all), note)
        self.effects = (*self.effects, effect)
        return effect.modelled

    def _add_leakage(self) -> tuple[Echoes, ...]:
        """Add the leakage to what is still; return its echoes."""
        radar, receiver = self._radar, self._receiver
        if receiver.leakage_db is None:
            return ()
        antennas = (radar.tx_antenna, radar.rx_antenna)
        gains = math.prod(one.peak_gain for one in antennas if one is not None)
        # Received power of an echo of 1 m^2 over the power of the Tx.
        of_1_m2 = gains * radar.wavelength_m**2 / (4 * math.pi) ** 3
        power = 10 ** (receiver.leakage_db / 10 - math.log10(of_1_m2))
        # It goes straight from each Tx to each Rx, and some way on the board.
        apart = radar.tx_m[:, None] - radar.rx_m[radar.rx_of_tx]
        length = np.linalg.norm(apart, axis=-1)[..., None] + receiver.leakage_length_m
        echoes = Echoes(
            length=length,
            amplitude=np.full((1, *length.shape), math.sqrt(power), np.complex128),
            frequency=np.array([radar.centre_frequency_hz]),
            tx=np.arange(radar.n_tx),
            part=np.array([-1]),
            bounces=np.array([0]),
        )
        note = "as the power of an echo at the antennas, in range bin 0 or beside it"
        if not self._keep("leakage", power, self._expected.cell_m2, note):
            return ()
        times = radar.chirp_times(radar.n_tx)
        self._still += synthesize(echoes, radar, times, dtype=np.complex64)
        return (echoes,)

    def _in_m2(self, level_dbm: float) -> float:
        return 10 ** (level_dbm / 10) * 1e-3 / self._radar.watts_per_m2

    def _set_phase_noise(self, seed: int, still: tuple[Echoes, ...]) -> None:
        e = self._expected
        farthest_s = max(mover.delay_s for mover in e.movers)
        noise = PhaseNoise(self._radar, self._receiver, seed, still, farthest_s)
        note = "residual density, where it is densest, over that of the noise"
        level = max(noise.level_m2(mover.power_m2, mover.delay_s) for mover in e.movers)
        if self._keep("phase_noise", level, e.noise_m2, note):
            self._noise, self._fields = noise, noise.fields()

    def _set_channels(self) -> None:
        receiver, radar = self._receiver, self._radar
        given = receiver.channel_gain_db, receiver.channel_phase_deg
        if given == (0.0, 0.0):
            return
        # A deviation is drawn for each Tx and each Rx, and adds up over both; figures that are
        # given hold channel by channel.
        random = np.random.default_rng(stream(receiver.seed))
        errors = []
        for one in given:
            of_tx, of_rx = random.standard_normal(radar.n_tx), random.standard_normal(len(radar.rx))
            if isinstance(one, float):
                errors.append(one * (of_tx[:, None] + of_rx[radar.rx_of_tx]) / math.sqrt(2))
            else:
                errors.append(np.reshape(one, (radar.n_tx, radar.n_rx)))
        # Judged by what they change of the strongest echo.
        gain = 10 ** (errors[0] / 20) * np.exp(1j * np.radians(errors[1]))
        wrong = float((np.abs(gain - 1) ** 2).mean()) * self._peak_m2
        note = "what errors of gain and phase change of the strongest echo"
        if self._keep("channels", wrong, self._expected.cell_m2, note):
            self._gain = gain.astype(np.complex64)

    def _set_interferer(self, other: Interferer, n_chirps: int) -> None:
        radar = self._radar
        # A plane wave: each Rx gets it with the phase of its place along the direction of arrival.
        azimuth, elevation = math.radians(other.azimuth_deg), math.radians(other.elevation_deg)
        across = math.cos(elevation)
        direction = across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)
        turns = (radar.rx_m[radar.rx_of_tx] @ np.array(direction)) / radar.wavelength_m
        power = self._in_m2(other.power_dbm)
        self._steering = (math.sqrt(power) * np.exp(-2j * np.pi * turns)).astype(np.complex64)
        # How often its ramps cross the band of the IF is found in some rows over the capture.
        n_rows = n_chirps // chirps_together(radar)
        rows = np.unique(np.linspace(0, n_rows - 1, min(n_rows, _ROWS_LOOKED_AT)).astype(np.int64))
        samples = np.zeros((len(rows), radar.n_rx, radar.samples_per_chirp), np.complex64)
        self._add_ramps(rows, samples)
        cells = np.abs(_profiles(samples[:, 0])) ** 2
        crossed = float((samples[:, 0] != 0).mean())
        note = (
            f"in the band of the IF for {crossed:.3%} of the samples; its peak over range, as if "
            "in phase from chirp to chirp"
        )
        peak = float(cells.max(axis=-1).mean())
        if not self._keep("interferer", peak, self._expected.cell_m2, note):
            self._steering[:] = 0

    def _set_baseband(self, most: float, profiles: NDArray[np.complex128]) -> None:
        """Settle what acts on all that one ADC samples, for still samples up to ``most``.

        The image of an echo is that of :eq:`image-rejection`.
        """
        receiver, e = self._receiver, self._expected
        keep = self._keep
        # The two branches of the mixer: what stays of the signal, and its image.
        if receiver.iq_gain_db or receiver.iq_phase_deg:
            turned = 10 ** (receiver.iq_gain_db / 20) * np.exp(
                1j * np.radians(receiver.iq_phase_deg)
            )
            own, image = (1 + turned) / 2, (1 - turned.conjugate()) / 2
            note = "image of the strongest echo, at the negative of its beat frequency and velocity"
            if keep("iq", float(abs(image) ** 2) * self._peak_m2, e.cell_m2, note):
                self._image = np.complex64(own), np.complex64(image)
        rate = self._radar.sample_rate_hz
        self._corners = np.zeros(0, np.float32)
        # What the filters take, of still echoes by range and of each mover at its delay.
        if receiver.highpass_hz:
            beat = np.arange(profiles.shape[-1]) * rate / profiles.shape[-1]
            moving_hz = [self._radar.slope_hz_per_s * mover.delay_s for mover in e.movers]
            of_still, of_moving = (
                np.abs(1 - _passed(receiver.highpass_hz, np.array(f))) for f in (beat, moving_hz)
            )
            moving = np.array([mover.power_m2 for mover in e.movers]) * of_moving**2
            lost = max((np.abs(profiles * of_still) ** 2).max(), moving.max())
            if keep("highpass", float(lost), e.cell_m2, "what it takes from the strongest echo"):
                corners = np.pi * np.array(receiver.highpass_hz) / rate
                self._corners = corners.astype(np.float32)
        # The offset is shared evenly by both branches.
        self._dc = np.complex64(0)
        if receiver.dc_dbm is not None:
            power = self._in_m2(receiver.dc_dbm)
            if keep("dc", power, e.cell_m2, "in range bin 0, at velocity 0"):
                self._dc = np.complex64(math.sqrt(power / 2) * (1 + 1j))
        self._set_adc(most)

    def _set_adc(self, most: float) -> None:
        """Settle the converter for still samples up to ``most``."""
        receiver, e = self._receiver, self._expected
        self._step, self._limit = np.float32(0), np.float32(np.inf)
        if receiver.adc_full_scale_dbm is None:
            return
        full = math.sqrt(self._in_m2(receiver.adc_full_scale_dbm))
        # Rounding by up to half a step in each branch: step^2 / 12 twice.
        if receiver.adc_bits is not None:
            step = full / 2 ** (receiver.adc_bits - 1)
            if self._keep("quantisation", step**2 / 6, e.noise_m2, "white noise of rounding"):
                self._step = np.float32(step)
        # The largest sample, if everything were in phase for a moment.
        moving = sum(math.sqrt(mover.peak_m2) for mover in e.movers)
        other = float(np.abs(self._steering).max())
        most = float(abs(self._dc)) + most + other + moving + 4 * math.sqrt(e.noise_m2)
        beyond = max(most - full, 0.0)
        note = f"samples reach {20 * math.log10(max(most, 1e-300) / full):.1f} dB of full scale"
        if self._keep("clipping", beyond**2, e.cell_m2, note):
            self._limit = np.float32(full)

    # -- blocks of samples -------------------------------------------------------------------------

    def phases(self, echoes: Echoes, first: int) -> NDArray[np.float32] | None:
        """Return the phase noise of chirps from ``first`` on, with these echoes that move."""
        if self._noise is None:
            return None
        return self._noise.phases(first, mean_delays(echoes))

    def turn_moving(self, samples: _Samples, phases: NDArray[np.float32] | None) -> None:
        """Give phase noise to samples (chirp, rx, sample) of what moves."""
        if phases is not None:
            own = np.ascontiguousarray(phases[:, 0])
            _in_threads(lambda some: turn_by_noise(own[some], samples[some]), len(samples))

    def transmit(self, samples: _Samples, phases: NDArray[np.float32] | None, first: int) -> None:
        """Add what is still, with its phase noise, and apply the errors of channels.

        Samples (chirp, rx, sample) are those of each Tx by itself.
        """
        if phases is None and not self._still.any() and (self._gain == 1).all():
            return
        tx = self._radar.tx_of_chirp(np.arange(first, first + len(samples)))
        none = np.zeros((len(samples), 0, samples.shape[2]), np.float32)
        nodes = none if phases is None else np.ascontiguousarray(phases[:, 1:])

        def fill(some: slice) -> None:
            add_still(tx[some], self._still, nodes[some], self._fields, self._gain, samples[some])

        _in_threads(fill, len(samples))

    def receive(self, received: _Samples, first: int) -> None:
        """Apply what acts on received samples (row, rx, sample), with noise.

        They begin with chirp ``first``.
        """
        # In the order of the signal: another radar, then the mixer, the filters and the converter.
        rows = first // chirps_together(self._radar) + np.arange(len(received))
        if self._steering.any():
            self._add_ramps(rows, received)
        changed = bool(self._step or self._dc) or math.isfinite(self._limit)

        def fill(some: slice) -> None:
            if self._image[1]:
                mirror(*self._image, received[some])
            if len(self._corners):
                high_pass(self._corners, received[some])
            if changed:
                convert(self._dc, self._step, self._limit, received[some])

        _in_threads(fill, len(received))

    def _add_ramps(self, rows: NDArray[np.int64], samples: _Samples) -> None:
        radar, other = self._radar, self._receiver.interferer
        assert other is not None
        # When and at which frequency the sampling of each row begins, because the other radar has a
        # clock of its own.
        chirps = rows * chirps_together(radar)
        starts = radar.centres_of(chirps) - radar.samples_per_chirp / radar.sample_rate_hz / 2
        tx = radar.tx_of_chirp(chirps)
        frequency = radar.sampled_start_hz + radar.tx_offset_hz[tx]
        of_ramp = other.start_frequency_hz, other.slope_hz_per_s
        ramps = (*of_ramp, other.ramp_s, other.period_s, other.start_s)
        sweep = radar.slope_hz_per_s, radar.sample_rate_hz

        def fill(some: slice) -> None:
            own = starts[some], frequency[some], tx[some]
            add_ramps(*own, *sweep, ramps, self._steering, samples[some])

        _in_threads(fill, len(samples))


def _profiles(samples: _Samples) -> NDArray[np.complex128]:
    """Range profiles of samples, whose cells are amplitudes of echoes."""
    window = np.hanning(samples.shape[-1] + 1)[:-1]
    return np.asarray(np.fft.fft(samples * (window / window.sum())))


def _passed(corners: tuple[float, ...], frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Response of analogue filters of first order at some frequencies [Hz]."""
    parts = [1j * frequency / (1j * frequency + corner) for corner in corners]
    return np.asarray(np.prod(parts, axis=0), dtype=np.complex128)


def _in_threads(work: Callable[[slice], None], count: int) -> None:
    """Do some work for slices of so many rows, which do not depend on each other."""
    step = _ROWS_A_THREAD
    thread_map(lambda begin: work(slice(begin, begin + step)), range(0, count, step))
