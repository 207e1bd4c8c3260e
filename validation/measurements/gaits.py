"""Six gaits of recorded people by four fidelity levels: does ray tracing matter where it is hard?

    RTRADAR_JOINTS=folder python validation/measurements/gaits.py OUT [--conditions | --quick]
        [--no-build]

With ``--conditions`` the level is the same and the room, the radar or the noise differs; what
stands still is removed from all.

Recorded walkers of `RTRADAR_JOINTS` walk as they are used to and as people with five complaints do.
Each stretch is simulated by each level from the same instant, with the same noise, for the radar of
few channels. Each person is left out in turn; the classifier learns from the others by one level
and is asked about the person by every level. Windows are described as by `rtradar predict`.

Intervals are over people, who are drawn with replacement. Two levels are compared person by person,
and the smallest difference that could have been seen is that which a two-sided test at 5 % finds in
80 % of such experiments, with the spread that the differences between people have.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from people import answers_of, both, described
from people_data import long_enough
from scipy.stats import t as student
from sklearn.metrics import confusion_matrix

from rtradar.classify.outcomes import Answers, balanced_accuracy, interval
from rtradar.classify.study import classes_of
from rtradar.clouds.collection import Collection

DATA_SETS = Path(__file__).resolve().parents[1]


class Condition(NamedTuple):
    """By which level, where, by which radar and with how much noise stretches are simulated."""

    level: str
    scene: str = "free-space"
    radar: str = "few_channels.toml"
    snr_db: float = 20.0
    clutter_removal: str = "none"


LEVELS = {level: Condition(level) for level in ("analytic-paper", "analytic", "specular")}
SAME = Condition("specular", clutter_removal="mean")
CONDITIONS = {
    "living-room": SAME._replace(scene="living-room"),
    "iwr6843": SAME._replace(radar="iwr6843"),
    "10-db": SAME._replace(snr_db=10.0),
    "free-space": SAME,
}
"""By name of the data set; the last one is compared with the others."""

STRETCHES = 3
"""Recordings of each person and gait that are used; they are spread over those that there are."""

HEAD = """
seed = 0
folder = "${{RTRADAR_JOINTS}}"
clutter_removal = "{clutter_removal}"
[windows]
duration_s = 1.6
place = "random"
[each]
radar = ["{radar}"]
scene = ["{scene}"]
fidelity = ["{level}"]
[drawn]
snr_db = [{snr_db}, {snr_db}]
"""


def specification(folder: Path, condition: Condition, stretches: int) -> str:
    """Data set of all gaits in one condition."""
    rows = [
        row
        for row in csv.DictReader((folder / "MANIFEST.csv").open())
        if row["dataset"] == "gait" and long_enough(folder / row["file"])
    ]
    counts = Counter((row["person"], row["activity"]) for row in rows)
    text, seen = HEAD.format(**condition._asdict()), Counter[tuple[str, str]]()
    for row in rows:
        key = row["person"], row["activity"]
        step = max(counts[key] // stretches, 1)
        if seen[key] % step == 0 and seen[key] // step < stretches:
            text += (
                f'[[recordings]]\nfile = "{row["file"]}"\nlabel = "{row["activity"]}"\n'
                f'subject = "{row["person"]}"\nlicence = "see its folder"\n'
            )
        seen[key] += 1
    return text


def build(out: Path, stretches: int, conditions: dict[str, Condition]) -> None:
    """Build the data sets that are not complete."""
    out.mkdir(parents=True, exist_ok=True)
    few = "few_channels.toml"
    (out / few).write_bytes((DATA_SETS / few).read_bytes())
    for name, condition in conditions.items():
        spec = out / f"{name}.toml"
        spec.write_text(specification(Path(os.environ["RTRADAR_JOINTS"]), condition, stretches))
        words = ["dataset", "build", str(spec), "--out", str(out / name), "--workers", "1"]
        subprocess.run([sys.executable, "-m", "rtradar", *words], check=True)


def transferred(sets: dict[str, Collection]) -> dict[tuple[str, str], Answers]:
    """Leave each person out, learn by one level, and ask by every level."""
    orders = {level: np.argsort(clouds.column("recording")) for level, clouds in sets.items()}
    features = {level: described(clouds)[orders[level]] for level, clouds in sets.items()}
    level, first = next(iter(sets.items()))
    truth = classes_of(first)[1][orders[level]]
    people = first.column("subject").astype(str)[orders[level]]
    found = {}
    for learnt in sets:
        chances = {asked: np.zeros((len(truth), truth.max() + 1)) for asked in sets}
        for person in np.unique(people):
            own = people == person
            model = both().fit(features[learnt][~own], truth[~own])
            for asked in sets:
                chances[asked][own] = model.predict_proba(features[asked][own])
        for asked, clouds in sets.items():
            of_all = classes_of(clouds)[1]
            found[learnt, asked] = answers_of(clouds, chances[asked], of_all, orders[asked])
    return found


def by_person(answers: Answers) -> NDArray[np.float64]:
    """Balanced accuracy of each person, (person,)."""
    return np.array(
        [
            balanced_accuracy(Answers(*(column[answers.subjects == person] for column in answers)))
            for person in np.unique(answers.subjects)
        ]
    )


def compared(one: Answers, other: Answers) -> str:
    """Say by how much more is known of the one than of the other, person by person."""
    apart = by_person(one) - by_person(other)
    error, free = apart.std(ddof=1) / np.sqrt(len(apart)), len(apart) - 1
    sure, likely = student.ppf([0.975, 0.8], free)
    return (
        f"{100 * apart.mean():+5.1f} points ({100 * (apart.mean() - sure * error):+.1f} to "
        f"{100 * (apart.mean() + sure * error):+.1f}); "
        f"{100 * (sure + likely) * error:.1f} could have been seen"
    )


def report(found: dict[tuple[str, str], Answers], names: tuple[str, ...]) -> None:
    """Print the accuracies of all pairs of levels, and the levels compared with the last one."""
    levels = list(dict.fromkeys(learnt for learnt, _ in found))
    for level in levels:
        answers = found[level, level]
        low, high = interval(answers)
        each = ", ".join(f"{100 * one:.0f}" for one in by_person(answers))
        print(
            f"{level:16} {balanced_accuracy(answers):6.1%} ({low:.1%} to {high:.1%}); "
            f"by person {each}"
        )
    print("learnt from (down), asked about (across)", *levels)
    for learnt in levels:
        known = [f"{balanced_accuracy(found[learnt, asked]):6.1%}" for asked in levels]
        print(f"{learnt:16}", *known)
    best = levels[-1]
    for level in levels[:-1]:
        print(f"{level} less {best}: {compared(found[level, level], found[best, best])}")
        print(
            f"learnt by {level}, asked by {best}, less learnt by {best}: "
            f"{compared(found[level, best], found[best, best])}"
        )
    answers = found[best, best]
    print(names, confusion_matrix(answers.truth, answers.probabilities.argmax(axis=1)), sep="\n")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT", help="folder of data sets")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--quick", action="store_true", help="one stretch each, by formulas alone")
    which.add_argument("--conditions", action="store_true", help="rooms, radars and noise")
    parser.add_argument("--no-build", action="store_true", help="measure what is there")
    options = parser.parse_args()
    conditions = CONDITIONS if options.conditions else LEVELS
    if options.quick:
        conditions = {name: LEVELS[name] for name in ("analytic-paper", "analytic")}
    if not options.no_build:
        build(options.out, 1 if options.quick else STRETCHES, conditions)
    sets = {name: Collection(options.out / name) for name in conditions}
    asked = [sorted(clouds.column("recording").tolist()) for clouds in sets.values()]
    if any(some != asked[0] for some in asked):
        raise SystemExit("the data sets have not the same recordings; build them to the end")
    names, truth = classes_of(next(iter(sets.values())))
    print(
        f"{len(truth)} stretches; balanced accuracy, chance {1 / len(names):.1%}, 95 % over people"
    )
    report(transferred(sets), names)
    return 0


if __name__ == "__main__":
    sys.exit(main())
