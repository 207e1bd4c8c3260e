"""Anybody's IF samples give what a run gives of the same samples, to the bit."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import rtradar as rt
from rtradar.errors import InputError
from rtradar.pipeline import processing
from rtradar.settings import SimulationOptions

OPTIONS: SimulationOptions = {"fidelity": "analytic", "duration_s": 0.23, "seed": 3}


@pytest.fixture(scope="module")
def samples(kick: rt.Motion, small: rt.Radar) -> xr.DataArray:
    return rt.simulate(kick, small, **OPTIONS).samples


def assert_same(found: rt.Result, expected: rt.Result) -> None:
    ours, other = (one.maps.drop_attrs(deep=False) for one in (found, expected))
    xr.testing.assert_identical(ours, other)
    np.testing.assert_array_equal(found.points, expected.points)
    np.testing.assert_array_equal(found.spatial.points, expected.spatial.points)


@pytest.mark.parametrize("multiplexing", ["tdm", "ddm"])
def test_samples_of_a_simulation_give_the_maps_of_a_run(
    kick: rt.Motion, small: rt.Radar, multiplexing: str
) -> None:
    radar = dataclasses.replace(small, multiplexing=multiplexing)
    found = rt.simulate(kick, radar, **OPTIONS).samples
    removal = "mean" if multiplexing == "tdm" else "none"
    processed = rt.process_samples(found, radar, clutter_removal=removal, seed=3)
    ran = rt.run(kick, radar, clutter_removal=removal, **OPTIONS)
    # Who returned what, and where they were, only a simulation knows.
    truth = [name for name in ran.maps.variables if name not in processed.maps.variables]
    wanted = {
        "source",
        "person_position",
        "person_speed",
        "joints",
        "person",
        "joint",
        "coordinate",
    }
    assert set(truth) == wanted
    ran = dataclasses.replace(ran, _in_memory=ran.maps.drop_vars(truth))
    assert_same(processed, ran)
    if removal != "none":  # of a stream, the middle is known too late
        streamed = rt.process_samples(iter([found]), radar, clutter_removal=removal, seed=3)
        received = [name for name in processed.maps if str(name).endswith("_received")]
        assert len(received) == 3
        assert_same(streamed, dataclasses.replace(ran, _in_memory=ran.maps.drop_vars(received)))
    known = processed.summary.keys() & ran.summary.keys()
    assert {"windows", "chirps", "detections", "capture_s"} <= known
    for name in ("windows", "chirps", "detections", "capture_s"):
        assert processed.summary[name] == ran.summary[name]
    assert repr(processed).startswith("Result IF samples\n")
    with pytest.raises(InputError, match="view: IF samples have no body"):
        processed.view()
    assert "data:image/png" in processed._repr_html_()


def reused(samples: xr.DataArray) -> Iterator[np.ndarray[Any, Any]]:
    """Blocks of uneven length, each in the memory of the one before."""
    buffer = np.empty((47, 4, 128), np.complex64)
    for first in range(0, len(samples), 47):
        part = samples.values[first : first + 47]
        buffer[: len(part)] = part
        yield buffer[: len(part)]


def test_other_shapes_and_blocks_give_the_same(
    kick: rt.Motion, small: rt.Radar, samples: xr.DataArray
) -> None:
    expected = rt.process_samples(samples, small)
    values = samples.values
    cycles = xr.DataArray(values.reshape(-1, 2, 4, 128), dims=("cycle", "tx", "rx", "sample"))
    for same in (
        values.astype(np.complex128),
        values.reshape(-1, 2, 4, 128),
        cycles.transpose("sample", "rx", "cycle", "tx"),
        np.concatenate([values, values[:1]]),  # half a cycle
        reused(samples),
        rt.simulate(kick, small, **OPTIONS).blocks(),
    ):
        assert_same(rt.process_samples(same, small), expected)


def test_a_folder_holds_maps_clouds_and_pictures(
    small: rt.Radar, samples: xr.DataArray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path)
    written = rt.process_samples(samples, small, "out", pictures=True, pfa=1e-4)
    monkeypatch.chdir("elsewhere")
    assert_same(written, rt.process_samples(samples, small, pfa=1e-4))
    assert set(written.summary["files"]) >= {
        *("maps.h5", "cloud_rdt.npz", "cloud_xyz.npz"),
        *(
            "range_doppler.png",
            "spectrogram.png",
            "range_angle.png",
            "cloud_xyz.png",
            "report.html",
        ),
    }
    assert written.summary["parameters"]["pfa"] == 1e-4


def broken(samples: xr.DataArray, value: complex) -> np.ndarray[Any, Any]:
    values = samples.values.astype(np.complex128)
    values[301, 1, 5] = value
    return values


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda x: x[:, :3], r"shape \(920, 3, 128\); radar 'small' needs .* 4, 128\) or \(cycle"),
        (lambda x: x.values.real, "are of type float32; they must be complex"),
        (lambda x: x.rename(chirp="pulse"), r"dimensions are \(pulse, rx, sample\); allowed: \(ch"),
        (lambda x: x[:100], r"100 chirps in whole cycles hold no frame of radar 'small', which"),
        (lambda x: iter([x[:100]]), "100 chirps in whole cycles hold no frame"),
        (lambda x: iter([]), "0 chirps in whole cycles"),
        (lambda x: broken(x, np.nan), "chirp 301 holds NaN"),
        (lambda x: broken(x, 1e300), "chirp 301 holds NaN, infinity, or more than single"),
        (lambda x: 5, "samples are of type int; give an array"),
    ],
)
def test_samples_that_are_none_of_the_radar_are_refused_and_leave_nothing(
    small: rt.Radar, samples: xr.DataArray, wrong: Any, says: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=says) as caught:
        rt.process_samples(wrong(samples), small, out=tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_options_of_another_function_are_refused(
    kick: rt.Motion, small: rt.Radar, samples: xr.DataArray
) -> None:
    with pytest.raises(InputError, match="process_samples has no option 'snr_db'; allowed: seed"):
        rt.process_samples(samples, small, snr_db=10.0)  # type: ignore[call-arg]
    with pytest.raises(
        InputError, match="simulate has no option 'pfa'; allowed: seed, slow_time, fidelity"
    ):
        rt.simulate(kick, small, pfa=1e-4)  # type: ignore[call-arg]
    with pytest.raises(InputError, match="run has no option 'fidelty'"):
        rt.run(kick, small, fidelty="analytic")  # type: ignore[call-arg]


def test_maps_too_large_for_memory_are_refused(
    small: rt.Radar, samples: xr.DataArray, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processing, "MEMORY_LIMIT_BYTES", 1e5)
    for given in (samples, iter([samples])):
        with pytest.raises(InputError, match=r"maps of .* s of radar 'small' would take"):
            rt.process_samples(given, small)


def test_numbers_of_an_adc_are_shown_as_such(small: rt.Radar, samples: xr.DataArray) -> None:
    result = rt.process_samples(samples * 1e6, small, unit="count")
    assert result.maps["range_doppler"].attrs["units"] == "count2"
    assert result.summary["parameters"]["unit"] == "count"
    bar = result.plot.range_doppler().figure.axes[-1]
    assert bar.get_ylabel() == "Power, mean of channels [dB re 1 count^2]"
    with pytest.raises(InputError, match="unit = 'V'; it must be m, or count"):
        rt.process_samples(samples, small, unit="V")  # type: ignore[arg-type]
