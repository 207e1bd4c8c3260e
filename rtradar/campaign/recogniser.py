"""A recogniser for one's own radar: simulated people in rooms, their points, and a forest.

Actors, and recorded people where a data set names some, do the activities in rooms drawn at random
before the radar, whose height, tilt and noise are drawn too: nobody knows those of a board that
somebody has put up. Recordings of a radar have no part in it.
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.campaign.build import UnmadeSamplesError, build_dataset
from rtradar.campaign.spec_file import read_spec
from rtradar.clouds.collection import Collection
from rtradar.clouds.sample_files import read_index, sample_path, write_index
from rtradar.description import MOST_FILES, path_from, plain, versions
from rtradar.errors import InputError, ValidityWarning
from rtradar.motion.synthetic import STYLES
from rtradar.radar import Radar
from rtradar.radar.array import UsualPlace
from rtradar.recognition import NOBODY, UNKNOWN, Grid, Points, Recogniser
from rtradar.recognition.points import describe_points, in_axes, without_person
from rtradar.recognition.recogniser import OUTLINE, distances, with_temperature
from rtradar.system.checks import brief, read_toml
from rtradar.system.files import digest_of, temporary_folder
from rtradar.system.registries import ACTIVITY_NAMES
from rtradar.system.seeds import word

if TYPE_CHECKING:
    from sklearn.ensemble import ExtraTreesClassifier

Array = NDArray[np.float64]

FRAME_S = 1 / 15
"""Frames that follow each other faster are left out: a movement of a person is slower [s]."""

TRAVELLING = ("walk",)
"""Activities whose actors come nearer to the radar, and stand farther from it therefore."""

_DRAWN = {
    "heading_deg": [-25.0, 25.0],
    "offset_x_m": [-1.2, -0.2],
    "offset_y_m": [-0.3, 0.3],
    "height_m": [1.55, 1.95],
    "radar_up_m": [-0.25, 0.25],
    "radar_pitch_deg": [-5.0, 12.0],
    "noise_db": [8.0, 28.0],
}
"""What is drawn for each window: people 1.5 to 3 m before the radar and turned to it. Its noise is
higher than its figure says, by what a chip loses to its own leakage, its quantisation and what
stands before its antennas."""

_FARTHER = {"offset_x_m": [-0.3, 0.5], "heading_deg": [-180.0, 180.0]}
_SUBJECTS, _FOLDS, _USUAL, _RIDGE = 200, 5, 0.995, 1e-2
_OF_POINTS = {"n_estimators": 500, "min_samples_leaf": 3, "max_features": 0.3}
_OF_CLOUDS = {"n_estimators": 300, "min_samples_leaf": 2}
_NUMBER = re.compile(r"-?\d[\d.]*")
_ENOUGH = 0.9  # of the samples must be made
_LIMITS = 5  # warnings that are shown, of those of the most samples
_LONGER_S = 6.0  # than a window is a take, in which the window lies anywhere


@dataclass(frozen=True, kw_only=True)
class RecogniserPlan:
    """What a recogniser shall know, and by whom it is taught.

    Parameters
    ----------
    radar : Radar
        Radar whose board lists the points.
    activities : mapping
        Classes, each with the actors that show it (``{"jump": ("jump:hop", "jump")}``), a style
        behind a colon; labels of recordings are classes or such names.
    unknown : sequence of str
        Actors that are none of the activities.
    scene : str, optional
        Scene; by default every window has a room of its own (`Scene.random`).
    motions : path, optional
        File of a data set, of which the recordings are taken.
    takes : int
        Number of windows of each class by actors.
    window_s : float
        Length of a window [s].
    clutter_removal : str
        What the board does about what stands still, see `RunSettings`.
    seed : int
        Seed of all that is drawn.

    Raises
    ------
    InputError
        Where something has no meaning.
    """

    radar: Radar
    activities: Mapping[str, Sequence[str]]
    unknown: Sequence[str] = ("stand", "sit")
    scene: str | None = None
    motions: Path | None = None
    takes: int = 60
    window_s: float = 4.0
    clutter_removal: str = "none"
    seed: int = 0

    def __post_init__(self) -> None:
        if len(self.activities) < 2:
            raise InputError("--activities: give at least two, such as walk,boxing")
        if not 1.0 <= self.window_s <= 60.0:
            raise InputError(f"--window {self.window_s:g}; 1 to 60 s are allowed")
        if self.takes < _FOLDS:
            raise InputError(
                f"--takes {self.takes}; at least {_FOLDS} are needed, to test on some of them"
            )
        for label in self.activities:
            if label in (UNKNOWN, NOBODY):
                raise InputError(f"--activities: '{label}' is a class of every recogniser")
        owners: dict[str, str] = {}
        for label, names in [*self.activities.items(), (UNKNOWN, self.unknown)]:
            for name in names:
                actor, _, style = name.partition(":")
                if actor not in ACTIVITY_NAMES:
                    raise InputError(f"'{name}' is no actor; there are {', '.join(ACTIVITY_NAMES)}")
                if style and style not in STYLES.get(actor, ()):
                    allowed = ", ".join(STYLES.get(actor, ())) or "none"
                    raise InputError(f"'{name}': styles of {actor} are {allowed}")
                if owners.setdefault(actor, label) != label:
                    raise InputError(
                        f"actor '{actor}' is of two classes, {owners[actor]} and {label}"
                    )

    @cached_property
    def grid(self) -> Grid:
        """Cells of the radar, and those of its frames that are looked at."""
        every = max(1, math.ceil(FRAME_S / self.radar.frame_hop_s - 0.01))
        return Grid(
            frame_s=every * self.radar.frame_hop_s,
            range_bin_m=self.radar.range_bin_m,
            velocity_bin_mps=self.radar.velocity_bin_mps,
            max_range_m=self.radar.max_range_m,
            window_s=self.window_s,
        )

    @cached_property
    def class_of(self) -> Mapping[str, str]:
        """The class of each actor and of each label of a recording."""
        pairs = [(name, label) for label, names in self.activities.items() for name in names]
        found = {name.partition(":")[0]: label for name, label in pairs}
        return (
            found
            | {label: label for label in self.activities}
            | dict.fromkeys((name.partition(":")[0] for name in self.unknown), UNKNOWN)
        )


class Taught(NamedTuple):
    """Numbers (window, number) of windows, the class of each, and who was seen."""

    numbers: Array
    classes: NDArray[np.str_]
    people: NDArray[np.str_]


def build_recogniser(plan: RecogniserPlan, out: Path, *, workers: int | None = None) -> Recogniser:
    """Make weights for the points that the board of a radar lists, by simulated people alone.

    Samples are made in a folder beside ``out``, named as that is without its ending; a build that
    was stopped goes on with those that are missing.

    Parameters
    ----------
    plan : RecogniserPlan
        What shall be known.
    out : path
        File of the weights, ``.npz``, which is replaced.
    workers : int, optional
        Processes that share the cores; by default one a core.

    Returns
    -------
    Recogniser
        The weights, as they are in the file.

    Raises
    ------
    InputError
        Where a sample cannot be made, or scikit-learn or Dask are missing.
    """
    try:
        import sklearn  # noqa: F401
    except ImportError:
        raise InputError(
            "a recogniser is taught by scikit-learn; install the extra 'learn' of rtradar, in a "
            "checkout: pip install -e '.[learn,campaign]'"
        ) from None
    if out.suffix != ".npz":
        raise InputError(f"--out {out}: weights are a file .npz")
    # Data sets of actors and of recorded people, which are one but for who is in it.
    common = _common(plan)
    tables = {"actors": common | _actors(plan, common)}
    if plan.motions is not None:
        tables["people"] = common | _recordings(plan.motions, plan.class_of)
    folders = [out.with_suffix("") / name for name in tables]
    for place, table in zip(folders, tables.values(), strict=True):
        _build(table, place, workers)
    samples = Collection(*folders)
    taught = taught_by(samples, plan.grid, plan.class_of)
    made = train_recogniser(taught, plan.radar, plan.grid, seed=plan.seed)
    more: dict[str, Any] = {
        "actors": {label: list(names) for label, names in plan.activities.items()},
        "unknown": list(plan.unknown),
        "samples": dict(Counter(samples.column("source").tolist())),
        "scene": plan.scene or "rooms at random",
        "limits": dict(_limits(samples)),
        "seed": plan.seed,
        "versions": versions(),
    }
    out.parent.mkdir(parents=True, exist_ok=True)
    made = Recogniser(made.forest, made.card | more)
    made.save(out)
    return made


def _common(plan: RecogniserPlan) -> dict[str, Any]:
    """Table of a data set without people; see `RecogniserPlan`."""
    radar, grid = plan.radar, plan.grid
    watts = radar.transmit_power_dbm is not None
    board = radar.multiplexing in ("tdm", "bpm") and watts
    radar = dataclasses.replace(radar, frame_period_s=grid.frame_s) if board else radar
    length_s = round(grid.frames * grid.frame_s + radar.frame_duration_s, 6)
    # Without a place of its own the radar stands where the scene has it.
    given = plain(radar)
    if isinstance(radar.position_m, UsualPlace):
        del given["position_m"]
    each: dict[str, Any] = {"radar": [given], "fidelity": ["analytic"]}
    drawn: dict[str, Any] = dict(_DRAWN)
    if watts:
        each["snr_db"] = ["physical"]
    else:
        del drawn["noise_db"]
        drawn["snr_db"] = [10.0, 25.0]
    if plan.scene is not None:
        each["scene"] = [plan.scene]
    return {
        "seed": plan.seed,
        "order": 0,
        "random_rooms": plan.scene is None,
        "whole_clouds": True,
        "skip_short": True,
        "body_material": "skin",
        "clutter_removal": plan.clutter_removal,
        "detector": "ti-oob" if board else "os-cfar",
        "windows": {"duration_s": length_s, "place": "random"},
        "each": each,
        "drawn": drawn,
    }


def _actors(plan: RecogniserPlan, common: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a data set of actors, so many takes of each class."""
    synthetic: list[dict[str, Any]] = []
    for names in (*plan.activities.values(), plan.unknown):
        for number, name in enumerate(names):
            actor, _, style = name.partition(":")
            count = len(range(number, plan.takes, len(names)))
            own: dict[str, Any] = {"label": actor, "count": count, "subjects": _SUBJECTS}
            own |= {"style": style} if style else {}
            own |= {"drawn": _FARTHER} if actor in TRAVELLING else {}
            synthetic.append(own)
    windows = common["windows"]
    return {
        "windows": windows | {"end_s": windows["duration_s"] + _LONGER_S},
        "synthetic": synthetic,
    }


def _recordings(motions: Path, class_of: Mapping[str, str]) -> dict[str, Any]:
    """Keys of a data set that name the recordings of another one, and their digests."""
    spec, given = read_spec(motions), read_toml(motions, "data set", "give a TOML file")
    if not spec.recordings:
        raise InputError(f"--motions {motions}: it names no recordings")
    for label in sorted({one.label for one in spec.recordings}):
        if label not in class_of:
            raise InputError(
                f"--motions {motions}: label {brief(label)} is none of {', '.join(class_of)}; "
                "name it in --activities or --unknown, as in walk=walk+stroll"
            )
    paths = {path for one in spec.recordings for path in (one.path, one.skeleton) if path}
    if len(paths) > MOST_FILES:
        raise InputError(f"--motions {motions}: {len(paths)} files; {MOST_FILES} are allowed")
    return {
        "root": str((motions.resolve().parent / given.get("root", ".")).resolve()),
        "files": [{"path": str(path), "sha256": digest_of(path)} for path in sorted(paths)],
        "recordings": given["recordings"],
        **({"folder": given["folder"]} if "folder" in given else {}),
    }


def _build(table: Mapping[str, Any], folder: Path, workers: int | None) -> None:
    """Build a data set of a table, of which paths are absolute."""
    import tomli_w

    with temporary_folder() as place:
        here = place.resolve()  # where its paths start from
        own = dict(table)
        if "root" in own:
            own["root"] = path_from(here, own["root"])
            own["files"] = [one | {"path": path_from(here, one["path"])} for one in own["files"]]
        spec = place / "recogniser.toml"
        spec.write_text(tomli_w.dumps(own), encoding="utf-8")
        try:
            build_dataset(spec, folder, workers=workers)
        except UnmadeSamplesError as error:
            _leave_out(folder, error)


def _leave_out(folder: Path, error: UnmadeSamplesError) -> None:
    """Go on without the samples that cannot be made, such as of who stands in a wall, if few."""
    every = read_index(folder)
    there = [name for name in every if sample_path(folder, name).is_file()]
    if len(there) < _ENOUGH * len(every):
        raise error
    warnings.warn(f"{error}: left out", ValidityWarning, stacklevel=3)
    write_index(folder, there)


def points_of(samples: Collection, index: int, grid: Grid) -> Points:
    """Put the whole spatial cloud of a sample on a grid."""
    row = samples.provenance[index]
    radar = Radar(**{"name": "?", **row["radar_parameters"], "position_m": row["radar_position_m"]})
    length_s = row["duration_s"] - radar.frame_duration_s
    table = in_axes(samples.whole_cloud(index), radar)
    return Points.on_grid(table, grid, length_s, radar.frame_hop_s)


def taught_by(samples: Collection, grid: Grid, class_of: Mapping[str, str]) -> Taught:
    """Describe the windows of samples, and the same windows once the person has left."""
    numbers, classes, people = list[Array](), list[str](), list[str]()
    subjects = samples.column("subject").tolist()
    for index, label in enumerate(samples.labels.tolist()):
        for _, window in points_of(samples, index, grid).windows(grid):
            for own, name in ((window, class_of[label]), (without_person(window), NOBODY)):
                if (found := describe_points(own)) is not None:
                    numbers.append(found)
                    classes.append(name)
                    people.append(str(subjects[index]))
    return Taught(np.array(numbers), np.array(classes), np.array(people))


def train_recogniser(
    taught: Taught, radar: Radar, grid: Grid | None = None, *, seed: int = 0
) -> Recogniser:
    """Train a forest on windows; folds over people calibrate and test it.

    Without a grid the windows are of RDT clouds. An InputError is raised where too few windows of
    an activity have points.
    """
    from sklearn.model_selection import StratifiedGroupKFold

    count = Counter(taught.classes.tolist())
    for name, number in sorted(count.items()):
        if number < _FOLDS and name not in (UNKNOWN, NOBODY):
            raise InputError(
                f"only {number} windows of '{name}' have enough points; {_FOLDS} are needed: take "
                "more (--takes)"
            )
    kept = np.array([count[name] >= _FOLDS for name in taught.classes.tolist()])
    taught = Taught(*(column[kept] for column in taught))
    names, truth = np.unique(taught.classes, return_inverse=True)
    held_out, away = np.zeros((len(truth), len(names))), np.zeros(len(truth))
    first = taught.numbers[:, : None if grid else OUTLINE]
    folds = StratifiedGroupKFold(_FOLDS, shuffle=True, random_state=word(seed))
    for learn, ask in folds.split(taught.numbers, truth, taught.people):
        part = _forest(grid, seed).fit(taught.numbers[learn], truth[learn])
        held_out[np.ix_(ask, part.classes_)] = part.predict_proba(taught.numbers[ask])
        away[ask] = distances(first[ask], *moments_of(first[learn]))
    right = held_out.argmax(axis=1) == truth
    card = {
        "classes": names.tolist(),
        "temperature": best_temperature(held_out, truth),
        "radar": limits_of(radar),
        "usual": dict(
            zip(
                ("mean", "inverse_covariance", "most"),
                (*moments_of(first), float(np.quantile(away, _USUAL))),
                strict=True,
            )
        ),
        "windows": dict(zip(names.tolist(), np.bincount(truth).tolist(), strict=True)),
        "people": len(set(taught.people.tolist())),
        "held_out": {
            name: float(right[truth == number].mean()) for number, name in enumerate(names.tolist())
        },
    } | ({"grid": dataclasses.asdict(grid)} if grid else {})
    return Recogniser(arrays_of(_forest(grid, seed).fit(taught.numbers, truth)), card)


def _forest(grid: Grid | None, seed: int) -> ExtraTreesClassifier:
    from sklearn.ensemble import ExtraTreesClassifier

    how = _OF_POINTS if grid else _OF_CLOUDS
    return ExtraTreesClassifier(class_weight="balanced", random_state=word(seed), **how)


def arrays_of(forest: ExtraTreesClassifier) -> dict[str, NDArray[Any]]:
    """Return the arrays of a `Recogniser` for a forest of scikit-learn."""
    trees = [estimator.tree_ for estimator in forest.estimators_]
    sizes = [tree.node_count for tree in trees]
    roots = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    chances = np.concatenate([tree.value[:, 0] for tree in trees])
    below, above = (
        np.concatenate(
            [
                np.maximum(getattr(tree, side), 0) + root
                for tree, root in zip(trees, roots, strict=True)
            ]
        )
        for side in ("children_left", "children_right")
    )
    return {
        "roots": roots,
        "feature": np.concatenate([np.maximum(tree.feature, -1) for tree in trees]),
        "threshold": np.concatenate([tree.threshold for tree in trees]),
        "below": below,
        "above": above,
        "chances": chances / chances.sum(axis=1, keepdims=True),
    }


def moments_of(numbers: Array) -> tuple[Array, Array]:
    """Return the mean and the inverse covariance of numbers (window, number)."""
    covariance = np.cov(numbers.T)
    # So that nearly dependent numbers, and those that few windows have, do no harm.
    ridge = _RIDGE * np.diag(covariance) + 1e-9
    inverse = np.asarray(np.linalg.inv(covariance + np.diag(ridge)), dtype=np.float64)
    return numbers.mean(axis=0), inverse


def limits_of(radar: Radar) -> dict[str, Any]:
    """Return what another radar must share for the weights to be good for it."""
    return {
        "name": radar.name,
        "range_bin_m": radar.range_bin_m,
        "velocity_bin_mps": radar.velocity_bin_mps,
        "max_velocity_mps": radar.max_velocity_mps,
        "frame_duration_s": radar.frame_duration_s,
        "frame_hop_s": radar.frame_hop_s,
    }


def best_temperature(probabilities: Array, truth: NDArray[np.int64]) -> float:
    """Return the temperature at which the mean logarithm of the true probabilities is largest."""
    from scipy.optimize import minimize_scalar

    def loss(log_temperature: float) -> float:
        scaled = with_temperature(probabilities, float(np.exp(log_temperature)))
        own = scaled[np.arange(len(truth)), truth]
        return -float(np.mean(np.log(np.maximum(own, 1e-12))))

    return float(np.exp(minimize_scalar(loss, bounds=(-3.0, 3.0), method="bounded").x))


def _limits(samples: Collection) -> Counter[str]:
    """Count the samples of each warning, whatever its numbers are."""
    texts = (row.get("limits", []) for row in samples.provenance)
    return Counter(one for own in texts for one in {_NUMBER.sub("...", text) for text in own})


def card_in_words(made: Recogniser) -> str:
    """Describe weights of points in a few lines of text."""
    return "\n".join(_lines(made.card))


def _lines(card: Mapping[str, Any]) -> Iterator[str]:
    yield f"radar {card['radar']['name']}, windows of {card['grid']['window_s']:g} s"
    known = ", ".join(f"{name} {part:.0%}" for name, part in card["held_out"].items())
    yield f"of people that were kept out it knows: {known}"
    counted = ", ".join(f"{count} {name}" for name, count in card["samples"].items())
    windows = ", ".join(f"{count} {name}" for name, count in card["windows"].items())
    yield f"learnt from windows of {card['people']} people: {windows}"
    yield f"from samples: {counted}, in {card['scene']}; no recording of a radar"
    for text, count in sorted(card["limits"].items(), key=lambda one: -one[1])[:_LIMITS]:
        yield f"warned of in {count} of {sum(card['samples'].values())} samples: {text}"
    yield f"actors: {json.dumps(card['actors'])}; {UNKNOWN}: {', '.join(card['unknown'])}"
