"""Whether there is an NVIDIA GPU, asked of its driver alone: torch and Mitsuba take seconds to say that there is none."""

from __future__ import annotations

import ctypes
import sys
from functools import lru_cache


@lru_cache(maxsize=1)
def has_nvidia_gpu() -> bool:
    """Whether an NVIDIA driver is there and knows of a GPU that this process may use."""
    try:
        driver = ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except OSError:
        return False
    count = ctypes.c_int(0)
    # Both give 0 for success (CUDA driver API).
    return driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0 and count.value > 0
