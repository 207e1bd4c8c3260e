"""Actors against recorded people: what a classifier that learns from actors knows of recordings.

    python validation/measurements/people.py OUT [--only NAME,...] [--no-build] [--measure NAME,...]

Builds the data sets that are not there yet: recordings of `RTRADAR_MOCAP` and `RTRADAR_JOINTS`, and
actors, all in windows round the strikes, which begin at random. The radar has few channels; the
recordings are seen by all 96, too.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from people_data import build
from shipped_weights import ANSWERS
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.ensemble import ExtraTreesClassifier, VotingClassifier
from sklearn.metrics import confusion_matrix
from sklearn.neighbors import NearestCentroid
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from rtradar.classify.baselines import axis_features
from rtradar.classify.outcomes import Answers, balanced_accuracy, calibration_error, interval
from rtradar.classify.prepare import stacked_for
from rtradar.classify.recipes import EDGES, SMALL, SPECTROGRAM, Recipe
from rtradar.classify.splits import subjects_of
from rtradar.classify.study import classes_of
from rtradar.classify.training import Examples, predict, train_network
from rtradar.clouds.collection import Collection
from rtradar.recognition import Recogniser
from rtradar.recognition.recogniser import UNKNOWN, cut_windows, describe


class Merged(Collection):
    """Actors under the names of activities that recordings are asked about."""

    @property
    def labels(self) -> NDArray[np.str_]:
        """Activity of every cloud."""
        return np.array([ANSWERS.get(label, label) for label in super().labels.tolist()])


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


def recordings(out: Path, which: str = "") -> Collection:
    """Return the data sets of recordings that are there, such as those ``which`` are _others."""
    folders = (out / f"{source}{which}" for source in ("mocap", "joints"))
    return Collection(*(folder for folder in folders if folder.exists()))


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
            table = np.zeros((len(least), len(least)))
            for draw in range(draws):
                some = alike(truth, least, draw)
                chances = left_out(features[some], truth[some], groups[some], forest)
                found.append(balanced_accuracy(answers_of(clouds, chances, truth, some)))
                table += confusion_matrix(truth[some], chances.argmax(axis=1))
            recalls = ", ".join(f"{one:.0%}" for one in table.diagonal() / table.sum(axis=1))
            print(
                f"{name} alone, {title}, other people, {least.tolist()} clouds: "
                f"{np.mean(found):.1%}, of {draws} draws {min(found):.1%} to {max(found):.1%}; "
                f"by activity {recalls}",
                flush=True,
            )


def alike(truth: NDArray[np.int64], counts: NDArray[np.int64], seed: int) -> NDArray[np.int64]:
    """Draw so many clouds of each class; return their indices."""
    random = np.random.default_rng(seed)
    drawn = [
        random.permutation(np.flatnonzero(truth == one))[:count] for one, count in enumerate(counts)
    ]
    return np.concatenate(drawn)


def examples_of(clouds: Collection, recipe: Recipe) -> Examples:
    """What the network of a recipe takes of the clouds, and their classes."""
    names, truth = classes_of(clouds)
    return Examples(stacked_for(clouds, recipe), torch.from_numpy(truth), names)


def to_recorded(actors: Collection, recorded: Collection, seeds: int) -> None:
    """Learn from actors and ask about recordings."""
    _, learnt = classes_of(actors)
    names, truth = classes_of(recorded)
    x, asked = described(actors), described(recorded)
    found = {}
    for title, make in (("nearest centroid", centroid), *MODELS.items()):
        found[title] = make().fit(x, learnt).predict_proba(asked)
        told(title, answers_of(recorded, found[title], truth))
    for recipe in (SMALL, EDGES, SPECTROGRAM):
        sets = [examples_of(clouds, recipe) for clouds in (actors, recorded)]
        each: list[NDArray[np.float64]] = []
        for seed in range(seeds):
            network, _ = train_network(*sets, recipe, seed=seed)
            each.append(np.exp(predict(network, sets[1], recipe)).astype(np.float64))
            told(f"network '{recipe.name}', seed {seed}", answers_of(recorded, each[-1], truth))
        if not each:
            continue
        found[recipe.name] = np.mean(each, axis=0)
        title = f"network '{recipe.name}', {seeds} seeds averaged"
        by_source(title, answers_of(recorded, found[recipe.name], truth), names)
        both_say = (found["forest"] + found[recipe.name]) / 2
        told(f"{title}, and the forest", answers_of(recorded, both_say, truth))


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


def shipped(recorded: Collection, radar: str) -> None:
    """Ask the weights that come with the package about recordings."""
    names, truth = classes_of(recorded)
    recogniser = Recogniser.shipped()
    order = [recogniser.classes.index(name) for name in names]
    chances = recogniser.probabilities(windows_of(recorded))[:, order]
    chances /= chances.sum(axis=1, keepdims=True)  # if it is one of these
    by_source(f"weights of the package, {radar}", answers_of(recorded, chances, truth), names)


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


def people_left_out_of_networks(actors: Collection, recorded: Collection) -> None:
    """Leave out a tenth of the people at a time; a network learns from spectrograms of the rest.

    Beside it `both` learns from the descriptions of the same people, and their answers are
    averaged.
    """
    (_, learnt), (names, truth) = classes_of(actors), classes_of(recorded)
    acted, taken = (examples_of(clouds, SPECTROGRAM) for clouds in (actors, recorded))
    features, more = described(recorded), (described(actors), learnt)
    groups = subjects_of(recorded) % 10
    for title, those in (("", None), (", actors beside", more)):
        by_network = np.zeros((len(truth), len(names)))
        for group in np.unique(groups):
            learn, asked = np.flatnonzero(groups != group), np.flatnonzero(groups == group)
            known = taken[learn]
            if those:
                often = taken[learn.repeat(RECORDED_OVER_ACTORS)]
                known = Examples(
                    torch.cat([often.points, acted.points]),
                    torch.cat([often.classes, acted.classes]),
                    names,
                )
            network, _ = train_network(known, taken[asked], SPECTROGRAM, seed=0)
            by_network[asked] = np.exp(predict(network, taken[asked], SPECTROGRAM))
        described_by = left_out(features, truth, groups, both, those)
        for said, chances in (
            ("network 'spectrogram'", by_network),
            ("both, descriptions", described_by),
            ("mean of them", (by_network + described_by) / 2),
        ):
            told(
                f"a tenth of the people left out, {said}{title}",
                answers_of(recorded, chances, truth),
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


def learning_curve(actors: Collection, recorded: Collection, draws: int = 24) -> None:
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
    print(f"known from real people alone; with actors, a recording counting as {weights} of them")
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

    Counted as well are windows of which they say that it is probably something else, and those
    that are unlike any that they have learnt from.
    """
    recogniser, found = Recogniser.shipped(), dict[tuple[str, str], list[tuple[int, bool, bool]]]()
    clouds = Collection(*recordings(out).folders, *recordings(out, "_others").folders)
    windows, place = windows_of(clouds), recogniser.classes.index(UNKNOWN)
    chances = recogniser.probabilities(windows)
    names = [name for name in recogniser.classes if name != UNKNOWN]
    answers = np.delete(chances, place, axis=1).argmax(axis=1).tolist()
    other = chances[:, place] > 0.5
    sources = [str(name).split("_")[0] for name in clouds.column("subject")]
    for label, source, window, answer, none in zip(
        clouds.labels.tolist(), sources, windows, answers, other.tolist(), strict=True
    ):
        unlike = recogniser.distance([window]) > 1
        found.setdefault((label, source), []).append((answer, none, unlike))
    titles = "".join(f"{name:>15}" for name in names)
    print(f"{'activity':20}{'source':14}{titles}   other unlike")
    for (label, source), row in sorted(found.items()):
        answered, none, unlike = zip(*row, strict=True)
        counts = "".join(f"{answered.count(one):15}" for one in range(len(names)))
        print(f"{label:20}{source:14}{counts}{sum(none):8}{sum(unlike):7}")
    known = np.isin(clouds.labels, names)
    goes = np.array([label.startswith(("walk_", "run")) for label in clouds.labels.tolist()])
    goes &= ~np.isin(clouds.labels, ["walk_in_place", "run_in_place"])
    for title, some in (
        ("the activities that are named", known),
        ("others, of people who go somewhere", ~known & goes),
        ("others, of people who stay in place", ~known & ~goes),
    ):
        print(f"{title}: {other[some].mean():.1%} of {np.count_nonzero(some)} are called other")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT", help="folder of data sets")
    parser.add_argument("--only", metavar="NAME,...", help="build only these data sets")
    parser.add_argument("--seeds", type=int, default=3, help="trainings of each network, or 0")
    parser.add_argument("--no-build", action="store_true", help="measure what is there")
    parser.add_argument(
        "--measure",
        metavar="NAME,...",
        help="some of axes, shipped, channels, learnt, people, curve, networks, others",
    )
    parser.add_argument(
        "--recordings", type=int, default=1000, help="most joint files of a person and activity"
    )
    options = parser.parse_args()
    out = options.out
    if not options.no_build:
        build(out, options.only and options.only.split(","), options.recordings)
    if options.only:
        return 0
    actors = Merged(out / "actors")
    recorded = recordings(out)
    print("balanced accuracy of windows, of recordings (95 % over people)")
    parts = {
        "axes": lambda: one_axis(actors, recorded),
        "shipped": lambda: shipped(recorded, "few channels"),
        "channels": lambda: shipped(recordings(out, "_all_channels"), "96 channels"),
        "learnt": lambda: to_recorded(actors, recorded, options.seeds),
        "people": lambda: people_left_out(actors, recorded),
        "curve": lambda: learning_curve(actors, recorded),
        "networks": lambda: people_left_out_of_networks(actors, recorded),
        "others": lambda: others(out),
    }
    for name in options.measure.split(",") if options.measure else parts:
        parts[name]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
