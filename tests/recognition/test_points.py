"""Points of boards: how files are read, the grid, and what is left when somebody has gone."""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.recognition import Grid, Points, read_points
from rtradar.recognition.board_files import beside_cells
from rtradar.recognition.points import (
    FEWEST,
    NEAR_M,
    describe_points,
    of_person,
    without_person,
)

GRID = Grid(frame_s=0.1, range_bin_m=0.05, velocity_bin_mps=0.5, max_range_m=6.0, window_s=2.0)


def table(seconds: float = 4.0, step_s: float = 0.1) -> NDArray[np.float64]:
    """Somebody 2 m away who swings, a trunk that is seen now and then, and a wall at 4 m."""
    random, rows = np.random.default_rng(0), []
    for frame in range(round(seconds / step_s)):
        time = frame * step_s
        speed = 1.5 * np.sin(2 * np.pi * 0.8 * time)
        rows += [[time, 2 + 0.2 * part, 0.1 * part, -0.3, speed] for part in random.normal(size=3)]
        rows += [[time, 4.0, -0.5, 0.4, 0.0]]
        rows += [[time, 2.05 + 0.1 * (frame % 3), 0.0, 0.2, 0.0]] * (frame % 4 == 0)
    return np.array(rows)


def later(rows: NDArray[np.float64], by_s: float) -> NDArray[np.float64]:
    return rows + np.array([by_s, 0, 0, 0, 0])


def points(seconds: float = 4.0) -> Points:
    return Points.on_grid(table(seconds), GRID)


def test_a_window_has_who_moves_and_not_the_room() -> None:
    (first, window), *_ = points().windows(GRID)
    assert (first, window.frames) == (0.0, 20)
    moving, still = of_person(window)
    assert (np.linalg.norm(moving.places, axis=1) < 3.3).all()
    assert np.sum(still.places[:, 2] == 0.2) >= 4  # the trunk
    assert (np.linalg.norm(still.places, axis=1) < 3.3).all()
    empty = without_person(window)
    assert (empty.doppler == 0).all()
    assert (np.abs(np.linalg.norm(empty.places, axis=1) - 2) > NEAR_M).all()
    assert describe_points(empty) is None


def test_windows_begin_every_second_and_a_short_recording_has_one() -> None:
    assert [start for start, _ in points(4.0).windows(GRID)] == pytest.approx([0.0, 1.0, 2.0])
    ((_, one),) = points(1.2).windows(GRID)
    assert one.frames == 20


@given(st.integers(1, 4), st.floats(0, 1e6))
def test_faster_frames_and_another_clock_are_the_same(every: int, later_s: float) -> None:
    slow = table()
    fast = np.concatenate([later(slow, 0.1 / every * k) for k in range(every)])
    found = Points.on_grid(later(fast, later_s), GRID)
    for own, other in zip(found[:4], Points.on_grid(slow, GRID)[:4], strict=True):
        np.testing.assert_allclose(np.sort(own, axis=0), np.sort(other, axis=0), atol=1e-9)


def test_points_of_one_cell_and_garbled_ones_are_left_out() -> None:
    one = np.array([[0.0, 2.0, 0.0, 0.0, 0.5]])
    rows = np.concatenate([one, one, one * [1, 20, 1, 1, 1], one * [1, np.nan, 1, 1, np.nan]])
    assert len(Points.on_grid(rows, GRID).frame) == 1


@given(st.integers(0, 40), st.integers(0, 2**31))
def test_any_points_are_described_in_as_many_numbers(count: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    rows = random.uniform([0, 0.1, -2, -1, -3], [2, 5, 2, 1, 3], (count, 5))
    ((_, window),) = Points.on_grid(rows, GRID, 2.0, 0.1).windows(GRID)
    found = describe_points(window)
    whole = describe_points(next(points().windows(GRID))[1])
    assert whole is not None
    if found is None:
        moving, still = of_person(window)
        assert len(moving.frame) + len(still.frame) < FEWEST
    else:
        assert found.shape == whole.shape
        assert np.isfinite(found).all()


# -- files -----------------------------------------------------------------------------------------


def written(folder: Path, rows: NDArray[np.float64]) -> Path:
    path = folder / "points.csv"
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    path.write_text("\n".join(["time_s,x_m,y_m,z_m,velocity_mps", *lines, ""]))
    return path


def test_tables_tell_which_axis_is_ahead(tmp_path: Path) -> None:
    rows = table()
    found, said = read_points(written(tmp_path, rows), GRID)
    np.testing.assert_array_equal(found, rows)
    assert said == "x is ahead and y to the left"
    ti = np.column_stack([rows[:, 0], -rows[:, 2], rows[:, 1], rows[:, 3:]])
    found, said = read_points(written(tmp_path, ti), GRID)
    np.testing.assert_array_equal(found, rows)
    assert said == "y is ahead and x to the right"
    names = dict(zip(("time_s", "x_m", "y_m", "z_m", "velocity_mps"), rows.T, strict=True))
    np.savez(tmp_path / "points.npz", **names)
    np.testing.assert_array_equal(read_points(tmp_path / "points.npz", GRID)[0], rows)


@pytest.mark.parametrize(("shift", "words"), [(5.0, "both x and y are"), (-2.0, "neither x nor y")])
def test_what_might_be_ahead_either_way_is_refused(
    tmp_path: Path, shift: float, words: str
) -> None:
    rows = table() + np.array([0, min(shift, 0.0), shift, 0, 0])
    path = written(tmp_path, rows)
    with pytest.raises(InputError, match=f"{words}.* unknown which is ahead.*--ahead x"):
        read_points(path, GRID)
    grid = dataclasses.replace(GRID, max_range_m=20.0)
    np.testing.assert_array_equal(read_points(path, grid, "x")[0], rows)
    np.testing.assert_array_equal(read_points(path, grid, "y")[0][:, 1], rows[:, 2])


def test_points_in_another_unit_are_refused(tmp_path: Path) -> None:
    rows = table() * [1, 1000, 1000, 1000, 1]
    with pytest.raises(InputError, match=r"m away, beyond the 6 m of the radar; give them in met"):
        read_points(written(tmp_path, rows), GRID)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.pcd", b"", "points are read from .csv, .npz, .txt, .dat"),
        ("a.csv", b"", "column time_s is missing"),
        ("a.csv", b"time_s,x_m,y_m,z_m,velocity_mps\n1,2,3,4\n", "line 2 is '1,2,3,4'"),
        ("a.csv", b"time_s,x_m,y_m,z_m,velocity_mps\n", "has no points"),
        ("a.csv", b"\xff\xfe", "holds no points of a board"),
        ("a.npz", b"no archive", "holds no points of a board"),
        ("a.txt", b"x: 1\ny: 2\n", "not every message"),
        ("a.dat", b"nothing", "no frame with points"),
    ],
)
def test_what_is_no_file_of_points_is_one_line(
    tmp_path: Path, name: str, content: bytes, words: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_points(tmp_path / name, GRID)


def test_what_ros_prints_is_read(tmp_path: Path) -> None:
    rows = table(1.0)
    message = (
        'header: \n  seq: 1\n  stamp: \n    secs: {0}\n    nsecs: {1}\n  frame_id: "ti_mmwave"\n'
        "point_id: 0\nx: {2}\ny: {3}\nz: {4}\nrange: 1.0\nvelocity: {5}\ndoppler_bin: 3\n---\n"
    )
    text = "".join(
        message.format(1_538_888_235, round(row[0] * 1e9), *row[1:]) for row in rows.tolist()
    )
    (tmp_path / "a.txt").write_text(text)
    found, said = read_points(tmp_path / "a.txt", GRID)
    np.testing.assert_allclose(later(found, -1_538_888_235), rows, atol=1e-6)
    assert said == "x is ahead and y to the left, as in ROS"


def packet(frame: int, rows: NDArray[np.float64], fixed: bool) -> bytes:
    """One frame of TI's visualiser, of x to the right, y ahead, z up and velocity."""
    if fixed:
        body = struct.pack("<2H", len(rows), 9) + b"".join(
            struct.pack("<H5h", 40, round(v / 0.5), 900, *(round(c * 512) for c in (x, y, z)))
            for x, y, z, v in rows.tolist()
        )
    else:
        body = rows.astype("<f4").tobytes()
    stats = struct.pack("<2I", 6, 4) + bytes(4)
    pieces = stats + struct.pack("<2I", 1, len(body)) + body
    head = bytes((2, 1, 4, 3, 6, 5, 8, 7))
    size = 8 + 4 * 8 + len(pieces)
    return head + struct.pack("<8I", 3, size, 0xA1443, frame, 0, len(rows), 2, 0) + pieces


@pytest.mark.parametrize("fixed", [False, True])
def test_what_the_visualiser_records_is_read(tmp_path: Path, fixed: bool) -> None:
    rows = table(1.0)
    rows[:, 4] = 0.5 * np.rint(rows[:, 4] / 0.5)
    ti = np.column_stack([-rows[:, 2], rows[:, 1], rows[:, 3:]])
    frames = np.rint(rows[:, 0] / 0.1).astype(int)
    content = b"".join(packet(7 + one, ti[frames == one], fixed) for one in np.unique(frames))
    (tmp_path / "a.dat").write_bytes(b"tail of a packet" + content + content[:50])
    found, said = read_points(tmp_path / "a.dat", GRID)
    np.testing.assert_allclose(found, rows, atol=2e-3 if fixed else 1e-6)
    assert said == "y is ahead and x to the right, as TI has it"


def test_velocities_of_another_profile_are_noticed() -> None:
    rows: Any = table()
    rows[:, 4] = 0.5 * np.rint(rows[:, 4] / 0.5)
    assert beside_cells(rows, GRID) == 0
    rows[:, 4] *= 1.3
    assert beside_cells(rows, GRID) > 0.3
