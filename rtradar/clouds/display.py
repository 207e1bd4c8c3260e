"""What a data set shows of itself: its samples, activities and the settings they were made with."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rtradar.cards import cut

_ENTRIES = {
    "Subjects": "subject",
    "Sources": "source",
    "Radars": "radar",
    "Scenes": "scene",
    "Levels": "fidelity",
    "SNR [dB]": "snr_db",
}
"""Entry of the provenance for each row."""


def rows(labels: Sequence[str], provenance: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Return what is in a data set, as texts by their labels.

    ``labels`` and ``provenance`` are those of each sample.
    """
    found = {"Samples": f"{len(labels):,}", "Activities": _counted(labels)}
    for label, key in _ENTRIES.items():
        values = [entries[key] for entries in provenance if key in entries]
        if values:
            found[label] = _counted(values)
    return found


def _counted(values: Iterable[object]) -> str:
    """List different values, the most frequent first, each with its number of samples."""
    counts = Counter(cut(str(value), 40) for value in values).most_common()
    if len(counts) > 12:
        return f"{len(counts)} different ones"
    return ", ".join(f"{value} ({count:,})" for value, count in counts)
