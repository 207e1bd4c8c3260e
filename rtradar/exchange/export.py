"""Export and import by the suffix of a file, which names its format."""

from __future__ import annotations

import os
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from rtradar.clouds import files as cloud_files
from rtradar.clouds.files import CloudTable
from rtradar.errors import InputError
from rtradar.exchange import if_formats
from rtradar.exchange.recording import IF_AXES, IfCube, IfRecording, in_short, open_recording
from rtradar.system.output_folder import check_whole

_T = TypeVar("_T")

IF_FORMATS: Mapping[
    str, tuple[Callable[[Path, IfRecording], dict[str, Any]], Callable[[Path], IfCube]]
] = {
    ".mat": (if_formats.write_mat, if_formats.read_mat),
    ".nc": (if_formats.write_netcdf, if_formats.read_netcdf),
    ".bin": (if_formats.write_int16, if_formats.read_int16),
}
"""Writer and reader of IF samples, by the suffix of the file."""

CLOUD_FORMATS: Mapping[
    str, tuple[Callable[[Path, CloudTable], dict[str, Any]], Callable[[Path], CloudTable]]
] = {
    ".npz": (cloud_files.write_npz, cloud_files.read_npz),
    ".ply": (cloud_files.write_ply, cloud_files.read_ply),
    ".pcd": (cloud_files.write_pcd, cloud_files.read_pcd),
}
"""Writer and reader of point clouds, by the suffix of the file."""

_DAMAGE = (
    OSError, ValueError, KeyError, IndexError, TypeError, EOFError, OverflowError, RuntimeError,
    zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip
"""Errors of readers of files that are damaged or of another kind."""


def export(source: str | Path, out: str | Path) -> dict[str, Any]:
    """Write IF samples or a cloud of a run for other tools; the suffix of ``out`` is the format.

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
    if os.path.isdir(origin):
        if suffix in CLOUD_FORMATS:
            raise InputError(
                f"'{origin}' is a folder; name the cloud in it, such as {origin / 'cloud_xyz.npz'}"
            )
        recording = open_recording(origin)
        about = {"axes": list(IF_AXES), "shape": list(recording.shape)}
        about |= IF_FORMATS[suffix][0](target, recording)
    elif suffix in IF_FORMATS:
        raise InputError(
            f"'{origin}' is no folder; IF samples come from one that rtradar run --save-if made"
        )
    else:
        if os.path.isdir(origin.parent):
            check_whole(origin.parent)
        cloud = read_cloud(origin)
        about = {"axes": list(cloud.names), "shape": list(cloud.values.shape)}
        about |= CLOUD_FORMATS[suffix][0](target, cloud)
    return {"file": str(target)} | about


def read_if(path: str | Path) -> IfCube:
    """Read IF samples, all at once, from a file that `export` wrote or from the folder of a run.

    Parameters
    ----------
    path : path
        File ``.mat``, ``.nc`` or ``.bin``, or the folder of a run that kept its IF samples.

    Returns
    -------
    IfCube

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    place = Path(path)
    if os.path.isdir(place):
        recording = open_recording(place)
        tx, (chirps, *rest) = recording.radar.n_tx, recording.shape
        return IfCube(recording.read(0, chirps * tx).reshape(chirps, *rest), recording.radar)
    return _read(place, IF_FORMATS, "IF samples")


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
    return cloud_files.checked(_read(place, CLOUD_FORMATS, "a cloud"), place)


def _read(path: Path, formats: Mapping[str, tuple[Any, Callable[[Path], _T]]], what: str) -> _T:
    if path.suffix.lower() not in formats:
        raise InputError(f"'{path}': {what} is read from {', '.join(formats)}; give such a file")
    try:
        return formats[path.suffix.lower()][1](path)
    except _DAMAGE as error:
        why = getattr(error, "strerror", None) or in_short(error)
        raise InputError(
            f"cannot read {what} from '{path}': {why}; give a file that rtradar wrote"
        ) from None
