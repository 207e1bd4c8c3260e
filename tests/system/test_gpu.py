"""Whether a driver that says this or that is taken for a GPU, and what torch makes of it."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from rtradar.system import gpu
from rtradar.system.gpu import gpu_for_ffts, gpu_name, has_nvidia_gpu


class Driver:
    def __init__(self, started: int, asked: int, gpus: int) -> None:
        self._started, self._asked, self._gpus = started, asked, gpus

    def cuInit(self, flags: int) -> int:  # noqa: N802
        return self._started

    def cuDeviceGetCount(self, count: Any) -> int:  # noqa: N802
        count._obj.value = self._gpus
        return self._asked

    def cuDeviceGet(self, device: Any, number: int) -> int:  # noqa: N802
        return self._asked

    def cuDeviceGetName(self, name: Any, size: int, device: Any) -> int:  # noqa: N802
        name.value = b"Some GPU"
        return self._asked

    def cuDriverGetVersion(self, version: Any) -> int:  # noqa: N802
        version._obj.value = 12080
        return self._asked


@pytest.fixture(autouse=True)
def _asked_anew() -> Iterator[None]:
    gpu._found.cache_clear()
    yield
    gpu._found.cache_clear()


@pytest.mark.parametrize(
    ("driver", "there"),
    [
        (Driver(0, 0, 1), True),
        (Driver(0, 0, 8), True),
        (Driver(0, 0, 0), False),
        (Driver(100, 0, 1), False),  # CUDA_ERROR_NO_DEVICE
        (Driver(0, 3, 1), False),  # CUDA_ERROR_NOT_INITIALIZED
    ],
)
def test_a_gpu_is_there_where_the_driver_starts_and_counts_one(
    monkeypatch: pytest.MonkeyPatch, driver: Driver, there: bool
) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda name: driver)
    assert has_nvidia_gpu() is there
    assert gpu_name() == ("Some GPU, driver 12080" if there else "")


def test_in_the_child_of_a_process_that_asked_there_is_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda name: Driver(0, 0, 1))
    assert has_nvidia_gpu()
    child = os.getpid() + 1
    monkeypatch.setattr(os, "getpid", lambda: child)
    assert not has_nvidia_gpu()


def test_without_a_driver_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Any:
        raise OSError(name)

    monkeypatch.setattr(ctypes, "CDLL", missing)
    assert not has_nvidia_gpu()


class Cuda:
    """Of a torch that finds a GPU or none, or fails over it."""

    def __init__(self, there: bool, error: Exception | None = None) -> None:
        self._there, self._error = there, error

    def is_available(self) -> bool:
        if self._error is not None:
            raise self._error
        return self._there


@pytest.mark.parametrize(
    ("cuda", "device", "said"),
    [
        (Cuda(True), "cuda", "Some GPU, driver 12080, wherever it is found to be faster"),
        (
            Cuda(False),
            None,
            "Some GPU, driver 12080, which torch 9.9 cannot use; install a CUDA build of torch",
        ),
        (
            Cuda(True, RuntimeError("no\nlibrary")),
            None,
            "Some GPU, driver 12080, but torch fails: no",
        ),
        (
            Cuda(True, AssertionError()),
            None,
            "Some GPU, driver 12080, but torch fails: AssertionError",
        ),
        (None, None, "Some GPU, driver 12080, but no torch; install it: pip install torch"),
    ],
)
def test_what_torch_makes_of_it(
    monkeypatch: pytest.MonkeyPatch, cuda: Cuda | None, device: str | None, said: str
) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda name: Driver(0, 0, 1))
    monkeypatch.setattr(gpu, "find_spec", lambda name: cuda)
    monkeypatch.setitem(sys.modules, "torch", SimpleNamespace(cuda=cuda, __version__="9.9"))
    assert gpu_for_ffts() == (device, said)


def test_without_a_driver_torch_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpu, "has_nvidia_gpu", lambda: False)
    monkeypatch.setattr(gpu, "find_spec", lambda name: pytest.fail("torch takes seconds to import"))
    assert gpu_for_ffts() == (None, "no NVIDIA driver, or no GPU")
