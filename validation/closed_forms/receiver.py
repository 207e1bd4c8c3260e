"""What a receiver adds to IF samples, effect by effect, against closed forms.

phase-noise   residual spectrum of still and of moving echoes against L(f) 4 sin^2(pi f tau)
iq            image of a tone below it against the ratio for an error of gain and of phase
quantisation  signal to noise of rounding against 6.02 b + 1.76 dB
clipping      third and fifth harmonic of a clipped tone against their Fourier coefficients
highpass      response over frequency against the analogue filters of first order
leakage       place and power against the length of its path and the coupling
dc            power in range bin 0
channels      errors given, and deviation of the angle that drawn ones cause
interferer    place, duration, chirp rate, power and direction of a crossing ramp

    python validation/closed_forms/receiver.py [--quick] [--json FILE]
"""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import j0

import rtradar as rt
from rtradar.signal.receiver import Expected, Mover, ReceiverStage
from rtradar.validate.rows import Row, judged, main, reported

LIGHT = 299_792_458.0
POWER_DBM = 12.0
Samples = NDArray[np.complex64]


def radar(n_rx: int = 1, **fields: Any) -> rt.Radar:
    """One Tx, chirps of 102.4 us and 100 MHz, 1024 samples at 10 MHz."""
    return rt.Radar(
        start_frequency_hz=12e9,
        bandwidth_hz=100e6,
        chirp_duration_s=102.4e-6,
        samples_per_chirp=1024,
        tx_y=1,
        tx_z=0,
        rx_y=n_rx,
        rx_z=0,
        frame_duration_s=0.01,
        transmit_power_dbm=POWER_DBM,
        receiver=rt.Receiver(**fields),
    )


def stage(made: rt.Radar, moving_m2: float = 1.0) -> ReceiverStage:
    """Everything that the receiver has, for there is no noise."""
    return ReceiverStage(
        made, Expected((Mover(moving_m2, 9 * moving_m2, 1e-8),), 0.0, 0.0), n_chirps=100
    )


def received(made: rt.Radar, samples: NDArray[Any]) -> NDArray[np.complex128]:
    """Samples (row, rx, sample) after the ADC."""
    out = np.array(samples, dtype=np.complex64)
    stage(made, float((np.abs(out) ** 2).max())).receive(out, 0)
    return out.astype(np.complex128)


def tone(bins: float, amplitude: float = 1.0) -> NDArray[np.complex128]:
    return np.asarray(amplitude * np.exp(2j * np.pi * bins * np.arange(1024) / 1024))[None, None]


def amplitude_of(made: rt.Radar, power_dbm: float) -> float:
    """Amplitude [m] of a power at the antenna by the radar equation, isotropic antennas."""
    wavelength = LIGHT / (made.start_frequency_hz + made.bandwidth_hz / 2)
    of_one_m2_dbm = POWER_DBM + 10 * math.log10(wavelength**2 / (4 * math.pi) ** 3)
    return float(10 ** ((power_dbm - of_one_m2_dbm) / 20))


def db(ratio: float) -> float:
    return 20 * math.log10(ratio)


# -- effects ---------------------------------------------------------------------------------------


def phase_noise_rows(quick: bool) -> Iterator[Row]:
    says = "residual phase noise against L(f) 4 sin^2(pi f tau), mean error over all offsets"
    chirps = 400 if quick else 4000
    offsets, levels = (1e4, 1e6, 5e6), (-80.0, -95.0, -110.0)
    for length in (3.0, 90.0):
        made = radar(
            phase_noise_hz=offsets,
            phase_noise_dbc_hz=levels,
            leakage_db=-20.0,
            leakage_length_m=length,
        )
        kept = stage(made)
        delay = (length + abs(made.tx[0] - made.rx[0]).max()) / LIGHT
        frequency = np.fft.fftfreq(1024, 1 / 10e6)
        lines = np.interp(np.log10(np.maximum(np.abs(frequency), 1)), np.log10(offsets), levels)
        expected = 10 ** (lines / 10) * 4 * np.sin(np.pi * frequency * delay) ** 2
        echoes = rt.Echoes(
            length=np.full((chirps, 1, 1), length),
            amplitude=np.ones((1, chirps, 1, 1), complex),
            frequency=np.array([12.05e9]),
            tx=np.zeros(chirps, np.int64),
            part=np.zeros(1, np.int64),
            bounces=np.ones(1, np.int64),
        )
        phases = kept.phases(echoes, 0)
        quiet = np.zeros((1, 1, 1024), np.complex64)
        still = np.zeros((chirps, 1, 1024), np.complex64)
        kept.transmit(still, phases, 0)
        pure = stage(radar(leakage_db=-20.0, leakage_length_m=length))
        pure.transmit(quiet, None, 0)
        moving = np.ones((chirps, 1, 1024), np.complex64)
        kept.turn_moving(moving, phases)
        # Beside zeros of sin^2 the interpolation over delays, to 2 % of the amplitude, is more.
        loud = np.abs(np.sin(np.pi * frequency * delay)) > 0.2 if length > 50 else frequency != 0
        for name, turned in (("still", still / quiet), ("moving", moving)):
            spectrum = np.abs(np.fft.fft(turned[:, 0].astype(np.complex128) - 1)) ** 2
            found = spectrum.mean(axis=0) / (1024 * 10e6)
            error = 10 * np.log10(found[loud].mean() / expected[loud].mean())
            shape = 10 * np.log10(found[loud] / expected[loud])
            claim = f"a {name} echo, path of {length:g} m"
            # Each bin is known to 1 / sqrt(chirps); 0.17 dB are the interpolation over delays.
            bins = 0.17 + 4.34 / math.sqrt(chirps)
            yield judged(
                claim, "density, all bins", "dB", error, 0.2, key="phase-noise", says=says,
                reference=0.0,
            )  # fmt: skip
            yield judged(
                claim, "rms error of a bin", "dB", float(np.sqrt((shape**2).mean())), 1.2 * bins,
                key="phase-noise", says="the same, rms error of one offset",
            )  # fmt: skip


def iq_rows() -> Iterator[Row]:
    says = "image of a tone by errors of IQ gain and phase, against the closed ratio"
    for gain_db, phase_deg in ((0.5, 0.0), (0.0, 3.0), (1.0, 5.0), (-0.2, -1.0)):
        made = radar(iq_gain_db=gain_db, iq_phase_deg=phase_deg)
        spectrum = np.abs(np.fft.fft(received(made, tone(37))[0, 0]))
        g, phi = 10 ** (gain_db / 20), math.radians(phase_deg)
        ratio = (1 + 2 * g * math.cos(phi) + g**2) / (1 - 2 * g * math.cos(phi) + g**2)
        # Single precision leaves 1e-7 of the tone, 1e-5 of the image.
        yield judged(
            f"{gain_db:g} dB, {phase_deg:g} deg", "image rejection", "dB",
            db(spectrum[37] / spectrum[-37]), 0.001, reference=10 * math.log10(ratio),
            key="iq", says=says,
        )  # fmt: skip


def quantisation_rows(quick: bool) -> Iterator[Row]:
    rng = np.random.default_rng(0)
    for bits in (6, 12) if quick else (4, 6, 8, 10, 12, 14):
        made = radar(adc_bits=bits, adc_full_scale_dbm=-40.0)
        full = amplitude_of(made, -40.0)
        # A step below, for the highest code is.
        steps = 2 ** (bits - 1) - 1
        size = full * (1 - 2.0 ** (1 - bits))
        given = np.concatenate([tone(bins, size) for bins in rng.uniform(100, 900, 100)])
        given = given.astype(np.complex64).astype(np.complex128)
        noise = (np.abs(received(made, given) - given) ** 2).mean()
        found = 10 * math.log10(full**2 / noise)
        # Rounding of a cosine: q^2 (1/12 + sum over n of (-1)^n J0(2 pi n A / q) / (pi n)^2).
        n = np.arange(1, 2000)
        exact = 1 / 12 + float(((-1.0) ** n * j0(2 * np.pi * n * steps) / (np.pi * n) ** 2).sum())
        expected = -10 * math.log10(2 * exact / 4.0 ** (bits - 1))
        # A hundred thousand samples of a bounded error: 0.03 dB.
        yield judged(
            f"{bits} bits", "signal to noise of a tone", "dB", found, 0.05, reference=expected,
            key="quantisation", says="signal to noise of an ADC, against rounding of a cosine",
        )  # fmt: skip
        if bits >= 8:  # where the Bessel functions above are 0.1 dB at most
            yield judged(
                f"{bits} bits", "signal to noise", "dB", found, 0.2,
                reference=20 * math.log10(2) * bits + 10 * math.log10(1.5),
                key="quantisation",
                says="signal to noise of an ADC that a tone just fills, against 6.02 b + 1.76 dB",
            )  # fmt: skip


def clipping_rows() -> Iterator[Row]:
    says = "harmonics of a clipped tone against its Fourier coefficients"
    made = radar(adc_full_scale_dbm=-40.0)
    full = amplitude_of(made, -40.0)
    for over_db in (3.0, 12.0):
        size = full * 10 ** (over_db / 20)
        spectrum = np.abs(np.fft.fft(received(made, tone(5, size))[0, 0])) / 1024
        edge = math.acos(full / size)
        for k, place in ((3, -15), (5, 25)):
            lost = math.sin((k - 1) * edge) / (2 * (k - 1)) + math.sin((k + 1) * edge) / (
                2 * (k + 1)
            )
            expected = 4 / math.pi * abs(size * lost - full * math.sin(k * edge) / k)
            # Harmonics past half the sample rate fold back, 0.02 of the fifth.
            yield judged(
                f"{over_db:g} dB over full scale", f"harmonic {k}", "dB",
                db(spectrum[place] / full), 0.2, reference=db(expected / full),
                key="clipping", says=says,
            )  # fmt: skip


def mover_rows() -> Iterator[Row]:
    """A corner reflector on a cart, twice as strong as the converter takes, behind a weak person.

    Its echo is a tone of amplitude A = sqrt(4 pi a^4 / (3 lambda^2)) / R^2, of which the fraction
    2 / pi acos(L / A) lies beyond the limit L.
    """
    edge_m, range_m = 0.4, 30.0
    made = radar(n_rx=1)
    expected = math.sqrt(4 * math.pi * edge_m**4 / 3) / made.wavelength_m / range_m**2
    level_dbm = db(expected / 2 / amplitude_of(made, 0.0))
    made = replace(radar(n_rx=1, adc_full_scale_dbm=level_dbm), position_m=(0.0, 0.0, 0.0))
    middle = edge_m / 3 * np.array([1 / math.sqrt(3), 0.0, 0.0])
    cart = rt.Object(
        "cart", "trihedral", "metal", position_m=tuple((range_m, 0, 0) - middle), yaw_deg=180.0,
        motion=rt.FollowingPath(velocity_mps=(1.0, 0.0, 0.0)),
    )  # fmt: skip
    person = rt.Person(rt.synthetic_motion("stand", duration_s=0.03), (0.0, 100.0))
    samples = rt.simulate(
        [person, cart], made, snr_db=math.inf, duration_s=0.02, fidelity="specular"
    ).samples.values
    limit = amplitude_of(made, level_dbm)
    beyond = float((np.abs(samples.real) > limit * (1 - 1e-5)).mean())
    says = "samples that an object which moves takes beyond the converter's limit, as a tone does"
    # Half a decibel of the reflector's cross-section.
    yield judged(
        "a corner reflector on a cart", "fraction of samples", "", beyond, 0.02,
        reference=2 / math.pi * math.acos(0.5), key="clipping", says=says,
    )  # fmt: skip


def highpass_rows() -> Iterator[Row]:
    says = "response of the high-pass filters up to half the sample rate, against analogue ones"
    window = np.hanning(1025)[:-1]
    for corners in ((175e3,), (175e3, 350e3), (300e3, 1.4e6)):
        made = radar(highpass_hz=corners)
        for f in (100e3, 350e3, 1e6, 4e6, 9.8e6):
            given = tone(f / 10e6 * 1024)
            found = abs((received(made, given) * given.conj() * window).sum()) / window.sum()
            expected = math.prod(f / math.hypot(f, corner) for corner in corners)
            claim, quantity = f"corners {corners}", f"response at {f / 1e6:g} MHz"
            values = db(found), db(expected)
            if f > 5e6:  # as its image would be: where the model ends
                yield reported(
                    claim, quantity, "dB", values[0], reference=values[1], key="highpass"
                )
                continue
            # The bilinear transform puts f = infinity at Fs / 2: it passes at 4 MHz what the filter
            # takes there, 0.5 dB with a corner at 1.4 MHz.
            yield judged(
                claim, quantity, "dB", values[0], 0.1 if max(corners) < 1e6 else 0.5,
                reference=values[1], key="highpass", says=says,
            )  # fmt: skip


def leakage_rows() -> Iterator[Row]:
    for length in (0.5, 4.0):
        made = radar(n_rx=2, leakage_db=-35.0, leakage_length_m=length)
        samples = np.zeros((1, 2, 1024), np.complex64)
        stage(made).transmit(samples, None, 0)
        one = samples[0, 1].astype(np.complex128)
        power_dbm = db(float(np.abs(one).mean()) / amplitude_of(made, 0.0))
        beat = np.angle((one[1:] * one[:-1].conj()).sum()) / (2 * np.pi) * 10e6
        path = length + float(np.linalg.norm(made.tx[0] - made.rx[1]))
        claim = f"lines of {length:g} m"
        says = "power of leakage against that transmitted and the coupling"
        yield judged(
            claim, "power", "dBm", power_dbm, 0.001, reference=POWER_DBM - 35.0,
            key="leakage", says=says,
        )  # fmt: skip
        # Single precision: 1e-7 rad between samples, over 1000 of them.
        says = "range of leakage against the length of its path"
        yield judged(
            claim, "range", "m", beat / (100e6 / 102.4e-6) * LIGHT / 2, 1e-3, reference=path / 2,
            key="leakage", says=says,
        )  # fmt: skip
    made = radar(dc_dbm=-63.0)
    constant = abs(received(made, np.zeros((1, 1, 1024))).mean())
    yield judged(
        "a constant", "power in range bin 0", "dBm", db(constant / amplitude_of(made, 0.0)), 0.001,
        reference=-63.0, key="dc", says="power of DC",
    )  # fmt: skip


def channel_rows(quick: bool) -> Iterator[Row]:
    gains, turns = (0.5, -1.0, 0.0, 2.0), (10.0, 0.0, -20.0, 5.0)
    made = radar(n_rx=4, channel_gain_db=gains, channel_phase_deg=turns)
    samples = np.ones((1, 4, 1024), np.complex64)
    stage(made).transmit(samples, None, 0)
    expected = 10 ** (np.array(gains) / 20) * np.exp(1j * np.radians(turns))
    error = float(np.abs(samples[0, :, 0] - expected).max())
    yield judged(
        "errors given", "largest difference", "1", error, 1e-6, key="channels",
        says="errors of channels that are given",
    )  # fmt: skip
    elements, sigma_deg, seeds = 16, 4.0, 100 if quick else 1000
    found = []
    for seed in range(seeds):
        made = radar(n_rx=elements, channel_phase_deg=sigma_deg, seed=seed)
        samples = np.ones((1, elements, 1024), np.complex64)
        stage(made).transmit(samples, None, 0)
        beam = np.abs(np.fft.fft(samples[0, :, 0], 1 << 14))
        found.append((int(np.argmax(beam)) + (1 << 13)) % (1 << 14) - (1 << 13))
    # Sine of the direction of the beam, for elements half a wavelength apart at 12 GHz.
    wavelengths = 0.5 * 12.05 / 12.0
    sines = np.array(found) / (1 << 14) / wavelengths
    # Of one Tx only the Rx differ, which have half of the variance. Skolnik, Radar Handbook:
    # variance of the slope of a line through phases that are off by sigma each.
    sigma = math.radians(sigma_deg) / math.sqrt(2)
    spread = elements * (elements**2 - 1) / 12
    expected_deg = math.degrees(sigma / (2 * math.pi * wavelengths * math.sqrt(spread)))
    # A deviation of that many values is known to 1 / sqrt(2 n); five of these.
    yield judged(
        f"phases off by {sigma_deg:g} deg, {elements} Rx", "deviation of the angle", "deg",
        math.degrees(float(sines.std())), expected_deg * 5 / math.sqrt(2 * seeds),
        reference=expected_deg, key="channels", says="deviation of the angle by errors of phase",
    )  # fmt: skip


def interferer_rows() -> Iterator[Row]:
    slope, azimuth_deg = 100e6 / 102.4e-6, 25.0
    for other_slope in (3e12, -2e12):
        # Its ramp meets ours in the middle of the chirp.
        middle_s = 51.2e-6
        start_hz = 12e9 + slope * middle_s - other_slope * middle_s
        other = rt.Interferer(
            start_frequency_hz=start_hz,
            slope_hz_per_s=other_slope,
            ramp_s=102.4e-6,
            period_s=1.0,
            power_dbm=-55.0,
            azimuth_deg=azimuth_deg,
        )
        made = radar(n_rx=2, interferer=other)
        samples = received(made, np.zeros((1, 2, 1024)))[0]
        hit = np.flatnonzero(samples[0])
        claim = f"a ramp of {other_slope / 1e12:g} MHz/us across ours of {slope / 1e12:.2f}"
        apart = slope - other_slope
        # The beat goes from 0 to the sample rate: before the crossing where theirs is faster.
        expected_us = 1e6 * 10e6 / abs(apart)
        start_us = 51.2 - (expected_us if apart < 0 else 0.0)
        says = "crossing ramp of another radar: when and how long it is in the band of the IF"
        for quantity, value, expected in (
            ("start", hit[0] * 0.1, start_us),
            ("duration", len(hit) * 0.1, expected_us),
        ):
            # A sample takes 0.1 us.
            yield judged(
                claim, quantity, "us", value, 0.1001, reference=expected, key="interferer",
                says=says,
            )  # fmt: skip
        inside = samples[:, hit[0] : hit[-1] + 1]
        power = db(float(np.abs(inside[0]).mean()) / amplitude_of(made, 0.0))
        says = "crossing ramp of another radar: power"
        yield judged(
            claim, "power", "dBm", power, 0.001, reference=-55.0, key="interferer", says=says
        )
        steps = inside[0, 1:] * inside[0, :-1].conj()
        rate = np.angle((steps[1:] * steps[:-1].conj()).mean()) / (2 * np.pi) * 10e6**2
        says = "crossing ramp of another radar: rate of its beat frequency"
        # Single precision: 1e-7 rad against 0.2 rad from step to step.
        yield judged(
            claim, "rate of the beat", "MHz/us", rate / 1e12, 1e-4, reference=apart / 1e12,
            key="interferer", says=says,
        )  # fmt: skip
        # Rx rise along +y: the wave from the left comes to the second first, and the IF turns back.
        turned = -np.angle((inside[1] * inside[0].conj()).mean())
        sine = turned / (2 * np.pi * 0.5 * 12.05 / 12.0)
        says = "crossing ramp of another radar: direction"
        yield judged(
            claim, "azimuth", "deg", math.degrees(math.asin(sine)), 0.001, reference=azimuth_deg,
            key="interferer", says=says,
        )  # fmt: skip


def measure(quick: bool) -> list[Row]:
    warnings.simplefilter("ignore", rt.ValidityWarning)
    return [
        *phase_noise_rows(quick),
        *mover_rows(),
        *iq_rows(),
        *quantisation_rows(quick),
        *clipping_rows(),
        *highpass_rows(),
        *leakage_rows(),
        *channel_rows(quick),
        *interferer_rows(),
    ]


if __name__ == "__main__":
    sys.exit(main("What a receiver adds against closed forms", measure))
