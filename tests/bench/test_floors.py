"""Floors of given work at given rates."""

from __future__ import annotations

import pytest

from rtradar.bench.floors import Rates, Work, floors
from rtradar.radar import Radar

RATES = Rates(
    copied_bytes=8e3,
    random_words=1e3,
    multiply_adds=5e3,
    range_ffts=10.0,
    doppler_ffts=20.0,
    spectrogram_ffts=40.0,
    angle_ffts=5.0,
)
WORK = Work(
    chirps=240,
    rx=2,
    samples=16,
    echoes=3,
    windows=5,
    cycles=10,
    channels=4,
    detections=30,
    lines=2,
    spectrogram_cycles=128,
)


def test_each_stage_has_the_largest_of_its_floors() -> None:
    found = {name: row["floor"] for name, row in floors(WORK, RATES).items()}
    assert WORK.if_samples == 7680
    assert found == {
        "elsewhere": pytest.approx(2 * 8 * 7680 / 8e3),
        "scatter": pytest.approx(24 * 240 * 2 * 3 / 8e3),
        "signal": pytest.approx(2 * 7680 * 3 / 5e3),  # more than the 7.68 s of writing
        "noise": pytest.approx(15.36),  # reading and writing, more than the 7.68 s of drawing
        "range": pytest.approx(48.0),  # 480 transforms
        "spectrogram": pytest.approx(0.0),  # 120 cycles are no whole window of 128
        "doppler": pytest.approx(16.0),  # 320 transforms
        "cfar": pytest.approx(5 * 800 / 8e3),
        "cloud": pytest.approx(800 / 8e3),
        "angle": pytest.approx(12.0),
    }


def test_a_slow_memory_is_the_floor_of_what_moves_much() -> None:
    slow = floors(WORK, RATES._replace(copied_bytes=80.0))
    assert slow["signal"]["floor"] == pytest.approx(8 * 7680 / 80)
    assert slow["noise"]["floor"] == pytest.approx(16 * 7680 / 80)
    assert slow["range"]["floor"] == pytest.approx(16 * 7680 / 80)
    assert slow["doppler"]["floor"] == pytest.approx(8 * 5 * 10 * 4 * 16 / 80)


SUMMARY = {
    "chirps": 48_000,
    "windows": 117,
    "detections": 20_000,
    "part_power_m2": dict.fromkeys(range(21), 1.0),
}


def test_the_size_of_a_run_by_the_papers_radar() -> None:
    work = Work.of(Radar.preset("paper-12ghz"), SUMMARY)
    assert (work.channels, work.cycles, work.lines, work.echoes) == (96, 133, 2, 21)
    assert work.if_samples == 48_000 * 8 * 256
    assert work.spectrogram_columns == 646  # starts at cycles 0, 6, ... 3870 of 4000


def test_a_window_of_the_spectrogram_is_as_long_where_all_transmit_at_once() -> None:
    work = Work.of(Radar(multiplexing="fdm"), SUMMARY)
    # 12 Tx at once: windows of 12 x 128 of 4000 cycles, which start at cycles 0, 76, ... 2432.
    assert (work.spectrogram_cycles, work.spectrogram_columns) == (1536, 33)
