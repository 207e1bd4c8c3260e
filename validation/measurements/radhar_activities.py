"""Activities of measured clouds (RadHAR), named by a recogniser that knows simulated people alone.

``rtradar recogniser build`` teaches it by synthetic actors and, where ``RTRADAR_JOINTS`` names
them, recorded people (`validation/radhar_people.toml`) who box, do jumping jacks, jump, squat and
walk, or stand and sit, of dry skin, in rooms drawn at random before the preset ``radhar``, whose
chip detects as its profile says. It is asked about the recorded files, of which it has seen none;
chance is 0.2. Intervals are of 90 %, by a bootstrap over files. Nothing is judged: the people, the
room and the way they move are others, and the table is shown whichever way it falls.

What was chosen after looking at the recorded points, without fitting: that peaks are grouped over
Doppler alone, as the profile's own line has it (`radhar.py` counts neighbours); the Hann window
over range (strong still echoes are three cells wide); noise 8 to 28 dB above the chip's figure (how
the levels of moving cells spread, and how they are distributed over Doppler); the radar's tilt, 5
degrees down to 12 up (heights of points); low jumps with quiet arms (style ``hop``) and squats with
quiet arms (there are few moving points); still points of the person as figures.

    RTRADAR_MEASURED=folder python validation/measurements/radhar_activities.py [--quick]
"""

from __future__ import annotations

import dataclasses
import os
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.campaign.recogniser import (
    RecogniserPlan,
    Taught,
    build_recogniser,
    points_of,
    taught_by,
    train_recogniser,
)
from rtradar.clouds.collection import Collection
from rtradar.recognition import NOBODY, UNKNOWN, Grid, Points, Recogniser
from rtradar.recognition.points import describe_points, of_person, without_person
from rtradar.system.files import temporary_folder
from rtradar.validate.rows import Row, leave_out, main, reported

ACTIVITIES = {
    "boxing": ("boxing", "punch"),
    "jack": ("jumping_jack",),
    "jump": ("jump:hop", "jump"),
    "squats": ("squat",),
    "walk": ("walk", "walk_in_place"),
}
"""Activities of the files, and those of actors."""

PEOPLE = Path(__file__).resolve().parents[1] / "radhar_people.toml"
PLAN = RecogniserPlan(radar=rt.Radar.preset("radhar"), activities=ACTIVITIES)
PADDED = 256 / 240  # the driver takes places for bins of 240 samples, which the chip pads to 256
COUNTING = 4  # of the numbers of a window, the first ones say how many points there are
Array = NDArray[np.float64]


class Asked(NamedTuple):
    """Windows of recorded files, the activity and the file of each."""

    windows: list[Points]
    activity: NDArray[np.str_]
    file: NDArray[np.int64]

    def some(self, which: NDArray[np.bool_]) -> Asked:
        own = [window for window, kept in zip(self.windows, which, strict=True) if kept]
        return Asked(own, self.activity[which], self.file[which])


def recorded(part: str, grid: Grid) -> Asked:
    """Windows of the files of the development day that are for training, or for the test."""
    folder = Path(os.environ["RTRADAR_MEASURED"], "radhar")
    windows, activity, file = list[Points](), list[str](), list[int]()
    names = [(name, path) for name in ACTIVITIES for path in folder.glob(f"{part}__{name}*.npz")]
    for number, (name, path) in enumerate(sorted(names)):
        with np.load(path) as stored:
            points, frame = stored["points"].astype(np.float64), stored["frame"].astype(np.float64)
        table = np.column_stack([frame / 30, points[:, :3] * PADDED, points[:, 4]])
        own = [window for _, window in Points.on_grid(table, grid).windows(grid)]
        windows += own
        activity += [name] * len(own)
        file += [number] * len(own)
    return Asked(windows, np.array(activity), np.array(file))


def balanced(asked: Asked, given: NDArray[np.str_], files: NDArray[np.int64]) -> float:
    """Right answers of some files, each as often as it is named, in the mean over activities."""
    right, all_of = (np.bincount(asked.file, own) for own in (given == asked.activity, None))
    name_of = dict(zip(asked.file.tolist(), asked.activity.tolist(), strict=True))
    shares = []
    for name in ACTIVITIES:
        own = [file for file in files.tolist() if name_of[file] == name]
        shares.append(right[own].sum() / all_of[own].sum())
    return float(np.mean(shares))


def answers(recogniser: Recogniser, windows: Sequence[Points]) -> NDArray[np.str_]:
    return np.array(recogniser.classes)[recogniser.probabilities(windows).argmax(axis=1)]


def rows_of(claim: str, recogniser: Recogniser, asked: Asked, *, whole: bool) -> Iterator[Row]:
    given, files = answers(recogniser, asked.windows), np.unique(asked.file)
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
        for other in (*ACTIVITIES, UNKNOWN, NOBODY) if whole else (name,):
            yield reported(claim, f"{name}, named {other}", "1", float((own == other).mean()))


def empty_rows(recogniser: Recogniser, asked: Asked) -> Iterator[Row]:
    """Of what stands still in the recordings: without moving points, and without the person."""
    for claim, windows in {
        "recorded points without Doppler": [own.some(own.doppler == 0) for own in asked.windows],
        "recorded points away from the person": [without_person(own) for own in asked.windows],
    }.items():
        given = answers(recogniser, windows)
        share = float(np.isin(given, (UNKNOWN, NOBODY)).mean())
        yield reported(claim, "named nobody or unknown", "1", share)


def counted(windows: Mapping[str, list[Points]]) -> dict[str, tuple[float, float]]:
    """Moving points a frame, and still ones, by activity."""
    return {
        name: tuple(  # type: ignore[misc]
            float(np.mean([which(window).sum() / window.frames for window in own]))
            for which in (lambda one: one.doppler != 0, lambda one: one.doppler == 0)
        )
        for name, own in windows.items()
    }


def count_rows(ours: Mapping[str, list[Points]], theirs: Mapping[str, list[Points]]) -> list[Row]:
    """Points a frame, simulated beside recorded, and how their histograms differ."""
    found, rows = (counted(windows) for windows in (ours, theirs)), list[Row]()
    own, other = found
    for name in ACTIVITIES:
        for kind, mine, his in zip(("moving", "still"), own[name], other[name], strict=True):
            rows.append(reported(name, f"{kind} points a frame", "1", mine, reference=his))
        pairs = [[of_person(one)[0] for one in windows[name]] for windows in (ours, theirs)]
        for what, edges in (
            ("Doppler", np.arange(-8.5, 9)),
            ("range from the middle", np.arange(-1.5, 1.6, 0.1)),
            ("height from the middle", np.arange(-1.2, 1.3, 0.1)),
        ):
            shares = [_histogram(windows, what, edges) for windows in pairs]
            apart = 0.5 * float(np.abs(shares[0] - shares[1]).sum())
            rows.append(reported(name, f"{what}: total variation", "1", apart))
    return rows


def _histogram(windows: list[Points], what: str, edges: Array) -> Array:
    values = []
    for one in windows:
        if len(one.frame):
            away = np.linalg.norm(one.places, axis=1)
            height = one.places[:, 2]
            values.append(
                one.doppler
                if what == "Doppler"
                else away - np.median(away)
                if what.startswith("range")
                else height - np.median(height)
            )
    count, _ = np.histogram(np.concatenate(values), edges)
    return np.asarray(count / max(count.sum(), 1))


def described(windows: Sequence[Points], names: Sequence[str], who: Sequence[str]) -> Taught:
    """Numbers of windows that have enough points."""
    found = [describe_points(window) for window in windows]
    kept = [number for number, own in enumerate(found) if own is not None]
    return Taught(
        np.array([found[number] for number in kept]),
        np.array([names[number] for number in kept]),
        np.array([who[number] for number in kept]),
    )


def together(*parts: Taught) -> Taught:
    return Taught(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def beside_recorded(
    simulated: Taught | None, files: int | None, train: Asked, grid: Grid, radar: rt.Radar
) -> Recogniser:
    """Taught by so many recorded files of each activity, with simulated windows beside."""
    which = np.zeros(len(train.windows), dtype=np.bool_)
    for name in ACTIVITIES:
        own = np.unique(train.file[train.activity == name])[:files]
        which |= np.isin(train.file, own)
    some = train.some(which)
    real = described(some.windows, some.activity.tolist(), [f"file {one}" for one in some.file])
    # Recorded windows count as much as simulated ones: each is learnt several times.
    if simulated is None:
        return train_recogniser(real, radar, grid)
    again = max(1, len(simulated.classes) // max(len(real.classes), 1))
    return train_recogniser(together(simulated, *[real] * again), radar, grid)


def measure(quick: bool) -> list[Row]:
    warnings.simplefilter("ignore", rt.ValidityWarning)
    at_hand = Path(os.environ.get("RTRADAR_MEASURED", ""), "radhar").is_dir()
    if not at_hand or find_spec("sklearn") is None:
        leave_out("RadHAR", "RTRADAR_MEASURED, the folder of radhar/, and scikit-learn")
        return []
    people = None if quick or "RTRADAR_JOINTS" not in os.environ else PEOPLE
    with temporary_folder() as folder:
        out = folder / "radhar.npz"
        takes = 5 if quick else 60
        plan = dataclasses.replace(PLAN, motions=people, takes=takes)
        recogniser = build_recogniser(plan, out)
        places = [out.with_suffix("") / name for name in ("actors", "people")]
        return rows_from(recogniser, [place for place in places if place.is_dir()])


def rows_from(recogniser: Recogniser, folders: Sequence[Path]) -> list[Row]:
    """What a recogniser knows, beside ones that are taught otherwise."""
    grid, radar = recogniser.grid, PLAN.radar
    assert grid is not None
    parts = {part: recorded(part, grid) for part in ("Train", "Test")}
    actors, everyone = Collection(folders[0]), Collection(*folders)
    simulated = taught_by(everyone, grid, PLAN.class_of)
    rows = count_rows(windows_by(actors, grid), _by_activity(*parts.values()))
    rows += empty_rows(recogniser, parts["Test"])
    taught = {"actors and recorded people": recogniser}
    taught["actors"] = train_recogniser(taught_by(actors, grid, PLAN.class_of), radar, grid)
    for who, own in taught.items():
        for part, asked in parts.items():
            claim = f"{who}, asked of recorded ({part.lower()} files)"
            rows += rows_of(claim, own, asked, whole=own is recogniser)
    for name, share in recogniser.card["held_out"].items():
        rows.append(reported("people that were kept out", f"{name}, named so", "1", share))
    # Without numbers that count, in windows of 2 s, and with recorded files beside.
    blind = simulated._replace(
        numbers=simulated.numbers * (np.arange(simulated.numbers.shape[1]) >= COUNTING)
    )
    rows += rows_of(
        "without counts", train_recogniser(blind, radar, grid), parts["Test"], whole=False
    )
    short = Grid(**{**vars(grid), "window_s": 2.0})
    two = train_recogniser(taught_by(everyone, short, PLAN.class_of), radar, short)
    rows += rows_of("windows of 2 s", two, recorded("Test", short), whole=False)
    for files in (1, 2, 5, None):
        count = "all" if files is None else str(files)
        for beside, who in ((None, "alone"), (simulated, "and simulated people")):
            own = beside_recorded(beside, files, parts["Train"], grid, radar)
            claim = f"{count} recorded files of each activity {who}"
            rows += rows_of(claim, own, parts["Test"], whole=False)
    return rows


def windows_by(samples: Collection, grid: Grid) -> dict[str, list[Points]]:
    """Windows of simulated people, by activity."""
    found: dict[str, list[Points]] = {name: [] for name in ACTIVITIES}
    for index, label in enumerate(samples.labels.tolist()):
        if (name := PLAN.class_of[label]) in found:
            found[name].append(points_of(samples, index, grid))
    return found


def _by_activity(*parts: Asked) -> dict[str, list[Points]]:
    found: dict[str, list[Points]] = {name: [] for name in ACTIVITIES}
    for part in parts:
        for window, name in zip(part.windows, part.activity.tolist(), strict=True):
            found[name].append(window)
    return found


if __name__ == "__main__":
    sys.exit(main("Activities of RadHAR by a recogniser of simulated people", measure))
