"""Files of strangers: what they claim is checked first, and errors are one line of our own."""

from __future__ import annotations

import dataclasses
import json
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import zarr

from rtradar.errors import InputError
from rtradar.exchange import export, read_cloud, read_if
from rtradar.radar import Radar

RADAR = Radar(
    tx_y=1, tx_z=0, rx_y=2, rx_z=0, samples_per_chirp=4,
    chirp_duration_s=1e-3, frame_duration_s=4e-3,
)  # fmt: skip
TOLD = dataclasses.asdict(RADAR)
SHAPE = (2, 1, 2, 4)
PLY = b"ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
PLY += b"property double x\nproperty double y\nproperty double z\n"
PCD = b"FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 1\n"


def refused(read: Any, path: Path, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        read(path)
    assert len(str(caught.value).splitlines()) == 1


HEADS = pytest.mark.parametrize(
    ("ending", "head", "end"), [(".ply", PLY, b"end_header\n"), (".pcd", PCD, b"DATA binary\n")]
)


@HEADS
@pytest.mark.parametrize("comment", [b"a" * 3_000_000, b"a = b [" * 400_000])
def test_a_long_comment_takes_no_time(
    tmp_path: Path, ending: str, head: bytes, end: bytes, comment: bytes
) -> None:
    path = tmp_path / f"x{ending}"
    path.write_bytes(head + b"# comment " + comment + b"\n" + end + bytes(24))
    # In time that grows with the square of its length: after hours.
    assert read_cloud(path).names == ("x", "y", "z")


@HEADS
def test_a_signalling_nan_is_told_as_any_other(
    tmp_path: Path, ending: str, head: bytes, end: bytes
) -> None:
    path = tmp_path / f"x{ending}"
    head = head.replace(b"double", b"float").replace(b"8 8 8", b"4 4 4")
    path.write_bytes(head + end + bytes.fromhex("0000a07f") + bytes(8))
    refused(lambda place: export(place, tmp_path / "x.npz"), path, "holds NaN or infinity")


def archive(path: Path, shape: tuple[int, ...], kind: str = "<f8", data_bytes: int = 24) -> Path:
    """A packed NumPy archive whose ``points`` claim this shape, with that many zeros behind it."""
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file,
        file.open("points.npy", "w", force_zip64=True) as member,
    ):
        header = {"descr": kind, "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(member, header)
        for first in range(0, data_bytes, 1 << 24):
            member.write(bytes(min(1 << 24, data_bytes - first)))
    return path


def test_an_archive_of_good_points_is_read(tmp_path: Path) -> None:
    assert read_cloud(archive(tmp_path / "x.npz", (1, 3))).values.tolist() == [[0, 0, 0]]


@pytest.mark.parametrize(
    ("shape", "kind", "says"),
    [
        ((10**12, 3), "<f8", "claims more than it holds"),
        ((10**12, 3), "<U0", "claims more than it holds"),
        ((-1, 3), "<f8", "cannot read a cloud"),
        ((1, 3), "|O", "cannot read a cloud"),
    ],
)
def test_an_archive_that_claims_more_than_it_holds(
    tmp_path: Path, shape: tuple[int, ...], kind: str, says: str
) -> None:
    refused(read_cloud, archive(tmp_path / "x.npz", shape, kind), says)


def test_an_archive_that_unpacks_to_more_than_a_gigabyte(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("points.npy", b"")
    data = bytearray(path.read_bytes())
    entry = data.index(b"PK\x01\x02")  # of the directory, which is believed
    data[entry + 24 : entry + 28] = (1_100_000_000).to_bytes(4, "little")
    path.write_bytes(data)
    refused(read_cloud, path, "claims more than 1000 MB")


@pytest.mark.parametrize("word", ["two\nlines", "\xb2", "", "]", "x" * 65])
def test_axes_that_no_header_can_tell(tmp_path: Path, word: str) -> None:
    for axes, units in (([word, "y", "z"], ["m"] * 3), (["x", "y", "z"], ["m", "m", word or "\n"])):
        told = {"axes": np.array(axes), "units": np.array(units)}
        np.savez(tmp_path / "x.npz", points=np.zeros((1, 3)), **told)
        refused(read_cloud, tmp_path / "x.npz", "are no short words")


def netcdf(path: Path, **changes: Any) -> Path:
    with h5py.File(path, "w") as file:
        for name in ("if_real", "if_imag"):
            usual = {"shape": SHAPE, "dtype": "<f4", "data": np.ones(SHAPE, "<f4")}
            file.create_dataset(name, **usual | changes)
        file.attrs["radar"] = json.dumps(TOLD)
    return path


def test_a_netcdf_file_that_claims_more_than_there_is(tmp_path: Path) -> None:
    assert read_if(netcdf(tmp_path / "x.nc")).samples.shape == SHAPE
    large = netcdf(tmp_path / "x.nc", shape=(10**10, *SHAPE[1:]), data=None, chunks=True)
    refused(read_if, large, "if_real claims more than")


def test_hdf5_files_lead_to_no_others(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(np.ones(SHAPE, "<f4").tobytes())
    elsewhere = [(str(tmp_path / "secret"), 0, h5py.h5f.UNLIMITED)]
    outside = netcdf(tmp_path / "x.nc", data=None, external=elsewhere)
    refused(read_if, outside, "if_real is not in this file")
    netcdf(tmp_path / "there.nc")
    with h5py.File(netcdf(tmp_path / "x.nc"), "a") as file:
        del file["if_imag"]
        file["if_imag"] = h5py.ExternalLink(str(tmp_path / "there.nc"), "if_imag")
    refused(read_if, tmp_path / "x.nc", "if_imag is not in this file")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ({"shape": (10**10, 1), "dtype": "<u2", "chunks": True}, "claims more"),
        ({"data": np.array([[2**63]], "<u8")}, "too large"),
    ],
)
def test_a_mat_file_whose_text_is_none(tmp_path: Path, text: Mapping[str, Any], says: str) -> None:
    with h5py.File(tmp_path / "x.mat", "w") as file:
        file["if_samples"] = np.zeros(SHAPE[::-1], "<c8")
        file.create_dataset("radar/all", **text)
    refused(read_if, tmp_path / "x.mat", says)


@pytest.mark.parametrize(
    "changes",
    [
        {"shape": [float("inf")] * 5},
        {"shape": [-2, -1, 2, 4, 2]},
        {"shape": [4, 1, 2, 4, 1]},
        {"shape": [2, 1, 2, 10**400, 2]},
        {"scale": 1e308},
        {"scale": 10**400},
        {"scale": float("nan")},
        {"scale": -1.0},
        {"radar": "[" * 10**5},
    ],
)
def test_the_text_beside_int16_samples(tmp_path: Path, changes: dict[str, Any]) -> None:
    what = "IF samples of rtradar: sample = scale * (I + 1j Q)"
    about = {"what": what, "shape": [*SHAPE, 2], "scale": 1e-3, "radar": TOLD}
    (tmp_path / "x.bin").write_bytes(bytes(64))
    (tmp_path / "x.json").write_text(json.dumps(about))
    assert read_if(tmp_path / "x.bin").samples.shape == SHAPE
    (tmp_path / "x.json").write_text(json.dumps(about | changes))
    refused(read_if, tmp_path / "x.bin", "cannot read IF samples")
    (tmp_path / "x.json").write_text("[" * 10**5)
    refused(read_if, tmp_path / "x.bin", "cannot read IF samples")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    folder = tmp_path / "run"
    zarr.create_array(folder / "if.zarr", data=np.ones((2, 2, 4), "<c8"), chunks=(2, 2, 4))
    (folder / "summary.json").write_text(json.dumps({"parameters": {"radar": TOLD}}))
    return folder


@pytest.mark.parametrize("chunks", [(64, 2, 4), (10**12, 2, 4)])
def test_samples_of_a_run_that_claim_more_than_any(
    run: Path, tmp_path: Path, chunks: tuple[int, ...]
) -> None:
    assert read_if(run).samples.shape == SHAPE
    shutil.rmtree(run / "if.zarr")
    zarr.create_array(run / "if.zarr", shape=(10**12, 2, 4), chunks=chunks, dtype="complex64")
    refused(read_if, run, "as no run writes")
    refused(lambda folder: export(folder, tmp_path / "x.nc"), run, "as no run writes")
    assert not (tmp_path / "x.nc").exists()


def test_damaged_samples_of_a_run(run: Path, tmp_path: Path) -> None:
    chunk = run / "if.zarr" / "c" / "0" / "0" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-3])
    refused(read_if, run, "cannot read IF samples from .*; run it again")
    refused(lambda folder: export(folder, tmp_path / "x.bin"), run, "cannot read IF samples")
    assert not (tmp_path / "x.bin").exists()


def test_a_summary_that_is_nested_without_end(run: Path) -> None:
    (run / "summary.json").write_text("[" * 10**5)
    refused(read_if, run, "tells of no radar")
