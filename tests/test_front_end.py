"""Antenna patterns against closed forms, their effect on echoes, and fields of a receiver."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

import rtradar as rt
from rtradar.body.body import Poses
from rtradar.front_end import Antenna
from rtradar.scatter import build_model, chirp_poses
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.common.polarization import unit
from rtradar.scatter.specular_points import solve_specular_points

BODY = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.2))


class Ball:
    """A body of one ball, in the middle of the room."""

    part_names, duration_s, owner = ("ball",), 1.0, np.zeros(1, dtype=np.int64)
    semi_axes = np.full((1, 3), 0.1)

    def at(self, times: NDArray[np.float64]) -> Poses:
        many = len(times), 1
        centres = np.broadcast_to([0.0, 0.0, 1.0], (*many, 3))
        return Poses(centres, np.broadcast_to(np.eye(3), (*many, 3, 3)), self.semi_axes)


def towards(azimuth_deg: float, elevation_deg: float) -> NDArray[np.float64]:
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    across = math.cos(elevation)
    return 7.0 * np.array(
        [across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)]
    )


@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.5, 20.0])
def test_cosine(exponent: float) -> None:
    antenna = Antenna(pattern="cosine", exponent=exponent)
    for azimuth, elevation in ((0, 0), (40, 0), (0, -25), (30, 30)):
        ahead = math.cos(math.radians(azimuth)) * math.cos(math.radians(elevation))
        assert antenna.relative(towards(azimuth, elevation), "v") == pytest.approx(ahead**exponent)
    assert antenna.relative(towards(120, 0), "v") == 0
    # Without losses, the gain has the mean 1 over the sphere.
    power, _ = quad(lambda t: math.cos(t) ** exponent * math.sin(t) / 2, 0, math.pi / 2)
    assert antenna.peak_gain * power == pytest.approx(1)


def test_dipole() -> None:
    antenna = Antenna(pattern="dipole")
    # Balanis, eq. 4-84: [cos(pi/2 cos t) / sin t]^2, t from the wire; 3 dB at 51 and 129 degrees.
    assert antenna.relative(towards(77, 0), "v") == pytest.approx(1)
    assert antenna.relative(towards(0, 45), "v") == pytest.approx(
        (math.cos(math.pi / 2 * math.sqrt(0.5)) ** 2) * 2
    )
    assert antenna.relative(towards(45, 0), "h") == pytest.approx(
        antenna.relative(towards(0, 45), "v")
    )
    assert antenna.relative(np.array([0, 0, 1.0]), "v") == pytest.approx(0, abs=1e-12)
    power, _ = quad(
        lambda t: (math.cos(math.pi / 2 * math.cos(t)) / math.sin(t)) ** 2 * math.sin(t) / 2,
        0,
        math.pi,
    )
    assert antenna.peak_gain * power == pytest.approx(1)
    assert 10 * math.log10(antenna.peak_gain) == pytest.approx(2.15, abs=0.005)


def test_table() -> None:
    antenna = Antenna(
        pattern="table",
        gain_dbi=10,
        azimuth_deg=(-60, 0, 60),
        azimuth_db=(-12, 0, -12),
        elevation_deg=(-15, 15),
        elevation_db=(-6, 0),
    )
    assert antenna.peak_gain == pytest.approx(10)
    for azimuth, elevation, level in (
        (0, 15, 0),
        (30, 15, -6),
        (-30, 0, -9),
        (60, -15, -18),
        (90, -40, -18),
    ):
        assert 10 * np.log10(antenna.relative(towards(azimuth, elevation), "v")) == pytest.approx(
            level
        )


@pytest.mark.parametrize("cut", ["azimuth", "elevation"])
def test_a_cut_that_is_left_out_is_flat(cut: str) -> None:
    table: dict[str, Any] = {f"{cut}_deg": [0, 40], f"{cut}_db": [0, -8]}
    antenna = Antenna(pattern="table", gain_dbi=3, **table)
    for angle, level in ((0, 0), (20, -4), (40, -8)):
        for other in (-30, 0, 60):
            azimuth, elevation = (angle, other) if cut == "azimuth" else (other, angle)
            assert 10 * np.log10(
                antenna.relative(towards(azimuth, elevation), "v")
            ) == pytest.approx(level, abs=1e-9)


def test_an_isotropic_antenna_is_the_same_all_round() -> None:
    everywhere = np.stack(
        [towards(azimuth, elevation) for azimuth in (-120, 0, 77) for elevation in (-90, 0, 45)]
    )
    assert Antenna().relative(everywhere, "h").tolist() == [1.0] * 9
    assert Antenna().peak_gain == 1


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"pattern": "yagi"}, "allowed: isotropic, cosine, dipole, table"),
        ({"pattern": "cosine"}, "only 'cosine' has one, and needs it"),
        ({"exponent": 2}, "only 'cosine' has one"),
        ({"pattern": "cosine", "exponent": -1}, "must be a number from 0 to 10000"),
        ({"pattern": "cosine", "exponent": "two"}, "must be a number"),
        ({"pattern": "table", "azimuth_deg": [0], "azimuth_db": [0]}, "needs gain_dbi"),
        ({"pattern": "table", "gain_dbi": 3}, "needs azimuth_deg"),
        (
            {"pattern": "table", "gain_dbi": 3, "azimuth_deg": [0, 0], "azimuth_db": [0, -1]},
            "angles ascend",
        ),
        ({"pattern": "table", "gain_dbi": 3, "azimuth_deg": [0, 1], "azimuth_db": [0]}, "as many"),
        (
            {"pattern": "table", "gain_dbi": 3, "azimuth_deg": [0], "azimuth_db": [1]},
            "must be a list of numbers from -300 to 0",
        ),
        (
            {"gain_dbi": 10**400},
            "gain_dbi = a number of more than 20 digits; it must be a number from",
        ),
        ({"azimuth_deg": [0]}, "'table' needs azimuth_deg and azimuth_db"),
        ({"gain": 3}, "unknown key 'gain'"),
        ({"two\nlines": 3}, r"unknown key 'two\\nlines'"),
        ({"gain_dbi": float("nan")}, "gain_dbi = nan; it must be a number from -100"),
        (
            {"pattern": "table", "gain_dbi": 3, "azimuth_deg": 16**5000},
            "azimuth_deg = a number of more than 20 digits; it must be a list of numbers",
        ),
    ],
)
def test_what_has_no_meaning_is_refused(fields: dict[str, Any], said: str) -> None:
    with pytest.raises(rt.InputError, match=f"tx_antenna: .*{said}"):
        rt.Radar(tx_antenna=fields)


def test_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "patch.toml"
    path.write_text(
        'tx_y = 1\n[tx_antenna]\npattern = "cosine"\nexponent = 2\n'
        '[rx_antenna]\npattern = "dipole"\ngain_dbi = 1.5\n'
    )
    radar = rt.Radar.load(path)
    assert radar.tx_antenna == Antenna(pattern="cosine", exponent=2.0)
    assert radar.rx_antenna == Antenna(pattern="dipole", gain_dbi=1.5)
    assert hash(radar) == hash(dataclasses.replace(radar))


@pytest.mark.parametrize("fidelity", ["analytic", "specular"])
def test_each_leg_of_an_echo_has_the_gain_of_its_direction(fidelity: str) -> None:
    plain = rt.Radar(tx_y=2, tx_z=1, rx_y=3, rx_z=3, position_m=(-2.0, 1.5, 0.8))
    shaped = dataclasses.replace(
        plain,
        tx_antenna=Antenna(pattern="cosine", exponent=6.0),
        rx_antenna=Antenna(pattern="dipole", gain_dbi=0.0),
    )
    chirps = np.arange(6)
    before, after = (build_model(fidelity, radar, BODY).echoes(chirps) for radar in (plain, shaped))
    np.testing.assert_array_equal(after.length, before.length)
    at = chirp_poses(plain, BODY, chirps)
    found = []
    for chirp, rx, part in np.ndindex(6, 3, 21):
        if before.amplitude[0, chirp, rx, part] == 0:
            assert after.amplitude[0, chirp, rx, part] == 0
            continue
        centre = at.centres[chirp, part]
        out, back = centre - at.tx[chirp], centre - at.rx[chirp, rx]
        ahead = out[0] / np.linalg.norm(out)
        along = back[2] / np.linalg.norm(back)
        expected = ahead**3 * math.cos(math.pi / 2 * along) / math.sqrt(1 - along**2)
        found.append(
            abs(after.amplitude[0, chirp, rx, part] / before.amplitude[0, chirp, rx, part])
            / expected
        )
    # By the centres of the parts here, by their specular points there: up to a few degrees at 2 m.
    assert np.median(found) == pytest.approx(1, abs=0.02)
    assert max(np.abs(np.log(found))) < 0.3


TURNS = {"path_times_s": (0.0, 0.2), "path_angles_deg": ((-36, 0, 0), (36, 0, 0))}


def through_patterns(
    level: str, plain: rt.Radar, chirps: NDArray[np.int64]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Amplitudes (node, chirp, rx, part) through cosine patterns: found, and by the directions of
    the specular points at every chirp."""
    beam = Antenna(pattern="cosine", exponent=6.0)
    shaped = dataclasses.replace(plain, tx_antenna=beam, rx_antenna=beam)
    before, after = (build_model(level, radar, BODY).echoes(chirps) for radar in (plain, shaped))
    at = chirp_poses(plain, BODY, chirps)
    points = solve_specular_points(at, points=True)[2]
    ahead = np.broadcast_to(at.axes, (len(chirps), 3, 3))[:, None, None, :, 0]
    ways = [unit(points - place) for place in (at.tx[:, None, None], at.rx[:, :, None])]
    cosines = [np.sum(way * ahead, axis=-1) for way in ways]
    return after.amplitude, before.amplitude * cosines[0] ** 3 * cosines[1] ** 3


def test_directions_are_those_of_the_specular_points() -> None:
    plain = rt.Radar(tx_y=2, tx_z=0, rx_y=2, rx_z=0, position_m=(-4.0, 1.0, 1.0))
    found, expected = through_patterns("analytic", plain, np.arange(2))
    np.testing.assert_allclose(found, expected, rtol=1e-3)


@pytest.mark.parametrize("moves", [{}, TURNS], ids=["at-rest", "turns"])
@pytest.mark.parametrize("level", ["analytic", "specular", "physical-optics"])
def test_patterns_are_followed_between_keyframes_and_antennas(
    level: str, moves: dict[str, Any]
) -> None:
    plain = rt.Radar(tx_y=6, tx_z=0, rx_y=2, rx_z=0, position_m=(-4.0, 1.0, 1.0), **moves)
    cycles = np.round(np.linspace(0, 0.15, 7) / plain.cycle_duration_s).astype(int)
    chirps = (plain.n_tx * cycles[:, None] + np.arange(plain.n_tx)).ravel()
    found, expected = through_patterns(level, plain, chirps)
    error = np.linalg.norm(found - expected) / np.linalg.norm(expected)
    # A part takes the specular point for the middle of the receivers, and a straight line in time.
    assert error < 1e-3


def test_a_part_straight_between_tx_and_rx_has_no_echo_and_no_nan() -> None:
    radar = rt.Radar(
        tx_positions_m=((0, 1, 0),),
        rx_positions_m=((0, -1, 0),),
        position_m=(0.0, 0.0, 1.0),
        rx_antenna=Antenna(pattern="dipole"),
    )
    body: Any = Ball()
    echoes = build_model("analytic", radar, body).echoes(np.arange(1))
    np.testing.assert_array_equal(echoes.amplitude, 0)


@pytest.mark.parametrize(("side", "received"), [("near", False), ("far", True)])
def test_a_room_is_received_through_the_pattern(side: str, received: bool) -> None:
    """A wall ahead answers as before, to the last bit of the peak; one behind does not at all."""
    room = rt.Scene.load("living-room")
    walls = tuple(wall for wall in room.walls if wall.name == side)
    scene = rt.Scene(walls=walls, radar_position_m=room.radar_position_m)
    looking = Antenna(pattern="cosine", exponent=2)
    powers = [
        sum(item.power_m2 for item in Clutter(scene.place(radar), scene, order=1).kept)
        for radar in (
            rt.Radar(tx_y=1, tx_z=0, rx_y=2, rx_z=0),
            rt.Radar(tx_y=1, tx_z=0, rx_y=2, rx_z=0, tx_antenna=looking, rx_antenna=looking),
        )
    ]
    assert powers[0] > 0
    assert powers[1] == pytest.approx(powers[0] if received else 0, rel=1e-3)


RAMPS = {"start_frequency_hz": 12e9, "slope_hz_per_s": 1e12, "ramp_s": 1e-4, "period_s": 2e-4}


def test_a_file_gives_what_its_tables_say(tmp_path: Path) -> None:
    file = tmp_path / "radar.toml"
    file.write_text(
        "transmit_power_dbm = 12\n[receiver]\nhighpass_hz = [175e3, 350e3]\nadc_bits = 12\n"
        "adc_full_scale_dbm = -30\n[receiver.interferer]\nstart_frequency_hz = 12e9\n"
        "slope_hz_per_s = -1e13\nramp_s = 1e-4\nperiod_s = 1e-4\npower_dbm = -60\n"
    )
    receiver = rt.Radar.load(file).receiver
    assert receiver is not None
    assert receiver.highpass_hz == (175e3, 350e3)
    assert receiver.adc_bits == 12
    assert receiver.interferer == rt.Interferer(
        start_frequency_hz=12e9, slope_hz_per_s=-1e13, ramp_s=1e-4, period_s=1e-4, power_dbm=-60.0
    )
    assert rt.Radar().receiver is None


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"adc_bits": 8}, "needs adc_full_scale_dbm"),
        ({"leakage_db": 3}, "from -200 to 0"),
        ({"adc_bits": 8.5, "adc_full_scale_dbm": 0}, "whole number"),
        ({"highpass_hz": 1e5}, "list of numbers"),
        ({"seed": -1}, "seed = -1"),
        ({"interferer": 3}, "table"),
        ({"phase_noise_hz": [1e6]}, "as many"),
        ({"phase_noise_hz": [2e6, 1e6], "phase_noise_dbc_hz": [-90, -90]}, "ascend"),
        ({"interferer": RAMPS}, "power_dbm is missing"),
        ({"interferer": {**RAMPS, "power_dbm": 0, "period_s": 1e-5}}, "shorter than its ramp"),
        ({"image": 1}, "unknown key 'image'"),
    ],
)
def test_what_a_receiver_cannot_be_is_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(rt.InputError, match=message) as caught:
        rt.Radar(receiver=fields, transmit_power_dbm=10)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("fields", "radar", "message"),
    [
        ({"dc_dbm": -60}, {}, "needs transmit_power_dbm"),
        ({"iq_phase_deg": 1}, {"multiplexing": "fdm"}, "acts on all bands of FDM"),
        ({"channel_gain_db": [1.0, 2.0]}, {}, "one for each of 96 channels"),
    ],
)
def test_a_receiver_must_fit_its_radar(
    fields: dict[str, Any], radar: dict[str, Any], message: str
) -> None:
    with pytest.raises(rt.InputError, match=message):
        rt.Radar(receiver=rt.Receiver(**fields), **radar)
