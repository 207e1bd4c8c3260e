"""Where a libLLVM may be, and whether a Mitsuba variant works with it.

It is the one of the environment variable, of the wheel or of the system. Each is tried in another
process, and the answer is kept on disk.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import json
import os
import platform
import re
import signal
import subprocess
import sys
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from rtradar.errors import InputError
from rtradar.system.files import atomic_file, temporary_folder

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


TIMEOUT_S = 120.0
"""Longest time for a probe. It takes half a second, but longer from a cold disk or on a new GPU."""

_PROBE = Path(__file__).with_name("probe_script.py")

_STOPPED = {
    -number
    for number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGKILL", signal.SIGTERM))
}
"""Signals by which somebody ended the probe, which says nothing about the library."""

_FINDINGS = {
    "is too old": "refused by Dr.Jit: too old",
    "Unable to load": "cannot be loaded",
    "the CUDA backend": "no CUDA driver or no GPU",
}
"""What it means that Dr.Jit says so."""


@dataclass(frozen=True)
class ProbeResult:
    """What a probe found: ``good``, or in a few words what went wrong.

    ``version`` is that of the libLLVM in use; None without one, or where it does not say.
    """

    finding: str
    version: str | None = None

    @property
    def good(self) -> bool:
        """Whether kernels may be run."""
        return self.finding == "good"


def probe_backend(variant: str, library: Library | None, *, fresh: bool = False) -> ProbeResult:
    """Whether a variant, by Mitsuba's name, works with that libLLVM; None leaves Dr.Jit the choice.

    The answer of an earlier process is taken from the disk, unless it is to be ``fresh``, if the
    library, Dr.Jit, Mitsuba and the probe are the same. Answers on GPUs, which come and go without
    a trace in a file, and probes that took too long are not kept.
    """
    key = None if variant.startswith("cuda") else _key(variant, library)
    kept = {} if key is None else _read_cache()
    if key in kept and not fresh:
        return ProbeResult(**kept[key])
    try:
        result, ended = _probe(variant, library)
    except subprocess.TimeoutExpired:
        return ProbeResult(
            f"hangs: no answer in {TIMEOUT_S:.0f} s", library.version if library else None
        )
    if key is not None and ended not in _STOPPED:
        _write_cache({**_read_cache(), key: {"finding": result.finding, "version": result.version}})
    return result


def _probe(variant: str, library: Library | None) -> tuple[ProbeResult, int]:
    """What it found, and the status with which it ended."""
    with temporary_folder() as kernels:
        # An empty kernel cache: the result must not come from what another libLLVM compiled.
        environment = {**os.environ, "DRJIT_CACHE_DIR": str(kernels)}
        if library is not None:
            environment[ENVIRONMENT_VARIABLE] = library.path
        # -P keeps the modules beside the script from shadowing others.
        command = [sys.executable, "-P", str(_PROBE), variant]
        done = subprocess.run(
            command,
            env=environment,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIMEOUT_S,
        )
    said: dict[str, Any] = {}
    for line in done.stdout.splitlines():
        if line.startswith("{"):
            said |= json.loads(line)
    found = said.get("llvm_version", [-1])
    version = ".".join(map(str, found)) if found[0] > 0 else (library.version if library else None)
    if done.returncode == 0 and said.get("works"):
        return ProbeResult("good", version), 0
    return ProbeResult(_what_went_wrong(done, said), version), done.returncode


def _what_went_wrong(done: subprocess.CompletedProcess[str], said: dict[str, Any]) -> str:
    if done.returncode == 0:
        return "gives wrong results"
    # A process that calls abort() ends by a signal, which Python tells by a negative status.
    if done.returncode < 0:
        return "aborts the process"
    for text, finding in _FINDINGS.items():
        if text in done.stderr:
            return finding
    lines = done.stderr.strip().splitlines()
    last = lines[-1] if lines else f"exit status {done.returncode}"
    return f"fails: {last[:200]}"


# -- memory ----------------------------------------------------------------------------------------


def cache_dir() -> Path:
    """Folder for what rtradar may lose: ``RTRADAR_CACHE``, or the platform's cache folder."""
    named = os.environ.get("RTRADAR_CACHE")
    if named:
        return Path(named)
    if sys.platform == "darwin":
        return Path("~/Library/Caches/rtradar").expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "rtradar"


def _key(variant: str, library: Library | None) -> str | None:
    """All that an answer depends on; None where that is unknown."""
    try:
        versions = [f"{name} {importlib.metadata.version(name)}" for name in ("mitsuba", "drjit")]
        about = [] if library is None else [library.path, str(os.stat(library.path).st_mtime_ns)]
        about.append(f"probe {zlib.crc32(_PROBE.read_bytes()):08x}")
    except (importlib.metadata.PackageNotFoundError, OSError):
        return None
    return "; ".join([variant, platform.machine(), sys.executable, *versions, *about])


def _read_cache() -> dict[str, Any]:
    try:
        kept = json.loads((cache_dir() / "probes.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return kept if isinstance(kept, dict) else {}


def _write_cache(kept: dict[str, Any]) -> None:
    # A read-only home costs the next start half a second, no more.
    with contextlib.suppress(OSError, InputError):
        folder = cache_dir()
        folder.mkdir(parents=True, exist_ok=True)
        with atomic_file(folder / "probes.json") as file:
            file.write(json.dumps(kept, indent=1).encode())
