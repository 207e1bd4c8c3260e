"""Exchange of IF samples (DCA1000, MATLAB, xarray, NumPy, Zarr) and point clouds.

The suffix of a file names its format.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rtradar.clouds import files as cloud_files
from rtradar.clouds.files import CloudTable
from rtradar.errors import InputError
from rtradar.exchange.if_formats import (
    open_mat,
    open_netcdf,
    open_npy,
    open_zarr,
    write_mat,
    write_netcdf,
    write_npy,
    write_zarr,
)
from rtradar.exchange.int16_files import Dca1000Layout, open_int16, write_int16
from rtradar.exchange.recording import (
    DAMAGE,
    IF_AXES,
    IfCube,
    IfRecording,
    SampleFile,
    open_recording,
    rows_in_cycle,
    unreadable,
)
from rtradar.radar import Radar
from rtradar.system.files import open_regular
from rtradar.system.output_folder import check_whole

__all__ = [
    "CLOUD_FORMATS",
    "IF_AXES",
    "IF_FORMATS",
    "CloudTable",
    "Dca1000Layout",
    "IfCube",
    "SampleFile",
    "export",
    "open_samples",
    "read_cloud",
    "read_if",
]


class Format(NamedTuple):
    """Writer and reader of a format, and whether its samples have an axis of Tx."""

    write: Callable[[Path, Any], dict[str, Any]]
    read: Callable[[Path], Any]
    by_tx: bool = False


IF_FORMATS: Mapping[str, Format] = {
    ".mat": Format(write_mat, open_mat, by_tx=True),
    ".nc": Format(write_netcdf, open_netcdf, by_tx=True),
    ".bin": Format(write_int16, open_int16, by_tx=True),
    ".npy": Format(write_npy, open_npy),
    ".zarr": Format(write_zarr, open_zarr),
}
"""Formats of IF samples, by the suffix of the file."""

CLOUD_FORMATS: Mapping[str, Format] = {
    ".npz": Format(cloud_files.write_npz, cloud_files.read_npz),
    ".ply": Format(cloud_files.write_ply, cloud_files.read_ply),
    ".pcd": Format(cloud_files.write_pcd, cloud_files.read_pcd),
}
"""Formats of point clouds, by the suffix of the file."""


def export(
    source: str | Path, out: str | Path, *, dca1000: Dca1000Layout | None = None
) -> dict[str, Any]:
    """Write IF samples or a cloud of a run for other tools; the suffix of ``out`` is the format.

    Parameters
    ----------
    source : path
        Folder of a run that kept its IF samples, or a cloud: .npz, .ply or .pcd.
    out : path
        Output file, which is replaced if it exists: .mat, .nc, .bin, .npy or .zarr for IF samples,
        .npz, .ply or .pcd for a cloud. A Zarr store that exists is not replaced.
    dca1000 : Dca1000Layout, optional
        Order of the words of a .bin file, in which a DCA1000 would record the samples; by default
        they are (chirp, tx, rx, sample, IQ).

    Returns
    -------
    dict
        Plain values: ``file``, ``axes``, ``shape``, ``type``, and ``scale`` for whole numbers.

    Raises
    ------
    InputError
        If the source holds nothing of that kind, or the file cannot be written.
    """
    origin, target = Path(source), Path(out)
    suffix = target.suffix.lower()
    if suffix not in IF_FORMATS and suffix not in CLOUD_FORMATS:
        raise InputError(
            f"'{target}': no format has the suffix '{target.suffix}'; "
            f"allowed: {', '.join(IF_FORMATS)} for IF samples, "
            f"{', '.join(CLOUD_FORMATS)} for clouds"
        )
    # A folder is that of a run with its IF samples, a file is a cloud.
    if os.path.isdir(origin):
        if suffix in CLOUD_FORMATS:
            raise InputError(
                f"'{origin}' is a folder; name the cloud in it, such as {origin / 'cloud_xyz.npz'}"
            )
        about = _export_samples(open_recording(origin), target, dca1000)
    elif suffix in IF_FORMATS:
        raise InputError(
            f"'{origin}' is no folder; IF samples come from one that rtradar run --save-if made"
        )
    else:
        # The folder of a run that did not finish is refused.
        if os.path.isdir(origin.parent):
            check_whole(origin.parent)
        cloud = read_cloud(origin)
        about = {"axes": list(cloud.names), "shape": list(cloud.values.shape)}
        about |= CLOUD_FORMATS[suffix].write(target, cloud)
    return {"file": str(target)} | about


def _export_samples(
    recording: IfRecording, target: Path, dca1000: Dca1000Layout | None
) -> dict[str, Any]:
    suffix = target.suffix.lower()
    about: dict[str, Any] = {"axes": list(IF_AXES), "shape": list(recording.cube_shape)}
    if dca1000 is not None:
        if suffix != ".bin":
            raise InputError(f"'{target}': a file of a DCA1000 is named .bin; give such a name")
        return about | write_int16(target, recording, dca1000)
    if recording.radar.receives_sums and IF_FORMATS[suffix].by_tx:
        raise InputError(
            f"'{recording.name}' holds the sum of all Tx, as multiplexing = "
            f"'{recording.radar.multiplexing}' receives it, which has no tx axis; export it as "
            ".npy, .zarr or for a DCA1000"
        )
    return about | IF_FORMATS[suffix].write(target, recording)


def open_samples(
    path: str | Path, radar: Radar | None = None, dca1000: Dca1000Layout | None = None
) -> SampleFile:
    """Open IF samples, simulated or measured; they are read when rows of them are asked for.

    Parameters
    ----------
    path : path
        File ``.bin``, ``.npy``, ``.zarr``, ``.nc`` or ``.mat``, or the folder of a run that kept
        its IF samples.
    radar : Radar, optional
        Radar that received them, in place of the one that the file names.
    dca1000 : Dca1000Layout, optional
        Order of the words of a .bin file, in place of that of the JSON file beside it; where there
        is none, that of the radar's chip.

    Returns
    -------
    SampleFile

    Raises
    ------
    InputError
        If the file cannot be read, or does not fit the radar.
    """
    place = Path(path)
    suffix = place.suffix.lower()
    if os.path.isdir(place) and suffix != ".zarr":
        recording = open_recording(place)
        return recording if radar is None else replace(recording, radar=radar)
    if suffix not in IF_FORMATS:
        raise InputError(
            f"'{path}': IF samples are read from {', '.join(IF_FORMATS)}; give such a file"
        )
    try:
        if not os.path.isdir(place):
            open_regular(place).close()  # not at a pipe, which would seem empty
        if suffix == ".bin":
            return open_int16(place, radar, dca1000)
        # Readers of other people's files fail in many ways; the user gets one line.
        found = IF_FORMATS[suffix].read(place)
    except DAMAGE as error:
        raise unreadable(place, "IF samples", error) from None
    return found if radar is None else replace(found, radar=radar)


def read_if(path: str | Path) -> IfCube:
    """Read IF samples, all at once, from a file that `export` wrote or from the folder of a run.

    Parameters
    ----------
    path : path
        File of a suffix in `IF_FORMATS`, or the folder of a run that kept its IF samples.

    Returns
    -------
    IfCube

    Raises
    ------
    InputError
        If the file cannot be read, or does not tell of its radar.
    """
    found = open_samples(path)
    if found.radar is None:
        raise InputError(
            f"'{path}' does not tell of its radar; read it with rtradar.exchange.open_samples"
        )
    rows = rows_in_cycle(found.radar)
    if found.tx_per_cycle not in (None, rows):
        raise InputError(
            f"'{path}' has cycles of {found.tx_per_cycle} Tx, and its radar '{found.radar.name}' "
            f"{rows}; read it with rtradar.exchange.open_samples, and give its radar"
        )
    # Rows come Tx by Tx, so that whole cycles have an axis of Tx.
    cycles = len(found) // rows
    samples = found[: cycles * rows].reshape(cycles, rows, *found.shape[1:])
    return IfCube(np.ascontiguousarray(samples), found.radar)


def read_cloud(path: str | Path) -> CloudTable:
    """Read a cloud of a run, or one that `export` wrote.

    Parameters
    ----------
    path : path
        File ``.npz``, ``.ply`` or ``.pcd``.

    Returns
    -------
    CloudTable

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    place = Path(path)
    if place.suffix.lower() not in CLOUD_FORMATS:
        raise InputError(
            f"'{path}': a cloud is read from {', '.join(CLOUD_FORMATS)}; give such a file"
        )
    try:
        cloud = CLOUD_FORMATS[place.suffix.lower()].read(place)
    except DAMAGE as error:
        raise unreadable(place, "a cloud", error) from None
    return cloud_files.checked(cloud, place)
