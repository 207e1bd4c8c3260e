"""What is true of each person, part and echo, against closed forms and the IF samples."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import rtradar as rt
from rtradar.body import Body
from rtradar.body.people import body_of_people
from rtradar.errors import InputError
from rtradar.motion import place
from rtradar.pipeline.output.truth import CYCLES_COMPARED, truth_of
from rtradar.pipeline.output.writer import open_maps
from rtradar.settings import RunSettings

RADAR = replace(rt.Radar.preset("paper-12ghz"), tx_y=2, tx_z=0, rx_y=3, rx_z=0)
WALK = rt.synthetic_motion("walk", duration_s=0.5)


@pytest.fixture(scope="module")
def alone() -> rt.Result:
    return rt.run(WALK, RADAR, duration_s=0.2, fidelity="analytic", snr_db=60)


def test_it_has_a_row_for_each_frame_and_a_column_for_each_part(alone: rt.Result) -> None:
    truth = alone.truth
    np.testing.assert_array_equal(truth["time"], alone.maps["time"])
    assert truth["range_m"].dims == truth["power_m2"].dims == ("time", "part")
    assert truth["range_m"].attrs["units"] == "m"
    assert truth["range_rate_mps"].attrs["units"] == "m/s"
    assert truth["visible"].dtype == bool
    assert len(set(truth["part"].values.tolist())) == 21
    assert (truth["person"] == 0).all()


def test_ranges_and_rates_are_those_of_the_parts(alone: rt.Result) -> None:
    body = Body.from_motion(place(WALK, duration_s=0.2))
    truth, step = alone.truth, 1e-3

    def nearest_m(time_s: float) -> np.ndarray:
        """Distance of each ellipsoid's point on the line to its centre: its specular range."""
        centres, frames, axes = body.at([time_s])
        away = centres[0] - np.array(RADAR.position_m)
        far = np.linalg.norm(away, axis=-1)
        local = np.einsum("pji,pj->pi", frames[0], away / far[:, None])
        return np.asarray(far - np.sqrt((axes**2 * local**2).sum(axis=-1)))

    for row, time_s in enumerate(truth["time"].values):
        # The far-field specular point is up to a^2 / 2 R nearer or farther, 1 cm of the trunk.
        np.testing.assert_allclose(truth["range_m"][row], nearest_m(time_s), atol=0.012)
        rate = (nearest_m(time_s + step) - nearest_m(time_s - step)) / (2 * step)
        # That changes as a limb turns: by up to 0.03 m/s here, of some 2 m/s.
        np.testing.assert_allclose(truth["range_rate_mps"][row], rate, atol=0.05)


def test_the_power_is_that_of_the_echoes_then(alone: rt.Result) -> None:
    capture = rt.simulate(WALK, RADAR, duration_s=0.2, fidelity="analytic", snr_db=60)
    for time_s, power in zip(alone.truth["time"].values, alone.truth["power_m2"], strict=True):
        # Of both Tx, which are as near to the middle of the array, the first one is looked at.
        echoes = capture.echoes(time_s - 0.5e-3, 1e-3)
        own = echoes["amplitude"].sel(chirp=echoes["tx"] == 0)
        expected = (np.abs(own) ** 2).mean(("chirp", "rx"))
        # Over a millisecond the power of a limb changes by a thousandth.
        np.testing.assert_allclose(power, expected, rtol=2e-3)
    assert alone.truth["visible"].all()


def test_a_folder_holds_the_same_as_memory(alone: rt.Result, tmp_path: Path) -> None:
    settings = {"duration_s": 0.2, "fidelity": "analytic", "snr_db": 60}
    out = rt.run(WALK, RADAR, out=tmp_path / "run", **settings)
    assert out.truth.identical(alone.truth)
    with np.load(tmp_path / "run" / "cloud_xyz.npz") as cloud:
        np.testing.assert_array_equal(cloud["part"], alone.spatial.part)
        np.testing.assert_array_equal(cloud["source"], alone.spatial.source)


def test_a_hidden_part_has_a_range_and_no_power() -> None:
    """Seen from behind, the trunk hides an arm that is bent before it."""
    person = rt.Person(rt.synthetic_motion("punch", duration_s=0.5), heading_deg=180)
    truth = rt.run(person, RADAR, duration_s=0.2, fidelity="specular").truth
    hidden = ~truth["visible"]
    assert hidden.any()
    assert (truth["power_m2"].values[hidden] == 0).all()
    assert np.isfinite(truth["range_m"]).all()


def test_objects_come_after_the_people_and_are_nobodys() -> None:
    ball = trimesh.creation.icosphere(3, 0.1)
    motion = rt.FollowingPath(velocity_mps=(1.5, 0.0, 0.0))
    cart = rt.Object("ball", ball, "metal", position_m=(-2.5, 1.0, 1.0), motion=motion)
    truth = rt.run([WALK, cart], RADAR, duration_s=0.15, fidelity="specular").truth
    assert truth["part"].values[-1] == "ball"
    assert truth["person"].values.tolist() == [0] * 21 + [-1]
    of_ball = truth.isel(part=-1)
    expected = 1.5 - 0.1 + 1.5 * truth["time"].values
    np.testing.assert_allclose(of_ball["range_m"], expected, atol=0.01)
    np.testing.assert_allclose(of_ball["range_rate_mps"], 1.5, atol=0.02)


def test_of_if_samples_nothing_is_known() -> None:
    samples = rt.simulate(WALK, RADAR, duration_s=0.2, fidelity="analytic").samples
    with pytest.raises(InputError, match=r"truth: of IF samples .* rt\.run"):
        rt.process_samples(samples, RADAR).truth  # noqa: B018


KICK = rt.synthetic_motion("kick", duration_s=0.2)


def test_truth_is_that_of_each_motion() -> None:
    people = rt.Person(WALK, (1, 0.5)), rt.Person(KICK, (-1, -0.5))
    body = body_of_people(people, RunSettings(duration_s=0.4))
    times = np.array([0.1, 0.3])
    truth = truth_of(body, times)
    alone = [
        body_of_people([rt.Person(WALK, (1, 0.5))], RunSettings(duration_s=0.4)),
        body_of_people([rt.Person(KICK, (-1, -0.5))], RunSettings()),
    ]
    for number, (one, own) in enumerate(zip(alone, (times, [0.1, 0.2]), strict=True)):
        joints = one.motion.at(own)[0]
        np.testing.assert_array_equal(truth["joints"][:, number], joints)
        np.testing.assert_array_equal(truth["person_position"][:, number], joints[:, 0])
    before, after = (alone[0].motion.at(times + step)[0][:, 0] for step in (-1e-4, 1e-4))
    speed = np.linalg.norm(after - before, axis=1) / 2e-4
    np.testing.assert_allclose(truth["person_speed"][:, 0], speed, rtol=1e-2)
    assert truth["person_speed"][1, 1] == 0.0


def test_maps_of_a_run_hold_the_truth(tmp_path: Path) -> None:
    result = rt.run(
        [rt.Person(WALK, (1, 0.5)), rt.Person(WALK, (-1, -0.5))],
        RADAR,
        duration_s=0.15,
        fidelity="analytic",
        out=tmp_path,
    )
    with open_maps(tmp_path / "maps.h5") as maps:
        assert maps["joints"].dims == ("time", "person", "joint", "coordinate")
        assert list(maps["person"].values) == ["synthetic:walk 1", "synthetic:walk 2"]
        place = maps["person_position"].sel(person="synthetic:walk 2", coordinate="x")
        np.testing.assert_allclose(place, -1, atol=0.2)
        assert maps["person_speed"].attrs["units"] == "m/s"
    assert [person["name"] for person in result.summary["people"]] == list(maps["person"].values)


LONG_KICK = rt.synthetic_motion("kick", duration_s=0.5)


def test_each_echo_has_its_chirp_receiver_part_path_and_person() -> None:
    people = [rt.Person(LONG_KICK, (0.0, 0.6)), rt.Person(LONG_KICK, (0.5, -0.6))]
    capture = rt.simulate(people, RADAR, duration_s=0.2, fidelity="specular")
    echoes = capture.echoes(start_s=0.05, duration_s=0.01)
    assert echoes["length_m"].dims == ("chirp", "rx", "echo")
    times = echoes["time"].values
    assert 0.05 <= times.min() < 0.05 + RADAR.chirp_interval_s
    assert 0.06 - RADAR.chirp_interval_s <= times.max() < 0.06
    np.testing.assert_array_equal(echoes["tx"], RADAR.tx_of_chirp(echoes["chirp"].values))
    assert set(echoes["person"].values.tolist()) == {0, 1}
    assert set(echoes["path"].values.tolist()) == {"body"}
    assert len(set(echoes["part"].values.tolist())) == 42
    assert echoes["visible"].dtype == bool
    np.testing.assert_array_equal(echoes["visible"], echoes["amplitude"] != 0)
    assert 0.5 < float(echoes["visible"].mean()) < 1


def test_they_are_those_that_make_the_samples() -> None:
    """A sum of beats, sample by sample, in the middle of a chirp, counted from the first sample."""
    radar = replace(RADAR, adc_start_s=5e-6)
    capture = rt.simulate(
        LONG_KICK, radar, duration_s=0.2, fidelity="specular", snr_db=float("inf")
    )
    echoes, samples = capture.echoes(duration_s=0.02), capture.samples
    tau = echoes["length_m"].values[..., None] / 299_792_458.0
    t = samples["fast_time"].values
    slope = radar.slope_hz_per_s
    start_hz = radar.start_frequency_hz + slope * radar.adc_start_s
    beat = np.exp(2j * np.pi * (start_hz * tau + slope * tau * t - slope * tau**2 / 2))
    expected = (echoes["amplitude"].values[..., None] * beat).sum(axis=2)
    found = samples.values[: len(expected)]
    # Single precision of the samples.
    assert np.abs(found - expected).max() < 2e-5 * np.abs(expected).max()


def test_in_a_room_the_walls_name_the_paths(beside_a_wall: tuple[rt.Radar, rt.Scene]) -> None:
    capture = rt.simulate(
        LONG_KICK, *beside_a_wall, duration_s=0.2, keep_all=True, fidelity="specular"
    )
    echoes = capture.echoes(duration_s=0.001)
    assert {"body", "left > body", "body > left"} <= set(echoes["path"].values.tolist())
    # A way over the wall is longer than the direct one of the same part.
    part = echoes["part"].values[0]
    own = echoes.isel(chirp=0, rx=0, echo=echoes["part"].values == part)
    by_path = dict(zip(own["path"].values.tolist(), own["length_m"].values.tolist(), strict=False))
    assert by_path["left > body"] > by_path["body"]


def test_no_chirp_and_too_many_are_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    capture = rt.simulate(LONG_KICK, RADAR, duration_s=0.2, fidelity="analytic")
    with pytest.raises(InputError, match=r"^[^\n]*no chirp is between start_s = 3\.0[^\n]*$"):
        capture.echoes(start_s=3.0)
    monkeypatch.setattr("rtradar.pipeline.processing.MEMORY_LIMIT_BYTES", 1_000_000)
    with pytest.raises(InputError, match=r"take them for a shorter time \(start_s, duration_s\)"):
        capture.echoes()


def test_two_levels_are_compared_part_by_part(tmp_path: Path) -> None:
    levels = ("analytic", "specular")
    out = tmp_path / "out"
    echoes = rt.compare(LONG_KICK, RADAR, out=out, fidelities=levels, duration_s=0.15).echoes
    assert echoes["field_m"].dims == ("fidelity", "chirp", "rx", "part")
    assert echoes.sizes["chirp"] == CYCLES_COMPARED * RADAR.n_tx
    assert echoes.attrs["reference"] == "specular"
    own, other = (echoes.sel(fidelity=level) for level in ("specular", "analytic"))
    assert (own["field_difference_m"] == 0).all()
    np.testing.assert_array_equal(other["field_m"] - own["field_m"], other["field_difference_m"])
    # The far-field formula's range is off by less than a centimetre, where both see a part.
    both = np.isfinite(other["length_difference_m"].values)
    assert both.any()
    assert np.abs(other["length_difference_m"].values[both]).max() < 0.02


@pytest.mark.slow
def test_several_recordings_have_no_echoes_of_their_own(small: rt.Radar, tmp_path: Path) -> None:
    several = rt.pipeline.compare_recordings(
        [LONG_KICK, rt.synthetic_motion("walk", duration_s=0.5)],
        small,
        out=tmp_path / "out",
        fidelities=("analytic-paper", "analytic"),
        duration_s=0.15,
    )
    with pytest.raises(InputError, match="of one recording"):
        several.echoes  # noqa: B018
