"""`rtradar view` of a folder that is damaged or malicious: one line, before anything is drawn."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from rtradar.errors import InputError
from rtradar.pipeline.output.view import load_run_view, view
from rtradar.radar import Radar
from rtradar.report.snapshots import Snapshots, save_snapshots

RADAR = Radar(
    tx_y=1,
    tx_z=0,
    rx_y=2,
    rx_z=0,
    samples_per_chirp=4,
    chirp_duration_s=1e-3,
    frame_duration_s=4e-3,
)
MAPS: dict[str, Any] = {
    "time": np.array([0.002, 0.004]),
    "range": RADAR.range_m,
    "velocity": RADAR.velocity_mps(4),
    "range_doppler": np.arange(1, 33, dtype=np.float32).reshape(2, 4, 4),
    "spectrogram_time": np.array([0.002, 0.003]),
    "spectrogram_velocity": np.array([-1.0, 0.0, 1.0]),
    "spectrogram": np.ones((2, 3), dtype=np.float32),
}
CLOUD = {"points": np.array([[0.002, 0.4, 0.1], [0.004, 0.8, -0.1]])}
COLUMNS = {name: np.array([0.1, 0.2]) for name in ("velocity", "power", "time")}


def moments() -> Snapshots:
    none = np.zeros(0, dtype=np.int64)
    fields = {
        "times": MAPS["time"],
        "window": np.array([0, 1]),
        "part_names": np.array(["head"]),
        "poses": np.ones((2, 1, 4, 3), dtype=np.float32),
        "path_names": np.array(["body"]),
        "echo_path": np.array([0]),
        "echo_part": np.array([0]),
        "echo_bounces": np.array([1]),
        **{name: np.ones((2, 1)) for name in ("range_m", "velocity_mps", "power_m2")},
        "corners": np.ones((2, 1, 1, 3), dtype=np.float32),
        "wall_names": np.array([], dtype=np.str_),
        "walls": np.zeros((0, 4, 3)),
        "furniture_names": np.array([], dtype=np.str_),
        "furniture_vertices": np.zeros((0, 3), dtype=np.float32),
        "furniture_faces": none.reshape(0, 3),
        "furniture_piece": none,
        "part_person": np.array([0]),
        "person_names": np.array(["person"]),
        "person_position": np.ones((2, 1, 3)),
        "person_speed": np.ones((2, 1)),
        "object_names": np.array([], dtype=np.str_),
        **dict.fromkeys(("mesh_source", "mesh_of_vertex", "mesh_part"), none),
        "mesh_faces": none.reshape(0, 3),
        "mesh_rows": np.zeros((2, 0, 3), dtype=np.float32),
        **dict.fromkeys(("blend_vertex", "blend_row"), none),
        "blend_weight": np.zeros(0, dtype=np.float32),
    }
    return Snapshots(**fields)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """As a run leaves it, but tiny."""
    out = tmp_path / "run"
    out.mkdir()
    parameters = {"radar": dataclasses.asdict(RADAR), "scene": "free-space", "motion": "walk"}
    (out / "summary.json").write_text(
        json.dumps({"parameters": parameters, "fidelity": "analytic"})
    )
    save_snapshots(out / "view.npz", moments())
    with h5py.File(out / "maps.h5", "w") as file:
        for name, values in MAPS.items():
            file[name] = values
    np.savez(out / "cloud_rdt.npz", **CLOUD)
    np.savez(out / "cloud_xyz.npz", **CLOUD, **COLUMNS)
    return out


def test_the_folder_is_good(folder: Path) -> None:
    linked = load_run_view(folder)
    # Each point of the cloud has the power of the cell that it is nearest to, looked for here one
    # by one.
    for (time, distance, velocity), power_db in zip(
        CLOUD["points"], linked.rdt_power_db, strict=True
    ):
        cell = tuple(
            int(np.abs(MAPS[axis] - value).argmin())
            for axis, value in (("time", time), ("range", distance), ("velocity", velocity))
        )
        # With R^4 for the loss over distance; the radar's first bin, at 0 m, ends at half a bin.
        place = max(MAPS["range"][cell[1]], RADAR.range_bin_m / 2)
        assert power_db == pytest.approx(
            10 * np.log10(MAPS["range_doppler"][cell] / RADAR.n_channels * place**4)
        )


def refused(folder: Path, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        load_run_view(folder)
    assert len(str(caught.value).splitlines()) == 1


NAN_AT_ONE = np.where(np.arange(32) == 5, np.nan, 1.0).reshape(2, 4, 4)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("range_doppler", {"data": NAN_AT_ONE}),
        ("range_doppler", {"data": NAN_AT_ONE[:, :2]}),
        ("range_doppler", {"data": np.ones((2, 4, 4), dtype=np.complex64)}),
        ("range_doppler", {"shape": (2, 10**7, 10**7), "dtype": "<f4", "chunks": True}),
        ("velocity", {"shape": (10**10,), "dtype": "<f8", "chunks": True}),
        ("velocity", {"data": np.array([0.0, np.nan, 1.0, 2.0])}),
        ("velocity", {"data": np.array([-1e308, 0.0, 1.0, 1e308])}),
        ("velocity", {"data": np.zeros(0)}),
        ("velocity", {"data": 3.0}),
        ("spectrogram_velocity", {"data": np.array([1.0])}),
        ("spectrogram", {"data": np.ones((2, 4))}),
        ("spectrogram", {"data": np.full((2, 3), np.inf)}),
        ("time", {"data": h5py.Empty("f8")}),
    ],
)
def test_maps_that_are_none(folder: Path, name: str, told: dict[str, Any]) -> None:
    with h5py.File(folder / "maps.h5", "a") as file:
        del file[name]
        file.create_dataset(name, **told)
    refused(folder, "maps.h5.* is damaged, or of another kind")


def test_maps_of_no_range_and_a_single_velocity(folder: Path) -> None:
    with h5py.File(folder / "maps.h5", "a") as file:
        for name, values in (("range", np.zeros(0)), ("range_doppler", np.zeros((2, 0, 4)))):
            del file[name]
            file[name] = values
    refused(folder, "maps.h5.* is damaged, or of another kind")
    with h5py.File(folder / "maps.h5", "a") as file:
        for name, values in (("range", RADAR.range_m), ("range_doppler", np.ones((2, 4, 4)))):
            del file[name]
            file[name] = values
        for name, values in (
            ("spectrogram_velocity", np.ones(1)),
            ("spectrogram", np.ones((2, 1))),
        ):
            del file[name]
            file[name] = values
    refused(folder, "maps.h5.* is damaged, or of another kind")


@pytest.mark.parametrize("file", ["cloud_rdt.npz", "cloud_xyz.npz"])
@pytest.mark.parametrize(
    "points",
    [
        np.array([["a", "b", "c"]]),
        np.full((1, 3), np.nan),
        np.full((1, 3), 1e300),
        np.ones((1, 3), dtype=complex),
        np.ones(2),
    ],
    ids=["text", "NaN", "huge", "complex", "shape"],
)
def test_clouds_that_are_none(folder: Path, file: str, points: np.ndarray) -> None:
    np.savez(folder / file, **{"points": points} | COLUMNS)
    refused(folder, "is damaged")


def test_a_cloud_that_claims_more_than_it_holds(folder: Path) -> None:
    import zipfile

    with (
        zipfile.ZipFile(folder / "cloud_rdt.npz", "w") as archive,
        archive.open("points.npy", "w") as member,
    ):
        np.lib.format.write_array_header_1_0(
            member, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3)}
        )
    refused(folder, "cloud_rdt.npz.* is damaged")


@pytest.mark.parametrize("letter", [0x110000, 0xD800])
def test_numbers_that_are_no_letters(folder: Path, letter: int) -> None:
    with np.load(folder / "view.npz") as arrays:
        content = dict(arrays)
    np.savez(
        folder / "view.npz",
        **content | {"part_names": np.array([letter], dtype=np.uint32).view("<U1")},
    )
    refused(folder, "holds what is no character")


def test_a_name_that_is_no_text_has_a_page_all_the_same(folder: Path) -> None:
    """JSON may hold half of a character, which no file can."""
    summary = json.loads((folder / "summary.json").read_text())
    summary["parameters"]["motion"] = "\ud800"
    (folder / "summary.json").write_text(json.dumps(summary))
    view(folder, page=folder / "view.html")
    assert "<h1>?" in (folder / "view.html").read_text(encoding="utf-8")
