"""The spatial cloud: where points stand, how peaks of the two lines are paired, and its file."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from rtradar.clouds import SpatialCloud, save_spatial_npz, spatial_points
from rtradar.errors import InputError
from rtradar.process.angles import AngleSpectra
from rtradar.radar import Radar

RADAR = Radar.preset("paper-12ghz")  # at (-4, 1, 1)
SINES = np.linspace(-0.85, 0.85, 341)  # steps of 0.005


def hills(*spectra: dict[float, float]) -> np.ndarray:
    """Spectra (cell, sine) with Gaussian peaks, which a parabola in dB finds exactly."""
    total = [
        sum(power * np.exp(-(((SINES - sine) / 0.02) ** 2)) for sine, power in hill.items())
        for hill in spectra
    ]
    return np.asarray(total, dtype=np.float32)


def spectra(
    y: np.ndarray | None, z: np.ndarray | None, range_m: list[float], velocity: list[float]
) -> AngleSpectra:
    return AngleSpectra(SINES, y, z, np.array(range_m), np.array(velocity))


def test_one_point_in_each_of_two_cells() -> None:
    seen = spectra(
        hills({0.6: 2.0}, {-0.24: 1.0}), hills({0.0: 4.0}, {0.64: 1.0}), [5.0, 2.0], [1.5, -2.0]
    )
    cloud = spatial_points(seen, RADAR, 0.75)
    # 3-4-5: x = 4, y = 3; then x = 2 sqrt(1 - 0.0576 - 0.4096) = 1.45986.
    expected = np.array([[0.0, 4.0, 1.0], [1.4598630 - 4, 1 - 0.48, 1 + 1.28]])
    np.testing.assert_allclose(cloud.points, expected, atol=1e-4)  # spectra are float32
    np.testing.assert_allclose(cloud.velocity, [1.5, -2.0])
    np.testing.assert_allclose(cloud.power, [3.0, 1.0], rtol=1e-4)
    np.testing.assert_array_equal(cloud.time, [0.75, 0.75])


@pytest.mark.parametrize(
    ("y", "z", "around"),
    [
        ({-0.3: 1.0, 0.2: 0.5}, {0.4: 0.4, -0.1: 0.9}, [[-0.3, -0.1], [0.2, 0.4]]),
        # Three echoes at one height: the z-line has one peak, and all are there.
        ({-0.3: 1.0, 0.2: 0.5, 0.5: 0.3}, {0.1: 0.9}, [[-0.3, 0.1], [0.2, 0.1], [0.5, 0.1]]),
    ],
)
def test_peaks_are_paired_by_rank_and_the_strongest_stands_in_for_a_missing_one(
    y: dict[float, float], z: dict[float, float], around: list[list[float]]
) -> None:
    seen = spectra(hills(y), hills(z), [1.0], [0.0])
    found = spatial_points(seen, RADAR, 0.0).points - RADAR.position_m
    np.testing.assert_allclose(found[:, 1:], around, atol=1e-4)


def test_no_direction_no_point() -> None:
    seen = spectra(
        hills({0.8: 1.0}, {0.0: 1.0}), hills({0.7: 1.0}, {0.0: 1.0}), [3.0, 4.0], [0.0, 1.0]
    )
    cloud = spatial_points(seen, RADAR, 0.0)
    np.testing.assert_allclose(cloud.points, [[0.0, 1.0, 1.0]], atol=1e-4)
    np.testing.assert_array_equal(cloud.velocity, [1.0])


@pytest.mark.parametrize("line", ["y", "z"])
def test_one_line_alone_invents_no_coordinate_across_it(line: str) -> None:
    power = hills({0.6: 2.0})
    seen = spectra(power if line == "y" else None, power if line == "z" else None, [5.0], [0.0])
    cloud = spatial_points(seen, RADAR, 0.0)
    # Range 5, 3 along the line, so 4 from the line in whatever direction.
    expected = [4.0, 3.0, math.nan] if line == "y" else [4.0, math.nan, 3.0]
    assert cloud.measured.tolist() == [True, line == "y", line == "z"]
    assert cloud.strongest().measured.tolist() == cloud.measured.tolist()
    np.testing.assert_allclose(cloud.points - RADAR.position_m, [expected], atol=1e-4)
    np.testing.assert_allclose(cloud.power, [2.0], rtol=1e-4)
    with pytest.raises(InputError, match="no line"):
        spatial_points(dataclasses.replace(seen, y=None, z=None), RADAR, 0.0)


@pytest.mark.parametrize("cells", [0, 1])
def test_nothing_detected_and_a_silent_cell_have_no_point(cells: int) -> None:
    silent = np.zeros((cells, len(SINES)), np.float32)
    cloud = spatial_points(spectra(silent, silent, [4.0] * cells, [0.0] * cells), RADAR, 0.0)
    assert (cloud.points.shape, cloud.power.shape) == ((0, 3), (0,))


def test_the_file_holds_the_cloud(tmp_path: Path) -> None:
    cloud = SpatialCloud(
        np.arange(6.0).reshape(2, 3), np.array([1.0, 2]), np.array([3.0, 4]), np.array([5.0, 6])
    )
    path = tmp_path / "cloud_xyz.npz"
    save_spatial_npz(path, cloud)
    with np.load(path) as file:
        for field in ("points", "velocity", "power", "time"):
            np.testing.assert_array_equal(file[field], getattr(cloud, field))
            assert file[field].dtype == np.float64
        assert file["axes"].tolist() == ["x", "y", "z"]
        assert file["units"].tolist() == ["m", "m", "m"]
    assert [entry.name for entry in tmp_path.iterdir()] == ["cloud_xyz.npz"]
    with pytest.raises(InputError, match="cannot write"):
        save_spatial_npz(tmp_path / "missing" / "cloud.npz", cloud)


@pytest.mark.parametrize(
    ("points", "velocity", "message"),
    [
        (np.zeros((2, 2)), np.zeros(2), "points has shape"),
        (np.zeros((2, 3)), np.zeros(3), "velocity has shape"),
        (np.full((1, 3), np.nan), np.zeros(1), "NaN or infinity"),
        (np.array([[math.nan, 0, 0]]), np.zeros(1), "NaN or infinity"),  # x is always measured
        (np.array([[0, math.nan, math.nan]]), np.zeros(1), "NaN or infinity"),
        (np.array([[0, 0, math.nan], [0, 0, 0]]), np.zeros(2), "NaN or infinity"),
        (np.array([[0, 0, math.inf]]), np.zeros(1), "NaN or infinity"),
        (np.zeros((1, 3)), np.array([math.nan]), "NaN or infinity"),
    ],
)
def test_clouds_that_do_not_fit(points: np.ndarray, velocity: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        SpatialCloud(points, velocity, np.zeros(len(points)), np.zeros(len(points)))


def test_the_strongest_points_are_those_within_forty_decibels() -> None:
    power = np.array([1.0, 2e-4, 0.99e-4, 1e-9])
    cloud = SpatialCloud(np.arange(12.0).reshape(4, 3), np.arange(4.0), power, np.zeros(4))
    assert cloud.strongest().velocity.tolist() == [0, 1]
    nothing = SpatialCloud(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0))
    assert len(nothing.strongest().points) == 0
