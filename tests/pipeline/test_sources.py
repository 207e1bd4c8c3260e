"""Who returned a cell, against maps that are simulated for each person alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
import xarray as xr

import rtradar as rt
from rtradar.pipeline.output.truth import EchoTable
from rtradar.pipeline.prepare import prepare
from rtradar.pipeline.sources import Sources
from rtradar.scene import Wall, material
from rtradar.settings import RunSettings

RADAR = replace(rt.Radar.preset("paper-12ghz"), tx_y=2, tx_z=1, rx_y=4, rx_z=4)
WALKER = rt.Person(rt.synthetic_motion("walk", duration_s=0.5), (0.3, 1.2))
KICKER = rt.Person(rt.synthetic_motion("kick", seed=1, duration_s=0.5), (0.0, 0.5))


@pytest.fixture(scope="module")
def together() -> rt.Result:
    return rt.run([WALKER, KICKER], RADAR, duration_s=0.15)


def test_a_cell_is_of_the_person_who_returns_most_of_it_alone(together: rt.Result) -> None:
    alone = [
        rt.run(person, RADAR, duration_s=0.15, noise_power_m2=0.0).maps["range_doppler"].values
        for person in (WALKER, KICKER)
    ]
    detected = together.maps["detections"].values.astype(bool)
    ratio_db = 10 * np.log10(alone[1][detected] / alone[0][detected].astype(float))
    source = together.maps["source"].values[detected]
    clear = np.abs(ratio_db) > 3
    assert clear.sum() > 300
    assert {0, 1} <= set(np.unique(source).tolist())
    assert (source[clear] == (ratio_db[clear] > 0)).mean() > 0.99
    assert (together.maps["source"].values[~detected] == -1).all()


def test_points_have_the_source_of_their_cell(together: rt.Result) -> None:
    cloud = together.spatial
    assert cloud.source is not None
    maps = together.maps
    for time, place, velocity, source in zip(
        cloud.time[::50], cloud.points[::50], cloud.velocity[::50], cloud.source[::50], strict=True
    ):
        cell = maps["source"].sel(
            time=time,
            range=np.linalg.norm(place - RADAR.position_m),
            velocity=velocity,
            method="nearest",
        )
        assert int(cell) == source


def test_expected_power_is_that_of_the_map() -> None:
    """Of one person without noise: interference leaves decibels in a cell, and none in the sum."""
    result = rt.run(WALKER, RADAR, duration_s=0.15, snr_db=60)
    settings = RunSettings(duration_s=0.15, snr_db=60)
    capture = prepare([WALKER], RADAR, rt.Scene(), settings)
    start = int(capture.frame_starts[0])
    found = result.maps["range_doppler"].values[0]
    of_parts = Sources(EchoTable(capture)).expected(start, *np.nonzero(np.ones(found.shape)))
    expected = of_parts.sum(axis=0).reshape(found.shape)
    strong = found > 1e-4 * found.max()
    ratio_db = 10 * np.log10(expected[strong] / found[strong])
    assert abs(np.median(ratio_db)) < 0.5
    assert (np.abs(ratio_db) < 6).mean() > 0.95
    assert abs(10 * np.log10(expected.sum() / found.sum())) < 0.5


def test_noise_is_nobody() -> None:
    result = rt.run(WALKER, RADAR, duration_s=0.15, pfa=1e-2)
    detected = result.maps["detections"].values.astype(bool)
    source = result.maps["source"].values
    far = detected & (np.abs(result.maps["velocity"].values) > 8)
    assert far.sum() > 1000
    assert (source[far] == -1).all()


def test_a_wall_is_the_rooms() -> None:
    """Without removal of clutter the wall at rest is the room's, and the walker is a person."""
    wall = Wall(
        name="back",
        corner_m=(2.0, 2.0, 0.0),
        edge_u_m=(0.0, 0.0, 2.5),
        edge_v_m=(0.0, -4.0, 0.0),
        material=material("concrete"),
        thickness_m=0.2,
    )
    scene = rt.Scene(walls=(wall,))
    result = rt.run(WALKER, RADAR, scene, duration_s=0.15, fidelity="analytic")
    cloud = result.spatial
    assert cloud.source is not None
    range_m = np.linalg.norm(cloud.points - result.radar.position_m, axis=1)
    wall_cells = (np.abs(cloud.velocity) < 0.02) & (np.abs(range_m - 6.0) < 0.05)
    assert wall_cells.any()
    assert (cloud.source[wall_cells] == -1).all()
    assert (cloud.source[np.abs(cloud.velocity) > 1.0] == 0).mean() > 0.8


def test_a_part_of_its_own_source_returns_most_of_a_cell(together: rt.Result) -> None:
    """Of points near one hand and far from all other parts, that hand is the part."""
    cloud, truth = together.spatial, together.truth
    assert cloud.source is not None
    assert cloud.part is not None
    known = cloud.source >= 0
    np.testing.assert_array_equal(known, cloud.part >= 0)
    assert (truth["person"].values[cloud.part[known]] == cloud.source[known]).all()
    range_m = np.linalg.norm(cloud.points - RADAR.position_m, axis=1)
    of_frame = truth.sel(time=xr.DataArray(cloud.time), method="nearest")
    away = np.abs(of_frame["range_m"].values - range_m[:, None]) / RADAR.range_bin_m
    away += np.abs(of_frame["range_rate_mps"].values - cloud.velocity[:, None])
    nearest, next_one = np.sort(away, axis=1)[:, :2].T
    clear = known & (nearest < 1) & (next_one > 4)
    assert clear.sum() > 100
    assert (cloud.part[clear] == away.argmin(axis=1)[clear]).mean() > 0.95


def test_an_object_comes_after_the_people() -> None:
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    motion = rt.FollowingPath(velocity_mps=(1.5, 0.0, 0.0))
    cart = rt.Object("cart", box, "metal", position_m=(-2.5, 1.0, 1.0), motion=motion)
    cloud = rt.run([WALKER, cart], RADAR, duration_s=0.15).spatial
    assert cloud.source is not None
    range_m = np.linalg.norm(cloud.points - RADAR.position_m, axis=1)
    # Between 1.4 m and its front 0.22 m further; the walker is 4 m away, and comes nearer.
    of_cart = (range_m < 2.0) & (np.abs(cloud.velocity - 1.5) < 0.2)
    assert of_cart.sum() > 10
    assert (cloud.source[of_cart] == 1).mean() > 0.9
    assert (cloud.source[range_m > 3.0] == 0).mean() > 0.8


def test_who_returned_a_cell_does_not_depend_on_how_far_ahead_is_looked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = []
    for ahead in (1, 8):
        monkeypatch.setattr("rtradar.pipeline.output.truth._LOOKS_AHEAD", ahead)
        found.append(rt.run([WALKER, KICKER], RADAR, duration_s=0.15).maps["source"].values)
    np.testing.assert_array_equal(*found)
