"""What each ingredient of the recognition of activities brings, one changed at a time.

    python validation/measurements/ingredients.py OUT

OUT is the folder of data sets that `people.py OUT` has built. Each row is what is known of the
recordings by a classifier that learns from actors alone, and by one that learns from the other
recorded people with the actors beside. For the latter, three people are left out at a time. The
descriptions and the models were chosen on such rows, so the last point or two of the best ones are
luck; `people.py` has a model that is chosen on the others.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from people import Merged, answers_of, both, forest, left_out, linear, windows_of

from rtradar.classify.outcomes import balanced_accuracy
from rtradar.classify.prepare import PHYSICAL_SCALES, for_training, stack_clouds
from rtradar.classify.splits import subjects_of
from rtradar.classify.study import classes_of
from rtradar.clouds.collection import Collection
from rtradar.recognition.recogniser import describe, envelopes, occupancy, outline

Numbers = NDArray[np.float64]
GROUPS = 13
"""Groups of people, three in each, of which one is left out at a time."""

COPIES = 2
"""Varied copies of each cloud of an actor."""


class Table:
    """Recordings that are asked about, and rows that are printed."""

    def __init__(self, recorded: Collection) -> None:
        self.recorded, self.windows = recorded, windows_of(recorded)
        self.names, self.truth = classes_of(recorded)
        people = subjects_of(recorded)
        order = np.random.default_rng(0).permutation(people.max() + 1)
        self.groups = order[people] % GROUPS

    def row(
        self,
        title: str,
        describing: Callable[[Numbers], Numbers],
        make: Callable[[], Any],
        actors: list[Numbers],
        learnt: NDArray[np.int64],
    ) -> None:
        """Print what is known from actors, and from people with actors, by cloud and recording."""
        asked, x = (np.array([describing(one) for one in some]) for some in (self.windows, actors))
        alone = make().fit(x, learnt).predict_proba(asked)
        beside = left_out(asked, self.truth, self.groups, make, (x, learnt))
        figures = []
        for chances in (alone, beside):
            answers = answers_of(self.recorded, chances, self.truth)
            figures += [balanced_accuracy(answers), balanced_accuracy(answers.by_recording())]
        shown = "".join(f"{figure:9.1%}" for figure in figures)
        print(f"{title:58}{shown}", flush=True)


def parts(*some: Callable[[Numbers], Numbers]) -> Callable[[Numbers], Numbers]:
    """Join descriptions."""
    return lambda window: np.concatenate([one(window) for one in some])


def varied(actors: Collection, seed: int = 0) -> list[Numbers]:
    """Vary the clouds of the actors as the recipe `small` does; return all copies."""
    torch.manual_seed(seed)
    stacked = stack_clouds(actors, edge_s=0.1)[:, :1500]
    return [
        cloud.numpy().astype(np.float64) * PHYSICAL_SCALES
        for _ in range(COPIES)
        for cloud in for_training(stacked, "wide", "physical")
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT", help="folder of data sets")
    out = parser.parse_args().out
    actors = Merged(out / "actors")
    table = Table(Collection(out / "mocap", out / "joints"))
    windows, (_, learnt) = windows_of(actors), classes_of(actors)
    raw = Collection(out / "actors").labels
    print(f"{'balanced accuracy by':58}    cloud recording cloud recording")
    print(f"{'learnt from':58}       actors        people and actors")
    for title, describing in (
        ("outline, forest: as before", outline),
        ("envelopes alone", envelopes),
        ("occupancy alone", occupancy),
        ("outline and envelopes", parts(outline, envelopes)),
        ("outline and occupancy", parts(outline, occupancy)),
        ("all three, forest: the weights of the package", describe),
    ):
        table.row(title, describing, forest, windows, learnt)
    for title, make in (("all three, linear", linear), ("all three, both", both)):
        table.row(title, describe, make, windows, learnt)
    half = subjects_of(actors) % 2 == 0
    for title, kept in (("half of the actors", half), ("no boxing actors", raw != "boxing")):
        some = [window for window, keep in zip(windows, kept, strict=True) if keep]
        table.row(f"all three, both, {title}", describe, both, some, learnt[kept])
    more = [*windows, *varied(actors)]
    title = f"all three, both, {COPIES} varied copies of each actor beside"
    table.row(title, describe, both, more, np.tile(learnt, 1 + COPIES))
    return 0


if __name__ == "__main__":
    sys.exit(main())
