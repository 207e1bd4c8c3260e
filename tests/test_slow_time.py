"""Slow time over frames: the schedule, the samples, and breath and heart in them."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rtradar as rt
from rtradar.cli import main
from rtradar.errors import InputError
from rtradar.process import vital_signs

BOARD: dict[str, Any] = {
    "base": "iwr6843",
    "name": "board",
    "samples_per_chirp": 64,
    "chirps_per_frame": 3,
    "frame_period_s": 0.05,
}


@pytest.fixture(scope="module")
def radar() -> rt.Radar:
    return rt.Radar.load(BOARD)


def test_cycles_are_where_the_frames_have_them(radar: rt.Radar) -> None:
    slow = radar.over_capture()
    np.testing.assert_allclose(slow.chirp_times(300), radar.chirp_times(300), atol=1e-12)
    np.testing.assert_allclose(slow.slots_of(np.arange(30)), radar.slots_of(np.arange(30)))
    cycles = np.arange(100)
    np.testing.assert_allclose(slow.cycle_times(cycles), radar.cycle_times(cycles), atol=1e-12)
    assert slow.cycles_per_frame == 128
    assert slow.hop_cycles == pytest.approx(32)
    assert slow.duration_of(3 * 128) == pytest.approx(6.4)
    assert slow.chirps_in(6.4) == 3 * 128
    assert slow.max_velocity_mps == pytest.approx(slow.wavelength_m / 4 / 0.05)
    assert slow.over_capture() is slow
    assert "fold back" in slow.gaps_text
    assert slow.gapless.chirp_times(3) == pytest.approx(radar.chirp_times(3))


def test_of_frames_of_several_cycles_the_first_counts(radar: rt.Radar) -> None:
    several = rt.Radar.load(BOARD | {"chirps_per_frame": 12})
    slow = several.over_capture()
    first = several.chirp_times(120).reshape(10, 4, 3)[:, 0]
    np.testing.assert_allclose(slow.chirp_times(30).reshape(10, 3), first, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frame_period_s": 0.05, "cycle_period_s": 0.05}, "both given"),
        ({"frame_period_s": None, "cycle_period_s": 1e-5}, "lengthen it, or shorten"),
    ],
)
def test_periods_that_do_not_fit_are_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        dataclasses.replace(rt.Radar.load(BOARD), **change)


def test_without_gaps_slow_time_is_refused() -> None:
    with pytest.raises(InputError, match="have no gaps"):
        rt.simulate("synthetic:stand", "paper-12ghz", slow_time="capture", duration_s=0.3)


@pytest.mark.filterwarnings("ignore::rtradar.ValidityWarning")  # a walk is fast for it
@pytest.mark.parametrize("level", ["analytic", "specular"])
def test_samples_are_those_of_the_frames(radar: rt.Radar, level: str) -> None:
    options: dict[str, Any] = {"fidelity": level, "duration_s": 0.5, "snr_db": np.inf}
    walk = rt.synthetic_motion("walk", duration_s=0.5)
    frames = rt.simulate(walk, radar, **options).samples.values
    with pytest.raises(InputError, match="holds no whole frame"):
        rt.simulate(walk, radar, slow_time="capture", **options)
    slow = radar.over_capture(8)
    capture = rt.simulate(walk, slow, slow_time="capture", **options).samples.values
    np.testing.assert_allclose(capture, frames, atol=1e-6 * np.abs(frames).max())


@settings(max_examples=8)
@given(
    st.floats(0.15, 0.5),
    st.floats(1.0, 6.0),
    st.floats(0.9, 1.8),
    st.floats(0.0, 3.0),
    st.integers(0, 2**31),
)
def test_breath_and_heart_are_read_beside_what_stands_still(
    breath_hz: float, breath_mm: float, heart_hz: float, still: float, seed: int
) -> None:
    radar = rt.Radar.load(BOARD).over_capture()
    random, cycles = np.random.default_rng(seed), 600
    time = radar.cycle_times(np.arange(cycles))
    way = 1e-3 * breath_mm * np.sin(2 * np.pi * breath_hz * time)
    way += 2e-4 * np.sin(2 * np.pi * heart_hz * time + 1.0)
    channels = np.exp(2j * np.pi * random.random(radar.n_channels))
    phase = np.exp(-4j * np.pi * way / radar.wavelength_m)
    series = phase[:, None] * channels + still * np.exp(2j * np.pi * random.random(12))
    noise = random.normal(size=(cycles, 12, 2)) @ [1, 1j]
    spectra = np.zeros((cycles, 12, 64), np.complex64)
    spectra[:, :, 20] = series + 0.01 * noise
    spectra[:, :, 40] = 0.01 * noise
    found = vital_signs(spectra.reshape(-1, 4, 64), radar)
    assert found.range_m == pytest.approx(radar.range_m[20])
    assert found.breath_hz == pytest.approx(breath_hz, rel=0.01)
    assert found.breath_m == pytest.approx(1e-3 * breath_mm, rel=0.02)
    assert found.explained > 0.95
    # A heart at a harmonic of the breath is one with it.
    if min(abs(heart_hz - k * breath_hz) for k in range(1, 7)) > 0.05:
        assert found.heart_hz == pytest.approx(heart_hz, rel=0.02)
        assert found.heart_m == pytest.approx(2e-4, rel=0.1)
    nowhere = vital_signs(spectra.reshape(-1, 4, 64), radar, range_m=float(radar.range_m[40]))
    assert nowhere.explained < 0.5
    with pytest.raises(InputError, match="the radar's ranges end at"):
        vital_signs(spectra.reshape(-1, 4, 64), radar, range_m=1e3)
    chosen = vital_signs(spectra.reshape(-1, 4, 64), radar, range_m=float(radar.range_m[20]))
    np.testing.assert_array_equal(chosen.way_m, found.way_m)


def test_a_recording_of_several_cycles_a_frame_is_refused() -> None:
    several = rt.Radar.load(BOARD | {"chirps_per_frame": 12})
    samples = np.zeros((12 * 200, 4, 64), np.complex64)
    with pytest.raises(InputError, match=r"has 4 cycles in each frame.*chirps_per_frame = 3"):
        rt.process_samples(samples, several, slow_time="capture")


def test_what_cannot_tell_a_breath_is_refused(radar: rt.Radar) -> None:
    slow = radar.over_capture()
    empty = np.zeros((3 * 100, 4, 64), np.complex64)
    with pytest.raises(InputError, match="has frames with gaps"):
        vital_signs(empty, radar)
    with pytest.raises(InputError, match=r"100 cycles in 5 s; at least 32 in 20 s"):
        vital_signs(empty, slow)
    slower = rt.Radar.load(BOARD | {"frame_period_s": 0.25}).over_capture()
    with pytest.raises(InputError, match="too slowly for 3 Hz; at most 2 Hz"):
        vital_signs(empty, slower)


@pytest.mark.parametrize("name", ["lie", "lie,style=bed", "sit,style=still"])
def test_who_lies_or_sits_still_does_not_move_but_breathes(name: str) -> None:
    motion = rt.synthetic_motion(name, seed=2, duration_s=2.0)
    places = motion.at(np.linspace(0, 2, 5))[0]
    assert np.ptp(places, axis=0).max() < 1e-9
    low, high = places[0, :, 2].min(), places[0, :, 2].max()
    if name.startswith("lie"):
        level = 0.5 if "bed" in name else 0.0
        assert level < low < high < level + 0.4
        assert np.ptp(places[0, :, 0]) > 1.5
    body = rt.Body.from_motion(motion, rt.Breathing(0.0, 0.25, 0.0, 0.5, 1.0))
    chest = body.at([0.0, 0.25]).centres[:, body.part_names.index("upper torso")]
    assert np.linalg.norm(chest[1] - chest[0]) == pytest.approx(5e-4)


def test_a_run_over_the_capture_is_kept_and_made_again(radar: rt.Radar, tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = ["run", "synthetic:sit,style=still", "--radar", "iwr6843", "--slow-time", "capture"]
    words += ["--fidelity", "analytic", "--duration", "7", "--breathing", "3,0.25,0.3,1.2"]
    words += ["--set", "radar.chirps_per_frame=3", "--set", "radar.samples_per_chirp=32"]
    assert main([*words, "--set", "radar.frame_period_s=0.05", "--out", str(out), "--quiet"]) == 0
    result = rt.Experiment.load(out / "run.toml").run()
    assert result.maps["range_doppler"].sizes["time"] == 1
    step = np.diff(result.maps["spectrogram"]["spectrogram_time"])
    assert step == pytest.approx(step[0])
    with h5py.File(out / "maps.h5") as maps:
        np.testing.assert_array_equal(maps["range_doppler"], result.maps["range_doppler"].values)
