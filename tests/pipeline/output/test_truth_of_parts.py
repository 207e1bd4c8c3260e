"""What is true of each part in a run, against closed forms of spheres and of motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import rtradar as rt
from rtradar.body import Body
from rtradar.errors import InputError
from rtradar.motion import place

RADAR = replace(rt.Radar.preset("paper-12ghz"), tx_y=2, tx_z=0, rx_y=2, rx_z=0)
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
    out = rt.run(WALK, RADAR, out=tmp_path / "run", pictures=False, **settings)
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
