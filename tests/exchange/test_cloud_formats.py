"""Clouds in every format: read back by us and by others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from rtradar.cli import main
from rtradar.clouds import SpatialCloud, save_cloud_npz, save_ply, save_spatial_npz
from rtradar.errors import InputError
from rtradar.exchange import CLOUD_FORMATS, export, read_cloud

N = 50


@pytest.fixture
def clouds(tmp_path: Path) -> tuple[Path, np.ndarray, SpatialCloud]:
    """A folder with both clouds of a run, and what is in them."""
    random = np.random.default_rng(1)
    points = random.standard_normal((N, 3))
    places, velocity = random.standard_normal((N, 3)), random.standard_normal(N)
    spatial = SpatialCloud(places, velocity, random.random(N) * 1e-9, random.random(N))
    save_cloud_npz(tmp_path / "cloud_rdt.npz", points)
    save_ply(tmp_path / "cloud_rdt.ply", points)
    save_spatial_npz(tmp_path / "cloud_xyz.npz", spatial)
    return tmp_path, points, spatial


def test_the_clouds_of_a_run_are_read(clouds: tuple[Path, np.ndarray, SpatialCloud]) -> None:
    folder, points, spatial = clouds
    for name in ("cloud_rdt.npz", "cloud_rdt.ply"):
        rdt = read_cloud(folder / name)
        assert (rdt.names, rdt.units) == (("time", "range", "velocity"), ("s", "m", "m/s"))
        np.testing.assert_array_equal(rdt.values, points)
    xyz = read_cloud(folder / "cloud_xyz.npz")
    assert xyz.names == ("x", "y", "z", "velocity", "power", "time")
    assert xyz.units == ("m", "m", "m", "m/s", "m2", "s")
    np.testing.assert_array_equal(xyz.values[:, :3], spatial.points)
    np.testing.assert_array_equal(xyz.values[:, 4], spatial.power)


@pytest.mark.parametrize("cloud", ["cloud_rdt.npz", "cloud_xyz.npz"])
@pytest.mark.parametrize("suffix", CLOUD_FORMATS)
def test_round_trips(
    clouds: tuple[Path, np.ndarray, SpatialCloud], cloud: str, suffix: str
) -> None:
    folder = clouds[0]
    first = read_cloud(folder / cloud)
    export(folder / cloud, folder / f"there{suffix}")
    export(folder / f"there{suffix}", folder / "back.npz")
    back = read_cloud(folder / "back.npz")
    assert (back.names, back.units) == (first.names, first.units)
    # PCD: float32, and nothing else lost
    kept = first.values.astype(np.float32) if suffix == ".pcd" else first.values
    np.testing.assert_array_equal(back.values, kept)


def test_trimesh_opens_ply(clouds: tuple[Path, np.ndarray, SpatialCloud]) -> None:
    folder, _, spatial = clouds
    export(folder / "cloud_xyz.npz", folder / "xyz.ply")
    seen = trimesh.load(folder / "xyz.ply")
    np.testing.assert_array_equal(seen.vertices, spatial.points)
    raw = seen.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(raw["power"].ravel(), spatial.power)


def test_pcd_is_laid_out_as_its_specification_says(
    clouds: tuple[Path, np.ndarray, SpatialCloud],
) -> None:
    folder, _, spatial = clouds
    export(folder / "cloud_xyz.npz", folder / "xyz.pcd")
    head, body = (folder / "xyz.pcd").read_bytes().split(b"DATA binary\n")
    lines = [line for line in head.decode().splitlines() if not line.startswith("#")]
    assert lines == [
        "VERSION 0.7", "FIELDS x y z velocity power time", "SIZE 4 4 4 4 4 4", "TYPE F F F F F F",
        "COUNT 1 1 1 1 1 1", f"WIDTH {N}", "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {N}",
    ]  # fmt: skip
    table = np.frombuffer(body, "<f4").reshape(N, 6)
    np.testing.assert_array_equal(table[:, :3], spatial.points.astype(np.float32))
    np.testing.assert_array_equal(table[:, 5], spatial.time.astype(np.float32))


def test_an_empty_cloud_stays_one(tmp_path: Path) -> None:
    save_cloud_npz(tmp_path / "none.npz", np.zeros((0, 3)))
    for suffix in CLOUD_FORMATS:
        export(tmp_path / "none.npz", tmp_path / f"out{suffix}")
        assert read_cloud(tmp_path / f"out{suffix}").values.shape == (0, 3)


def test_what_is_no_cloud_is_refused(tmp_path: Path) -> None:
    ascii_ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n"
    (tmp_path / "a.ply").write_text(ascii_ply)
    (tmp_path / "b.pcd").write_text("VERSION .7\nDATA ascii\n")
    (tmp_path / "c.npz").write_bytes(b"PK")
    np.savez(tmp_path / "d.npz", points=np.zeros((4, 2)))
    np.savez(tmp_path / "e.npz", points=np.full((4, 3), np.nan))
    for name in ("a.ply", "b.pcd", "c.npz", "d.npz", "none.ply"):
        with pytest.raises(InputError, match="cannot read a cloud"):
            read_cloud(tmp_path / name)
    with pytest.raises(InputError, match="holds NaN"):
        export(tmp_path / "e.npz", tmp_path / "out.ply")
    with pytest.raises(InputError, match="is read from"):
        read_cloud(tmp_path / "x.las")
    assert not (tmp_path / "out.ply").exists()


@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.parametrize("suffix", CLOUD_FORMATS)
def test_a_coordinate_that_is_not_measured_stays_so(tmp_path: Path, suffix: str, axis: int) -> None:
    places = np.arange(12.0).reshape(4, 3)
    places[:, axis] = np.nan
    cloud = SpatialCloud(places, np.arange(4.0), np.ones(4), np.zeros(4))
    save_spatial_npz(tmp_path / "cloud_xyz.npz", cloud)
    export(tmp_path / "cloud_xyz.npz", tmp_path / f"out{suffix}")
    np.testing.assert_array_equal(read_cloud(tmp_path / f"out{suffix}").values[:, :3], places)
    if suffix != ".npz":
        said = f"{'xyz'[axis]} is not measured: NaN"
        assert said.encode() in (tmp_path / f"out{suffix}").read_bytes()
    if suffix == ".ply":
        np.testing.assert_array_equal(trimesh.load(tmp_path / "out.ply").vertices, places)


@given(data=st.data())
def test_junk_is_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    suffix = data.draw(st.sampled_from(list(CLOUD_FORMATS)))
    base = tmp_path_factory.getbasetemp()
    good = base / f"good_cloud{suffix}"
    if not good.exists():
        save_cloud_npz(base / "source_cloud.npz", np.ones((3, 3)))
        export(base / "source_cloud.npz", good)
    changed = bytearray(good.read_bytes())
    for at, value in data.draw(
        st.lists(st.tuples(st.integers(0, len(changed) - 1), st.integers(0, 255)), max_size=20)
    ):
        changed[at] = value
    junk = base / f"junk_cloud{suffix}"
    junk.write_bytes(bytes(changed[: data.draw(st.integers(0, len(changed)))]))
    refusal = ""
    try:
        assert np.isfinite(read_cloud(junk).values).all()
    except InputError as error:
        refusal = str(error)
    assert "\n" not in refusal


def test_the_command(
    clouds: tuple[Path, np.ndarray, SpatialCloud], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = clouds[0]
    assert main(["export", str(folder / "cloud_xyz.npz"), "--out", str(folder / "xyz.pcd")]) == 0
    assert capsys.readouterr().out.startswith(
        "50 points: x, y, z, velocity, power, time; float32; see "
    )
    assert main(["export", str(folder / "none.npz"), "--out", str(folder / "xyz.pcd")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
