"""The data set MARS, and the clouds that rtradar predicts from its joints.

MARS (An and Ogras, ACM TECS 2021) pairs the points of an IWR1443BOOST, ten frames a second, with
the joints of a Kinect. Axes of both are x to the right, y away from the instrument and z up. Here
the joints move a body before the preset ``mars``, frame by frame, and what a chip of that kind does
makes points of its echoes:

static clutter    the mean over the chirps of a frame is removed, or is not
range             80 samples under a Blackman window, padded to 128
detection         CFAR over range alone and no grouping of peaks, at most 64 points, for recorded
                  points fill whole main lobes of both axes and come in the order of the chip
points            within a metre sideways and in height, nearer than 3 m, as the recorded ones are

Both windows, the chip's range FFT and its list are those of TI's mmWave SDK for that chip.
"""

from __future__ import annotations

import dataclasses
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.fft
import scipy.signal
from numpy.typing import NDArray

import rtradar as rt
from rtradar.motion import place
from rtradar.process import ti_oob

Reals = NDArray[np.float64]
Ints = NDArray[np.int64]

FRAME_S, DOPPLER_BIN_MPS = 0.1, 0.356
MOVES = 10
RANGE_BINS = 128
LONGEST_GAP = 2  # frames, from one to the next; the reader of joints bridges as much
SHORTEST = 8  # frames: the smoothing of shorter stretches is that of their ends alone


class Points(NamedTuple):
    """Points of frames, in the radar's axes: x right, y away, z up [m].

    The range is that of the range bin, whatever is known of the direction.
    """

    places: Reals  # (point, 3)
    range_m: Reals
    doppler: Ints  # bin, positive receding
    level: Reals  # magnitude, in any unit
    frame: Ints  # index of the frame in the take

    def of(self, kept: NDArray[np.bool_]) -> Points:
        return Points(*(values[kept] for values in self))

    def shifted(self, shift_m: tuple[float, float, float]) -> Points:
        """The same points elsewhere; what is away is added to the range, and alone is."""
        places = self.places + np.array(shift_m)
        return self._replace(places=places, range_m=self.range_m + shift_m[1])


@dataclass(frozen=True)
class Mounting:
    """What is not known of the instruments, and fitted on one person.

    ``offset_m`` is the place of the radar in the axes of the camera, ``lag_s`` how much earlier
    (negative) or later than the camera's frame the radar's of the same number is.
    """

    offset_m: tuple[float, float, float] = (0.15, 0.0, -0.25)
    lag_s: float = -0.05


@dataclass(frozen=True, eq=False)
class Take:
    """Frames in a row of one person in one move, without long gaps."""

    person: int
    move: int
    numbers: Ints  # (frame,)
    joints: Reals  # (frame, joint, 3), in the camera's axes [m]
    names: tuple[str, ...]
    measured: Points

    def until(self, frames: int | None) -> Take:
        """The first so many frames."""
        if frames is None:
            return self
        measured = self.measured.of(self.measured.frame < frames)
        numbers, joints = self.numbers[:frames], self.joints[:frames]
        return dataclasses.replace(self, numbers=numbers, joints=joints, measured=measured)

    @cached_property
    def motion(self) -> rt.Motion:
        """Motion of the joints, x away and y to the left."""
        x, y, z = np.moveaxis(self.joints, -1, 0)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, f"person {self.person}, move {self.move}.npz")
            np.savez(
                path,
                positions=np.stack([y, -x, z], axis=-1),
                joints=np.array(self.names),
                time_s=(self.numbers - self.numbers[0]) * FRAME_S,
                up=np.array("z"),
            )
            return rt.load_motion(path)


def at_hand() -> bool:
    return Path(os.environ.get("RTRADAR_MEASURED", ""), "mars").is_dir()


def takes_of(person: int) -> list[Take]:
    """All takes of a person, move by move."""
    found = []
    for part in ("validate", "test"):
        path = Path(os.environ["RTRADAR_MEASURED"], "mars", f"person{person}_{part}.npz")
        with np.load(path) as stored:
            numbers = stored["frame_number"]
            breaks = 1 + np.flatnonzero(np.diff(numbers) > LONGEST_GAP)
            moves = np.cumsum(np.diff(numbers, prepend=numbers[0]) > 300)
            found += [
                _take(person, int(moves[frames[0]]), frames, stored)
                for frames in np.split(np.arange(len(numbers)), breaks)
                if len(frames) >= SHORTEST
            ]
    return found


def _take(person: int, move: int, frames: Ints, stored: np.lib.npyio.NpzFile) -> Take:
    own = np.isin(stored["frame_of_point"], frames)
    points = stored["points"][own].astype(np.float64)
    measured = Points(
        points[:, :3],
        np.linalg.norm(points[:, :3], axis=1),
        np.rint(points[:, 3] / DOPPLER_BIN_MPS).astype(np.int64),
        points[:, 4],
        stored["frame_of_point"][own].astype(np.int64) - frames[0],
    )
    joints = stored["joint_positions"][frames].astype(np.float64)
    names = tuple(map(str, stored["joints"]))
    return Take(person, move, stored["frame_number"][frames], joints, names, measured)


def _before_radar(take: Take, mounting: Mounting) -> tuple[rt.Person, float, int]:
    """Return the person before a radar at x = y = 0, its height, and the first frame it has."""
    motion, first = take.motion, int(mounting.lag_s < 0)
    start_s = mounting.lag_s + first * FRAME_S
    # Every person is turned to the radar; one rotation about the vertical turns them back.
    ours, theirs = motion.at([start_s])[0][0], place(motion, start_s=start_s).at([0.0])[0][0]
    hips = [
        complex(*(nodes[motion.joints.index("l_hip")] - nodes[motion.joints.index("r_hip")])[:2])
        for nodes in (ours, theirs)
    ]
    turn = hips[0] / hips[1]
    x, y, z = mounting.offset_m
    root = complex(*ours[0, :2]) - complex(*theirs[0, :2]) * turn / abs(turn) - complex(y, -x)
    floor_m = (ours[0] - _root(take, start_s))[2]
    heading_deg = float(np.angle(turn, deg=True))
    person = rt.Person(motion, (root.real, root.imag), heading_deg=heading_deg, start_s=start_s)
    return person, z + floor_m, first


def _root(take: Take, time_s: float) -> Reals:
    """Base of the spine where the camera has it, x away, y to the left [m]."""
    times = (take.numbers - take.numbers[0]) * FRAME_S
    x, y, z = (np.interp(time_s, times, values) for values in take.joints[:, 0].T)
    return np.array([y, -x, z])


def frames_of(
    take: Take, mounting: Mounting, fidelity: str, *, every: int = 1, seed: int = 0
) -> Iterator[tuple[int, NDArray[np.complex64]]]:
    """Range spectra (cycle, tx, rx, range) of every so many frames of a take, as far as measured.

    Chirps between frames are not transmitted, and not simulated.
    """
    person, height_m, first = _before_radar(take, mounting)
    radar = dataclasses.replace(
        rt.Radar.preset("mars"),
        position_m=(0.0, 0.0, height_m),
        frame_period_s=every * FRAME_S,
    )
    simulation = rt.simulate(person, radar, fidelity=fidelity, snr_db="physical", seed=seed)
    window = scipy.signal.windows.blackman(radar.samples_per_chirp, sym=False).astype(np.float32)
    numbers = {number: frame for frame, number in enumerate(take.numbers - take.numbers[0])}
    for index, samples in enumerate(simulation.blocks()):
        frame = numbers.get(every * index + first)
        if frame is not None:
            cube = samples.values.reshape(-1, radar.n_tx, *samples.shape[1:])
            yield frame, scipy.fft.fft(cube * window, RANGE_BINS)


def detected(
    cube: NDArray[np.complexfloating], frame: int, *, removal: bool, **options: Any
) -> Points:
    """Points of a frame, as the chip makes them, within the volume of the recorded ones."""
    radar = rt.Radar.preset("mars")
    own = cube - cube.mean(axis=0) if removal else cube  # static removal as the chip does it
    mask, sines = ti_oob(own, radar, **options)
    row, column = np.nonzero(mask)
    window = scipy.signal.windows.hann(len(cube), sym=False)[:, None, None, None]
    spectra = scipy.fft.fft(own[..., row] * window, axis=0)
    doppler = column - len(cube) // 2
    level = np.abs(spectra[doppler, ..., np.arange(len(row))]).mean(axis=(1, 2))
    ahead = 1 - np.sum(sines**2, axis=1)
    directions = np.stack([-sines[:, 0], np.sqrt(ahead.clip(0)), sines[:, 1]], axis=1)
    ranges = row * range_bin_m(radar)
    places = ranges[:, None] * directions
    inside = (ahead >= 0) & (np.abs(places[:, ::2]) <= 1).all(axis=1) & (places[:, 1] <= 3)
    found = Points(places, ranges, doppler, level, np.full(len(row), frame))
    return found.of(inside)


def range_bin_m(radar: rt.Radar) -> float:
    return radar.range_bin_m * radar.samples_per_chirp / RANGE_BINS


def joined(parts: list[Points]) -> Points:
    return Points(*(np.concatenate(values) for values in zip(*parts, strict=True)))
