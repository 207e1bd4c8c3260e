"""The spectrogram follows a pendulum's closed form, and shows torso and both legs of a real walk.

Pendulum: a point on a rod of 1 m swings freely by +-47 degrees, sin(theta / 2) = k sn(w t, k^2), at
up to 2.5 m/s. The IF samples are computed here in NumPy, with the exact path of every chirp over
its own Tx and Rx. They go through range spectra and the stream, in blocks that cut cycles. The
velocity of a column is compared with the mean of the range rate over its window, weighted by the
square of the window, because there lies the centroid of the power of a tone of changing frequency.
The highest cell may be half a bin off, by the spacing of the bins alone. Neither the change of
speed within a window (5.5 bins at 12 GHz, 1.2 at 77 GHz) limits the accuracy, nor that one velocity
has 14 % less Doppler at the low end of a 12 GHz sweep than in its middle, and 14 % more at the high
end: both widen the ridge evenly. What is left in the centroid is the beat frequency, by which the
returning wave is lower (1e-4).

Walk: a recording of CMU, SNR 20 dB, one channel. The line of the torso is the highest cell of each
column, compared with the mean range rate of the three torso parts. A leg swings when its foot
approaches at 2.4 m/s or more; its line is the highest cell among those faster than the middle
between the foot and the next fastest part of the body, wherever these are 6 bins apart. The range
rate of the foot is that of its specular point, found by a general minimiser: a foot rotates while
it swings, and its centre is up to 0.2 m/s slower or faster.

    RTRADAR_MOCAP=folder python validation/closed_forms/spectrogram.py [--quick] [--json FILE]

Without RTRADAR_MOCAP, the folder of recordings, only the pendulum is measured.
"""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from doppler_floor import shortest
from numpy.typing import NDArray
from scipy.special import ellipj

import rtradar as rt
from rtradar.body import PART_NAMES, Body
from rtradar.motion import place
from rtradar.process import range_spectrum
from rtradar.process.spectrogram import SlidingSpectrogram, Spectrogram
from rtradar.scatter import build_model
from rtradar.scatter.link_budget import link_budget
from rtradar.signal import Noise, synthesize
from rtradar.validate.rows import Row, judged, leave_out, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import power_db

Array = NDArray[np.float64]
SPEED_OF_LIGHT = 299_792_458.0
WINDOW = 128
PENDULUM_S = 2.2  # a period is 2.09 s
ROD_M, GRAVITY, MODULUS, PIVOT = 1.0, 9.81, 0.4, np.array([0.0, 0.2, 2.0])
TORSO = ("lower torso", "middle torso", "upper torso")
SWING_MPS, APART_BINS = -2.4, 6


def gathered(radar: rt.Radar, blocks: Iterable[NDArray[np.complex64]], channel: int) -> Spectrogram:
    """Spectrogram of a stream of IF samples."""
    stream = SlidingSpectrogram(radar, channel=channel)
    parts = [stream.push(range_spectrum(samples, radar)) for samples in blocks]
    power, time = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("power", "time")
    )
    return Spectrogram(power, time, parts[0].velocity)


def over_window(radar: rt.Radar, middles: Array) -> tuple[Array, Array]:
    """Instants (time, cycle) [s] of each window, and the window's square (cycle,), of sum 1."""
    cycles = np.arange(WINDOW)
    weight = np.sin(np.pi * cycles / WINDOW) ** 4
    return middles[:, None] + (cycles - WINDOW / 2) * radar.cycle_duration_s, weight / weight.sum()


# -- pendulum --------------------------------------------------------------------------------------


def pendulum(times: Array) -> tuple[Array, Array]:
    """Position [m] and velocity [m/s] of the point, (..., 3)."""
    rate = np.sqrt(GRAVITY / ROD_M)
    sn, cn, _, _ = ellipj(rate * times + 0.3, MODULUS**2)
    angle, turning = 2 * np.arcsin(MODULUS * sn), 2 * MODULUS * rate * cn
    along = np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=-1)
    across = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=-1)
    return PIVOT + ROD_M * along, ROD_M * turning[..., None] * across


def range_rate(times: Array, tx: Array, rx: Array) -> Array:
    """Range rate of the pendulum, half that of the path Tx-point-Rx [m/s]."""
    at, velocity = pendulum(times)
    units = ((at - end) / np.linalg.norm(at - end, axis=-1, keepdims=True) for end in (tx, rx))
    return np.asarray(sum((unit * velocity).sum(axis=-1) for unit in units) / 2)


def pendulum_if(radar: rt.Radar) -> Iterator[NDArray[np.complex64]]:
    """IF samples in blocks of 413 chirps, which is no whole number of cycles."""
    chirps = round(PENDULUM_S / radar.chirp_duration_s)
    instants = np.arange(radar.samples_per_chirp) / radar.sample_rate_hz
    slope = radar.bandwidth_hz / radar.chirp_duration_s
    for first in range(0, chirps, 413):
        numbers = np.arange(first, min(first + 413, chirps))
        at, _ = pendulum((numbers + 0.5) * radar.chirp_duration_s)
        tx = numbers % radar.n_tx
        there = np.linalg.norm(radar.tx[tx] - at, axis=1)
        back = np.linalg.norm(radar.rx[radar.rx_of_tx[tx]] - at[:, None], axis=2)
        delay = ((there[:, None] + back) / SPEED_OF_LIGHT)[..., None]
        turns = radar.start_frequency_hz * delay + slope * delay * instants - slope * delay**2 / 2
        yield np.exp(2j * np.pi * (turns % 1)).astype(np.complex64)


def pendulum_rows(radar: rt.Radar) -> Iterator[Row]:
    # Of the Rx of each line, the two at its ends.
    ends = (radar.rx_y - 1) * radar.rx_spacing_wavelengths
    radar = dataclasses.replace(radar, rx_y=2, rx_z=2, rx_spacing_wavelengths=ends)
    for channel in (0, radar.n_channels - 1):
        tx, rx = divmod(channel, radar.n_rx)
        seen = gathered(radar, pendulum_if(radar), channel)
        times, weight = over_window(radar, seen.time)
        truth = range_rate(times, radar.tx[tx], radar.rx[radar.rx_of_tx[tx, rx]]) @ weight
        width = SPEED_OF_LIGHT / (
            2 * radar.centre_frequency_hz * WINDOW * radar.n_tx * radar.chirp_duration_s
        )
        ridge = seen.velocity[seen.power.argmax(axis=1)]
        # Within 20 bins of the highest cell: 14 % of 25 bins, 3 for the change of speed, and the
        # skirts of the window.
        near = np.abs(seen.velocity - ridge[:, None]) < 20.5 * width
        centroid = (seen.power * near * seen.velocity).sum(axis=1) / (seen.power * near).sum(axis=1)
        claim = f"{radar.name}, pendulum, channel {channel}"
        yield reported(claim, "greatest range rate", "m/s", float(np.abs(truth).max()))
        yield reported(
            claim,
            "greatest change of it within a window",
            "bins",
            steepest(radar, seen.time, truth) / width,
        )
        # One bin is the claim. A hundredth: a shift of a quarter cycle is 0.01 bins at 12 GHz.
        columns, says = len(truth), "spectrogram of a pendulum against elliptic functions"
        for name, found, limit in (("highest cell", ridge, 1.0), ("centroid", centroid, 0.01)):
            quantity, error = f"{name}, worst of {columns} columns", worst(found - truth, width)
            yield judged(
                claim, quantity, "bins", error, limit, says=f"{says}: {name}", cases=columns
            )
        # By Parseval's theorem 1.5 in range times 1.5 in velocity in every column, for an echo of
        # amplitude 1.
        total = seen.power.sum(axis=1)
        error = float(np.abs(total / 2.25 - 1).max())
        yield judged(
            claim,
            "power of a column, worst",
            "",
            error,
            1e-5,
            says=f"{says}: power of a column",
            cases=columns,
        )


def steepest(radar: rt.Radar, times: Array, rate: Array) -> float:
    return float(np.abs(np.gradient(rate, times)).max()) * WINDOW * radar.cycle_duration_s


def worst(error: Array, width: float) -> float:
    return float(np.abs(error).max() / width)


# -- walk ------------------------------------------------------------------------------------------


def walk(folder: Path) -> Body:
    motion = rt.load_motion(folder / "cmu/07_05.amc", skeleton=folder / "cmu/07.asf")
    return Body.from_motion(place(motion, start_s=0.5, duration_s=3.0))


def walk_spectrogram(
    radar: rt.Radar, body: Body, fidelity: str, snr_db: float = 20.0
) -> Spectrogram:
    """Channel 0 of a walk, by the single steps of the chain."""
    model = build_model(fidelity, radar, body)
    n_chirps = int(body.duration_s / radar.cycle_duration_s) * radar.n_tx
    noise = Noise.for_snr(link_budget(model, radar, body, n_chirps).power, snr_db, seed=0)
    block = 34 * radar.n_tx

    def blocks() -> Iterator[NDArray[np.complex64]]:
        for first in range(0, n_chirps, block):
            chirps = np.arange(first, min(first + block, n_chirps))
            samples = synthesize(
                model.echoes(chirps),
                radar,
                radar.chirp_times(len(chirps), first),
                dtype=np.complex64,
            )
            noise.add(samples, radar, first)
            yield samples

    return gathered(radar, blocks(), channel=0)


@dataclasses.dataclass(frozen=True)
class Gait:
    """Range rates of the body for channel 0, every 5 ms [m/s]."""

    times: Array
    parts: Array  # (time, part), of the centres
    feet: dict[str, Array]  # of the specular points

    @classmethod
    def of(cls, radar: rt.Radar, body: Body) -> Gait:
        times = np.linspace(0, body.duration_s, round(body.duration_s / 5e-3) + 1)
        poses, tx, rx = body.at(times), radar.tx[0], radar.rx[radar.rx_of_tx[0, 0]]
        ways = np.linalg.norm(poses.centres - tx, axis=2) + np.linalg.norm(
            poses.centres - rx, axis=2
        )
        feet = {}
        for side in ("left", "right"):
            k = PART_NAMES.index(f"{side} foot")
            pairs = zip(poses.centres[:, k], poses.frames[:, k], strict=True)
            mirrored = np.array(
                [shortest(tx, rx, centre, frame, poses.semi_axes[k]) for centre, frame in pairs]
            )
            feet[side] = np.gradient(mirrored, times) / 2
        return cls(times, np.gradient(ways, times, axis=0) / 2, feet)

    def seen(self, rate: Array, radar: rt.Radar, middles: Array) -> Array:
        """Range rates as the columns of a spectrogram average them."""
        times, weight = over_window(radar, middles)
        return np.asarray(np.interp(times, self.times, rate) @ weight)


def swings(rate: Array, times: Array) -> Iterator[slice]:
    """Intervals of at least 0.1 s in which a foot approaches fast."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (rate < SWING_MPS).astype(int), [0]])))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        if times[end - 1] - times[first] >= 0.1:
            yield slice(first, end)


def walk_rows(radar: rt.Radar, body: Body, gait: Gait, fidelity: str) -> Iterator[Row]:
    found = walk_spectrogram(radar, body, fidelity)
    claim = f"{radar.name}, walk, {fidelity}"
    width = found.velocity[1] - found.velocity[0]
    noise = float(np.median(found.power[:, found.velocity > 3.5]))  # nothing recedes so fast

    torso = gait.seen(
        gait.parts[:, [PART_NAMES.index(name) for name in TORSO]].mean(axis=1), radar, found.time
    )
    away = np.abs(found.velocity[found.power.argmax(axis=1)] - torso) / width
    # An arm or a thigh sometimes outshines the torso, so the median over the columns is judged.
    says = "spectrogram of a recorded walk against the motion: torso, legs; median of the columns"
    yield judged(
        claim,
        "torso: highest cell, median of the columns",
        "bins",
        float(np.median(away)),
        1.0,
        says=says,
    )
    yield reported(claim, "torso: fraction of columns within 3 bins", "", float((away < 3).mean()))

    count = 0
    for side, rate in gait.feet.items():
        foot = gait.seen(rate, radar, found.time)
        others = [k for k, name in enumerate(PART_NAMES) if name != f"{side} foot"]
        next_fastest = np.min(
            [gait.seen(gait.parts[:, k], radar, found.time) for k in others], axis=0
        )
        for run in swings(foot, found.time):
            apart = np.flatnonzero(next_fastest[run] - foot[run] > APART_BINS * width) + run.start
            beyond = found.velocity < ((foot + next_fastest) / 2)[apart, None]
            power = np.where(beyond, found.power[apart], 0.0)
            away = np.abs(found.velocity[power.argmax(axis=1)] - foot[apart]) / width
            begin, end = found.time[run.start], found.time[run.stop - 1]
            case = f"{side} leg, {begin:.2f} to {end:.2f} s"
            quantity, middle = (
                f"{case}: its line, median of {len(apart)} columns",
                float(np.median(away)),
            )
            yield judged(claim, quantity, "bins", middle, 1.0, says=says)
            yield reported(
                claim, f"{case}: fraction of columns within 3 bins", "", float((away < 3).mean())
            )
            yield reported(
                claim,
                f"{case}: above the noise, median",
                "dB",
                float(power_db(np.median(power.max(axis=1)) / noise)),
            )
            level = np.median(power.max(axis=1) / found.power[apart].max(axis=1))
            yield reported(
                claim, f"{case}: re the highest cell, median", "dB", float(power_db(level))
            )
            count += 1
    # The right foot swings when the recording begins, then the left, right and left one.
    yield judged(
        claim,
        "swings of the legs",
        "",
        count,
        0.0,
        reference=4,
        says="swings of the legs in that spectrogram, of 4: missed",
    )


def measure(quick: bool) -> list[Row]:
    presets = ("paper-12ghz",) if quick else ("paper-12ghz", "paper-77ghz")
    rows = [row for preset in presets for row in pendulum_rows(rt.Radar.preset(preset))]
    folder = os.environ.get("RTRADAR_MOCAP")
    if not folder:
        leave_out("a recorded walk", "RTRADAR_MOCAP, the folder of recordings")
        return rows
    body = walk(Path(folder))
    for preset in presets:
        # One Rx a line is enough for one channel.
        radar = dataclasses.replace(rt.Radar.preset(preset), rx_y=1, rx_z=1)
        gait = Gait.of(radar, body)
        for fidelity in ("analytic",) if quick else ("analytic", "specular"):
            rows += walk_rows(radar, body, gait, fidelity)
    return rows


if __name__ == "__main__":
    sys.exit(
        main("The spectrogram follows a pendulum, and shows torso and legs of a walk.", measure)
    )
