"""Activities of measured clouds (RadHAR), named by a forest that has learnt from simulated ones.

Synthetic actors box, do jumping jacks, jump, squat and walk (along or in place) before the preset
``radhar``, with its noise in watts and the detection of the recorded profile: CFAR over range
alone, peaks grouped over Doppler, 9 dB. On both sides points without Doppler are left out, which
are the room in the recorded ones. Windows of 2 s become figures that do not depend on how many
points there are or where the person stands: the histogram of Doppler, spreads in height, sideways
and in range, how height goes with Doppler, and how the mean Doppler goes on over time.

No room hides weak echoes of an actor, who has more points: windows are thinned to numbers drawn
from those of recorded training files, whatever their activity.

A forest learns from windows of simulated clouds alone, and is asked about the recorded test files;
chance is 0.2. Beside it is what a forest knows that has learnt from recorded training files, of the
same room, and what both know of simulated actors. Nothing is judged: the people, the room and the
way they move are others, and the table is shown whichever way it falls.

    RTRADAR_MEASURED=folder python validation/measurements/radhar_activities.py [--quick]
"""

from __future__ import annotations

import dataclasses
import os
import sys
import warnings
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.fft
import scipy.signal
from numpy.typing import NDArray

import rtradar as rt
from rtradar.process import ti_oob
from rtradar.validate.rows import Row, leave_out, main, reported

Array = NDArray[np.float64]

ACTIVITIES = {
    "boxing": ("boxing", "punch"),
    "jack": ("jumping_jack",),
    "jump": ("jump",),
    "squats": ("squat",),
    "walk": ("walk", "walk_in_place"),
}
"""Activities of the files, and those of actors."""

FEWEST = 8  # points of a window that is asked about
WINDOW_S, STEP_S, EVERY = 2.0, 1.0, 2  # every second frame is simulated, and taken of the files
LARGEST_BIN = 5
RADAR = dataclasses.replace(rt.Radar.preset("radhar"), position_m=(0.0, 0.0, 1.0))
FRAME_S = EVERY / 30


class Cloud(NamedTuple):
    """Points that move: x ahead, y sideways, z up [m], Doppler bin, number of the frame."""

    places: Array
    doppler: NDArray[np.int64]
    frame: NDArray[np.int64]
    frames: int


def recorded(part: str, activity: str) -> Iterator[Cloud]:
    """Clouds of the files of an activity."""
    folder = Path(os.environ["RTRADAR_MEASURED"], "radhar")
    for file in sorted(folder.glob(f"{part}__{activity}*.npz")):
        with np.load(file) as stored:
            points, frame = stored["points"].astype(np.float64), stored["frame"]
        kept = (points[:, 4] != 0) & (points[:, 3] > 0) & (points[:, 3] < 6) & (frame % EVERY == 0)
        doppler = np.rint(points[kept, 4] / RADAR.velocity_bin_mps).astype(np.int64)
        number = (frame[kept].astype(np.int64) - int(frame.min())) // EVERY
        yield Cloud(points[kept, :3], doppler, number, int(np.ptp(frame)) // EVERY + 1)


def simulated(activity: str, seed: int, seconds: float) -> Cloud:
    """Cloud of an actor who does an activity somewhere before the radar."""
    random = np.random.default_rng([seed, sorted(ACTIVITIES).index(activity)])
    names = ACTIVITIES[activity]
    name = names[seed % len(names)]
    height_m, away, aside = random.uniform((1.6, 1.3, -0.3), (1.9, 2.4, 0.3))
    motion = rt.synthetic_motion(name, seed=seed, duration_s=seconds, height_m=height_m)
    across = 90.0 if name == "walk" else 0.0
    place = (away + (0.3 if across else 0.0), aside)
    person = rt.Person(motion, place, heading_deg=across + random.uniform(-20, 20))
    radar = dataclasses.replace(RADAR, frame_period_s=FRAME_S)
    simulation = rt.simulate(person, radar, fidelity="analytic", snr_db="physical", seed=seed)
    window = scipy.signal.windows.blackman(radar.samples_per_chirp, sym=False).astype(np.float32)
    parts = []
    for frame, samples in enumerate(simulation.blocks()):
        cube = samples.values.reshape(-1, radar.n_tx, *samples.shape[1:])
        spectra = scipy.fft.fft(cube * window)
        mask, sines = ti_oob(
            spectra, radar, threshold_db=9.0, cfar_axes="range", grouping="doppler"
        )
        row, column = np.nonzero(mask)
        doppler = column - len(cube) // 2
        ahead = np.sqrt((1 - np.sum(sines**2, axis=1)).clip(0))
        directions = np.column_stack([ahead, sines])
        places = radar.range_m[row, None] * directions
        kept = doppler != 0
        parts.append((places[kept], doppler[kept], np.full(int(kept.sum()), frame)))
    places, doppler, number = (np.concatenate(values) for values in zip(*parts, strict=True))
    return Cloud(places, doppler, number, len(parts))


def windows(cloud: Cloud, most: NDArray[np.int64], seed: int) -> Iterator[Array]:
    """Figures of each window of a cloud that has points enough.

    Windows that have more points than one of ``most (window,)``, drawn at random, are thinned to so
    many.
    """
    random = np.random.default_rng(seed)
    length, step = round(WINDOW_S / FRAME_S), round(STEP_S / FRAME_S)
    for first in range(0, cloud.frames - length + 1, step):
        (kept,) = np.nonzero((cloud.frame >= first) & (cloud.frame < first + length))
        kept = random.permutation(kept)[: random.choice(most)]
        if len(kept) >= FEWEST:
            own = cloud.frame[kept] - first
            yield figures(cloud.places[kept], cloud.doppler[kept], own, length)


def points_of_windows(clouds: dict[str, list[Cloud]]) -> NDArray[np.int64]:
    """Number of points (window,) of each window that has enough, whatever the activity."""
    length = round(WINDOW_S / FRAME_S)
    many = [np.bincount(cloud.frame // length) for own in clouds.values() for cloud in own]
    found = np.concatenate(many)
    return found[found >= FEWEST]


def figures(places: Array, doppler: NDArray[np.int64], frame: Array, length: int) -> Array:
    """Figures (figure,) of the points of a window."""
    bins = np.clip(doppler, -LARGEST_BIN, LARGEST_BIN)
    histogram = np.bincount(bins + LARGEST_BIN, minlength=2 * LARGEST_BIN + 1) / len(bins)
    middle = places - np.median(places, axis=0)
    spreads = np.quantile(middle, (0.1, 0.25, 0.75, 0.9), axis=0).ravel()
    with np.errstate(invalid="ignore"):  # of what is alike in all points
        together = np.corrcoef(np.column_stack([middle, bins]).T)[np.triu_indices(4, 1)]
    many = np.bincount(frame, minlength=length)
    mean = np.bincount(frame, doppler, length) / np.maximum(many, 1)
    energy = max(float(np.mean(mean**2)), 1e-9)
    lags = [
        float(np.mean(mean[lag:] * mean[: length - lag])) / energy for lag in (1, 2, 3, 5, 8, 12)
    ]
    uneven = [many.std() / many.mean(), float((many == 0).mean()), mean.std()]
    return np.nan_to_num(np.concatenate([histogram, spreads, together, lags, uneven]))


class Table(NamedTuple):
    """Figures (window, figure) of clouds, and the activity of each window."""

    figures: Array
    activity: NDArray[np.str_]

    @classmethod
    def of(cls, clouds: dict[str, list[Cloud]], most: NDArray[np.int64]) -> Table:
        found = [
            (row, name)
            for name, own in clouds.items()
            for seed, one in enumerate(own)
            for row in windows(one, most, seed)
        ]
        return cls(np.array([row for row, _ in found]), np.array([name for _, name in found]))


def answers(learnt: Table, asked: Table) -> dict[str, Array]:
    """Fractions of the answers (activity,) that a forest gives to the windows of each activity."""
    from sklearn.ensemble import RandomForestClassifier

    forest = RandomForestClassifier(
        n_estimators=200, min_samples_leaf=2, class_weight="balanced", random_state=0
    )
    given = forest.fit(learnt.figures, learnt.activity).predict(asked.figures)
    return {
        name: np.array([(given[asked.activity == name] == other).mean() for other in ACTIVITIES])
        for name in ACTIVITIES
    }


def rows_of(claim: str, found: dict[str, Array], whole: bool) -> Iterator[Row]:
    right = [found[name][number] for number, name in enumerate(ACTIVITIES)]
    yield reported(claim, "right, mean over activities", "1", float(np.mean(right)), reference=0.2)
    for name, share in found.items():
        for other, value in zip(ACTIVITIES, share, strict=True):
            if whole or name == other:
                yield reported(claim, f"{name}, named {other}", "1", float(value))


def measure(quick: bool) -> list[Row]:
    warnings.simplefilter("ignore", rt.ValidityWarning)
    at_hand = Path(os.environ.get("RTRADAR_MEASURED", ""), "radhar").is_dir()
    if not at_hand or find_spec("sklearn") is None:
        leave_out("RadHAR", "RTRADAR_MEASURED, the folder of radhar/, and scikit-learn")
        return []
    actors, seconds = (2, 5.0) if quick else (10, 8.0)
    made = {name: [simulated(name, seed, seconds) for seed in range(actors)] for name in ACTIVITIES}
    return rows_from(made)


def rows_from(made: dict[str, list[Cloud]]) -> list[Row]:
    """What a forest knows that has learnt from simulated clouds, beside one of recorded ones."""
    held = max(1, len(made["walk"]) // 5)
    recordings = {
        part: {name: list(recorded(part, name)) for name in ACTIVITIES}
        for part in ("Train", "Test")
    }
    most = points_of_windows(recordings["Train"])
    train, test = (Table.of(recordings[part], most) for part in ("Train", "Test"))
    learnt = Table.of({name: own[held:] for name, own in made.items()}, most)
    others = Table.of({name: own[:held] for name, own in made.items()}, most)
    rows = [
        reported("recorded test files", f"windows of {name}", "1", (test.activity == name).sum())
        for name in ACTIVITIES
    ]
    return [
        *rows,
        *rows_of("from simulated, asked of recorded", answers(learnt, test), whole=True),
        *rows_of("from simulated, asked of simulated", answers(learnt, others), whole=False),
        *rows_of("from recorded, asked of recorded", answers(train, test), whole=False),
        *rows_of("from recorded, asked of simulated", answers(train, others), whole=False),
    ]


if __name__ == "__main__":
    sys.exit(main("Activities of RadHAR by a forest that learnt from simulated clouds", measure))
