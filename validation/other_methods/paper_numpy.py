"""The paper's method in plain NumPy, with which `rtradar bench` compares: one frame of 100 ms.

For each chirp, each receiver of its Tx and each ellipsoid: range of the centre and closed-form
cross-section, one complex exponential for every IF sample (paper, eqs 8 to 11, with the small term
that eq. 9 neglects), the sum over the body, noise (eq. 12), range FFT (eq. 13), Doppler FFT
(eq. 16), the sum of the magnitudes of all channels, and OS-CFAR with the paper's multiplier. Each
frame is synthesised once, as in `rtradar run`. Frames do not overlap here, which saves this method
three of four Doppler FFTs. Poses are given, and their interpolation is not timed.

One TDM cycle is computed at once: 96 x 21 x 256 exponentials, which stay in a processor's cache;
larger blocks are slower. All cycles cost the same, because they have the same shapes, so with
``--cycles N`` the time is scaled to a whole frame; the Doppler FFT and CFAR are always of a whole
frame. NumPy does all of this in one thread except for BLAS, which is limited to one thread, and has
nothing to do here.

    python validation/other_methods/paper_numpy.py [--radar NAME|TOML] [--cycles N] [--json FILE]
"""

from __future__ import annotations

import os

if __name__ == "__main__":
    for _library in ("OMP", "OPENBLAS", "MKL"):
        os.environ[f"{_library}_NUM_THREADS"] = "1"  # before NumPy is imported

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.motion import place

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

GUARD, REACH = 2, 6  # the paper's CFAR: 2 guard and 4 training cells on each side
QUANTILE, OS_SCALE = 0.75, 5.0003
SNR_DB = 20.0
NOISE_SEED = 0


class Poses(NamedTuple):
    """Centres (chirp, part, 3), frames (chirp, part, 3, 3) and semi-axes (part, 3) of the body."""

    centres: Array
    frames: Array
    semi_axes: Array


def poses(radar: rt.Radar, cycles: int) -> Poses:
    """Poses of a synthetic walk at the centres of the first chirps."""
    body = Body.from_motion(place(rt.synthetic_motion("walk", seed=0, duration_s=3.0)))
    return Poses(*body.at(radar.chirp_times(cycles * radar.n_tx)))


def cross_section(semi_axes: Array, sight: Array) -> Array:
    """Cross-section [m^2] of ellipsoids (part, 3) along vectors in their axes; paper, ref. 22."""
    a, b, c = semi_axes.T
    x, y, z = np.moveaxis(sight, -1, 0)
    return np.pi * (a * b * c) ** 2 / ((a * x) ** 2 + (b * y) ** 2 + (c * z) ** 2) ** 2


def if_samples(radar: rt.Radar, body: Poses, first: int = 0) -> Complex:
    """IF samples (chirp, rx, sample) without noise of some chirps of a cycle, from ``first`` on."""
    at = np.asarray(radar.position_m)
    tx_index = (first + np.arange(len(body.centres))) % radar.n_tx
    tx, rx = radar.tx[tx_index] - at, radar.rx[radar.rx_of_tx[tx_index]] - at
    sight = body.centres - at
    distance = np.sqrt((sight**2).sum(axis=-1))
    sight /= distance[..., None]
    # Spreading, which the paper omits, costs nothing.
    amplitude = (
        np.sqrt(cross_section(body.semi_axes, (body.frames * sight[..., None]).sum(axis=-2)))
        / distance**2
    )
    # Eqs 10 and 11: a plane wave reaches an element sooner by its place along the line of sight.
    sooner = ((tx[:, None] + rx)[:, :, None] * sight[:, None]).sum(axis=-1)
    tau = (2 * distance[:, None] - sooner) / SPEED_OF_LIGHT_MPS  # (chirp, rx, part)
    t = np.arange(radar.samples_per_chirp) / radar.sample_rate_hz
    start, slope = radar.start_frequency_hz, radar.slope_hz_per_s
    # Eq. 9, and the sum over the body.
    turns = (start * tau - slope * tau**2 / 2)[..., None] + (slope * tau)[..., None] * t
    return (amplitude[:, None, :, None] * np.exp(2j * np.pi * turns)).sum(axis=2)


def hann(n: int) -> Array:
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)


def os_cfar(power: Array) -> NDArray[np.bool_]:
    """Detected cells (range, velocity), above a multiple of a quantile of their training cells."""
    rows, columns = power.shape
    padded = np.pad(power, REACH, constant_values=np.inf)  # sorted behind all real cells
    width = 2 * REACH + 1
    trains = np.ones((width, width), dtype=bool)
    trains[REACH - GUARD : REACH + GUARD + 1, REACH - GUARD : REACH + GUARD + 1] = False
    around = np.lib.stride_tricks.sliding_window_view(padded, (width, width))
    mask = np.empty(power.shape, dtype=bool)
    for row in range(rows):
        cells = np.sort(around[row][:, trains], axis=-1)
        rank = np.ceil(QUANTILE * np.isfinite(cells).sum(axis=-1) * (1 - 1e-12)).astype(int)
        mask[row] = power[row] > OS_SCALE * cells[np.arange(columns), rank - 1]
    return mask


class Stopwatch:
    """Seconds by the name of the stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def of(self, stage: str, times: float = 1.0) -> Iterator[None]:
        """Time a block of code, and count it several times."""
        began = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + times * (time.perf_counter() - began)


def frame_seconds(radar: rt.Radar, body: Poses) -> dict[str, float]:
    """Seconds of a whole frame by stage; the poses of some cycles are repeated to fill it."""
    cycles = len(body.centres) // radar.n_tx
    scale = radar.cycles_per_frame / cycles
    watch = Stopwatch()
    rng = np.random.default_rng(NOISE_SEED)
    shape = (radar.n_tx, radar.n_rx, radar.samples_per_chirp)
    window = hann(radar.samples_per_chirp)
    cube = np.empty((radar.cycles_per_frame, *shape), dtype=np.complex128)
    for cycle in range(cycles):
        chirps = slice(cycle * radar.n_tx, (cycle + 1) * radar.n_tx)
        with watch.of("echoes and IF", scale):
            samples = if_samples(
                radar, Poses(body.centres[chirps], body.frames[chirps], body.semi_axes)
            )
        with watch.of("noise", scale):
            sigma = math.sqrt(np.mean(np.abs(samples) ** 2) / 10 ** (SNR_DB / 10) / 2)
            samples += sigma * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
        with watch.of("range", scale):
            cube[cycle] = np.fft.fft(samples * window, axis=-1)
    for cycle in range(cycles, len(cube)):
        cube[cycle] = cube[cycle % cycles]
    power = np.zeros((radar.samples_per_chirp, radar.cycles_per_frame))
    with watch.of("doppler"):
        for tx in range(radar.n_tx):
            doppler = np.fft.fft(cube[:, tx] * hann(len(cube))[:, None, None], axis=0)
            power += np.abs(doppler).sum(axis=1).T
        power = np.fft.fftshift(power, axes=1)
    with watch.of("cfar"):
        os_cfar(power)
    return watch.seconds


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--radar", default="paper-12ghz", help="name of a preset, or a TOML file")
    parser.add_argument(
        "--cycles", type=int, help="TDM cycles that are synthesised (default: a whole frame)"
    )
    parser.add_argument(
        "--repeats", type=int, default=1, help="frames to time, after a cycle for warming up"
    )
    parser.add_argument(
        "--json",
        type=Path,
        metavar="FILE",
        help="write the seconds of each stage to this file, a dictionary for each frame",
    )
    options = parser.parse_args()
    radar = rt.Radar.load(options.radar)
    cycles = min(options.cycles or radar.cycles_per_frame, radar.cycles_per_frame)
    body = poses(radar, cycles)
    if_samples(radar, poses(radar, 1))
    frames = [frame_seconds(radar, body) for _ in range(options.repeats)]
    for seconds in frames:
        print(
            ", ".join(f"{stage} {each:.3f} s" for stage, each in seconds.items()),
            f"= {sum(seconds.values()):.3f} s a frame",
        )
    if options.json:
        found = {
            "radar": radar.name,
            "frame_s": radar.frame_duration_s,
            "cycles": cycles,
            "frames": frames,
        }
        options.json.write_text(
            json.dumps(found | {"cycles_per_frame": radar.cycles_per_frame}, indent=1) + "\n"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
