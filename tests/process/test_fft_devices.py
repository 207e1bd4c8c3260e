"""FFTs by torch give what ours give, and are chosen only where they were found to be faster.

torch's CPU stands for a GPU here: to torch it is a device as any other, and the same code runs on both.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import rtradar as rt
from rtradar.errors import ValidityWarning
from rtradar.motion import synthetic_motion
from rtradar.pipeline import prepare as preparing
from rtradar.process import FftDevices, fastest_fft_devices, fft_devices, power_map, range_spectrum

torch = pytest.importorskip("torch", reason="torch comes with the extra 'learn'")

BY_TORCH = "cpu:0"
SMALL = rt.Radar(tx_y=2, tx_z=1, rx_y=2, rx_z=2, samples_per_chirp=32, frame_duration_s=3.75e-3, chirp_duration_s=62.5e-6)


def noise(*shape: int) -> np.ndarray:
    random = np.random.default_rng(0)
    return (random.standard_normal(shape) + 1j * random.standard_normal(shape)).astype(np.complex64)


def agree(found: np.ndarray, expected: np.ndarray) -> None:
    """To float32's rounding: sums of as many terms as there are samples or channels, each rounded to 6e-8."""
    assert found.dtype == expected.dtype
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-6 * np.abs(expected).max())


@pytest.fixture
def as_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let torch's CPU be found as a GPU; what was measured before is forgotten."""
    monkeypatch.setattr(fft_devices, "gpu_for_ffts", lambda: (BY_TORCH, "torch's CPU"))
    fft_devices._measured.cache_clear()


@pytest.mark.parametrize(
    "samples", [noise(37, SMALL.n_rx, 32), noise(37, SMALL.n_rx, 32).real, noise(37, SMALL.n_rx, 32).astype(np.complex128)]
)
def test_range_spectra(samples: np.ndarray) -> None:
    samples.flags.writeable = False
    agree(range_spectrum(samples, SMALL, device=BY_TORCH), range_spectrum(samples, SMALL))
    window = np.hamming(32)
    agree(range_spectrum(samples, SMALL, window=window, device=BY_TORCH), range_spectrum(samples, SMALL, window=window))


@pytest.mark.parametrize("multiplexing", ["tdm", "ddm"])
@pytest.mark.parametrize("cycles", [20, 133])
@pytest.mark.parametrize("channel", [None, 5])
def test_power_maps(multiplexing: str, cycles: int, channel: int | None) -> None:
    radar = rt.Radar(tx_y=2, tx_z=1, rx_y=2, rx_z=2, samples_per_chirp=32, multiplexing=multiplexing, channels="all")
    cycles -= cycles % radar.n_doppler_bands if multiplexing == "ddm" else 0
    cube = noise(cycles, radar.n_tx, radar.n_rx, 32)
    cube.flags.writeable = False
    window = np.hanning(cycles + 2)[1:-1]
    found = power_map(cube, radar, channel=channel, doppler_window=window, device=BY_TORCH)
    agree(found, power_map(cube, radar, channel=channel, doppler_window=window))


def test_a_whole_run_gives_the_same_maps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    radar = rt.Radar(tx_y=2, tx_z=0, rx_y=4, rx_z=0, chirp_duration_s=250e-6, samples_per_chirp=128, frame_duration_s=0.05)
    motion = synthetic_motion("walk", seed=1, duration_s=0.5)
    maps = {}
    for device in ("cpu", BY_TORCH):
        monkeypatch.setattr(preparing, "fastest_fft_devices", lambda radar, device=device: FftDevices(device, device))
        found = rt.run(motion, radar, out=tmp_path / device, fidelity="analytic", clutter_removal="mean")
        assert found.summary["fft_devices"] == {"range": device, "doppler": device}
        with h5py.File(tmp_path / device / "maps.h5") as file:
            maps[device] = {name: file[name][()] for name in ("range_time", "range_doppler", "range_doppler_received")}
    for name, expected in maps["cpu"].items():
        agree(maps[BY_TORCH][name], expected)


@pytest.mark.parametrize("variant", ["llvm", "scalar", "cpu"])
def test_a_backend_of_the_cpu_by_name_keeps_ffts_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variant: str) -> None:
    monkeypatch.setattr(preparing, "fastest_fft_devices", lambda radar: pytest.fail("nothing is to be measured"))
    radar = rt.Radar(tx_y=1, tx_z=0, rx_y=2, rx_z=0, chirp_duration_s=250e-6, samples_per_chirp=128, frame_duration_s=0.05)
    motion = synthetic_motion("walk", seed=1, duration_s=0.2)
    found = rt.run(motion, radar, out=tmp_path, fidelity="analytic", variant=variant)
    assert found.summary["fft_devices"] == {"range": "cpu", "doppler": "cpu"}


@pytest.mark.usefixtures("as_gpu")
@pytest.mark.parametrize(("gpu_s", "chosen"), [(0.5, BY_TORCH), (1.0, "cpu"), (2.0, "cpu")])
def test_the_faster_is_chosen(monkeypatch: pytest.MonkeyPatch, gpu_s: float, chosen: str) -> None:
    monkeypatch.setattr(fft_devices, "_best_s", lambda transform, device: 1.0 if device == "cpu" else gpu_s)
    assert fastest_fft_devices(SMALL) == FftDevices(chosen, chosen)


@pytest.mark.usefixtures("as_gpu")
def test_both_kinds_are_measured_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([1.0, 2.0, 2.0, 1.0])  # by torch, then ours; of range, then of Doppler
    monkeypatch.setattr(fft_devices, "_best_s", lambda transform, device: next(times))
    assert fastest_fft_devices(SMALL) == FftDevices(BY_TORCH, "cpu")
    assert fastest_fft_devices(SMALL) == FftDevices(BY_TORCH, "cpu")  # measured once: no further times are asked for


@pytest.mark.usefixtures("as_gpu")
def test_what_is_measured_is_the_time_of_the_transform() -> None:
    assert set(fastest_fft_devices(SMALL)) <= {"cpu", BY_TORCH}
    assert fft_devices._best_s(lambda device: np.zeros(1), "cpu") < fft_devices._best_s(lambda device: _slow(), "cpu")


def _slow() -> np.ndarray:
    return np.sort(np.random.default_rng(0).standard_normal(100_000))


@pytest.mark.usefixtures("as_gpu")
@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (
            lambda x, radar, device: range_spectrum(x, radar) * (1.001 if device != "cpu" else 1),
            r"differ by 1\.0e-03 of the peak",
        ),
        (lambda x, radar, device: range_spectrum(x, radar) * (np.nan if device != "cpu" else 1), "differ by nan of the peak"),
    ],
)
def test_a_gpu_that_gives_something_else_is_not_used(monkeypatch: pytest.MonkeyPatch, wrong, said: str) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(fft_devices, "range_spectrum", wrong)
    with pytest.warns(ValidityWarning, match=said):
        assert fastest_fft_devices(SMALL) == FftDevices()


@pytest.mark.usefixtures("as_gpu")
def test_a_gpu_that_fails_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise torch.cuda.OutOfMemoryError("CUDA out of memory. Tried to allocate 1 GiB.\nMore lines.")

    monkeypatch.setattr(fft_devices.range_spectrum.__globals__["torch_transforms"], "range_spectra", fails)
    with pytest.warns(ValidityWarning, match=r"fails at FFTs \(CUDA out of memory\. Tried to allocate 1 GiB\.\); the CPU"):
        assert fastest_fft_devices(SMALL) == FftDevices()


@pytest.mark.parametrize(("driver", "installed", "said"), [(False, True, "no NVIDIA driver"), (True, False, "no torch; install")])
def test_what_is_missing_is_told(monkeypatch: pytest.MonkeyPatch, driver: bool, installed: bool, said: str) -> None:
    monkeypatch.setattr(fft_devices, "has_nvidia_gpu", lambda: driver)
    monkeypatch.setattr(fft_devices, "find_spec", lambda name: object() if installed else None)
    device, words = fft_devices.gpu_for_ffts()
    assert device is None
    assert said in words


def test_a_torch_without_cuda_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fft_devices, "has_nvidia_gpu", lambda: True)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert fft_devices.gpu_for_ffts() == (
        None,
        f"a GPU, which torch {torch.__version__} cannot use; install a CUDA build of torch",
    )
    assert fastest_fft_devices(SMALL) == FftDevices()


def test_a_gpu_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fft_devices, "has_nvidia_gpu", lambda: True)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda: "Some GPU")
    assert fft_devices.gpu_for_ffts() == ("cuda", "Some GPU, wherever it is found to be faster")


def test_without_a_gpu_torch_is_not_imported() -> None:
    code = (
        "import sys; from rtradar.process import fft_devices; fft_devices.has_nvidia_gpu = lambda: False; import rtradar; "
        "fft_devices.fastest_fft_devices(rtradar.Radar()); print('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "False"
