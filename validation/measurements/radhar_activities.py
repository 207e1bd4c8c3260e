"""Activities of measured clouds (RadHAR), named by a forest that has learnt from simulated ones.

Synthetic actors and, where ``RTRADAR_JOINTS`` and ``RTRADAR_MOCAP`` name them, recorded people box,
do jumping jacks, jump, squat and walk, of dry skin, in rooms drawn at random (`rt.Scene.random`)
before the preset ``radhar``, whose chip detects as its profile says. The radar stands 0.9 to 1.4 m
high and looks 5 degrees down to 12 degrees up, and its noise is 8 to 18 dB higher than its figure
says. Windows of 4 s become the figures of `radhar_windows`; moving points are thinned at random,
to between all and a third.

What was chosen after looking at the recorded points, without fitting: that peaks are grouped over
Doppler alone, as the profile's own line has it (`radhar.py` counts neighbours); the Hann window
over range (strong still echoes are three cells wide); the noise (how the levels of moving cells
spread); the mount (heights of the points); low jumps with quiet arms (style ``hop``) and squats
with quiet arms (there are few moving points); still points of the person as figures. Of several
points in a cell of range and Doppler the first one counts.

A forest learns from windows of simulated clouds alone, and is asked about the recorded files;
chance is 0.2. Beside it is what a forest knows that has learnt from the recorded training files of
the same day and room. Intervals are of 90 %, by a bootstrap over files. Nothing is judged: the
people, the room and the way they move are others, and the table is shown whichever way it falls.

    RTRADAR_MEASURED=folder python validation/measurements/radhar_activities.py [--quick]
"""

from __future__ import annotations

import csv
import dataclasses
import itertools
import os
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.fft
import scipy.signal
from numpy.typing import NDArray
from radhar_windows import Array, Cloud, Numbers, described

import rtradar as rt
from rtradar.process import ti_oob
from rtradar.validate.rows import Row, leave_out, main, reported

ACTIVITIES = {
    "boxing": ("boxing", "punch"),
    "jack": ("jumping_jack",),
    "jump": ("jump,style=hop", "jump"),
    "squats": ("squat",),
    "walk": ("walk", "walk_in_place", "walk"),
}
"""Activities of the files, and those of actors."""

RECORDED = {"boxing": "punching", "jack": "jumping_jacks", "jump": "jump", "squats": "squat"}
"""Activities of recorded people that are learnt too, by the names of their manifests."""

WINDOW_S, STEP_S, EVERY = 4.0, 1.0, 2  # every second frame is simulated, and taken of the files
FRAME_S = EVERY / 30
RADAR = dataclasses.replace(rt.Radar.preset("radhar"), frame_period_s=FRAME_S)
LENGTH, STEP = round(WINDOW_S / FRAME_S), round(STEP_S / FRAME_S)
LONGEST_M = 5.45  # of the recorded points; two have a garbled number


def recorded(part: str, activity: str) -> Iterator[Cloud]:
    """Clouds of the files of an activity."""
    folder = Path(os.environ["RTRADAR_MEASURED"], "radhar")
    for file in sorted(folder.glob(f"{part}__{activity}*.npz")):
        with np.load(file) as stored:
            points, frame = stored["points"].astype(np.float64), stored["frame"].astype(np.int64)
        frame -= frame.min()
        kept = (points[:, 3] > 0) & (points[:, 3] < LONGEST_M) & (frame % EVERY == 0)
        cell, doppler = (
            np.rint(points[kept, column] / step).astype(np.int64)
            for column, step in ((3, RADAR.range_bin_m), (4, RADAR.velocity_bin_mps))
        )
        cloud = Cloud(points[kept, :3], doppler, cell, frame[kept] // EVERY, 0)
        _, first = np.unique(np.stack([cloud.frame, cell, doppler]), axis=1, return_index=True)
        only = np.isin(np.arange(len(cell)), first)
        yield cloud.some(only)._replace(frames=int(frame.max()) // EVERY + 1)


class Take(NamedTuple):
    """Somebody who does an activity, and a number from which all else is drawn."""

    activity: str
    seed: int
    motion: Any
    seconds: float
    start_s: float = 0.0


def actors(count: int, seconds: float) -> Iterator[Take]:
    """So many takes of actors of each activity."""
    for (activity, names), seed in itertools.product(ACTIVITIES.items(), range(count)):
        name = names[seed % len(names)]
        height_m = np.random.default_rng([seed, 1]).uniform(1.6, 1.9)
        motion = rt.synthetic_motion(name, seed=seed, duration_s=seconds, height_m=height_m)
        yield Take(activity, seed, motion, seconds)


def people(count: int, seconds: float) -> Iterator[Take]:
    """At most so many takes of recorded people of each activity, in turn over the people."""
    for name, variable in itertools.product(RECORDED, ("RTRADAR_JOINTS", "RTRADAR_MOCAP")):
        folder = Path(os.environ.get(variable, ""))
        if variable not in os.environ:
            continue
        by_person: dict[str, list[dict[str, str]]] = {}
        with (folder / "MANIFEST.csv").open() as file:
            for row in csv.DictReader(file):
                if row["activity"] == RECORDED[name] and row.get("format", "BVH") in ("AMC", "BVH"):
                    by_person.setdefault(row.get("person") or row["subject"], []).append(row)
        turns = itertools.zip_longest(*(by_person[key] for key in sorted(by_person)))
        found = [row for turn in turns for row in turn if row is not None]
        for seed, row in enumerate(found[:count]):
            start_s = (int(row.get("start_frame") or 1) - 1) / float(row.get("fps") or 1)
            skeleton = row.get("skeleton_file")
            motion = rt.load_motion(
                folder / row["file"], **({"skeleton": folder / skeleton} if skeleton else {})
            )
            length_s = min(motion.duration_s - start_s - 0.02, seconds)
            if length_s >= WINDOW_S + 0.1:
                yield Take(name, 1000 + seed, motion, length_s, start_s)


def simulated(take: Take) -> Cloud:
    """Points of somebody in a room at random, before a radar that somebody has put up there."""
    random = np.random.default_rng([take.seed, sorted(ACTIVITIES).index(take.activity)])
    away, aside, height, pitch, lost_db, turned = random.uniform(
        (1.5, -0.3, 0.9, -5.0, 8.0, -25.0), (2.4, 0.3, 1.4, 12.0, 18.0, 25.0)
    )
    if take.activity == "walk" and "walk_in_place" not in take.motion.name:
        turned += random.choice([0.0, 90.0, 180.0, 270.0])
    radar = dataclasses.replace(
        RADAR,
        position_m=(-away, aside, height),
        pitch_deg=pitch,
        noise_figure_db=float(RADAR.noise_figure_db or 0.0) + lost_db,
    )
    simulation = rt.simulate(
        rt.Person(take.motion, (0.0, 0.0), heading_deg=turned),
        radar,
        scene=rt.Scene.random(int(random.integers(1_000_000))),
        fidelity="analytic",
        order=0,
        snr_db="physical",
        seed=take.seed,
        body_material="skin",
        start_s=take.start_s,
        duration_s=take.seconds,
    )
    window = scipy.signal.windows.hann(radar.samples_per_chirp, sym=False).astype(np.float32)
    parts: list[tuple[NDArray[Any], ...]] = []
    for frame, samples in enumerate(simulation.blocks()):
        cube = samples.values.reshape(-1, radar.n_tx, *samples.shape[1:])
        mask, sines = ti_oob(scipy.fft.fft(cube * window), radar)
        row, column = np.nonzero(mask)
        ahead = np.sqrt((1 - np.sum(sines**2, axis=1)).clip(0))
        places = radar.range_m[row, None] * np.column_stack([ahead, sines])
        parts.append((places, column - len(cube) // 2, row, np.full(len(row), frame)))
    return Cloud(*(np.concatenate(of) for of in zip(*parts, strict=True)), len(parts))


class Table(NamedTuple):
    """Figures (window, figure) of clouds, and the activity and the file of each window."""

    figures: Array
    activity: NDArray[np.str_]
    file: Numbers

    @classmethod
    def of(cls, clouds: Iterable[tuple[str, Cloud]]) -> Table:
        found = [
            (described(cloud.window(first, LENGTH)), name, number)
            for number, (name, cloud) in enumerate(clouds)
            for first in range(0, cloud.frames - LENGTH + 1, STEP)
        ]
        return cls(*(np.array(column) for column in zip(*found, strict=True)))


def learnt_from(clouds: Iterable[tuple[str, Cloud]]) -> Table:
    """Table of simulated clouds, with a part of their moving points."""
    random = np.random.default_rng(0)
    return Table.of((name, cloud.thinned(3 ** -random.random(), random)) for name, cloud in clouds)


def answers(learnt: Table, asked: Table) -> NDArray[np.str_]:
    """What a forest answers to each window."""
    from sklearn.ensemble import ExtraTreesClassifier

    forest = ExtraTreesClassifier(
        500, min_samples_leaf=3, max_features=0.3, class_weight="balanced", random_state=0
    )
    return np.asarray(forest.fit(learnt.figures, learnt.activity).predict(asked.figures))


def balanced(asked: Table, given: NDArray[np.str_], files: Numbers) -> float:
    """Right answers of some files, each as often as it is named, in the mean over activities."""
    right, all_of = (
        np.bincount(asked.file, weights) for weights in (given == asked.activity, None)
    )
    name_of = dict(zip(asked.file.tolist(), asked.activity.tolist(), strict=True))
    shares = []
    for name in ACTIVITIES:
        own = [file for file in files.tolist() if name_of[file] == name]
        shares.append(right[own].sum() / all_of[own].sum())
    return float(np.mean(shares))


def rows_of(claim: str, learnt: Table, asked: Table, *, whole: bool) -> Iterator[Row]:
    given = answers(learnt, asked)
    files = np.unique(asked.file)
    yield reported(
        claim, "right, mean over activities", "1", balanced(asked, given, files), reference=0.2
    )
    # Files are drawn activity by activity, so that each has some.
    random = np.random.default_rng(0)
    of_name = [np.unique(asked.file[asked.activity == name]) for name in ACTIVITIES]
    drawn = [
        balanced(asked, given, np.concatenate([random.choice(own, len(own)) for own in of_name]))
        for _ in range(500)
    ]
    yield reported(claim, "lower end of 90 %", "1", float(np.quantile(drawn, 0.05)))
    for name in ACTIVITIES:
        own = given[asked.activity == name]
        for other in ACTIVITIES:
            if whole or name == other:
                yield reported(claim, f"{name}, named {other}", "1", float((own == other).mean()))


def moving_rows(
    made: Iterable[tuple[str, Cloud]], files: Mapping[str, Table | Any]
) -> Iterator[Row]:
    """Moving points a frame, simulated beside recorded."""
    clouds = list(made)
    for name in ACTIVITIES:
        ours, theirs = (
            np.mean([(cloud.doppler != 0).sum() / cloud.frames for cloud in own])
            for own in ([cloud for own, cloud in clouds if own == name], files[name])
        )
        yield reported(name, "moving points a frame", "1", float(ours), reference=float(theirs))


def measure(quick: bool) -> list[Row]:
    warnings.simplefilter("ignore", rt.ValidityWarning)
    at_hand = Path(os.environ.get("RTRADAR_MEASURED", ""), "radhar").is_dir()
    if not at_hand or find_spec("sklearn") is None:
        leave_out("RadHAR", "RTRADAR_MEASURED, the folder of radhar/, and scikit-learn")
        return []
    count, seconds = (1, 5.0) if quick else (24, 10.0)
    of_actors = [(take.activity, simulated(take)) for take in actors(count, seconds)]
    of_people = [
        (take.activity, simulated(take)) for take in people(0 if quick else count, seconds)
    ]
    return rows_from(of_actors, of_people)


def rows_from(of_actors: list[tuple[str, Cloud]], of_people: list[tuple[str, Cloud]]) -> list[Row]:
    """What a forest knows that has learnt from simulated clouds, beside one of recorded ones."""
    files = {
        part: [(name, cloud) for name in ACTIVITIES for cloud in recorded(part, name)]
        for part in ("Train", "Test")
    }
    tables = {part: Table.of(clouds) for part, clouds in files.items()}
    both = {
        name: [cloud for part in files.values() for own, cloud in part if own == name]
        for name in ACTIVITIES
    }
    rows = [*moving_rows(of_actors, both)]
    taught = {"actors": learnt_from(of_actors), "all": learnt_from([*of_actors, *of_people])}
    for who, table in taught.items():
        for part, asked in tables.items():
            claim = f"from simulated ({who}), asked of recorded ({part.lower()} files)"
            rows += rows_of(claim, table, asked, whole=who == "all" and part == "Test")
    claim = "from recorded, asked of recorded (test files)"
    return [*rows, *rows_of(claim, tables["Train"], tables["Test"], whole=False)]


if __name__ == "__main__":
    sys.exit(main("Activities of RadHAR by a forest that learnt from simulated clouds", measure))
