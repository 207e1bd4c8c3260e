"""Points as the chips make them: where a target is, one for each peak, on the grids of the chip."""

from __future__ import annotations

import dataclasses
import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rtradar as rt
from rtradar.clouds import points_of_sines
from rtradar.description.run_file import plain
from rtradar.errors import ExtensionError, InputError
from rtradar.process import build_detector, build_point_detector, range_spectrum, ti_oob
from rtradar.process.detectors import _along, _around

RADAR = rt.Radar(
    name="board",
    start_frequency_hz=77e9,
    bandwidth_hz=2e9,
    chirp_duration_s=60e-6,
    samples_per_chirp=64,
    tx_y=2,
    tx_z=2,
    rx_y=4,
    rx_z=4,
    tx_spacing_wavelengths=2.0,
    position_m=(0.0, 0.0, 0.0),
    frame_duration_s=60e-6 * 4 * 32,
)
LIGHT_MPS = 299_792_458.0


def cube_of(
    *targets: tuple[float, float, float, float], noise: float = 1e-3, radar: rt.Radar = RADAR
) -> np.ndarray:
    """Range spectra (cycle, tx, rx, range) of points (range, speed, u, w), by the paths alone."""
    random = np.random.default_rng(0)
    chirps = np.arange(radar.chirps_per_frame)
    shape = (len(chirps), radar.n_rx, radar.samples_per_chirp)
    samples = noise * random.standard_normal((*shape, 2)).view(np.complex128)[..., 0]
    fast = (np.arange(shape[2]) / shape[2] - 0.5) * radar.bandwidth_hz + radar.centre_frequency_hz
    middle = chirps.mean()
    for range_m, speed, u, w in targets:
        there = np.array([np.sqrt(1 - u * u - w * w), u, w])
        ranges = range_m + speed * (chirps - middle) * radar.chirp_duration_s
        point = ranges[:, None] * there
        tx = chirps % radar.n_tx
        out = np.linalg.norm(point - radar.tx[tx], axis=1)[:, None]
        back = np.linalg.norm(point[:, None] - radar.rx[radar.rx_of_tx[tx]], axis=2)
        samples += np.exp(2j * np.pi * ((out + back) / LIGHT_MPS)[..., None] * fast)
    spectra = range_spectrum(samples, radar)
    return spectra.reshape(-1, radar.n_tx, radar.n_rx, shape[2])


@given(
    range_m=st.floats(1.5, 3.8),
    speed=st.floats(-3.5, 3.5),
    u=st.floats(-0.7, 0.7),
    w=st.floats(-0.5, 0.5),
)
def test_a_point_is_found_at_its_place_to_half_a_bin(
    range_m: float, speed: float, u: float, w: float
) -> None:
    mask, sines = ti_oob(cube_of((range_m, speed, u, w)), RADAR)
    # Half a bin away two cells are the same but for noise, and both may be peaks.
    assert 1 <= mask.sum() <= 2
    power = np.ones(mask.shape)
    cloud = points_of_sines(sines, mask, power, RADAR, 0.0)
    found = np.linalg.norm(cloud.points, axis=1)
    np.testing.assert_allclose(found, range_m, atol=0.51 * RADAR.range_bin_m)
    np.testing.assert_allclose(cloud.velocity, speed, atol=0.51 * RADAR.velocity_bin_mps)
    # Within half an azimuth bin, and 0.01 for noise and the spherical wave.
    np.testing.assert_allclose(sines[:, 0], u, atol=1 / 64 + 0.01)
    np.testing.assert_allclose(sines[:, 1], w, atol=0.03)


TWO = (2.0, 1.0, 0.2, 0.0), (3.0, -1.5, -0.3, 0.1)


def test_each_target_is_one_point_and_noise_is_none() -> None:
    mask, sines = ti_oob(cube_of(*TWO), RADAR)
    rows, columns = np.nonzero(mask)
    np.testing.assert_allclose(RADAR.range_m[rows], [2.0, 3.0], atol=0.51 * RADAR.range_bin_m)
    speeds = RADAR.velocity_mps(32)[columns]
    np.testing.assert_allclose(speeds, [1.0, -1.5], atol=0.51 * RADAR.velocity_bin_mps)
    np.testing.assert_allclose(sines, [[0.2, 0.0], [-0.3, 0.1]], atol=0.03)
    mask, sines = ti_oob(cube_of(), RADAR)
    assert (mask.sum(), sines.shape) == (0, (0, 2))


def test_of_neighbours_only_the_strongest_is_a_point() -> None:
    cube = cube_of(*TWO)
    power = (np.abs(np.fft.fft(cube * np.hanning(32)[:, None, None, None], axis=0)) ** 2).mean(
        axis=(1, 2)
    )
    mask, _ = ti_oob(cube, RADAR)
    for row, column in np.argwhere(mask):
        doppler = (column - 16) % 32
        about = power[np.ix_([(doppler + k) % 32 for k in (-1, 0, 1)], row + np.arange(-1, 2))]
        assert about.max() == power[doppler, row]


def test_without_grouping_all_cells_of_a_main_lobe_are_points() -> None:
    """Along an axis without grouping the neighbours of a peak are points too."""
    cube = cube_of((2.0, 1.0, 0.2, 0.0))
    found = {name: ti_oob(cube, RADAR, grouping=name)[0] for name in ("both", "none")}
    for along, axis in (("range", 1), ("doppler", 0)):
        mask, _ = ti_oob(cube, RADAR, grouping=along, cfar_axes="range")
        assert mask.sum() > found["both"].sum()
        assert np.ptp(np.nonzero(mask)[axis]) >= 2
    assert not (found["both"] & ~found["none"]).any()
    assert found["none"].sum() > 3


def test_over_range_alone_an_echo_at_all_speeds_is_seen() -> None:
    """A range bin that is full of echoes hides from CFAR over Doppler, not from that over range."""
    targets = [(2.0, speed, 0.0, 0.0) for speed in np.linspace(-3.5, 3.5, 15)]
    both, alone = (
        ti_oob(cube_of(*targets), RADAR, cfar_axes=axes)[0].sum() for axes in ("both", "range")
    )
    assert both == 0
    assert alone >= 8


@pytest.mark.parametrize("mode", ["ca", "cago", "caso"])
@pytest.mark.parametrize("axis", ["range", "doppler"])
def test_the_noise_beside_a_cell_is_that_of_the_mode(mode: str, axis: str) -> None:
    """The level rises by a step along the axis; a cell just below it has both beside it."""
    level = np.zeros((32, 40))
    across = level.T if axis == "range" else level
    across[20:, :] = 10.0
    found = _along(level, mode, 4, 2) if axis == "range" else _around(level, mode, 4, 2)
    noise = found.T[:, 5] if axis == "range" else found[:, 5]
    # Cells 21 to 24 are those above 18, of which 14 to 15 are below.
    assert noise[18] == {"ca": 5.0, "cago": 10.0, "caso": 0.0}[mode]
    assert noise[10] == 0.0
    if axis == "range":  # at the ends one side is whole, and counts alone
        assert noise[0] == 0.0
        assert noise[39] == 10.0
    else:  # a circle
        assert noise[0] == noise[18]


def test_the_radar_says_how_its_chip_detects() -> None:
    own = dataclasses.replace(RADAR, chip=rt.Chip(grouping="none", threshold_db=20.0, max_points=7))
    cube = cube_of(*TWO)
    given = ti_oob(cube, RADAR, grouping="none", max_points=7)[0]
    np.testing.assert_array_equal(ti_oob(cube, own, threshold_db=15.0)[0], given)
    assert ti_oob(cube, own, grouping="both")[0].sum() == 2
    assert rt.Radar.load(plain(own)) == own


def test_the_list_ends_at_so_many_points_receding_ones_first() -> None:
    many = [(1.2 + 0.3 * k, speed, 0.0, 0.0) for k in range(8) for speed in (-2.0, 0.0, 2.0)]
    whole, _ = ti_oob(cube_of(*many), RADAR)
    speeds = RADAR.velocity_mps(32)[np.nonzero(whole)[1]]
    assert len(speeds) >= 20
    receding = int((speeds > -0.5).sum())
    for most in (1, receding):
        mask, sines = ti_oob(cube_of(*many), RADAR, max_points=most)
        assert mask.sum() == len(sines) == most
        assert (RADAR.velocity_mps(32)[np.nonzero(mask)[1]] > -0.5).all()
        assert not (mask & ~whole).any()


def test_one_line_of_antennas_measures_one_angle() -> None:
    y_line = dataclasses.replace(RADAR, tx_z=0, rx_z=0)
    mask, sines = ti_oob(cube_of((2.0, 1.0, 0.25, 0.0), radar=y_line), y_line)
    np.testing.assert_array_equal(sines, [[0.25, np.nan]])
    place = points_of_sines(sines, mask, np.ones(mask.shape), y_line, 0.0).points[0]
    assert np.isnan(place[2])
    assert place[1] == pytest.approx(0.25 * np.hypot(place[0], place[1]))
    z_line = dataclasses.replace(RADAR, tx_y=0, rx_y=0)
    _, sines = ti_oob(cube_of((2.0, 1.0, 0.0, 0.25), radar=z_line), z_line)
    np.testing.assert_allclose(sines, [[np.nan, 0.25]], atol=0.01)


def test_a_board_with_one_raised_tx_measures_both_angles() -> None:
    """The array of an IWR1443 in its own order, turned; directions are in the radar's axes."""
    half = RADAR.wavelength_m / 2
    board = dataclasses.replace(
        RADAR,
        tx_positions_m=[(0, 0, 0), (0, 2 * half, half), (0, 4 * half, 0)],
        rx_positions_m=[(0, k * half, 0) for k in range(4)],
        tx_order=(0, 2, 1),
        frame_duration_s=60e-6 * 3 * 32,
        yaw_deg=30.0,
    )
    u, w = 0.3, -0.2
    there = board.axes @ np.array([np.sqrt(1 - u * u - w * w), u, w])
    mask, sines = ti_oob(cube_of((2.5, 1.5, there[1], there[2]), radar=board), board)
    np.testing.assert_allclose(sines, [[u, w]], atol=0.03)
    place = points_of_sines(sines, mask, np.ones(mask.shape), board, 0.0).points[0]
    np.testing.assert_allclose(place, 2.5 * there, atol=0.1)


def test_azimuth_is_on_the_grid_of_measured_clouds() -> None:
    """The direction along y is a whole number of 1/32, as in clouds that such a chip gave."""
    walk = rt.synthetic_motion("walk", duration_s=0.5)
    placed = dataclasses.replace(RADAR, position_m=(-4.0, 0.0, 1.0), samples_per_chirp=128)
    result = rt.run(
        walk, placed, fidelity="analytic", detector="ti-oob", detector_options={"max_points": 64}
    )
    clouds = {"simulated": (result.spatial.points - placed.position_m)[:, [1, 0, 2]]}
    measured = os.environ.get("RTRADAR_MEASURED")
    if measured:
        with np.load(Path(measured) / "mars" / "person1_test.npz") as file:
            clouds["measured"] = file["points"][:, :3]  # sideways, away, up
    for name, points in clouds.items():
        bins = 32 * points[:, 0] / np.linalg.norm(points, axis=1)
        assert len(bins) > 20, name
        # Files have places of 10 bits after the point; at 2 m that is 0.01 of a bin.
        assert np.abs(bins - np.rint(bins)).max() < 0.02, name
    counts = np.unique(result.spatial.time, return_counts=True)[1]
    assert counts.max() <= 64
    assert result.summary["parameters"]["detector_options"] == {"max_points": 64}


@pytest.mark.parametrize(
    ("options", "changes", "says"),
    [
        ({"threshold_db": 0.0}, {}, "threshold_db = 0.0; it must be above 0 dB"),
        ({"threshold_db": math.nan}, {}, "threshold_db = nan; it must be above 0"),
        ({"max_points": math.inf}, {}, "max_points = inf; it must be a whole number"),
        ({"max_points": 0}, {}, "max_points = 0; it must be a whole number"),
        ({"points": 3}, {}, "no option 'points'; allowed: threshold_db, max_points"),
        ({"cfar_axes": "all"}, {}, "cfar_axes = 'all'; allowed: both, range"),
        ({"grouping": 1}, {}, "grouping = 1; allowed: both, range, doppler, none"),
        ({}, {"multiplexing": "fdm"}, "multiplexing = 'fdm'; the chain is that of tdm"),
        ({}, {"frame_duration_s": 60e-6 * 4 * 5}, "5 Doppler bins leave no cell"),
    ],
)
def test_what_the_chain_cannot_do_is_refused(
    options: dict[str, Any], changes: dict[str, Any], says: str
) -> None:
    radar = dataclasses.replace(RADAR, **changes)
    cube = np.ones((radar.cycles_per_frame, radar.n_tx, radar.n_rx, 64), np.complex64)
    with pytest.raises(InputError, match=says):
        build_point_detector("ti-oob", radar, options=options)(cube)


def test_options_reach_detectors_of_power_too() -> None:
    power = np.ones((9, 9))
    power[4, 4] = 1e3
    assert build_detector("os-cfar", pfa=1e-3, looks=1, options={"guard": 0})(power).sum() == 1
    with pytest.raises(InputError, match="'ca-cfar' has no option 'quantile'; allowed: guard"):
        build_detector("ca-cfar", pfa=1e-3, looks=1, options={"quantile": 0.5})
    with pytest.raises(InputError, match="'ti-oob' takes all channels"):
        build_detector("ti-oob", pfa=1e-3, looks=1)


def test_another_package_may_give_points(monkeypatch: pytest.MonkeyPatch) -> None:
    def given(cube: Any, radar: Any, *, window_functions: Any, sines: int = 2) -> Any:
        mask = np.zeros((cube.shape[3], cube.shape[0]), dtype=bool)
        mask[5, 3] = True
        return mask, np.zeros((1, sines))

    monkeypatch.setitem(rt.process.DETECTORS._registered, "given", given)
    mask, found = build_point_detector("given", RADAR)(cube_of())
    assert (mask.sum(), found.tolist()) == (1, [[0.0, 0.0]])
    with pytest.raises(ExtensionError, match=r"sines of shape \(1, 3\)"):
        build_point_detector("given", RADAR, options={"sines": 3})(cube_of())
