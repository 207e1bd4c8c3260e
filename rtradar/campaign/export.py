"""Export of a data set as one Zarr group that explains itself."""

from __future__ import annotations

import json
import os
import re
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from rtradar.clouds.collection import Collection
from rtradar.clouds.sample_files import ARRAYS, KINDS, UNKNOWN, attributes, read_sample, read_shape
from rtradar.errors import InputError
from rtradar.system.checks import brief, printable
from rtradar.system.files import check_place
from rtradar.system.output_folder import new_folder
from rtradar.system.templates import templates

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}")
_CHUNK_BYTES = 4_000_000  # about what is read at a time
_MOST_A_CHUNK = 256
_COUNTS = {"points": ("n_points", "RDT cloud"), "spatial": ("n_spatial", "spatial cloud")}
"""Name of the number of points of a cloud, and what the cloud is called."""
_COORDINATES = {"coordinate": ["time", "range", "velocity"], "axis": ["x", "y", "z"]}
_NOT_KNOWN = -2  # who returned a point that is none, or of a sample with one person
_UNITS = re.compile(r"_(s|m|deg|db)$")


def export_dataset(folders: Sequence[Path], out: Path) -> int:
    """Copy a data set into a Zarr group with a data card, for `xarray.open_zarr` and ``zarr``.

    Arrays have ``sample`` as first dimension and are filled up with NaN where samples differ in
    size. Memory stays constant, whatever the number of samples.

    Parameters
    ----------
    folders : sequence of path
        Folders made by ``rtradar dataset build``.
    out : path
        New group, which appears when it is complete.

    Returns
    -------
    int
        Number of samples.

    Raises
    ------
    InputError
        If the folders hold no whole data set, ``out`` exists already or cannot be written.
    """
    if os.path.lexists(out):
        raise InputError(f"'{out}' is there already; give another name, or move it away (--out)")
    check_place(out, "--out")
    collection = Collection(*folders)
    if not len(collection):
        raise InputError(f"'{folders[0]}' holds no sample; build a data set that has some")
    import zarr

    # Arrays, attributes, and a text for people; metadata of all arrays together, so that opening
    # reads one file.
    with new_folder(out) as work, warnings.catch_warnings():
        # Both are in use everywhere, though no part of the specification of Zarr 3 yet.
        warnings.filterwarnings("ignore", message=".*(specification|Consolidated metadata).*")
        group = zarr.create_group(work)
        _write_columns(group, collection)
        _write_arrays(group, collection)
        group.attrs.update(_summary(collection))
        text = data_card(collection, dict(group.arrays()))
        group.attrs["description"] = text
        zarr.consolidate_metadata(work)
        (work / "README.md").write_text(text, encoding="utf-8")
    return len(collection)


def _put(group: Any, name: str, values: Any, dims: Sequence[str], **attrs: Any) -> None:
    """Write a small array at once."""
    array = np.asarray(values)
    text = array.dtype.kind in "UO"
    made = group.create_array(
        name,
        shape=array.shape,
        chunks=tuple(max(1, size) for size in array.shape),
        dtype="string" if text else array.dtype,
        dimension_names=dims,
    )
    made[...] = array.astype(object) if text else array
    made.attrs.update(attrs)


def _write_columns(group: Any, collection: Collection) -> None:
    """Write the ids, the labels and every entry of the provenance, one value for each sample."""
    # One array for each entry of the provenance.
    table = collection.to_pandas().drop(columns="folder")  # a place on this machine alone
    _put(group, "sample", table.index.to_numpy(), ["sample"], long_name="id of the sample")
    for name in table.columns:
        if not _NAME.fullmatch(str(name)) or name in (*ARRAYS, *dict(_COUNTS.values()), "sample"):
            raise InputError(f"provenance holds {brief(name)}, which can name no array")
        values = [None if value is None or value != value else value for value in table[name]]
        attrs: dict[str, Any] = {}
        if unit := _UNITS.search(name):
            attrs["units"] = {"db": "dB"}.get(unit[1], unit[1])
        if name == "label":
            attrs |= {"classes": list(collection.classes), "long_name": "number of the class"}
        _put(group, name, _column(values), ["sample"], **attrs)


def _column(values: list[Any]) -> Any:
    """Return values as whole numbers, as numbers with NaN, or as text, JSON but for strings."""
    given = [value for value in values if value is not None]
    numbers = given and all(
        type(value) is float or (type(value) is int and abs(value) < 2**63) for value in given
    )
    if numbers and all(type(value) is int for value in values):
        return np.array(values, dtype=np.int64)
    if numbers:
        return np.array([np.nan if value is None else float(value) for value in values])
    text = ["" if v is None else v if isinstance(v, str) else json.dumps(v) for v in values]
    return np.array([printable(one) for one in text], dtype=object)


def _write_arrays(group: Any, collection: Collection) -> None:
    """Write clouds, maps, joints and their axes; only one chunk at a time is in memory."""
    names = [KINDS[kind] for kind in collection.kinds]
    axes = sorted({axis for name in names for axis in ARRAYS[name].dims if axis in ARRAYS})
    # As large as the largest sample; of clouds the number of points says where the rest begins.
    for name in names:
        shapes = np.array([read_shape(path, name) for path in collection.paths])
        shape = tuple(shapes.max(axis=0).tolist())
        if name in _COUNTS:
            count, cloud = _COUNTS[name]
            said = f"number of points of the {cloud}; what follows them is NaN"
            _put(group, count, shapes[:, 0], ["sample"], long_name=said)
        _stream(group, name, shape, ("sample", *ARRAYS[name].dims), collection)
        beside = []  # of each point
        if name == "spatial":
            sources = any("source_names" in row for row in collection.provenance)
            whole = all(row.get("whole_clouds") for row in collection.provenance)
            beside += ["spatial_source"] * sources
            beside += ["spatial_time", "spatial_velocity"] * whole
        for own in beside:
            _stream(group, own, shape[:1], ("sample", *ARRAYS[own].dims), collection)
    # An axis that is the same for all samples is stored once.
    for name in axes:
        first = read_sample(collection.paths[0], name)
        if all(np.array_equal(read_sample(path, name), first) for path in collection.paths):
            _put(group, name, first, [name], **attributes(name))
        else:
            size = max(read_shape(path, name)[0] for path in collection.paths)
            _stream(group, name, (size,), ("sample", name), collection, f"{name}_of_sample")
    # Names along axes that are no numbers.
    dims = {dim for name in names for dim in ARRAYS[name].dims}
    known = _COORDINATES | (
        {"joint": collection.maps(0)["joint"].values} if "joint" in dims else {}
    )
    for name, values in known.items():
        _put(group, name, np.array(values, dtype=object), [name])


def _stream(
    group: Any,
    name: str,
    shape: tuple[int, ...],
    dims: Sequence[str],
    collection: Collection,
    own_name: str | None = None,
) -> None:
    kind = np.dtype(ARRAYS[name].dtype)
    # Chunks of some megabytes hold whole samples.
    each_bytes = max(1, int(np.prod(shape)) * kind.itemsize)
    step = min(max(1, _CHUNK_BYTES // each_bytes), _MOST_A_CHUNK, len(collection))
    fill = np.nan if kind.kind == "f" else _NOT_KNOWN
    array = group.create_array(
        own_name or name,
        shape=(len(collection), *shape),
        chunks=(step, *(max(1, size) for size in shape)),
        dtype=kind,
        dimension_names=dims,
        fill_value=fill,
    )
    array.attrs.update(attributes(name))
    bar: dict[str, Any] = {"desc": name, "unit": "chunk", "disable": None, "leave": False}
    for begin in tqdm(range(0, len(collection), step), **bar):
        block = np.full((min(step, len(collection) - begin), *shape), fill, kind)
        for number, row in enumerate(block, start=begin):
            if name == "spatial_source" and collection.spatial_source(number) is None:
                continue
            values = read_sample(collection.paths[number], name)
            row[tuple(map(slice, values.shape))] = values
        array[begin : begin + len(block)] = block


def _summary(collection: Collection) -> dict[str, Any]:
    """Return the attributes of the group."""
    rows = collection.provenance
    return {
        "title": f"Radar point clouds of {len(collection)} motions, simulated by rtradar",
        "classes": list(collection.classes),
        "counts": dict(sorted(Counter(collection.labels.tolist()).items())),
        "licences": dict(Counter(str(row.get("licence", UNKNOWN)) for row in rows)),
        "radars": {str(row.get("radar")): row.get("radar_parameters") for row in rows},
        # Not "coordinates", a name that has a meaning of its own in these files.
        "world_axes": "x from the radar to the person, y left, z up [m]",
    }


def data_card(collection: Collection, arrays: Mapping[str, Any]) -> str:
    """Describe a data set and its arrays in Markdown, by the text of ``card.md``.

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
    rows, labels = collection.provenance, Counter(collection.labels.tolist())

    def counts(key: str, usual: str | None = None) -> Counter[str]:
        given = (row.get(key, usual) for row in rows)
        return Counter(printable(str(value)) for value in given if value is not None)

    # What warnings the samples came with, and how many came with each.
    limits = Counter(
        printable(str(line))
        for row in rows
        if isinstance(row.get("limits"), list)
        for line in row["limits"]
    )
    if empty := sum(not read_shape(path, "points")[0] for path in collection.paths):
        limits["nothing was detected: the cloud is empty"] = empty
    ranges = {
        name: [row[key] for row in rows if isinstance(row.get(key), int | float)]
        for key, name in (("snr_db", "SNR [dB]"), ("heading_deg", "heading [deg]"))
    }
    classes = [(printable(one), k, labels[one]) for k, one in enumerate(collection.classes)]
    template = templates(Path(__file__).parent, escaped=False).get_template("card.md")
    card = template.render(
        samples=len(collection),
        motions=len(counts("recording")),
        people=len(counts("subject").keys() - {UNKNOWN}),
        classes=classes,
        arrays=[
            (name, array)
            for name, array in sorted(arrays.items())
            if len(array.shape) > 1 or "long_name" in array.attrs
        ],
        counts=counts,
        ranges=ranges,
        limits=limits,
    )
    return f"{card}\n"
