"""Static-clutter removal against sums that are written out here.

Removal: the IF samples of a static room of five reflectors and of three moving points, 60 dB below
the strongest reflector, are computed in float64, rounded to complex64 as in the pipeline, and go
through range spectra and each removal. The reference is the moving points alone, in float64 from
the IF samples to the removal, which is written out here. The difference is the residual of the
room and the rounding that it leaves on the moving points.

Maps: a walk of 0.6 s in the living room by `rt.run` with each removal. What every map of
``maps.h5`` contains where nothing moves is divided by the same without removal.

    python validation/closed_forms/clutter.py [--quick] [--json FILE]
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.process import (
    clutter_removal,
    power_map,
    range_spectrum,
)
from rtradar.radar import Radar
from rtradar.validate.rows import Row, judged, main, reported

ROOM_DB = 60.0
MOST_LEFT_DB = -100.0
SETTINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "mean": ("mean", {}),
    "exponential, 0.2 s": ("exponential", {"time_constant_s": 0.2}),
    "mti, 2 pulses": ("mti", {"pulses": 2}),
    "mti, 3 pulses": ("mti", {"pulses": 3}),
}


def thin(name: str, n_tx: int, n_rx: int, **changes: Any) -> Radar:
    """A preset with fewer antennas and its own cycle duration."""
    whole = Radar.preset(name)
    return Radar(
        name=name,
        start_frequency_hz=whole.start_frequency_hz,
        chirp_duration_s=whole.cycle_duration_s / n_tx,
        tx_y=n_tx,
        tx_z=0,
        rx_y=n_rx,
        rx_z=0,
        **changes,
    )


def hann(n: int) -> NDArray[np.float64]:
    return np.sin(np.pi * np.arange(n) / n) ** 2


# -- removal ---------------------------------------------------------------------------------------


def echo(
    radar: Radar, n_chirps: int, range_of: Callable[[NDArray[np.float64]], Any]
) -> NDArray[np.complex128]:
    """IF of a point of amplitude 1, (chirp, rx, sample); each antenna is a little farther away."""
    chirps = np.arange(n_chirps)
    extra = 1.3e-3 * (chirps % radar.n_tx)[:, None] + 1.7e-3 * np.arange(radar.n_rx)
    times = (chirps + 0.5) * radar.chirp_duration_s
    tau = (2 * np.broadcast_to(range_of(times), times.shape)[:, None] + extra)[
        ..., None
    ] / SPEED_OF_LIGHT_MPS
    fast = np.arange(radar.samples_per_chirp) / radar.sample_rate_hz
    slope = radar.slope_hz_per_s
    return np.exp(
        2j * np.pi * (radar.start_frequency_hz * tau + slope * tau * fast - slope * tau**2 / 2)
    )


def room(radar: Radar, n_chirps: int) -> NDArray[np.complex128]:
    """Five static reflectors of amplitude 1 and less, each a tenth of the one before in power."""
    one = sum(
        10 ** (-i / 2) * echo(radar, radar.n_tx, lambda _, r=r: r)
        for i, r in enumerate((4.3, 2.71, 6.05, 1.2, 8.4))
    )
    return np.tile(one, (n_chirps // radar.n_tx, 1, 1))


def movers(radar: Radar, n_chirps: int) -> NDArray[np.complex128]:
    """A torso that approaches slowly, a limb that swings at up to 5 m/s, and a breathing chest."""
    paths: list[Callable[[NDArray[np.float64]], Any]] = [
        lambda t: 4.4 - 1.1 * t,
        lambda t: 4.2 + 0.5 * np.sin(10 * t),
        lambda t: 3.1 + 0.004 * np.sin(2 * np.pi * 0.3 * t),
    ]
    return sum(echo(radar, n_chirps, path) for path in paths) * 10 ** (-ROOM_DB / 20)


def by_hand(
    method: str,
    cycles: NDArray[np.complex128],
    radar: Radar,
    *,
    time_constant_s: float = 1.0,
    pulses: int = 2,
) -> NDArray[np.complex128]:
    """The last frame after each removal, written out in NumPy."""
    n = radar.cycles_per_frame
    if method == "mean":
        return cycles[-n:] - cycles[-n:].mean(axis=0)
    if method == "mti":
        kernel = {2: (1, -1), 3: (1, -2, 1)}[pulses]
        weights = np.array(kernel) / math.sqrt(sum(weight**2 for weight in kernel))
        return sum(
            weight * cycles[len(cycles) - n - i : len(cycles) - i]
            for i, weight in enumerate(weights)
        )
    share = 1 - math.exp(-radar.cycle_duration_s / time_constant_s)
    background, left = cycles[0], []
    for i, cycle in enumerate(cycles):
        left.append(cycle - background)
        step = max(share, 1 / (i + 1))
        background = (1 - step) * background + step * cycle
    return np.array(left[-n:])


def spectra_of(cycles: NDArray[np.complexfloating]) -> NDArray[np.complexfloating]:
    """Doppler spectra with a Hann window of coherent gain 1, in float64."""
    window = hann(len(cycles)) / hann(len(cycles)).sum()
    return np.fft.fft(cycles.astype(np.complex128) * window[:, None, None, None], axis=0)


def by_package(
    method: str, x: NDArray[np.complex128], radar: Radar, options: dict[str, Any]
) -> NDArray[np.complexfloating]:
    """The last frame of the stream, in the precision of the pipeline."""
    removal, shape = (
        clutter_removal(method, radar, **options),
        (-1, radar.n_tx, radar.n_rx, radar.samples_per_chirp),
    )
    parts = []
    step = 37 * radar.n_tx
    for first in range(0, len(x), step):
        spectra = range_spectrum(x[first : first + step].astype(np.complex64), radar)
        parts.append(removal.block(spectra, first))
    return removal.window(np.concatenate(parts).reshape(shape)[-radar.cycles_per_frame :])


def room_rows(name: str) -> Iterator[Row]:
    radar = thin(name, 2, 2)
    n_chirps = round(2.3 * radar.cycles_per_frame) * radar.n_tx
    still, moving = room(radar, n_chirps), movers(radar, n_chirps)
    weights = hann(radar.samples_per_chirp) / hann(radar.samples_per_chirp).sum()
    truth = np.fft.fft(moving * weights, axis=2).reshape(
        -1, radar.n_tx, radar.n_rx, radar.samples_per_chirp
    )
    shape = (-1, radar.n_tx, radar.n_rx, radar.samples_per_chirp)
    strongest = abs(
        spectra_of(np.fft.fft(still * weights, axis=2).reshape(shape)[-radar.cycles_per_frame :])
    ).max()
    for label, (method, options) in SETTINGS.items():
        claim = f"{name}, {label}"
        alone = by_package(method, still, radar, options)
        says = "clutter removal: residual of a static room alone, over its strongest cell"
        quantity = "residual of the room alone, over its strongest cell"
        yield judged(claim, quantity, "", abs(alone).max() / strongest, 0.0, says=says)
        ours = spectra_of(by_package(method, still + moving, radar, options))
        expected = spectra_of(by_hand(method, truth, radar, **options))
        left_db = 20 * math.log10(abs(ours - expected).max() / strongest)
        about = f"a room {ROOM_DB:g} dB above the moving points"
        quantity = f"residual of {about}, over its strongest cell"
        yield judged(
            claim, quantity, "dB", left_db, MOST_LEFT_DB, says=f"clutter removal: {quantity}"
        )
        kept_db = 20 * math.log10(
            abs(expected).max() / abs(spectra_of(truth[-radar.cycles_per_frame :])).max()
        )
        yield reported(
            claim, "strongest cell of the moving points, after over before", "dB", kept_db
        )


def response_rows(name: str) -> Iterator[Row]:
    """Tones from 1 bin to half the pulse rate, as complex64 range spectra."""
    radar = thin(name, 1, 1, samples_per_chirp=1)
    n = 40 * radar.cycles_per_frame
    turns = np.linspace(1 / radar.cycles_per_frame, 0.5, 60)
    for label, (method, options) in SETTINGS.items():
        if method == "mean":
            continue
        worst = 0.0
        for turn in turns:
            x = np.exp(2j * np.pi * turn * np.arange(n)).astype(np.complex64)[:, None, None]
            y = clutter_removal(method, radar, **options).block(x, 0)[-radar.cycles_per_frame :]
            measured_db = 10 * math.log10(np.mean(abs(y.astype(np.complex128)) ** 2))
            gain = abs(2 * math.sin(math.pi * turn))
            if method == "mti":
                order = options["pulses"] - 1
                gain = gain**order / math.sqrt(math.comb(2 * order, order))
            else:
                keep = math.exp(-radar.cycle_duration_s / options["time_constant_s"])
                gain /= abs(1 - keep * np.exp(-2j * np.pi * turn))
            worst = max(worst, abs(measured_db - 20 * math.log10(gain)))
        # The second difference of float32 values of size 1 is as small as 9e-5 at 77 GHz, so the
        # rounding error is at most 6e-8 / 9e-5 = 0.006 dB, and its rms is less.
        quantity = "response from 1 bin to half the pulse rate, largest error"
        yield judged(
            f"{name}, {label}", quantity, "dB", worst, 0.006, says=f"clutter removal: {quantity}"
        )
        for speed in (0.5, 1.0, 2.0):
            turn = speed / (2 * radar.max_velocity_mps)
            x = np.exp(2j * np.pi * turn * np.arange(n)).astype(np.complex64)[:, None, None]
            y = clutter_removal(method, radar, **options).block(x, 0)[-radar.cycles_per_frame :]
            yield reported(
                f"{name}, {label}",
                f"gain at {speed:g} m/s",
                "dB",
                10 * math.log10(np.mean(abs(y) ** 2)),
            )


def mean_rows(name: str) -> Iterator[Row]:
    """Loss of a slow echo by subtracting the mean, and the ghost of a fast echo at zero Doppler."""
    radar = thin(name, 1, 1, samples_per_chirp=1)
    n, removal = radar.cycles_per_frame, clutter_removal("mean", radar)

    def powers(bins: float) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        x = np.exp(2j * np.pi * bins / n * np.arange(n))[:, None, None, None]
        return power_map(x, radar)[0], power_map(removal.window(x), radar)[0]

    outside = np.setdiff1d(np.arange(n), n // 2 + np.arange(-1, 2))
    changed = 0.0
    for bins in np.arange(2.0, 40.0, 0.37):
        before, after = powers(bins)
        changed = max(changed, abs(after[outside] - before[outside]).max() / before.max())
    yield judged(
        f"{name}, mean",
        "power of movers of 2 to 40 bins outside bins -1 to 1, largest change of their peak",
        "",
        changed,
        1e-12,
    )
    slow = np.arange(0.0, 2.0, 0.002)
    kept = np.array([after.max() / before.max() for before, after in map(powers, slow)])
    half = slow[np.flatnonzero(kept < 0.5)[-1]]
    yield reported(
        f"{name}, mean", "an echo slower than this loses more than half of its peak", "bins", half
    )
    yield reported(f"{name}, mean", "the same", "m/s", half * radar.velocity_bin_mps)
    for bins in (5.5, 20.5):
        before, after = powers(bins)

        def sums(x: float) -> complex:
            """Mean of a tone of x bins over the frame."""
            return (
                np.exp(1j * np.pi * x * (n - 1) / n)
                * math.sin(math.pi * x)
                / (n * math.sin(math.pi * x / n))
            )

        own = (
            sums(bins) - (sums(bins - 1) + sums(bins + 1)) / 2
        )  # the side lobe of its Hann spectrum
        peak = max(abs(sums(x) - (sums(x - 1) + sums(x + 1)) / 2) for x in (-0.5, 0.5))
        ghost_db = 10 * math.log10(after[n // 2] / before.max())
        closed_db = 20 * math.log10(abs(own - sums(bins)) / peak)
        claim = f"ghost at zero of a mover at {bins:g} bins, of its peak"
        says = "clutter removal by the mean: ghost at zero Doppler against closed form"
        yield judged(f"{name}, mean", claim, "dB", ghost_db, 1e-6, reference=closed_db, says=says)


def noise_rows(quick: bool) -> Iterator[Row]:
    """Mean power of white noise after removal, over that before."""
    radar = thin("paper-12ghz", 1, 8, samples_per_chirp=256)
    n = 4 * radar.cycles_per_frame if quick else 20 * radar.cycles_per_frame
    rng = np.random.default_rng(2)
    x = rng.standard_normal((n, 8, 256, 2), dtype=np.float32).view(np.complex64)[..., 0]
    settings = {**SETTINGS, "exponential, 5 ms": ("exponential", {"time_constant_s": 5e-3})}
    for label, (method, options) in settings.items():
        y = clutter_removal(method, radar, **options).window(
            clutter_removal(method, radar, **options).block(x, 0)
        )
        factor = float((abs(y[n // 2 :]) ** 2).mean() / (abs(x[n // 2 :]) ** 2).mean())
        share = 1 - math.exp(-radar.cycle_duration_s / options.get("time_constant_s", 1.0))
        expected = {"mean": 1 - 1 / n, "mti": 1.0, "exponential": 2 / (2 - share)}[method]
        if (
            method != "exponential" or options["time_constant_s"] < 0.1
        ):  # in the longer one the transient has not yet decayed
            says = "clutter removal: power of white noise, after over before"
            yield judged(
                f"white noise, {label}",
                "power after over before",
                "",
                factor,
                0.005,
                reference=expected,
                says=says,
            )


def map_rows(quick: bool) -> Iterator[Row]:
    """Level of maps where nothing moves: at zero Doppler, or the mean of range over time."""
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.6)
    level: dict[str, dict[str, float]] = {}
    removals = ("mean",) if quick else ("mean", "exponential", "mti")
    for removal in ("none", *removals):
        with tempfile.TemporaryDirectory() as folder:
            radar, scene = Radar.preset("paper-12ghz"), rt.Scene.load("living-room")
            given = {"fidelity": "analytic", "clutter_removal": removal}
            rt.run(motion, radar, scene, out=folder, **given)
            with h5py.File(Path(folder) / "maps.h5") as maps:
                rest = {
                    name: int(np.abs(maps[name][:]).argmin())
                    for name in ("velocity", "spectrogram_velocity")
                }
                still = {
                    "range-Doppler": maps["range_doppler"][..., rest["velocity"]],
                    "spectrogram": maps["spectrogram"][:, rest["spectrogram_velocity"]],
                    "range over time": maps["range_time"][:],
                }
                level[removal] = {
                    name: 10 * math.log10(float(values.mean())) for name, values in still.items()
                }
    says = "clutter removal in a living room: level where nothing moves, over that without removal"
    for removal in removals:
        for name, value in level[removal].items():
            # The walker is 20 to 30 dB below the room; a map without removal stays at 0 dB.
            yield judged(
                f"{removal}, {name}",
                "level over none",
                "dB",
                value - level["none"][name],
                -20.0,
                says=says,
            )


def measure(quick: bool) -> list[Row]:
    rows: list[Row] = list(map_rows(quick))
    for name in ("paper-12ghz", "paper-77ghz"):
        rows += [*room_rows(name), *response_rows(name), *mean_rows(name)]
    rows += noise_rows(quick)
    return rows


if __name__ == "__main__":
    sys.exit(main("Static-clutter removal.", measure))
