"""Whether there is an NVIDIA GPU, asked of its driver alone: torch and Mitsuba take seconds to say that there is none."""

from __future__ import annotations

import ctypes
import os
import sys
import warnings
from functools import lru_cache
from importlib.util import find_spec

_NAME_BYTES = 256


def has_nvidia_gpu() -> bool:
    """Whether an NVIDIA driver is there and knows of a GPU that this process may use."""
    # CUDA does not work in the child of a process that has begun with it.
    return _found()[0] == os.getpid()


def gpu_name() -> str:
    """Name of the first GPU and version of its driver, where `has_nvidia_gpu`; else nothing."""
    return _found()[1]


@lru_cache(maxsize=1)
def _found() -> tuple[int | None, str]:
    """The process that has found a GPU, and what it is."""
    try:
        driver = ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except OSError:
        return None, ""
    # All give 0 for success (CUDA driver API).
    count, device, version = ctypes.c_int(0), ctypes.c_int(0), ctypes.c_int(0)
    if driver.cuInit(0) or driver.cuDeviceGetCount(ctypes.byref(count)) or count.value < 1:
        return None, ""
    name = ctypes.create_string_buffer(_NAME_BYTES)
    if driver.cuDeviceGet(ctypes.byref(device), 0) or driver.cuDeviceGetName(
        name, _NAME_BYTES, device
    ):
        return None, ""
    driver.cuDriverGetVersion(ctypes.byref(version))
    return os.getpid(), f"{name.value.decode(errors='replace')}, driver {version.value}"


def gpu_for_ffts() -> tuple[str | None, str]:
    """Look for a GPU that torch can use.

    Returns
    -------
    device : str or None
        As torch names it.
    words : str
        What there is, or what is missing, in a few words.
    """
    if not has_nvidia_gpu():
        return None, "no NVIDIA driver, or no GPU"
    if find_spec("torch") is None:
        return None, f"{gpu_name()}, but no torch; install it: pip install torch"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of drivers too old, which is told here
            import torch

            there = torch.cuda.is_available()
    except Exception as error:  # whatever a broken installation raises
        return None, f"{gpu_name()}, but torch fails: {first_line(error)}"
    if not there:
        return (
            None,
            f"{gpu_name()}, which torch {torch.__version__} cannot use; install a CUDA build of torch",
        )
    return "cuda", f"{gpu_name()}, wherever it is found to be faster"


def first_line(error: BaseException) -> str:
    """What an error says, in one line: those of drivers have many, or none."""
    return next(iter(str(error).splitlines()), type(error).__name__)
