"""One door for every format: what the name of a file says is written, or read."""

from __future__ import annotations

import os
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from rtradar.errors import InputError
from rtradar.exchange.clouds import (
    CloudTable,
    checked,
    read_npz,
    read_pcd,
    read_ply,
    write_npz,
    write_pcd,
    write_ply,
)
from rtradar.exchange.int16 import read_int16, write_int16
from rtradar.exchange.mat import read_mat, write_mat
from rtradar.exchange.netcdf import read_netcdf, write_netcdf
from rtradar.exchange.recording import IF_AXES, IfCube, IfRecording, open_recording
from rtradar.system.output_folder import check_whole

_T = TypeVar("_T")

IF_FORMATS: Mapping[
    str, tuple[Callable[[Path, IfRecording], dict[str, Any]], Callable[[Path], IfCube]]
] = {
    ".mat": (write_mat, read_mat),
    ".nc": (write_netcdf, read_netcdf),
    ".bin": (write_int16, read_int16),
}
"""What writes and reads IF samples, by the suffix of the file."""

CLOUD_FORMATS: Mapping[
    str, tuple[Callable[[Path, CloudTable], dict[str, Any]], Callable[[Path], CloudTable]]
] = {
    ".npz": (write_npz, read_npz),
    ".ply": (write_ply, read_ply),
    ".pcd": (write_pcd, read_pcd),
}
"""What writes and reads point clouds."""

_DAMAGE = (
    OSError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    EOFError,
    OverflowError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
)
"""What readers say of files that are damaged or something else."""


def export(source: str | Path, out: str | Path) -> dict[str, Any]:
    """Write what a run left for other tools; the suffix of ``out`` names the format.

    Parameters
    ----------
    source : path
        Folder of a run that kept its IF samples, or a cloud: .npz, .ply or .pcd.
    out : path
        Output file, which is replaced if it exists: .mat, .nc or .bin for IF samples, .npz, .ply or
        .pcd for a cloud.

    Returns
    -------
    dict
        What was written: ``file``, ``axes``, ``shape``, ``type``, and ``scale`` of whole numbers.

    Raises
    ------
    InputError
        Where there is nothing of that kind to write, or the file cannot be written.
    """
    origin, target = Path(source), Path(out)
    suffix = target.suffix.lower()
    if suffix not in IF_FORMATS and suffix not in CLOUD_FORMATS:
        raise InputError(
            f"'{target}': no format has the suffix '{target.suffix}'; "
            f"allowed: {', '.join(IF_FORMATS)} for IF samples, "
            f"{', '.join(CLOUD_FORMATS)} for clouds"
        )
    if os.path.isdir(origin):
        if suffix in CLOUD_FORMATS:
            raise InputError(
                f"'{origin}' is a folder; name the cloud in it, such as {origin / 'cloud_xyz.npz'}"
            )
        recording = open_recording(origin)
        said = {"axes": list(IF_AXES), "shape": list(recording.shape)} | IF_FORMATS[suffix][0](
            target, recording
        )
    elif suffix in IF_FORMATS:
        raise InputError(
            f"'{origin}' is no folder; IF samples come from one that rtradar run --save-if made"
        )
    else:
        if os.path.isdir(origin.parent):
            check_whole(origin.parent)
        cloud = read_cloud(origin)
        said = {"axes": list(cloud.names), "shape": list(cloud.values.shape)} | CLOUD_FORMATS[
            suffix
        ][0](target, cloud)
    return {"file": str(target)} | said


def read_if(path: str | Path) -> IfCube:
    """IF samples, all at once, from a file that `export` wrote or from the folder of a run.

    Parameters
    ----------
    path : path
        ``.mat``, ``.nc`` or ``.bin``, or the folder of a run that kept its IF samples.

    Returns
    -------
    IfCube

    Raises
    ------
    InputError
        Where it cannot be read.
    """
    place = Path(path)
    if os.path.isdir(place):
        recording = open_recording(place)
        tx, (chirps, *rest) = recording.radar.n_tx, recording.shape
        return IfCube(recording.read(0, chirps * tx).reshape(chirps, *rest), recording.radar)
    return _read(
        place, {suffix: reader for suffix, (_, reader) in IF_FORMATS.items()}, "IF samples"
    )


def read_cloud(path: str | Path) -> CloudTable:
    """A cloud of a run, or one that `export` wrote.

    Parameters
    ----------
    path : path
        ``.npz``, ``.ply`` or ``.pcd``.

    Returns
    -------
    CloudTable

    Raises
    ------
    InputError
        Where it cannot be read.
    """
    place = Path(path)
    return checked(
        _read(place, {suffix: reader for suffix, (_, reader) in CLOUD_FORMATS.items()}, "a cloud"),
        place,
    )


def _read(path: Path, readers: Mapping[str, Callable[[Path], _T]], what: str) -> _T:
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"'{path}': {what} is read from {', '.join(readers)}; give such a file")
    try:
        return reader(path)
    except _DAMAGE as error:
        why = (
            getattr(error, "strerror", None)
            or " ".join(str(error).split())[:100]
            or type(error).__name__
        )
        raise InputError(
            f"cannot read {what} from '{path}': {why}; give a file that rtradar wrote"
        ) from None
