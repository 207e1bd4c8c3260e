"""A room alone, whose mean cycle is subtracted: what is left, and what is refused."""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.cli import main
from rtradar.errors import InputError
from rtradar.process import clutter_removal

pytestmark = pytest.mark.filterwarnings("ignore:nobody is visible", "ignore:nothing was detected")

STILL = rt.synthetic_motion("stand", seed=0, duration_s=0.3)


@pytest.fixture(scope="module")
def empty(
    beside_a_wall: tuple[rt.Radar, rt.Scene], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The folder of a run of a room without people and noise, without its IF samples."""
    out = tmp_path_factory.mktemp("empty") / "out"
    rt.run([], *beside_a_wall, duration_s=0.2, snr_db=float("inf"), out=out)
    return out


def test_nothing_is_left_of_the_room_itself(
    beside_a_wall: tuple[rt.Radar, rt.Scene], empty: Path
) -> None:
    options = {"duration_s": 0.2, "snr_db": float("inf")}
    with_it, without = (
        rt.run([], *beside_a_wall, background=own, **options).maps for own in (str(empty), None)
    )
    # Single precision.
    assert float(with_it.range_doppler.max()) < 1e-12 * float(without.range_doppler.max())
    assert with_it.range_doppler.attrs["clutter_removal"] == "background"


def test_a_person_who_stands_stays_and_the_mean_removes_them(
    beside_a_wall: tuple[rt.Radar, rt.Scene], empty: Path
) -> None:
    options = {"duration_s": 0.2, "snr_db": float("inf"), "fidelity": "analytic"}
    alone = rt.run(STILL, beside_a_wall[0], **options)
    left = rt.run(STILL, *beside_a_wall, background=str(empty), **options)
    gone = rt.run(STILL, *beside_a_wall, clutter_removal="mean", **options)
    power, expected, removed = (
        float(own.maps.range_doppler.sel(velocity=0, method="nearest").max())
        for own in (left, alone, gone)
    )
    assert power > 0.5 * expected
    assert removed < 0.01 * expected


@pytest.mark.slow
def test_a_run_again_and_its_kept_samples_are_the_same_background(
    beside_a_wall: tuple[rt.Radar, rt.Scene], tmp_path: Path
) -> None:
    radar, scene = beside_a_wall
    maps = []
    for save_if in (False, True):
        out = tmp_path / str(save_if)
        rt.run([], radar, scene, duration_s=0.2, out=out, save_if=save_if)
        found = rt.run(STILL, radar, scene, background=out, duration_s=0.2, fidelity="analytic")
        maps.append(found.maps.range_doppler.values)
    np.testing.assert_array_equal(*maps)
    # Samples that were received are processed alike.
    samples = rt.simulate(STILL, radar, scene, duration_s=0.2, fidelity="analytic").samples
    processed = rt.process_samples(samples, scene.place(radar), background=str(out))
    np.testing.assert_array_equal(processed.maps.range_doppler.values, maps[0])


def test_the_run_file_names_the_background_and_notices_a_change(
    small_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = "--radar", str(small_file), "--duration", "0.2", "--quiet"
    empty, out = tmp_path / "empty", tmp_path / "out"
    assert main(["run", *words, "--out", str(empty)]) == 0
    more = "--fidelity", "analytic", "--background", str(empty)
    assert main(["run", "synthetic:walk", *words, *more, "--out", str(out)]) == 0
    table = tomllib.loads((out / "run.toml").read_text())
    assert table["settings"]["background"] == "../empty"
    assert [entry["path"] for entry in table["files"]] == ["../empty/run.toml"]
    assert main(["run", str(out / "run.toml"), "--quiet", "--out", str(tmp_path / "again")]) == 0
    with (empty / "run.toml").open("a") as file:
        file.write("\n")
    capsys.readouterr()
    assert main(["run", str(out / "run.toml"), "--out", str(tmp_path / "third")]) == 2
    assert "has changed since" in capsys.readouterr().err


@pytest.mark.slow
def test_a_background_that_names_itself_is_that_of_its_samples(
    beside_a_wall: tuple[rt.Radar, rt.Scene], tmp_path: Path
) -> None:
    radar, scene = beside_a_wall
    out = tmp_path / "out"
    rt.run([], radar, scene, duration_s=0.2, out=out)
    options = {"duration_s": 0.2, "fidelity": "analytic", "background": str(out)}
    before = rt.run(STILL, radar, scene, **options).maps.range_doppler.values
    file = out / "run.toml"
    file.write_text(file.read_text().replace("[settings]\n", '[settings]\nbackground = "."\n'))
    after = rt.run(STILL, radar, scene, **options).maps.range_doppler.values
    np.testing.assert_array_equal(before, after)


def test_another_radar_unit_or_place_is_refused(
    beside_a_wall: tuple[rt.Radar, rt.Scene], empty: Path, tmp_path: Path
) -> None:
    radar, scene = beside_a_wall
    options = {"duration_s": 0.2, "background": str(empty)}
    tilted = dataclasses.replace(radar, pitch_deg=-10)
    with pytest.raises(InputError, match="its radar has another pitch_deg"):
        rt.run(STILL, tilted, scene, **options)
    moving = dataclasses.replace(radar, path_times_s=(0, 1), path_m=((-4, 1, 1), (-3, 1, 1)))
    with pytest.raises(InputError, match="moves, and a room"):
        rt.run(STILL, moving, **options)
    with pytest.raises(InputError, match="does not exist; give the folder of a run"):
        rt.run(STILL, radar, scene, duration_s=0.2, background=str(tmp_path / "none"))
    samples = rt.simulate(STILL, radar, scene, duration_s=0.2, fidelity="analytic").samples
    with pytest.raises(InputError, match="in m, and these in count"):
        rt.process_samples(samples, scene.place(radar), background=str(empty), unit="count")


def test_a_background_goes_before_another_removal(small: rt.Radar) -> None:
    shape = small.n_tx, small.n_rx, small.samples_per_chirp
    rng = np.random.default_rng(0)
    cycle = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    chirps = np.concatenate([cycle + 1, cycle + 2])
    both = clutter_removal("mti", small, background=cycle)
    found = both.block(chirps, 0).reshape(2, *shape)
    np.testing.assert_allclose(found[0], 0, atol=1e-12)
    np.testing.assert_allclose(found[1], 1 / np.sqrt(2))
    assert both.description(2) == "background, then MTI canceller of 2 pulses"
    with pytest.raises(InputError, match="that of a cycle of radar"):
        clutter_removal("none", small, background=cycle[:, :1])
