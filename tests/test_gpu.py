"""Whether a driver that says this or that is taken for a GPU."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from typing import Any

import pytest

from rtradar.gpu import has_nvidia_gpu


class Driver:
    def __init__(self, started: int, asked: int, gpus: int) -> None:
        self._started, self._asked, self._gpus = started, asked, gpus

    def cuInit(self, flags: int) -> int:  # noqa: N802
        return self._started

    def cuDeviceGetCount(self, count: Any) -> int:  # noqa: N802
        count._obj.value = self._gpus
        return self._asked


@pytest.fixture(autouse=True)
def _asked_anew() -> Iterator[None]:
    has_nvidia_gpu.cache_clear()
    yield
    has_nvidia_gpu.cache_clear()


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


def test_without_a_driver_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Any:
        raise OSError(name)

    monkeypatch.setattr(ctypes, "CDLL", missing)
    assert not has_nvidia_gpu()
