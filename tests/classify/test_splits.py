from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rtradar.classify.splits import (
    Split,
    check,
    chosen,
    intervals_of,
    make_splits,
    recordings_of,
    subjects_of,
    values_of,
)
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError


class Table(Collection):
    """Labels and provenance alone."""

    def __init__(self, rows: list[dict[str, Any]]) -> None:
        self._name = "of rows"
        self._about = [{"label": row["label"], "provenance": row} for row in rows]

    def __len__(self) -> int:
        return len(self._about)

    def points(self, index: int) -> NDArray[np.float64]:
        raise AssertionError("a split reads no clouds")

    spatial = points


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """Recordings of one subject, label and source each; intervals may be equal or overlap."""
    rows = []
    for number in range(draw(st.integers(4, 14))):
        choices = {
            "label": ["kick", "walk"],
            "subject": "abcd",
            "source": ["synthetic", "recorded"],
        }
        recording = {name: draw(st.sampled_from(some)) for name, some in choices.items()}
        recording["recording"] = f"recording-{number}"
        for _ in range(draw(st.integers(1, 4))):
            choices = {"start_s": [0.0, 0.5, 1.0, 2.0], "duration_s": [0.5, 1.0]}
            interval = {name: draw(st.sampled_from(some)) for name, some in choices.items()}
            models = st.sampled_from(["analytic", "specular"])
            seen_by = draw(st.lists(models, min_size=1, max_size=3))
            rows += [recording | interval | {"fidelity": fidelity} for fidelity in seen_by]
    return Table(draw(st.permutations(rows)))


@pytest.mark.parametrize("scheme", ["folds", "recording", "across:fidelity"])
def test_a_recording_of_several_names_is_one_recording(scheme: str) -> None:
    def row(name: str, content: str, label: str) -> dict[str, Any]:
        told = {"recording": name, "recording_digest": content, "label": label}
        return told | {"fidelity": "specular", "start_s": 0.0, "duration_s": 1.0}

    rows = []
    for label in ("kick", "walk"):
        for number in range(4):
            # The same file in two data sets, of which each names it from a folder of its own, and
            # once with another skeleton.
            one, other = f"{label}/{number}.amc", f"{number}-{label}.amc"
            content = f"{label}{number}"
            rows += [row(one, content, label), row(other, content, label)]
            rows += [row(other, f"{content} and another .asf", label)]
        rows += [row(f"synthetic:{label}:{number}", "", label) for number in range(4)]
    table = Table(rows)
    assert len(set(recordings_of(table).tolist())) == 2 * (4 + 4)
    for split in make_splits(table, scheme, folds=4):
        sides = (split.train, split.test)
        train, test = (
            {rows[k]["recording_digest"].partition(" ")[0] for k in one} for one in sides
        )
        assert train & test <= {""}  # actors have none


def test_recordings_of_one_name_each_are_numbered_by_their_names() -> None:
    # Folds follow from the numbers: trainings that are gone on with shall find those that they
    # began with.
    names = np.random.default_rng(0).permutation([f"{number}.amc" for number in range(40)] * 3)
    told = {"label": "walk"}
    rows = [told | {"recording": n, "recording_digest": n[::-1]} for n in names.tolist()]
    assert recordings_of(Table(rows)).tolist() == np.unique(names, return_inverse=True)[1].tolist()


@pytest.mark.slow
@given(
    table=tables(),
    scheme=st.sampled_from(["folds", "recording", "subject", "recorded", "across:fidelity"]),
    folds=st.sampled_from([None, 2, 3]),
    seed=st.integers(0, 5),
)
def test_no_moment_of_a_recording_is_on_both_sides(
    table: Table, scheme: str, folds: int | None, seed: int
) -> None:
    try:
        splits = make_splits(table, scheme, folds=folds, seed=seed)
    except InputError:
        return  # too few recordings for it, and said so
    recording, start = table.column("recording"), table.column("start_s")
    end = start + table.column("duration_s")
    kept_apart = {"subject": "subject", "recording": "recording", "recorded": "source"}
    for split in splits:
        assert not set(split.train) & set(split.test)
        for one in split.train:
            same = split.test[recording[split.test] == recording[one]]
            assert not ((start[same] < end[one]) & (start[one] < end[same])).any()
        if scheme in kept_apart:
            column = table.column(kept_apart[scheme])
            assert not set(column[split.train]) & set(column[split.test])
        if scheme == "across:fidelity":
            assert set(table.column("fidelity")[split.train]) == {split.trained_on}
            assert not set(recording[split.train]) & set(recording[split.test])
    if scheme not in ("recorded", "across:fidelity"):
        asked = np.concatenate([split.test for split in splits])
        assert sorted(asked.tolist()) == list(range(len(table)))


def test_the_papers_folds_are_stratified(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=100)
    splits = make_splits(clouds, "folds")
    assert [len(split.test) for split in splits] == [30] * 10
    for split in splits:
        assert set(Counter(clouds.labels[split.test].tolist()).values()) == {10}


def test_the_seed_decides(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=20)
    first, again, other = (
        [split.test.tolist() for split in make_splits(clouds, "folds", seed=seed)]
        for seed in (1, 1, 2)
    )
    assert first == again != other


def test_across_learns_from_every_value_and_asks_about_all(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=6, views=2)
    splits = make_splits(clouds, "across:fidelity", folds=3)
    assert [split.trained_on for split in splits] == ["analytic"] * 3 + ["specular"] * 3
    fidelity = clouds.column("fidelity")
    assert all(set(fidelity[split.test]) == {"analytic", "specular"} for split in splits)
    asked = [split.test.tolist() for split in splits]
    assert asked[:3] == asked[3:]
    both = {"analytic / free-space", "specular / free-space"}
    assert set(values_of(clouds, "across:fidelity,scene")) == both


def test_intervals_that_overlap_are_one_moment() -> None:
    rows = [
        {"recording": name, "start_s": start, "duration_s": 1.0, "label": "walk"}
        for name, start in [("a", 0.0), ("b", 0.0), ("a", 0.9), ("a", 1.8), ("a", 2.8), ("a", 0.0)]
    ]
    moments = intervals_of(Table(rows))
    assert moments[0] == moments[2] == moments[3] == moments[5]
    assert len({moments[0], moments[1], moments[4]}) == 3


def test_a_leak_is_never_handed_out() -> None:
    split = Split("fold 1", np.array([0, 1]), np.array([2, 3]))
    labels = np.array(["walk"] * 4)
    check(split, np.array([0, 1, 2, 3]), labels)
    with pytest.raises(InputError, match=r"1 intervals are on both sides, the first .* of cloud 1"):
        check(split, np.array([0, 2, 2, 3]), labels)
    with pytest.raises(InputError, match="no training cloud shows kick"):
        check(split, np.arange(4), np.array(["walk", "walk", "kick", "walk"]))
    with pytest.raises(InputError, match="no test clouds"):
        check(Split("fold 1", np.array([0]), np.array([], dtype=np.int64)), np.arange(4), labels)


def test_one_source_cannot_be_split_by_source() -> None:
    row = {"recording": "a", "start_s": 0.0, "duration_s": 1.0, "label": "walk"}
    row |= {"source": "synthetic"}
    with pytest.raises(InputError, match="no cloud has source 'recorded'"):
        make_splits(Table([row]), "recorded")


def test_trainings_are_chosen_by_number(made_up: Callable[..., Any]) -> None:
    splits = make_splits(made_up(), "folds", folds=3)
    assert chosen(splits, None) == [0, 1, 2]
    assert chosen(splits, [3, 1, 3]) == [0, 2]
    with pytest.raises(InputError, match="--fold 4: there are 3"):
        chosen(splits, [4])


def test_a_recording_of_nobody_known_counts_as_somebody_of_its_own() -> None:
    rows = [
        {"label": label, "subject": subject, "recording": f"{label}-{number}", "start_s": start_s,
         "duration_s": 1.0}
        for label in ("kick", "walk")
        for number, subject in enumerate(("unknown", "unknown", "her", "her"))
        for start_s in (0.0, 2.0)
    ]  # fmt: skip
    groups = subjects_of(Table(rows)).reshape(2, 4, 2)
    assert (groups[..., 0] == groups[..., 1]).all()  # both intervals of a recording
    assert len(np.unique(groups[:, :2])) == 4
    assert len(np.unique(groups[:, 2:])) == 1
    assert len(make_splits(Table(rows), "subject", folds=2)) == 2
