"""Data card of an exported data set: what it is, how it was made, and what it is not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from rtradar.clouds.collection import Collection
from rtradar.clouds.sample_files import UNKNOWN, read_shape
from rtradar.system.checks import printable

_COLUMNS = {
    "source": "where the motion is from",
    "radar": "radars",
    "scene": "scenes",
    "fidelity": "fidelity levels",
    "duration_s": "lengths of intervals [s]",
    "body_material": "material of the body",
    "clutter_removal": "removal of static clutter",
    "detector": "detectors",
    "pfa": "probability of a false alarm",
    "version": "versions of rtradar",
}
_RANGES = {"snr_db": "SNR [dB]", "heading_deg": "heading [deg]"}
_MOST_SHOWN = 12
_LIMITS = """\
- Everything here is simulated. The person is 21 ellipsoids on the bones of a skeleton, conductors
  unless another material is said above: no clothing, no soft tissue.
- rtradar's documentation says how far each fidelity level is from the truth.
- Motions of synthetic actors are made by formulas. They are cleaner and less varied than those of
  people: test what learns from them on recordings."""
_READING = """\
```python
import xarray as xr

data = xr.open_zarr("this.zarr")
data["points"].sel(sample=data["sample"][0])  # point, (time [s], range [m], velocity [m/s])
data["label"], data["label"].attrs["classes"]
```

Clouds are filled up with NaN: the first `n_points` of `points` and the first `n_spatial` of
`spatial` are points. `spatial_source`, where several people or objects are, says who returned each
of them: its number in `source_names`, or -1 for the room or nobody. Entries that are no number and
no text, such as positions, are JSON."""


def data_card(collection: Collection, arrays: Mapping[str, Any]) -> str:
    """Describe a data set and its arrays in Markdown.

    Parameters
    ----------
    collection : Collection
        The data set.
    arrays : mapping
        Zarr arrays by name.

    Returns
    -------
    str
    """
    rows = collection.provenance
    labels = Counter(collection.labels.tolist())
    motions = len({str(row.get("recording")) for row in rows})
    subjects = Counter(str(row.get("subject", UNKNOWN)) for row in rows)
    known = len(subjects) - (UNKNOWN in subjects)
    said = f"{len(collection)} samples of {motions} motions of {known} known people"
    empty = sum(not read_shape(path, "points")[0] for path in collection.paths)
    told = [row["limits"] for row in rows if isinstance(row.get("limits"), list)]
    limits = Counter(printable(str(line)) for lines in told for line in lines)
    if empty:
        limits["nothing was detected: the cloud is empty"] = empty
    return "\n".join(
        [
            "# Data card",
            "",
            f"{said}, in {len(labels)} classes: what a MIMO FMCW radar would see of each motion.",
            "",
            _table(
                ("class", "label", "samples"),
                ((name, number, labels[name]) for number, name in enumerate(collection.classes)),
            ),
            "## Arrays",
            "",
            _table(
                ("name", "dimensions", "size", "unit", "meaning"),
                (
                    (
                        f"`{name}`",
                        ", ".join(array.metadata.dimension_names),
                        " x ".join(map(str, array.shape)),
                        array.attrs.get("units", ""),
                        array.attrs.get("long_name", ""),
                    )
                    for name, array in sorted(arrays.items())
                    if len(array.shape) > 1 or "long_name" in array.attrs
                ),
            ),
            "All other arrays are provenance: one value for each sample.",
            "",
            "## How it was made",
            "",
            *_made(rows),
            "",
            "## Licences",
            "",
            *_licences(rows),
            "",
            "## Limits",
            "",
            _LIMITS,
            *(f"- in {count} samples: {line}" for line, count in limits.most_common(_MOST_SHOWN)),
            "",
            "## Reading it",
            "",
            _READING,
            "",
        ]
    )


def _made(rows: list[Mapping[str, Any]]) -> list[str]:
    lines = ["Made with `rtradar dataset build`.", ""]
    for key, name in _COLUMNS.items():
        counted = Counter(printable(str(row[key])) for row in rows if key in row)
        if counted:
            shown = [f"{value} ({count})" for value, count in counted.most_common(_MOST_SHOWN)]
            more = len(counted) - len(shown)
            lines.append(f"- {name}: {', '.join(shown)}{f' and {more} more' if more else ''}")
    for key, name in _RANGES.items():
        values = [row[key] for row in rows if isinstance(row.get(key), int | float)]
        if values:
            lines.append(f"- {name}: {min(values):.3g} to {max(values):.3g}")
    unknown = sum(row.get("subject") == UNKNOWN for row in rows)
    if unknown:
        lines.append(
            f"- subject unknown: {unknown} samples; each of their recordings counts as a person of "
            "its own where a split goes by subject"
        )
    return lines


def _licences(rows: list[Mapping[str, Any]]) -> list[str]:
    counted = Counter(printable(str(row.get("licence", UNKNOWN))) for row in rows)
    hints = {UNKNOWN: "; nobody said what may be done with them: find out before you pass them on"}
    return [
        f"- {name}: {count} samples{hints.get(name, '')}" for name, count in counted.most_common()
    ]


def _table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    head = list(head)
    lines = [head, ["---"] * len(head), *([printable(str(cell)) for cell in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"
