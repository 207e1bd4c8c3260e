"""Splits into training and test sets that never share an interval of a recording.

Clouds of one interval (for another radar, seed, scene or fidelity), or of overlapping intervals,
show the same motion, so that a test on one of them is biased if another was used for training.
Every scheme keeps them together, and every split is checked for this before it is returned.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds.collection import Collection
from rtradar.clouds.sample_files import UNKNOWN
from rtradar.errors import InputError
from rtradar.system.seeds import word

SCHEMES = (
    "folds", "recording", "subject", "leave-one-subject-out", "recorded", "across:COLUMN"
)  # fmt: skip
"""Schemes: folds over clouds (the paper's), recordings or subjects; recorded; across a column."""

_ACROSS = "across:"
_MAX_FOLDS = {"folds": 10, "recording": 10, "subject": 10, _ACROSS: 5}


@dataclass(frozen=True)
class Split:
    """Training and test clouds of one training.

    Parameters
    ----------
    name : str
        Name of the split in tables.
    train, test : (n,) int64
        Indices of the clouds, ascending.
    trained_on : str
        Column value of the training clouds in the scheme ``across``, otherwise empty.
    """

    name: str
    train: NDArray[np.int64]
    test: NDArray[np.int64]
    trained_on: str = ""


def make_splits(
    clouds: Collection, scheme: str, *, folds: int | None = None, seed: int = 0
) -> list[Split]:
    """Make all splits of a scheme.

    Parameters
    ----------
    clouds : Collection
        Labelled clouds, of which only labels and provenance are read.
    scheme : str
        Scheme of the splits. ``folds``: the paper's, stratified over clouds. ``recording``,
        ``subject``: each recording or subject is on one side only; a recording whose subject is
        ``unknown`` counts as a subject of its own. ``leave-one-subject-out``: test on one recorded
        person after the other, train on all others and on all actors; if there are no recordings,
        test on one actor after the other. ``recorded``: train on synthetic motion, test on recorded
        motion. ``across:COLUMN`` (or ``across:A,B``): for every value of the column(s) and every
        fold over recordings, train on the clouds of that value, test on clouds of all values from
        other recordings.
    folds : int, optional
        Number of folds, at least 2. The default is 10 (``across``: 5), or the number of groups in
        the class with the fewest.
    seed : int
        Seed of the shuffling.

    Returns
    -------
    list of Split
        Splits, stratified as far as the groups allow (scikit-learn's StratifiedGroupKFold).

    Raises
    ------
    InputError
        If the scheme is unknown, there are too few groups, or a test class has no training cloud.
    """
    intervals, recordings = intervals_of(clouds), recordings_of(clouds)
    if scheme == "recorded":
        splits = [_synthetic_to_recorded(clouds)]
    elif scheme == "leave-one-subject-out":
        splits = _each_left_out(clouds)
    elif scheme.startswith(_ACROSS):
        values = values_of(clouds, scheme)
        parts = _folds(clouds, "recording", recordings, folds, _MAX_FOLDS[_ACROSS], seed)
        splits = [
            Split(
                f"{value}, {part.name}", part.train[values[part.train] == value], part.test, value
            )
            for value in np.unique(values).tolist()
            for part in parts
        ]
    elif scheme in _MAX_FOLDS:
        groups = {"folds": intervals, "recording": recordings}.get(scheme)
        if groups is None:
            groups = subjects_of(clouds)
        splits = _folds(clouds, scheme, groups, folds, _MAX_FOLDS[scheme], seed)
    else:
        raise InputError(f"split '{scheme}' is unknown; give one of {', '.join(SCHEMES)}")
    for split in splits:
        check(split, intervals, clouds.labels)
    return splits


def values_of(clouds: Collection, scheme: str) -> NDArray[np.str_]:
    """Return the value that ``across:...`` compares, (cloud,); empty strings for other schemes."""
    if not scheme.startswith(_ACROSS):
        return np.full(len(clouds), "")
    names = [name.strip() for name in scheme.removeprefix(_ACROSS).split(",")]
    columns = [clouds.column(name) for name in names]
    return np.array([" / ".join(str(value) for value in row) for row in zip(*columns, strict=True)])


def intervals_of(clouds: Collection) -> NDArray[np.int64]:
    """Number the groups of clouds of equal or overlapping intervals of a recording, (cloud,)."""
    import pandas as pd  # slow to import

    start, length = (clouds.column(name).astype(float) for name in ("start_s", "duration_s"))
    given = {"recording": recordings_of(clouds), "start": start, "end": start + length}
    table = pd.DataFrame(given).sort_values(["recording", "start"], kind="stable")
    each = table.groupby("recording")
    until = each["end"].cummax().groupby(table["recording"]).shift(fill_value=-np.inf)
    # Intervals with the same start are the same even if they have no length.
    begins = (table["start"] >= until) & (table["start"] != each["start"].shift())
    return (begins.cumsum() - 1).sort_index().to_numpy(np.int64)


def recordings_of(clouds: Collection) -> NDArray[np.int64]:
    """Number the recordings, (cloud,); one file may have several names in several folders."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    names = _numbered(clouds.column("recording"))
    try:
        contents = clouds.column("recording_digest").astype(str)
    except InputError:  # no sample has a digest
        return names
    # Clouds belong together if a chain of equal names or equal contents connects them.
    known = np.flatnonzero((contents != "") & (contents != "None"))
    ends = names.max() + 1 + np.unique(contents[known], return_inverse=True)[1]
    n_nodes = names.max() + 1 + len(known)
    links = coo_array((np.ones(len(known)), (names[known], ends)), shape=(n_nodes, n_nodes))
    return np.asarray(connected_components(links, directed=False)[1][names], dtype=np.int64)


def subjects_of(clouds: Collection) -> NDArray[np.int64]:
    """Number the subjects, (cloud,); each recording of an unknown one counts as somebody else."""
    subjects = clouds.column("subject").astype(str)
    alone = [f"recording {number}" for number in recordings_of(clouds)]
    return _numbered(np.where(subjects == UNKNOWN, alone, subjects))


def check(split: Split, intervals: NDArray[np.int64], labels: NDArray[np.str_]) -> None:
    """Raise InputError if a side is empty, an interval is on both, or a test class is new."""
    if not len(split.train) or not len(split.test):
        side = "training" if not len(split.train) else "test"
        raise InputError(
            f"split '{split.name}' has no {side} clouds; give fewer folds, or another split"
        )
    both = np.intersect1d(intervals[split.train], intervals[split.test])
    if both.size:
        index = split.train[np.isin(intervals[split.train], both)][0]
        raise InputError(
            f"split '{split.name}': {both.size} intervals are on both sides, "
            f"the first is that of cloud {index}; "
            "take care that a recording has one subject and one source"
        )
    if unknown := sorted(set(labels[split.test].tolist()) - set(labels[split.train].tolist())):
        raise InputError(
            f"split '{split.name}': no training cloud shows {', '.join(unknown)}; "
            "give fewer folds, or add recordings of it"
        )


def _synthetic_to_recorded(clouds: Collection) -> Split:
    source = clouds.column("source").astype(str)
    known = {name: np.flatnonzero(source == name) for name in ("synthetic", "recorded")}
    if lacking := [name for name, those in known.items() if not len(those)]:
        raise InputError(
            f"split 'recorded': no cloud has source '{lacking[0]}'; "
            "build a data set of synthetic and recorded motion"
        )
    return Split("synthetic to recorded", known["synthetic"], known["recorded"])


def _each_left_out(clouds: Collection) -> list[Split]:
    subjects, source = subjects_of(clouds), clouds.column("source").astype(str)
    asked = source == "recorded" if (source == "recorded").any() else np.full(len(source), True)
    names, index = clouds.column("subject").astype(str), np.arange(len(clouds))
    return [
        Split(f"{names[subjects == one][0]}", index[subjects != one], index[subjects == one])
        for one in np.unique(subjects[asked])
    ]


def _folds(
    clouds: Collection,
    what: str,
    groups: NDArray[np.int64],
    folds: int | None,
    most: int,
    seed: int,
) -> list[Split]:
    from sklearn.model_selection import StratifiedGroupKFold

    labels = clouds.labels
    names, counts = np.unique(labels, return_counts=True)
    largest = min(len(np.unique(groups)), int(counts.max()))
    fewest = min((len(np.unique(groups[labels == name])), name) for name in names.tolist())
    if folds is not None and not 2 <= folds <= max(2, largest):
        raise InputError(
            f"--folds {folds}: split '{what}' of these clouds can have 2 to {max(2, largest)}"
        )
    if fewest[0] < 2:
        raise InputError(
            f"split '{what}': {fewest[1]} has one independent group of clouds; "
            "it takes two, to learn and to be asked"
        )
    n_folds = min(most, fewest[0]) if folds is None else folds
    # scikit-learn warns about the number of clouds, but groups count, which are checked above.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="The least populated class", category=UserWarning)
        maker = StratifiedGroupKFold(n_folds, shuffle=True, random_state=word(seed))
        parts = list(maker.split(labels, labels, groups))
    return [
        Split(f"fold {number}", np.sort(train).astype(np.int64), np.sort(test).astype(np.int64))
        for number, (train, test) in enumerate(parts, start=1)
    ]


def _numbered(column: NDArray[Any]) -> NDArray[np.int64]:
    """Number the groups of equal values of a column."""
    return np.unique(column.astype(str), return_inverse=True)[1].astype(np.int64)


def chosen(splits: Sequence[Split], numbers: Sequence[int] | None) -> list[int]:
    """Return the indices of the splits with these numbers, from 1; of all splits for None."""
    if numbers is None:
        return list(range(len(splits)))
    if wrong := [number for number in numbers if not 1 <= number <= len(splits)]:
        raise InputError(
            f"--fold {wrong[0]}: there are {len(splits)} trainings; give 1 to {len(splits)}"
        )
    return sorted({number - 1 for number in numbers})
