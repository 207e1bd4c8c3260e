"""FFTs by torch give what ours give, and are chosen only where they were found to be faster.

torch's CPU stands for a GPU here: to torch it is a device as any other, and the same code runs on both.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import rtradar as rt
from rtradar.errors import ValidityWarning
from rtradar.motion import synthetic_motion
from rtradar.pipeline import prepare as preparing
from rtradar.process import (
    FftDevices,
    fastest_fft_devices,
    fft_devices,
    power_map,
    range_spectrum,
    torch_transforms,
)

torch = pytest.importorskip("torch", reason="torch comes with the extra 'learn'")

BY_TORCH = "cpu:0"
SMALL = rt.Radar(
    tx_y=2,
    tx_z=1,
    rx_y=2,
    rx_z=2,
    samples_per_chirp=32,
    frame_duration_s=3.75e-3,
    chirp_duration_s=62.5e-6,
)


def noise(*shape: int) -> np.ndarray:
    random = np.random.default_rng(0)
    return (random.standard_normal(shape) + 1j * random.standard_normal(shape)).astype(np.complex64)


def agree(found: np.ndarray, expected: np.ndarray) -> None:
    """To float32's rounding: sums of as many terms as there are samples or channels, each rounded to 6e-8."""
    assert found.dtype == expected.dtype
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-6 * np.abs(expected).max())


@pytest.fixture
def as_gpu(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let torch's CPU be found as a GPU, and seconds be worth its while; what was measured before is forgotten."""
    monkeypatch.setattr(fft_devices, "has_nvidia_gpu", lambda: True)
    monkeypatch.setattr(fft_devices, "gpu_for_ffts", lambda: (BY_TORCH, "torch's CPU"))
    measured = fft_devices._seconds
    measured.cache_clear()
    yield
    measured.cache_clear()


def takes(monkeypatch: pytest.MonkeyPatch, seconds: dict[str, tuple[float, float]]) -> None:
    """Let FFTs over fast time and over slow time take so long on each device."""
    monkeypatch.setattr(
        fft_devices, "_seconds", lambda radar, device: fft_devices._Seconds(*seconds[device])
    )


@pytest.mark.parametrize(
    "samples",
    [
        noise(37, SMALL.n_rx, 32),
        noise(37, SMALL.n_rx, 32).real,
        noise(37, SMALL.n_rx, 32).astype(np.complex128),
    ],
)
def test_range_spectra(samples: np.ndarray) -> None:
    samples.flags.writeable = False
    agree(range_spectrum(samples, SMALL, device=BY_TORCH), range_spectrum(samples, SMALL))
    window = np.hamming(32)
    agree(
        range_spectrum(samples, SMALL, window=window, device=BY_TORCH),
        range_spectrum(samples, SMALL, window=window),
    )
    out = np.empty(samples.shape, np.complex64)
    assert range_spectrum(samples, SMALL, device=BY_TORCH, out=out) is out
    agree(out, range_spectrum(samples, SMALL))


@pytest.mark.parametrize("multiplexing", ["tdm", "ddm"])
@pytest.mark.parametrize("cycles", [20, 133])
@pytest.mark.parametrize("channel", [None, 5])
def test_power_maps(multiplexing: str, cycles: int, channel: int | None) -> None:
    radar = rt.Radar(
        tx_y=2,
        tx_z=1,
        rx_y=2,
        rx_z=2,
        samples_per_chirp=32,
        multiplexing=multiplexing,
        channels="all",
    )
    cycles -= cycles % radar.n_doppler_bands if multiplexing == "ddm" else 0
    cube = noise(cycles, radar.n_tx, radar.n_rx, 32)
    cube.flags.writeable = False
    window = np.hanning(cycles + 2)[1:-1]
    found = power_map(cube, radar, channel=channel, doppler_window=window, device=BY_TORCH)
    agree(found, power_map(cube, radar, channel=channel, doppler_window=window))


def test_a_whole_run_gives_the_same_maps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    radar = rt.Radar(
        tx_y=2,
        tx_z=0,
        rx_y=4,
        rx_z=0,
        chirp_duration_s=250e-6,
        samples_per_chirp=128,
        frame_duration_s=0.05,
    )
    motion = synthetic_motion("walk", seed=1, duration_s=0.5)
    by_torch: list[str] = []
    for name in ("range_spectra", "doppler_power"):
        transform = getattr(torch_transforms, name)

        def counted(*given: Any, name: str = name, transform: Any = transform) -> Any:
            by_torch.append(name)
            return transform(*given)

        monkeypatch.setattr(torch_transforms, name, counted)
    maps = {}
    for device in ("cpu", BY_TORCH):
        by_torch.clear()
        monkeypatch.setattr(
            preparing, "fastest_fft_devices", lambda *_, device=device: FftDevices(device, device)
        )
        found = rt.run(
            motion, radar, out=tmp_path / device, fidelity="analytic", clutter_removal="mean"
        )
        assert found.summary["fft_devices"] == {"range": device, "doppler": device}
        assert by_torch.count("doppler_power") == (
            0 if device == "cpu" else found.summary["windows"]
        )
        assert ("range_spectra" in by_torch) == (device != "cpu")
        with h5py.File(tmp_path / device / "maps.h5") as file:
            maps[device] = {
                name: file[name][()]
                for name in ("range_time", "range_doppler", "range_doppler_received")
            }
    for name, expected in maps["cpu"].items():
        agree(maps[BY_TORCH][name], expected)


def test_a_run_goes_on_where_a_gpu_fails_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    radar = rt.Radar(
        tx_y=2,
        tx_z=0,
        rx_y=4,
        rx_z=0,
        chirp_duration_s=250e-6,
        samples_per_chirp=128,
        frame_duration_s=0.05,
    )
    motion = synthetic_motion("walk", seed=1, duration_s=0.3)
    whole = rt.run(motion, radar, out=tmp_path / "cpu", fidelity="analytic", variant="cpu")

    def fails(*_: object) -> None:
        raise torch.cuda.OutOfMemoryError("CUDA out of memory.\nMore lines.")

    for name in ("range_spectra", "doppler_power"):
        monkeypatch.setattr(torch_transforms, name, fails)
    monkeypatch.setattr(preparing, "fastest_fft_devices", lambda *_: FftDevices(BY_TORCH, BY_TORCH))
    with pytest.warns(
        ValidityWarning, match=r"fails at FFTs \(CUDA out of memory\.\); the CPU does them"
    ):
        found = rt.run(motion, radar, out=tmp_path / "gpu", fidelity="analytic")
    np.testing.assert_array_equal(found.points, whole.points)


@pytest.mark.parametrize("variant", ["llvm", "scalar", "cpu"])
def test_a_backend_of_the_cpu_by_name_keeps_ffts_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variant: str
) -> None:
    monkeypatch.setattr(
        preparing, "fastest_fft_devices", lambda *_: pytest.fail("nothing is to be measured")
    )
    radar = rt.Radar(
        tx_y=1,
        tx_z=0,
        rx_y=2,
        rx_z=0,
        chirp_duration_s=250e-6,
        samples_per_chirp=128,
        frame_duration_s=0.05,
    )
    motion = synthetic_motion("walk", seed=1, duration_s=0.2)
    found = rt.run(motion, radar, out=tmp_path, fidelity="analytic", variant=variant)
    assert found.summary["fft_devices"] == {"range": "cpu", "doppler": "cpu"}


@pytest.mark.usefixtures("as_gpu")
@pytest.mark.parametrize(
    ("on_gpu", "chosen"),
    [
        ((0.5, 0.5), (BY_TORCH, BY_TORCH)),
        ((0.5, 2.0), (BY_TORCH, "cpu")),
        ((2.0, 0.5), ("cpu", BY_TORCH)),
        ((1.0, 1.0), ("cpu", "cpu")),
    ],
)
def test_the_faster_is_chosen_for_either_kind(
    monkeypatch: pytest.MonkeyPatch, on_gpu: tuple[float, float], chosen: tuple[str, str]
) -> None:
    takes(monkeypatch, {"cpu": (1.0, 1.0), BY_TORCH: on_gpu})
    assert fastest_fft_devices(SMALL, 10_000, 10) == chosen


@pytest.mark.usefixtures("as_gpu")
def test_what_takes_the_cpu_seconds_is_not_worth_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    takes(monkeypatch, {"cpu": (0.01, 0.02), BY_TORCH: (0.001, 0.001)})
    chirps = 512 * 400  # 4 s
    assert fastest_fft_devices(SMALL, chirps, 301) == (BY_TORCH, BY_TORCH)
    monkeypatch.setattr(
        fft_devices, "gpu_for_ffts", lambda: pytest.fail("torch takes seconds to import")
    )
    assert fastest_fft_devices(SMALL, chirps, 299) == ("cpu", "cpu")


@pytest.mark.usefixtures("as_gpu")
def test_times_are_those_of_the_transforms_and_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fft_devices, "power_map", lambda *_, device: time.sleep(0.05))
    found = fft_devices._seconds(SMALL, "cpu")
    assert 0 < found.range < 0.05 <= found.doppler
    monkeypatch.setattr(fft_devices, "power_map", lambda *_, device: pytest.fail("it was measured"))
    assert fft_devices._seconds(SMALL, "cpu") == found


@pytest.mark.usefixtures("as_gpu")
@pytest.mark.parametrize(
    ("factor", "said"),
    [(1.001, r"differ by 1\.0e-03 of the peak"), (np.nan, "differ by nan of the peak")],
)
@pytest.mark.parametrize("kind", ["range_spectra", "doppler_power"])
def test_a_gpu_that_gives_something_else_is_not_used(
    monkeypatch: pytest.MonkeyPatch, kind: str, factor: float, said: str
) -> None:
    transform = getattr(torch_transforms, kind)
    monkeypatch.setattr(
        torch_transforms, kind, lambda *given: transform(*given) * np.float32(factor)
    )
    with pytest.warns(ValidityWarning, match=said):
        assert fastest_fft_devices(SMALL, 10**12, 0) == FftDevices()


@pytest.mark.usefixtures("as_gpu")
@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            torch.cuda.OutOfMemoryError("CUDA out of memory.\nMore lines."),
            r"fails at FFTs \(CUDA out of memory\.\); the CPU",
        ),
        (AssertionError(), r"fails at FFTs \(AssertionError\); the CPU"),
    ],
)
def test_a_gpu_that_fails_is_not_used(
    monkeypatch: pytest.MonkeyPatch, error: Exception, said: str
) -> None:
    def fails(*_: object) -> None:
        raise error

    monkeypatch.setattr(torch_transforms, "doppler_power", fails)
    with pytest.warns(ValidityWarning, match=said):
        assert fastest_fft_devices(SMALL, 10**12, 0) == FftDevices()


@pytest.mark.usefixtures("as_gpu")
def test_divided_doppler_is_compared_before_its_copies_are_taken_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    radar = rt.Radar(
        tx_y=2,
        tx_z=0,
        rx_y=2,
        rx_z=0,
        samples_per_chirp=32,
        frame_duration_s=20e-3,
        multiplexing="ddm",
        channels="all",
    )
    takes(monkeypatch, {"cpu": (1.0, 1.0), BY_TORCH: (0.5, 0.5)})
    assert fastest_fft_devices(radar, 10**6, 0) == (BY_TORCH, BY_TORCH)


def test_without_a_gpu_torch_is_not_imported() -> None:
    code = (
        "import sys; from rtradar.process import fft_devices; fft_devices.has_nvidia_gpu = lambda: False; import rtradar; "
        "fft_devices.fastest_fft_devices(rtradar.Radar(), 10**12, 10**9); print('torch' in sys.modules)"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.strip()
        == "False"
    )
