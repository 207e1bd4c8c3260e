"""Where a libLLVM may be: the environment variable, the wheel, the system."""

from __future__ import annotations

import importlib.metadata
import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

ENVIRONMENT_VARIABLE = "DRJIT_LIBLLVM_PATH"
"""Dr.Jit reads it, once, when it is imported."""

WHEEL = "karellen-llvm-core"

_NAME = re.compile(
    r"libLLVM(?:-(?P<dashed>\d[\d.]*)(?:git|rc\d*)?)?\.(?:so(?:\.(?P<dotted>\d[\d.]*))?|dylib)"
)

_SYSTEM_PATTERNS = {
    "linux": (
        "/usr/lib/*-linux-gnu/libLLVM*.so*",
        "/usr/lib/llvm*/lib/libLLVM*.so*",
        "/usr/lib/libLLVM*.so*",
        "/usr/lib64/libLLVM*.so*",
        "/usr/lib64/llvm*/lib*/libLLVM*.so*",
        "/usr/local/lib/libLLVM*.so*",
    ),
    "darwin": (
        "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
        "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
        "/opt/local/libexec/llvm-*/lib/libLLVM*.dylib",
    ),
}


@dataclass(frozen=True)
class Library:
    """A libLLVM that may or may not work, and who brought it.

    The path, for the dynamic loader, exists unless the environment variable names one that does
    not.
    """

    path: str
    origin: Literal["environment", "wheel", "system"]

    @property
    def version(self) -> str | None:
        """As far as the file's name tells; None where it tells nothing."""
        name = _NAME.fullmatch(Path(self.path).name)
        return (name["dashed"] or name["dotted"]) if name else None


def candidates() -> list[Library]:
    """Every libLLVM on this machine in the order in which they are tried, each file once.

    The environment variable goes first, then the wheel, then what the system has, newest first.
    """
    found: dict[str, Library] = {}
    named = os.environ.get(ENVIRONMENT_VARIABLE)
    if named:
        found[os.path.realpath(named)] = Library(named, "environment")
    for path in _of_wheel():
        found.setdefault(path, Library(path, "wheel"))
    system = (Library(path, "system") for path in _of_system())
    for library in sorted(system, key=_by_age):
        found.setdefault(library.path, library)
    return list(found.values())


def _by_age(library: Library) -> tuple[float, ...]:
    # A file without a number is what the package manager calls its current one.
    return (
        tuple(-float(number) for number in library.version.split("."))
        if library.version
        else (-float("inf"),)
    )


def _of_wheel() -> Iterator[str]:
    try:
        distribution = importlib.metadata.distribution(WHEEL)
    except importlib.metadata.PackageNotFoundError:
        return
    for file in distribution.files or ():
        path = Path(str(distribution.locate_file(file)))
        if _NAME.fullmatch(path.name) and path.is_file():
            yield os.path.realpath(path)


def _of_system() -> Iterator[str]:
    patterns = _SYSTEM_PATTERNS.get(sys.platform, ())
    # A Python of conda's has its libraries beside it.
    own = tuple(f"{prefix}/lib/libLLVM*" for prefix in {sys.prefix, sys.base_prefix})
    for pattern in (*own, *patterns):
        for path in Path("/").glob(pattern.lstrip("/")):
            if _NAME.fullmatch(path.name) and path.is_file():
                yield os.path.realpath(path)
