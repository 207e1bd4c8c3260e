"""Who learns from what and is asked about what: training and test sets that never share a moment of a recording.

Clouds of one interval (another radar, seed, scene or fidelity), or of intervals that overlap, show the same motion: a network
that has learnt the one has seen the other. Every scheme keeps them together, and every split is checked for it before it is
handed out.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.classify.source import Clouds
from rtradar.errors import InputError
from rtradar.system.seeds import word

SCHEMES = ("folds", "recording", "subject", "recorded", "across:COLUMN")
"""Folds over clouds (the paper's), recordings, subjects; synthetic to recorded; each value of a column to every other."""

_ACROSS = "across:"
_MOST_FOLDS = {"folds": 10, "recording": 10, "subject": 10, _ACROSS: 5}


@dataclass(frozen=True)
class Split:
    """One training and its test.

    Parameters
    ----------
    name : str
        For tables.
    train, test : (n,) int64
        Indices of clouds, ascending.
    trained_on : str
        Value of the column that the training clouds share; empty but in ``across``.
    """

    name: str
    train: NDArray[np.int64]
    test: NDArray[np.int64]
    trained_on: str = ""


def make_splits(
    clouds: Clouds, scheme: str, *, folds: int | None = None, seed: int = 0
) -> list[Split]:
    """All splits of a scheme.

    Parameters
    ----------
    clouds : Clouds
        Only labels and provenance are read.
    scheme : str
        ``folds``: the paper's, stratified over clouds. ``recording``, ``subject``: each recording or subject on one side only.
        ``recorded``: learn from synthetic motion, be asked about recorded. ``across:COLUMN`` (or ``across:A,B``): for every value
        of the column(s) and every fold over recordings, learn from the clouds of that value and be asked about the clouds of all
        values, of other recordings.
    folds : int, optional
        At least 2; default 10 (``across``: 5), or as many as there are groups in the class with the fewest.
    seed : int
        Of the shuffling.

    Returns
    -------
    list of Split
        Stratified as far as the groups allow (scikit-learn's StratifiedGroupKFold).

    Raises
    ------
    InputError
        Where the scheme is unknown, there are too few groups, or a class to be asked about is never learnt.
    """
    moments, recordings = moments_of(clouds), recordings_of(clouds)
    if scheme == "recorded":
        splits = _synthetic_to_recorded(clouds)
    elif scheme.startswith(_ACROSS):
        values = values_of(clouds, scheme)
        parts = _folds(clouds, "recording", recordings, folds, _MOST_FOLDS[_ACROSS], seed)
        splits = [
            Split(
                f"{value}, fold {number}", part.train[values[part.train] == value], part.test, value
            )
            for value in np.unique(values).tolist()
            for number, part in enumerate(parts, start=1)
        ]
    elif scheme in _MOST_FOLDS:
        groups = (
            moments
            if scheme == "folds"
            else recordings
            if scheme == "recording"
            else _numbered(clouds.column(scheme))
        )
        splits = _folds(clouds, scheme, groups, folds, _MOST_FOLDS[scheme], seed)
    else:
        raise InputError(f"split '{scheme}' is unknown; give one of {', '.join(SCHEMES)}")
    for split in splits:
        check(split, moments, clouds.labels)
    return splits


def values_of(clouds: Clouds, scheme: str) -> NDArray[np.str_]:
    """Value of the column(s) that ``across:...`` names, for every cloud, (cloud,); empty strings for other schemes."""
    if not scheme.startswith(_ACROSS):
        return np.full(len(clouds), "")
    names = [name.strip() for name in scheme.removeprefix(_ACROSS).split(",")]
    columns = [_column(clouds, name) for name in names]
    return np.array([" / ".join(str(value) for value in row) for row in zip(*columns, strict=True)])


def moments_of(clouds: Clouds) -> NDArray[np.int64]:
    """A number for every cloud, (cloud,), the same for clouds whose intervals of one recording are the same or overlap."""
    recording = recordings_of(clouds)
    start = clouds.column("start_s").astype(np.float64)
    end = start + clouds.column("duration_s").astype(np.float64)
    moments = np.zeros(len(clouds), dtype=np.int64)
    number, last, begun, until = -1, -1, -np.inf, -np.inf
    for index in np.lexsort((start, recording)):
        # The same start is the same interval even where it has no length.
        if recording[index] != last or not (start[index] < until or start[index] == begun):
            number, last, until = number + 1, recording[index], -np.inf
        begun, until = start[index], max(until, end[index])
        moments[index] = number
    return moments


def recordings_of(clouds: Clouds) -> NDArray[np.int64]:
    """A number for every cloud, (cloud,), the same for clouds of one recording: one file has several names in several folders."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    names = _numbered(clouds.column("recording"))
    try:
        contents = clouds.column("recording_digest").astype(str)
    except (KeyError, InputError):  # of none of them
        return names
    # Those that share a name or a content, or share one of them with others that do.
    known = np.flatnonzero((contents != "") & (contents != "None"))
    ends = names.max() + 1 + np.unique(contents[known], return_inverse=True)[1]
    n_nodes = names.max() + 1 + len(known)
    links = coo_array((np.ones(len(known)), (names[known], ends)), shape=(n_nodes, n_nodes))
    return np.asarray(connected_components(links, directed=False)[1][names], dtype=np.int64)


def check(split: Split, moments: NDArray[np.int64], labels: NDArray[np.str_]) -> None:
    """Raise where a split is not one: a side is empty, a moment is on both, or a class is asked about that was not learnt."""
    if not len(split.train) or not len(split.test):
        side = "training" if not len(split.train) else "test"
        raise InputError(
            f"split '{split.name}' has no {side} clouds; give fewer folds, or another split"
        )
    both = np.intersect1d(moments[split.train], moments[split.test])
    if both.size:
        index = split.train[np.isin(moments[split.train], both)][0]
        raise InputError(
            f"split '{split.name}': {both.size} intervals are on both sides, the first is that of cloud {index}; "
            "take care that a recording has one subject and one source"
        )
    if unknown := sorted(set(labels[split.test].tolist()) - set(labels[split.train].tolist())):
        raise InputError(
            f"split '{split.name}': no training cloud shows {', '.join(unknown)}; give fewer folds, or add recordings of it"
        )


def _synthetic_to_recorded(clouds: Clouds) -> list[Split]:
    source = _column(clouds, "source").astype(str)
    known = {name: np.flatnonzero(source == name) for name in ("synthetic", "recorded")}
    if lacking := [name for name, those in known.items() if not len(those)]:
        raise InputError(
            f"split 'recorded': no cloud has source '{lacking[0]}'; build a data set of synthetic and recorded motion"
        )
    return [Split("synthetic to recorded", known["synthetic"], known["recorded"])]


def _folds(
    clouds: Clouds, what: str, groups: NDArray[np.int64], folds: int | None, most: int, seed: int
) -> list[Split]:
    from sklearn.model_selection import StratifiedGroupKFold

    labels = clouds.labels
    largest = min(len(np.unique(groups)), int(np.unique(labels, return_counts=True)[1].max()))
    fewest = min(
        (len(np.unique(groups[labels == label])), label) for label in np.unique(labels).tolist()
    )
    if folds is not None and not 2 <= folds <= max(2, largest):
        raise InputError(
            f"--folds {folds}: split '{what}' of these clouds can have 2 to {max(2, largest)}"
        )
    if fewest[0] < 2:
        raise InputError(
            f"split '{what}': {fewest[1]} has one independent group of clouds; it takes two, to learn and to be asked"
        )
    n_folds = min(most, fewest[0]) if folds is None else folds
    # scikit-learn counts clouds where groups count, and would warn or refuse: said above in groups.

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="The least populated class", category=UserWarning)
        parts = list(
            StratifiedGroupKFold(n_folds, shuffle=True, random_state=word(seed)).split(
                labels, labels, groups
            )
        )
    return [
        Split(f"fold {number}", np.sort(train).astype(np.int64), np.sort(test).astype(np.int64))
        for number, (train, test) in enumerate(parts, start=1)
    ]


def _numbered(column: NDArray[Any]) -> NDArray[np.int64]:
    """Groups by the values of a column, as numbers."""
    return np.unique(column.astype(str), return_inverse=True)[1].astype(np.int64)


def _column(clouds: Clouds, name: str) -> NDArray[Any]:
    try:
        return np.asarray(clouds.column(name))
    except KeyError:
        raise InputError(
            f"the clouds have no column '{name}' in their provenance; see index of the data set"
        ) from None


def chosen(splits: Sequence[Split], numbers: Sequence[int] | None) -> list[int]:
    """Places of the splits that are asked for by number, from 1; all of them without."""
    if numbers is None:
        return list(range(len(splits)))
    if wrong := [number for number in numbers if not 1 <= number <= len(splits)]:
        raise InputError(
            f"--fold {wrong[0]}: there are {len(splits)} trainings; give 1 to {len(splits)}"
        )
    return sorted({number - 1 for number in numbers})
