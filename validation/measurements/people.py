"""Actors against recorded people: what a classifier that learns from actors knows of recordings.

    python validation/measurements/people.py OUT [--only NAME,...] [--no-build] [--measure NAME,...]

Builds the data sets that are not there yet: recordings of `RTRADAR_MOCAP` and `RTRADAR_JOINTS`, and
actors, all in windows round the strikes, which begin at random. The radar has few channels; a part
of the actors is seen by all 96, too, and what the two radars' clouds differ in is printed.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.ensemble import ExtraTreesClassifier, VotingClassifier
from sklearn.metrics import confusion_matrix
from sklearn.neighbors import NearestCentroid
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import rtradar as rt
from rtradar.classify.baselines import axis_features
from rtradar.classify.prepare import stack_clouds
from rtradar.classify.recipes import EDGES, SMALL
from rtradar.classify.scores import Answers, balanced_accuracy, calibration_error, interval
from rtradar.classify.splits import subjects_of
from rtradar.classify.study import classes_of
from rtradar.classify.training import Examples, predict, train_network
from rtradar.classify.weights import MERGED
from rtradar.clouds.collection import Collection
from rtradar.recognition import Recogniser
from rtradar.recognition.description import describe
from rtradar.recognition.windows import cut_windows

HEAD = """
seed = 0
folder = "{folder}"
[windows]
duration_s = 1.6
place = "strike"
count = 2
[each]
radar = ["few_channels.toml"]
scene = ["free-space"]
fidelity = ["analytic"]
[drawn]
heading_deg = [-30.0, 30.0]
snr_db = [15.0, 25.0]
offset_x_m = [-0.3, 0.3]
offset_y_m = [-0.3, 0.3]
"""
FEW = Path(__file__).resolve().parents[1] / "few_channels.toml"
ACTIVITIES = {
    "walk": "walk",
    "kick": "kick",
    "punch": "punch",
    "punching": "punch",
    "jumping_jack": "jumping_jack",
    "jumping_jacks": "jumping_jack",
}
"""Activities of an actor by the names that the recordings have."""

OTHERS = ("sit", "bend", "squat", "wave", "jump", "stand", "walk_in_place", "fall")
"""Activities of actors that the weights of the package have not learnt."""

WINDOW_S = 1.6


def of_mocap(folder: Path, *, known: bool = True) -> str:
    """Specification of the recordings with skeletons; those too short for a window are left out.

    They are of `ACTIVITIES`, or of all others.
    """
    text = ""
    for row in csv.DictReader((folder / "MANIFEST.csv").open()):
        if (row["activity"] in ACTIVITIES) != known or row["format"] not in ("AMC", "BVH"):
            continue
        rate, frames = float(row["fps"]), int(row["frames"])
        first, last = (int(row[key]) for key in ("start_frame", "end_frame"))
        start_s, end_s, length_s = (first - 1) / rate, last / rate, (frames - 1) / rate
        spare = max(0.0, WINDOW_S + 0.2 - (end_s - start_s)) / 2  # of an activity that is shorter
        start_s, end_s = max(0.0, start_s - spare), min(length_s - 1e-4, end_s + spare)
        if end_s - start_s < WINDOW_S:
            continue
        text += _recording(row["file"], row["activity"], row["subject"], start_s, end_s)
        if row["skeleton_file"]:
            text += f'skeleton = "{row["skeleton_file"]}"\n'
    return text


def of_joints(folder: Path, most: int, *, known: bool = True) -> str:
    """Specification of the recordings of joint positions, ``most`` of each person and activity.

    They are of `ACTIVITIES`, or of all others.
    """
    text, taken = "", Counter[tuple[str, str]]()
    for row in csv.DictReader((folder / "MANIFEST.csv").open()):
        if (row["activity"] in ACTIVITIES) != known:
            continue
        if long_enough(folder / row["file"]):
            taken[row["person"], row["activity"]] += 1
            if taken[row["person"], row["activity"]] > most:
                continue
            text += _recording(
                row["file"], row["activity"], f"{row['dataset']}_{row['person']}", 0.0
            )
    return text


def long_enough(recording: Path) -> bool:
    """Whether a file of joint positions holds a window.

    Where it has a gap it is read from one side alone, and is shorter than its manifest says.
    """
    return rt.load_motion(recording).duration_s > WINDOW_S + 0.05


def _recording(
    file: str, activity: str, subject: str, start_s: float, end_s: float | None = None
) -> str:
    until = "" if end_s is None else f"end_s = {end_s:.4f}\n"
    return (
        f'[[recordings]]\nfile = "{file}"\nlabel = "{ACTIVITIES.get(activity, activity)}"\n'
        f'subject = "{subject}"\nlicence = "see its folder"\nstart_s = {start_s:.4f}\n{until}'
    )


def data_sets(out: Path, most: int) -> dict[str, str]:
    """Text of the specification of every data set, by its name."""
    (out / "few_channels.toml").write_bytes(FEW.read_bytes())
    found = {}
    for name, variable, those in (
        ("mocap", "RTRADAR_MOCAP", of_mocap),
        ("joints", "RTRADAR_JOINTS", partial(of_joints, most=most)),
        ("mocap_others", "RTRADAR_MOCAP", partial(of_mocap, known=False)),
        ("joints_others", "RTRADAR_JOINTS", partial(of_joints, most=most, known=False)),
    ):
        if folder := os.environ.get(variable):
            found[name] = HEAD.format(folder=f"${{{variable}}}") + those(Path(folder))
    found["actors"] = (FEW.parent / "actors.toml").read_text()
    head, _, _ = found["actors"].partition("[[synthetic]]")
    found["actors_others"] = head + "".join(
        f'[[synthetic]]\nlabel = "{label}"\ncount = 24\nsubjects = 200\n\n' for label in OTHERS
    )
    found["channels_few"] = found["actors"].replace("count = 60", "count = 10")
    found["channels_all"] = found["channels_few"].replace("few_channels.toml", "paper-12ghz")
    return found


def build(out: Path, only: list[str] | None, most: int, workers: int = 1) -> None:
    """Build the data sets that are not complete."""
    out.mkdir(parents=True, exist_ok=True)
    for name, text in data_sets(out, most).items():
        if only is None or name in only:
            spec = out / f"{name}.toml"
            spec.write_text(text)
            words = ["dataset", "build", str(spec), "--out", str(out / name)]
            words += ["--workers", str(workers)]
            subprocess.run([sys.executable, "-m", "rtradar", *words], check=True)


class Merged(Collection):
    """Actors under the names of activities that recordings are asked about."""

    @property
    def labels(self) -> NDArray[np.str_]:
        """Activity of every cloud."""
        return np.array([MERGED.get(label, label) for label in super().labels.tolist()])


def answers_of(
    clouds: Collection,
    chances: NDArray[np.float64],
    truth: NDArray[np.int64],
    of: Any = slice(None),
) -> Answers:
    """Answers about the clouds with these indices."""
    recordings, subjects = (
        clouds.column(name).astype(str)[of] for name in ("recording", "subject")
    )
    return Answers(chances, truth[of], recordings, subjects)


def told(title: str, answers: Answers) -> None:
    """Print balanced accuracies, an interval over people and the error of calibration."""
    recordings = answers.by_recording()
    low, high = interval(recordings)
    print(
        f"{title:56} {balanced_accuracy(answers):6.1%} {balanced_accuracy(recordings):6.1%} "
        f"({low:.1%} to {high:.1%}), calibration error {calibration_error(recordings):.1%}",
        flush=True,
    )


def forest() -> Any:
    """Extremely randomised trees, as those of the weights of the package."""
    return ExtraTreesClassifier(200, class_weight="balanced", min_samples_leaf=2, random_state=0)


def linear() -> Any:
    """Linear discriminant analysis, whose covariance is shrunk as Ledoit and Wolf say."""
    return make_pipeline(
        StandardScaler(), LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto")
    )


def both() -> Any:
    """The mean of both, which err in different ways."""
    return VotingClassifier([("forest", forest()), ("linear", linear())], voting="soft")


def centroid() -> Any:
    """The class whose mean description is nearest."""
    return make_pipeline(StandardScaler(), NearestCentroid())


MODELS = {"forest": forest, "linear": linear, "both": both}
"""What learns from descriptions, by name."""


def windows_of(clouds: Collection) -> list[NDArray[np.float64]]:
    """Cut the ends off each cloud, as is done for the weights of the package."""
    lengths = clouds.column("duration_s").astype(float)
    return [cut_windows(clouds.points(k), length_s)[0] for k, length_s in enumerate(lengths)]


def described(clouds: Collection) -> NDArray[np.float64]:
    """Describe each cloud, (cloud, number), as is done for the weights of the package."""
    return np.array([describe(window) for window in windows_of(clouds)])


RECORDED_OVER_ACTORS = 3
"""As how many clouds of actors each recorded one counts where both are learnt from. Where they
count alike, actors teach less than they spoil once recordings are of some twenty people; counting
3 and 5 times differs by no more than chance (``--measure curve``)."""

Taught = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Descriptions (cloud, number) and their classes (cloud,)."""


def with_actors(recorded: Taught, actors: Taught, weight: int = RECORDED_OVER_ACTORS) -> Taught:
    """Put recordings, each so many times, and actors together."""
    (x, y), (more, of_more) = recorded, actors
    return (
        np.concatenate([x.repeat(weight, axis=0), more]),
        np.concatenate([y.repeat(weight), of_more]),
    )


def left_out(
    features: NDArray[np.float64],
    truth: NDArray[np.int64],
    groups: Any,
    make: Any,
    more: Taught | None = None,
) -> NDArray[np.float64]:
    """Chances (cloud, class) of each cloud from all of other groups, and from ``more`` beside."""
    chances = np.zeros((len(truth), truth.max() + 1))
    for group in np.unique(groups):
        learn = groups != group
        taught = features[learn], truth[learn]
        model = make().fit(*(taught if more is None else with_actors(taught, more)))
        chances[np.ix_(~learn, model.classes_)] = model.predict_proba(features[~learn])
    return chances


def one_axis(actors: Collection, recorded: Collection, draws: int = 4) -> None:
    """What time, range or velocity alone tells, of actors and of recordings that are cut alike.

    More clouds teach more. So the forest learns from as many of each activity: of as many as the
    rarer side has, drawn some times.
    """
    sides = {"actors": actors, "recorded": recorded}
    truths = {title: classes_of(clouds)[1] for title, clouds in sides.items()}
    least = np.min([np.bincount(truth) for truth in truths.values()], axis=0)
    for axis, name in enumerate(("time", "range", "velocity")):
        for title, clouds in sides.items():
            features, truth = axis_features(clouds, axis), truths[title]
            groups, found = subjects_of(clouds) % 10, []  # ten parts of people are enough
            for draw in range(draws):
                some = alike(truth, least, draw)
                chances = left_out(features[some], truth[some], groups[some], forest)
                found.append(balanced_accuracy(answers_of(clouds, chances, truth, some)))
            print(
                f"{name} alone, {title}, other people, {least.tolist()} clouds: "
                f"{np.mean(found):.1%}, of {draws} draws {min(found):.1%} to {max(found):.1%}",
                flush=True,
            )


def alike(truth: NDArray[np.int64], counts: NDArray[np.int64], seed: int) -> NDArray[np.int64]:
    """Draw so many clouds of each class; return their indices."""
    random = np.random.default_rng(seed)
    drawn = [
        random.permutation(np.flatnonzero(truth == one))[:count] for one, count in enumerate(counts)
    ]
    return np.concatenate(drawn)


def to_recorded(actors: Collection, recorded: Collection, seeds: int) -> None:
    """Learn from actors and ask about recordings."""
    _, learnt = classes_of(actors)
    names, truth = classes_of(recorded)
    x, asked = described(actors), described(recorded)
    for title, make in (("nearest centroid", centroid), *MODELS.items()):
        told(title, answers_of(recorded, make().fit(x, learnt).predict_proba(asked), truth))
    for recipe in (SMALL, EDGES):
        sets = [
            Examples(stack_clouds(one, edge_s=recipe.edge_s), torch.from_numpy(those), names)
            for one, those in ((actors, learnt), (recorded, truth))
        ]
        each: list[NDArray[np.float64]] = []
        for seed in range(seeds):
            network, _ = train_network(*sets, recipe, seed=seed)
            each.append(np.exp(predict(network, sets[1], recipe)).astype(np.float64))
            told(f"network '{recipe.name}', seed {seed}", answers_of(recorded, each[-1], truth))
        if not each:
            continue
        mean = answers_of(recorded, np.mean(each, axis=0), truth)
        by_source(f"network '{recipe.name}', {seeds} seeds averaged", mean, names)


def by_source(title: str, answers: Answers, names: tuple[str, ...]) -> None:
    """Print what is known of all recordings, of those of each source, and what is mistaken."""
    told(title, answers)
    whole = answers.by_recording()
    sources = np.array([name.split("_")[0] for name in whole.subjects])
    for source in np.unique(sources):
        part = Answers(*(column[sources == source] for column in whole))
        shown = ", ".join(names[one] for one in np.unique(part.truth))
        told(f"    of which {source} ({shown})", part)
    print(names, confusion_matrix(whole.truth, whole.probabilities.argmax(axis=1)), sep="\n")


def shipped(recorded: Collection) -> None:
    """Ask the weights that come with the package about recordings."""
    names, truth = classes_of(recorded)
    recogniser, windows_s = Recogniser.shipped(), recorded.column("duration_s").astype(float)
    order = [recogniser.classes.index(name) for name in names]
    each = [
        recogniser.probabilities(cut_windows(recorded.points(index), length_s)).mean(axis=0)[order]
        for index, length_s in enumerate(windows_s)
    ]
    by_source("weights of the package", answers_of(recorded, np.array(each), truth), names)


def people_left_out(actors: Collection, recorded: Collection) -> None:
    """Leave each person out, with and without actors; and what the data set alone tells."""
    _, learnt = classes_of(actors)
    names, truth = classes_of(recorded)
    groups, more = subjects_of(recorded), (described(actors), learnt)
    subjects = recorded.column("subject").astype(str)
    sources = np.array([name.split("_")[0] for name in subjects])
    features = described(recorded)
    which = (sources[:, None] == np.unique(sources)).astype(float)
    told("data set alone", answers_of(recorded, left_out(which, truth, groups, forest), truth))
    for beside, those in (("", None), (", actors beside", more)):
        each = {
            title: left_out(features, truth, groups, make, those)
            for title, make in (("forest", forest), ("linear", linear))
        }
        each["both"] = (each["forest"] + each["linear"]) / 2
        answers = {title: answers_of(recorded, some, truth) for title, some in each.items()}
        for title, some in answers.items():
            told(f"leave one person out, {title}{beside}", some)
        by_source(f"leave one person out, chosen{beside}", chosen_on_others(answers), names)
    common = np.flatnonzero(np.isin(recorded.labels, ["jumping_jack", "punch"]))
    for beside, those in (("", None), (", actors beside", more)):
        chances = left_out(features, truth, sources, both, those)[common]
        told(
            f"leave one data set out, jacks and punches{beside}",
            answers_of(recorded, chances, truth, common),
        )


def chosen_on_others(each: dict[str, Answers]) -> Answers:
    """For each person, take the answers of the model that knows most recordings of the others.

    So what the best of several models knows is not flattered by the choice.
    """
    titles, first = list(each), next(iter(each.values()))
    chances = np.zeros_like(first.probabilities)
    for person in np.unique(first.subjects):
        own = first.subjects == person
        known = [
            balanced_accuracy(Answers(*(column[~own] for column in each[title])).by_recording())
            for title in titles
        ]
        chances[own] = each[titles[int(np.argmax(known))]].probabilities[own]
    return first._replace(probabilities=chances)


def learning_curve(actors: Collection, recorded: Collection, draws: int) -> None:
    """Balanced accuracy by recording over the number of real people, with and without actors.

    Beside each figure with actors is what they add, and the standard error of that over the draws
    of people.
    """
    (_, learnt), (_, truth) = classes_of(actors), classes_of(recorded)
    more, features, groups = (described(actors), learnt), described(recorded), subjects_of(recorded)

    def known(taught: Taught, asked: NDArray[np.bool_]) -> float:
        model, chances = both().fit(*taught), np.zeros((np.count_nonzero(asked), truth.max() + 1))
        chances[:, model.classes_] = model.predict_proba(features[asked])
        return balanced_accuracy(answers_of(recorded, chances, truth, asked).by_recording())

    weights = (1, RECORDED_OVER_ACTORS, 5)
    print("real people: known from them alone; with actors, each recording counting as 1, 3 and 5")
    print(f"0 real people: -; {known(more, np.full(len(truth), True)):.1%}")
    for count in (2, 5, 10, 20, 30):
        found = []
        for draw in range(draws):
            some = np.random.default_rng(draw).permutation(np.unique(groups))[:count]
            learn = np.isin(groups, some)
            own = features[learn], truth[learn]
            taught = [own, *(with_actors(own, more, weight) for weight in weights)]
            found.append([known(each, ~learn) for each in taught])
        mean, shown = np.mean(found, axis=0), ""
        for place in range(1, 1 + len(weights)):
            gain = np.array(found)[:, place] - np.array(found)[:, 0]
            error = gain.std(ddof=1) / np.sqrt(draws)
            shown += f"; {mean[place]:.1%} ({gain.mean():+.1%}, standard error {error:.1%})"
        print(f"{count} real people: {mean[0]:.1%}{shown}", flush=True)


def others(out: Path) -> None:
    """Print what the weights of the package call each activity of each source, known or not.

    Those who move unlike any that the weights have learnt from are counted as well.
    """
    recogniser, found = Recogniser.shipped(), dict[tuple[str, str], list[tuple[str, bool]]]()
    every = ("mocap", "mocap_others", "joints", "joints_others")
    clouds = Collection(*(out / name for name in every if (out / name).exists()))
    windows_s, subjects = clouds.column("duration_s").astype(float), clouds.column("subject")
    for index, (label, subject) in enumerate(zip(clouds.labels, subjects, strict=True)):
        windows = cut_windows(clouds.points(index), windows_s[index])
        answer = recogniser.classes[recogniser.probabilities(windows).mean(axis=0).argmax()]
        row = found.setdefault((str(label), str(subject).split("_")[0]), [])
        row.append((answer, recogniser.distance(windows) > 1))
    print(
        f"{'activity':20}{'source':14}", *(f"{name:>14}" for name in recogniser.classes), "unlike"
    )
    for (label, source), answers in sorted(found.items()):
        counts = Counter(answer for answer, _ in answers)
        shown = "".join(f"{counts[name]:15}" for name in recogniser.classes)
        print(f"{label:20}{source:14}{shown}{sum(unlike for _, unlike in answers):7}")


def fifth_class(actors: Collection, recorded: Collection, out: Path) -> None:
    """Print what a forest knows, and calls another activity, that has learnt others as well."""
    (_, learnt), (names, truth) = classes_of(actors), classes_of(recorded)
    x = np.concatenate([described(actors), described(more := Collection(out / "actors_others"))])
    model = forest().fit(x, np.concatenate([learnt, np.full(len(more), len(names))]))
    answers = answers_of(recorded, model.predict_proba(described(recorded)), truth)
    told("forest that has learnt other activities", answers)
    unknown = Collection(out / "mocap_others", out / "joints_others")
    other = model.predict(described(unknown)) == len(names)
    counts = {label: (unknown.labels == label) for label in np.unique(unknown.labels)}
    for label, those in counts.items():
        print(f"{label:20}{np.count_nonzero(those):5} windows, another: {other[those].mean():6.1%}")
    still = ~np.char.startswith(unknown.labels.astype(str), "walk") & (unknown.labels != "run")
    still |= unknown.labels == "walk_in_place"
    print(f"all but those who walk or run: {other[still].mean():.1%} of {np.count_nonzero(still)}")


def channels(out: Path) -> None:
    """What clouds of few channels differ in from those of all, feature by feature."""
    few, many = (described(Collection(out / f"channels_{name}")) for name in ("few", "all"))
    spread = many.std(axis=0) + 1e-9
    off = np.abs(few.mean(axis=0) - many.mean(axis=0)) / spread
    print(
        f"few channels: means of {off.size} features are off by {np.median(off):.2f} of their "
        f"spread, at most {off.max():.2f}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT", help="folder of data sets")
    parser.add_argument("--only", metavar="NAME,...", help="build only these data sets")
    parser.add_argument("--seeds", type=int, default=3, help="trainings of each network, or 0")
    parser.add_argument("--no-build", action="store_true", help="measure what is there")
    parser.add_argument(
        "--measure",
        metavar="NAME,...",
        help="some of axes, shipped, learnt, people, curve, others, fifth",
    )
    parser.add_argument("--draws", type=int, default=24, help="draws of people of the curve")
    parser.add_argument("--workers", type=int, default=1, help="processes that build")
    parser.add_argument(
        "--recordings", type=int, default=1000, help="most joint files of a person and activity"
    )
    options = parser.parse_args()
    out = options.out
    if not options.no_build:
        build(out, options.only and options.only.split(","), options.recordings, options.workers)
    if options.only:
        return 0
    actors = Merged(out / "actors")
    recorded = Collection(*(out / name for name in ("mocap", "joints") if (out / name).exists()))
    print("balanced accuracy of windows, of recordings (95 % over people)")
    parts = {
        "axes": lambda: one_axis(actors, recorded),
        "shipped": lambda: shipped(recorded),
        "learnt": lambda: to_recorded(actors, recorded, options.seeds),
        "people": lambda: people_left_out(actors, recorded),
        "curve": lambda: learning_curve(actors, recorded, options.draws),
        "others": lambda: others(out),
        "fifth": lambda: fifth_class(actors, recorded, out),
    }
    for name in options.measure.split(",") if options.measure else parts:
        parts[name]()
    if (out / "channels_all").exists() and not options.measure:
        channels(out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
