"""Scenes without people: a room alone, and objects that move in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import rtradar as rt
from rtradar.cli import main
from rtradar.errors import InputError, ValidityWarning
from rtradar.scatter import MODELS

pytestmark = pytest.mark.filterwarnings("ignore:nobody is visible", "ignore:nothing was detected")

FAN = rt.Object("fan", "fan", "metal", position_m=(0, 0.5, 1), motion=rt.Turning(rate_hz=5))


def test_a_room_alone_is_as_still_as_its_clutter_is_strong(
    beside_a_wall: tuple[rt.Radar, rt.Scene],
) -> None:
    capture = rt.simulate([], *beside_a_wall, duration_s=0.3, snr_db=float("inf"))
    cycles = capture.samples.values.reshape(-1, *capture.samples.shape[1:])
    n_tx = beside_a_wall[0].n_tx
    assert np.ptp(np.abs(cycles.reshape(-1, n_tx, *cycles.shape[1:])), axis=0).max() == 0
    result = rt.run([], *beside_a_wall, duration_s=0.3, snr_db=float("inf"))
    clutter = result.summary["room"]["clutter"]
    assert np.mean(np.abs(cycles) ** 2) == pytest.approx(clutter["power_m2"], rel=1e-5)
    assert clutter["signal_to_clutter_db"] is None
    assert clutter["false_alarm_rate"] == float(result.maps.detections.mean()) > 0
    # The mirror image of the radar is 3.4 m away, on the other side of the wall.
    peak = int(result.maps.range_time.values.mean(axis=0).argmax())
    assert abs(float(result.maps.range[peak]) - 1.7) < beside_a_wall[0].range_bin_m


@pytest.mark.parametrize("fidelity", list(MODELS.built_in))
def test_an_object_alone_is_the_same_at_every_level_that_traces_alike(
    small: rt.Radar, fidelity: str
) -> None:
    options: dict[str, float] = {"duration_s": 0.15, "snr_db": float("inf")}
    alone = rt.simulate([FAN], small, fidelity=fidelity, **options)
    assert alone.echoes().sizes["echo"] > 0
    assert set(alone.echoes().part.values) == {"fan"}
    # One blade hides another, where anything is traced.
    alike = "analytic" if fidelity.startswith("analytic") else "specular"
    expected = rt.simulate([FAN], small, fidelity=alike, **options)
    np.testing.assert_array_equal(alone.samples, expected.samples)


def test_noise_of_nobody_is_held_against_one_square_metre(small: rt.Radar) -> None:
    with pytest.warns(ValidityWarning, match="relative to a point of 1 m"):
        capture = rt.simulate([], small, duration_s=0.15, snr_db=20)
    expected = np.linalg.norm(small.position_m) ** -4 / 100
    assert capture.noise_power_m2 == pytest.approx(expected)
    assert np.mean(np.abs(capture.samples) ** 2) == pytest.approx(expected, rel=0.02)


@pytest.mark.slow
def test_the_folder_of_nobody_can_be_shown_and_run_again(
    small_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    words = "--scene", "fan-beside-person", "--duration", "0.2", "--radar", str(small_file)
    assert main(["run", *words, "--fidelity", "analytic", "--out", str(first)]) == 0
    assert main(["run", str(first / "run.toml"), "--out", str(second)]) == 0
    one, other = (
        xr.open_dataset(folder / "maps.h5", engine="h5netcdf", decode_cf=False)
        for folder in (first, second)
    )
    xr.testing.assert_identical(one, other)
    still, page = tmp_path / "still.png", tmp_path / "view.html"
    shown = ["view", str(first), "--out", str(page), "--still", str(still), "--no-browser"]
    assert main(shown) == 0
    assert still.exists()
    assert page.exists()
    assert "nobody" in page.read_text()
    assert "Traceback" not in capsys.readouterr().err


def test_truth_and_people_of_nobody_are_empty(small: rt.Radar) -> None:
    result = rt.run([], small, "free-space", duration_s=0.15)
    assert result.truth.sizes["part"] == 0
    assert result.summary["people"] == []
    assert len(result.points) == 0
    assert "nobody" in repr(result)


def test_how_long_nobody_is_simulated_must_be_said(small: rt.Radar, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nobody is in the scene; give a motion, or say"):
        rt.run([], small)
    with pytest.raises(InputError, match="nobody is in scene 'free-space'"):
        rt.compare([], small, out=tmp_path / "out", duration_s=0.2)
    assert not (tmp_path / "out").exists()
