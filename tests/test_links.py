"""Several radars in one run: each as alone, and what one sends and another receives."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rtradar as rt
from rtradar.errors import InputError, ValidityWarning
from rtradar.pipeline.links import link_of, links_of

OPTIONS: dict[str, Any] = {"fidelity": "specular", "duration_s": 0.1, "snr_db": np.inf}


def board(name: str, place: tuple[float, float, float], **fields: Any) -> rt.Radar:
    table = {
        "name": name,
        "start_frequency_hz": 24e9,
        "bandwidth_hz": 1e9,
        "chirp_duration_s": 200e-6,
        "samples_per_chirp": 64,
        "frame_duration_s": 0.05,
        "tx_positions_m": [[0.0, 0.0, 0.0]],
        "rx_positions_m": [[0.0, 0.1, 0.0], [0.0, 0.106, 0.0]],
        "position_m": list(place),
    }
    return rt.Radar.load(table | fields)


@pytest.fixture(scope="module")
def walk() -> rt.Motion:
    return rt.synthetic_motion("walk", duration_s=0.5)


LEFT, RIGHT = (-3.0, 1.5, 1.0), (-3.0, -1.5, 1.0)


def test_each_radar_receives_what_it_receives_alone(walk: rt.Motion, tmp_path: Path) -> None:
    radars = [board("left", LEFT), board("right", RIGHT), board("same", LEFT)]
    found = rt.run(walk, radars, out=tmp_path, **OPTIONS)
    assert [*found] == ["left", "right", "same"]
    for radar in radars:
        alone = rt.run(walk, radar, **OPTIONS)
        own = found[radar.name].maps["range_doppler"].values
        np.testing.assert_array_equal(own, alone.maps["range_doppler"].values)
        assert (tmp_path / radar.name / "summary.json").is_file()
    first, other = (found[name].maps["range_doppler"].values for name in ("left", "same"))
    np.testing.assert_array_equal(first, other)


def test_a_link_is_a_radar_with_the_antennas_of_two(walk: rt.Motion) -> None:
    left, right = board("left", LEFT), board("right", RIGHT)
    found = rt.run(walk, [left, right], links="all", **OPTIONS)
    assert [*found] == ["left", "right", "left>right", "right>left"]
    pair = board("pair", RIGHT, tx_positions_m=[[0.0, 3.0, 0.0]])
    by_hand = rt.run(walk, pair, **OPTIONS).maps["range_doppler"].values
    np.testing.assert_allclose(
        found["left>right"].maps["range_doppler"].values, by_hand, rtol=1e-6, atol=1e-12
    )


def test_both_ways_of_a_link_are_one(walk: rt.Motion) -> None:
    # One antenna on each end, which looks more into some directions than into others.
    pattern = {"pattern": "cosine", "exponent": 4.0}
    fields: dict[str, Any] = {"rx_positions_m": [[0.0, 0.0, 0.0]]}
    fields |= {"tx_antenna": pattern, "rx_antenna": pattern}
    radars = [
        board("left", LEFT, yaw_deg=-40.0, **fields),
        board("right", RIGHT, yaw_deg=40.0, **fields),
    ]
    found = rt.run(walk, radars, links="all", **OPTIONS)
    there, back = (
        found[name].maps["range_doppler"].values for name in ("left>right", "right>left")
    )
    np.testing.assert_allclose(there, back, rtol=1e-5, atol=1e-5 * there.max())


def test_a_turned_antenna_looks_elsewhere() -> None:
    antenna = rt.Antenna(pattern="cosine", exponent=2.0, angles_deg=(90.0, 0.0, 0.0))
    power = antenna.relative(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), "v")
    assert power == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
    up = rt.Antenna(pattern="cosine", exponent=2.0, angles_deg=(0.0, 90.0, 0.0))
    assert up.relative(np.array([0.0, 0.0, 1.0]), "v") == pytest.approx(1.0)
    sender = board("a", LEFT, yaw_deg=20.0, pitch_deg=-30.0, tx_antenna={"pattern": "dipole"})
    receiver = board("b", RIGHT, yaw_deg=-50.0, roll_deg=10.0)
    with pytest.warns(ValidityWarning, match="up is another direction"):
        link = link_of(sender, receiver)
    assert link.tx_antenna is not None
    world = np.random.default_rng(0).normal(size=(9, 3))
    seen = link.tx_antenna.relative(world @ receiver.axes, "v")
    assert seen == pytest.approx(rt.Antenna(pattern="dipole").relative(world @ sender.axes, "v"))


@pytest.mark.parametrize(
    ("radars", "links", "words"),
    [
        ([], "own", "give at least one"),
        ([board("a", LEFT)], "each", "links = 'each'; allowed: own, all"),
        ([board("a", LEFT), board("a", RIGHT)], "own", "a name of its own"),
        ([board("a>b", LEFT)], "own", "a name of its own"),
        (
            [board("a", LEFT), board("b", RIGHT, bandwidth_hz=2e9)],
            "all",
            "bandwidth_hz = .* same chirps",
        ),
        (
            [board("a", LEFT), board("b", RIGHT, tx_positions_m=[[0.0] * 3, [0.0, 0.01, 0.0]])],
            "all",
            "1 and 2 Tx",
        ),
    ],
)
def test_what_is_no_link_is_refused(radars: list[rt.Radar], links: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        links_of(radars, rt.Scene(), links)


def test_errors_of_one_board_and_unlike_frames_have_no_link() -> None:
    left, right = board("left", LEFT), board("right", RIGHT)
    noisy = dataclasses.replace(right, receiver=rt.Receiver(iq_phase_deg=1.0))
    with pytest.raises(InputError, match=r"of a \[receiver\] are those of one board"):
        link_of(left, noisy)
    framed = [
        dataclasses.replace(one, frame_period_s=0.1, chirps_per_frame=count)
        for one, count in ((left, 100), (right, 200))
    ]
    with pytest.raises(InputError, match="chirps_per_frame = 100 and 200"):
        link_of(*framed)


def test_one_place_of_a_scene_is_not_for_two() -> None:
    one, other = rt.Radar.preset("iwr1443"), rt.Radar.preset("iwr6843")
    with pytest.raises(InputError, match="iwr1443 and iwr6843 have no place of their own"):
        links_of([one, other], rt.Scene(), "own")
    placed = dataclasses.replace(other, position_m=(-2.0, 0.0, 1.0))
    assert [*links_of([one, placed], rt.Scene(), "own")] == ["iwr1443", "iwr6843"]
