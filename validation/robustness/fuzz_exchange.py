"""Targets of `fuzz_readers.py` in what `rtradar export` writes and reads: IF samples and clouds."""

from __future__ import annotations

import dataclasses
import json
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from fuzz_kit import Target, as_text, hdf5, npz, written
from fuzz_small import ARRAYS, COLUMNS, JSON, POINTS, RADAR, RADAR_WORDS, SPATIAL, SUMMARY

from rtradar.exchange import export, read_cloud, read_if

IF = (np.arange(2 * 2 * 4) * (1e-3 + 2e-3j)).reshape(2, 1, 2, 4).astype(np.complex64)
TOLD = json.dumps(dataclasses.asdict(RADAR))
MAT = {
    "if_samples": np.zeros(IF.T.shape, dtype="<f4,<f4"),
    "radar/all": np.frombuffer(TOLD.encode("utf-16-le"), dtype="<u2")[:, None],
}
NETCDF = {"if_real": IF.real, "if_imag": IF.imag, "radar": np.array(TOLD)}


def _zarr(folder: Path, data: bytes) -> None:
    """Summary, metadata of the array, and its one chunk, separated by the word CUT."""
    summary, about, chunk = (*data.split(b"CUT"), b"", b"")[:3]
    run = folder / "run"
    shutil.rmtree(run, ignore_errors=True)
    (run / "if.zarr" / "c" / "0" / "0").mkdir(parents=True)
    (run / "summary.json").write_bytes(summary)
    (run / "if.zarr" / "zarr.json").write_bytes(about)
    (run / "if.zarr" / "c" / "0" / "0" / "0").write_bytes(chunk)
    read_if(run)
    export(run, folder / "out.bin")


def _zarrs() -> list[bytes]:
    import zarr

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "if.zarr"
        zarr.create_array(folder, data=IF.reshape(2, 2, 4), chunks=(2, 2, 4), compressors=None)
        return [
            b"CUT".join(
                (
                    json.dumps(SUMMARY).encode(),
                    (folder / "zarr.json").read_bytes(),
                    (folder / "c/0/0/0").read_bytes(),
                )
            )
        ]


def _int16(folder: Path, data: bytes) -> None:
    about, _, numbers = data.partition(b"CUT")
    (folder / "x.json").write_bytes(about)
    read_if(written(folder / "x.bin", numbers))


def _int16s() -> list[bytes]:
    about = {"shape": [*IF.shape, 2], "scale": 1e-3, "radar": dataclasses.asdict(RADAR)}
    return [json.dumps(about).encode() + b"CUT" + bytes(IF.size * 4)]


def _mat(folder: Path, data: bytes) -> None:
    read_if(hdf5(folder / "x.mat", MAT, data))


def _netcdf(folder: Path, data: bytes) -> None:
    read_if(hdf5(folder / "x.nc", NETCDF, data))


def _cloud(
    ending: str, make: Callable[[Path, bytes], Path] = written
) -> Callable[[Path, bytes], None]:
    def read(folder: Path, data: bytes) -> None:
        cloud = read_cloud(make(folder / f"x{ending}", data))
        assert cloud.values.shape[1] == len(cloud.names) == len(cloud.units)

    return read


def _clouds(ending: str) -> list[bytes]:
    with tempfile.TemporaryDirectory() as name:
        source, out = Path(name) / "x.npz", Path(name) / f"y{ending}"
        np.savez(
            source,
            points=POINTS,
            axes=np.array(["x", "y", "z"]),
            units=np.array(["m"] * 3),
            **COLUMNS,
        )
        export(source, out)
        return [out.read_bytes()]


TARGETS = {
    "if.zarr": Target(
        _zarr,
        _zarrs,
        JSON
        + " CUT complex64 float32 shape chunk_shape bytes gzip zstd crc32c blosc sharding_indexed",
    ),
    "int16": Target(_int16, _int16s, JSON + " CUT shape scale radar " + RADAR_WORDS),
    "mat": Target(_mat, lambda: [as_text(MAT)], ARRAYS, most_bytes=8192),
    "netcdf": Target(
        _netcdf, lambda: [as_text({name: NETCDF[name] for name in ("if_real", "if_imag")})], ARRAYS
    ),
    "cloud npz": Target(
        _cloud(".npz", lambda path, data: npz(path, SPATIAL, data)),
        lambda: [as_text(SPATIAL)],
        ARRAYS,
    ),
    "cloud ply": Target(
        _cloud(".ply"),
        lambda: _clouds(".ply"),
        "element vertex face property double float uchar list end_header comment x = y [m]",
    ),
    "cloud pcd": Target(
        _cloud(".pcd"),
        lambda: _clouds(".pcd"),
        "FIELDS SIZE TYPE COUNT POINTS WIDTH DATA binary F I U 4 8 1 # x = y [m]",
    ),
}
