"""Where a libLLVM may be, and whether a Mitsuba variant works with it.

It may be named by the environment variable, or come with the wheel or with the system. Each is
tried in another process, and the answer is kept on disk.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import json
import os
import platform
import re
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal, NamedTuple

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


class Library(NamedTuple):
    """A libLLVM that may or may not work, and who brought it.

    The path, for the dynamic loader, exists unless the environment variable names one that does
    not.
    """

    path: str
    origin: Literal["environment", "wheel", "system"]

    @property
    def version(self) -> str | None:
        """Version as far as the file's name tells it; None where it tells nothing."""
        name = _NAME.fullmatch(Path(self.path).name)
        return (name["dashed"] or name["dotted"]) if name else None


def candidates() -> list[Library]:
    """Every libLLVM on this machine in the order in which they are tried, each file once.

    The environment variable goes first, then the wheel, then what the system has, newest first.
    """
    # By their real paths, so that links to one file count once.
    named = os.environ.get(ENVIRONMENT_VARIABLE)
    found = {os.path.realpath(named): Library(named, "environment")} if named else {}
    system = {path: Library(path, "system") for path in _libraries(_of_system())}
    wheel = {path: Library(path, "wheel") for path in _libraries(_of_wheel())}
    for path, library in [*wheel.items(), *sorted(system.items(), key=_newness, reverse=True)]:
        found.setdefault(path, library)
    return list(found.values())


def _newness(item: tuple[str, Library]) -> list[float]:
    # A file without a number is the current version of the package manager.
    return [float(number) for number in (item[1].version or "inf").split(".")]


def _libraries(paths: Iterable[Path]) -> list[str]:
    return [os.path.realpath(one) for one in paths if _NAME.fullmatch(one.name) and one.is_file()]


def _of_wheel() -> list[Path]:
    try:
        wheel = importlib.metadata.distribution(WHEEL)
    except importlib.metadata.PackageNotFoundError:
        return []
    return [Path(str(wheel.locate_file(file))) for file in wheel.files or ()]


def _of_system() -> Iterator[Path]:
    # A Python from conda has its libraries beside it.
    own = (f"{prefix}/lib/libLLVM*" for prefix in (sys.prefix, sys.base_prefix))
    for pattern in (*own, *_SYSTEM_PATTERNS.get(sys.platform, ())):
        yield from Path("/").glob(pattern.lstrip("/"))


TIMEOUT_S = 120.0
"""Longest time for a probe. It takes half a second, but longer from a cold disk or on a new GPU."""

_PROBE = Path(__file__).with_name("probe_script.py")

_SIGNALS = signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGKILL", signal.SIGTERM)
_STOPPED = {None, *(-number for number in _SIGNALS)}
"""Exit statuses that say nothing about the library: none in time, and signals somebody sent."""

_FINDINGS = {
    "is too old": "refused by Dr.Jit: too old",
    "Unable to load": "cannot be loaded",
    "the CUDA backend": "no CUDA driver or no GPU",
}
"""What messages of Dr.Jit mean."""


class ProbeResult(NamedTuple):
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
    kept = None if variant.startswith("cuda") else _kept_in(variant, library)
    if kept is not None and not fresh:
        with contextlib.suppress(OSError, ValueError, TypeError):  # none, or a damaged one
            return ProbeResult(**json.loads(kept.read_bytes()))
    result, ended = _probe(variant, library)
    if kept is not None and ended not in _STOPPED:
        # A read-only home costs the next start half a second, no more.
        with contextlib.suppress(OSError, InputError):
            kept.parent.mkdir(parents=True, exist_ok=True)
            with atomic_file(kept) as file:
                file.write(json.dumps(result._asdict()).encode())
    return result


def _probe(variant: str, library: Library | None) -> tuple[ProbeResult, int | None]:
    """Return what the probe found, and its exit status, None where it did not end."""
    version = library.version if library else None
    with temporary_folder() as kernels:
        # An empty kernel cache, so that no kernel of another libLLVM gives the result.
        environment = {**os.environ, "DRJIT_CACHE_DIR": str(kernels)}
        if library is not None:
            environment[ENVIRONMENT_VARIABLE] = library.path
        # -P keeps the modules beside the script from shadowing others.
        command = [sys.executable, "-P", str(_PROBE), variant]
        options: dict[str, Any] = {"env": environment, "text": True, "errors": "replace"}
        try:
            done = subprocess.run(command, capture_output=True, timeout=TIMEOUT_S, **options)
        except subprocess.TimeoutExpired:
            return ProbeResult(f"hangs: no answer in {TIMEOUT_S:.0f} s", version), None
    # The script prints JSON in two lines, the second only if the kernel did not abort.
    lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    said = {key: value for line in lines for key, value in line.items()}
    if (found := said.get("llvm_version", [-1]))[0] > 0:
        version = ".".join(map(str, found))
    return ProbeResult(_finding(done, said), version), done.returncode


def _finding(done: subprocess.CompletedProcess[str], said: dict[str, Any]) -> str:
    if done.returncode == 0:
        return "good" if said.get("works") else "gives wrong results"
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


def _kept_in(variant: str, library: Library | None) -> Path | None:
    """File of an answer, named by all that it depends on; None where that is unknown."""
    # A new version, another file of the library or another script is another question.
    try:
        versions = [importlib.metadata.version(name) for name in ("mitsuba", "drjit")]
        about = () if library is None else (library.path, os.stat(library.path).st_mtime_ns)
        asked = variant, platform.machine(), sys.executable, *versions, *about, _PROBE.read_bytes()
    except (importlib.metadata.PackageNotFoundError, OSError):
        return None
    return cache_dir() / f"probe-{hashlib.sha256(repr(asked).encode()).hexdigest()[:16]}.json"
