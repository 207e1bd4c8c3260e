"""A run without a folder: the maps of a run with one, nothing written, and a limit of memory."""

from __future__ import annotations

import dataclasses
import html
import math
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import rtradar as rt
from rtradar.errors import InputError
from rtradar.pipeline import processing
from rtradar.settings import RunOptions

OPTIONS: RunOptions = {"fidelity": "analytic", "duration_s": 0.3, "clutter_removal": "mean"}


@pytest.fixture(scope="module")
def in_memory(
    kick: rt.Motion, small: rt.Radar, tmp_path_factory: pytest.TempPathFactory
) -> rt.Result:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("empty"))
        result = rt.run(kick, small, **OPTIONS)
        assert not list(Path().iterdir())
    return result


@pytest.fixture(scope="module")
def written(
    kick: rt.Motion, small: rt.Radar, tmp_path_factory: pytest.TempPathFactory
) -> rt.Result:
    return rt.run(kick, small, out=tmp_path_factory.mktemp("run") / "out", **OPTIONS)


def test_maps_in_memory_are_those_of_the_file(in_memory: rt.Result, written: rt.Result) -> None:
    assert in_memory.out is None
    assert written.out is not None
    with xr.open_dataset(written.out / "maps.h5", engine="h5netcdf", decode_cf=False) as maps:
        xr.testing.assert_identical(in_memory.maps, maps)
    xr.testing.assert_identical(in_memory.maps, written.maps)
    np.testing.assert_array_equal(in_memory.points, written.points)
    np.testing.assert_array_equal(in_memory.spatial.points, written.spatial.points)
    assert in_memory.summary.keys() == written.summary.keys() - {"files", "pictures"}
    budget, other = in_memory.link_budget, written.link_budget
    assert budget is not None
    assert other is not None
    np.testing.assert_array_equal(budget.power_at, other.power_at)


def test_maps_have_named_dimensions_units_and_meanings(in_memory: rt.Result) -> None:
    maps = in_memory.maps
    assert maps.range_doppler.dims == ("time", "range", "velocity")
    assert maps.range_azimuth.dims == ("time", "range", "azimuth")
    for values in (*maps.data_vars.values(), *maps.coords.values()):
        assert values.attrs["units"]
        assert values.attrs["long_name"]
    np.testing.assert_array_equal(maps.range, in_memory.radar.range_m)
    assert maps.time.attrs["units"] == "s"


def test_a_result_says_what_it_is_in_a_few_lines(in_memory: rt.Result) -> None:
    lines = repr(in_memory).splitlines()
    assert len(lines) <= 10
    assert lines[0] == "Result synthetic:kick"
    assert max(map(len, lines)) <= 100
    assert "  made by      radar small, fidelity analytic, scene free-space" in lines


def test_a_notebook_shows_a_card_of_one_screen_with_a_picture(in_memory: rt.Result) -> None:
    card = in_memory._repr_html_()
    assert "20.0 dB" in card
    assert f"{in_memory.summary['detections']} in 11 frames" in card
    assert "data:image/png;base64," in card
    assert len(card) < 300_000


def test_results_draw_themselves(in_memory: rt.Result) -> None:
    axes = in_memory.plot.range_doppler(time_s=0.2)
    assert "0.20 s" in axes.get_title("left")
    plt.close("all")


def test_the_view_is_the_same_in_memory_and_of_a_folder(
    in_memory: rt.Result, written: rt.Result, tmp_path: Path
) -> None:
    page, other = in_memory.view(height_px=700), written.view()
    assert page.html == other.html
    frame = page._repr_html_()
    assert "height: 700px" in frame
    assert html.unescape(frame.split('"')[1]) == page.html
    page.save(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text() == page.html


def test_maps_of_a_folder_that_is_gone_are_refused_in_one_line(
    in_memory: rt.Result, tmp_path: Path
) -> None:
    gone = dataclasses.replace(in_memory, out=tmp_path / "gone", _in_memory=None)
    with pytest.raises(InputError, match=r"maps.h5' cannot be read"):
        _ = gone.maps
    assert "gone" in repr(gone)


def test_maps_too_large_for_memory_are_refused_before_any_work(
    kick: rt.Motion, small: rt.Radar, in_memory: rt.Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = sum(in_memory.maps[name].nbytes for name in in_memory.maps.data_vars)
    known = processing.bytes_of_maps(small, in_memory.summary["chirps"], sources=True)
    assert 0.8 * size < known < 1.2 * size
    monkeypatch.setattr(processing, "MEMORY_LIMIT_BYTES", 1_000_000_000)
    # No array of so many frames is ever made.
    long = dataclasses.replace(kick, rate_hz=1e-3, first_frame_s=0.0, length_s=None)
    with pytest.raises(InputError, match=r"would take [\d.]+ GB .* 1\.0 GB are allowed; .* out="):
        rt.run(long, small)


def test_a_radar_of_one_channel_has_no_angles_and_does_without(small: rt.Radar) -> None:
    radar = dataclasses.replace(small, tx_y=1, rx_y=1, chirp_duration_s=500e-6)
    walk = rt.synthetic_motion("walk", seed=0, duration_s=1.0)
    result = rt.run(walk, radar, fidelity="analytic", duration_s=0.2, snr_db=math.inf)
    assert "range_azimuth" not in result.maps
    assert "no noise" in repr(result)
    assert "data:image/png" in result._repr_html_()
    size = sum(result.maps[name].nbytes for name in ("range_doppler", "detections", "range_time"))
    assert processing.bytes_of_maps(radar, result.summary["chirps"]) == pytest.approx(size, rel=0.1)


def test_if_samples_are_not_kept_without_a_folder(kick: rt.Motion, small: rt.Radar) -> None:
    with pytest.raises(InputError, match="save_if = True keeps IF samples in a folder"):
        rt.run(kick, small, save_if=True)


def test_every_public_name_is_listed() -> None:
    assert set(rt.__all__) <= set(dir(rt))
    for name in dir(rt):
        assert getattr(rt, name) is not None


@pytest.mark.slow
def test_matplotlib_is_loaded_by_the_first_picture(small_file: Path, tmp_path: Path) -> None:
    code = (
        "import sys, rtradar as rt\n"
        "motion = rt.synthetic_motion('kick', seed=0, duration_s=0.15)\n"
        "result = rt.run(motion, rt.Radar.load(sys.argv[1]), fidelity='analytic')\n"
        "assert 'matplotlib' not in sys.modules\n"
        "result.plot.range_time(); assert 'matplotlib' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code, small_file], check=True, cwd=tmp_path)
