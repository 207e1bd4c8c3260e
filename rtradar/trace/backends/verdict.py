"""Whether a Mitsuba variant works with a libLLVM, found out in a process of its own and remembered on disk."""

from __future__ import annotations

import contextlib
import importlib.metadata
import json
import os
import platform
import signal
import subprocess
import sys
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rtradar.errors import InputError
from rtradar.system.files import atomic_file, temporary_folder
from rtradar.trace.backends.llvm import ENVIRONMENT_VARIABLE, Library

TIMEOUT_S = 120.0
"""A probe takes half a second; a cold disk, or a GPU that compiles its kernels for the first time, takes longer."""

_PROBE = Path(__file__).with_name("probe.py")

_STOPPED = {
    -number
    for number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGKILL", signal.SIGTERM))
}
"""Somebody ended the probe, with the program that waits for it perhaps: that says nothing of the library."""


@dataclass(frozen=True)
class Verdict:
    """What a probe found.

    Parameters
    ----------
    finding : str
        ``good``, or in a few words what went wrong.
    version : str or None
        Of the libLLVM in use; None where there is none or it does not tell.
    """

    finding: str
    version: str | None = None

    @property
    def good(self) -> bool:
        """Whether kernels may be run."""
        return self.finding == "good"


def judge(variant: str, library: Library | None, *, fresh: bool = False) -> Verdict:
    """Whether ``variant`` works, with that libLLVM loaded.

    The answer of an earlier process is taken from the disk where neither the library nor Dr.Jit nor Mitsuba has changed
    since, nor what is asked; answers on GPUs, which come and go without a trace in a file, and probes that took too long are
    not kept.

    Parameters
    ----------
    variant : str
        Mitsuba's name of it.
    library : Library or None
        The libLLVM for Dr.Jit; None leaves the choice to Dr.Jit.
    fresh : bool
        Probe even where the answer is on the disk.
    """
    key = None if variant.startswith("cuda") else _key(variant, library)
    kept = {} if key is None else _read_cache()
    if key in kept and not fresh:
        return Verdict(**kept[key])
    try:
        verdict, ended = _probe(variant, library)
    except subprocess.TimeoutExpired:
        return Verdict(
            f"hangs: no answer in {TIMEOUT_S:.0f} s", library.version if library else None
        )
    if key is not None and ended not in _STOPPED:
        _write_cache(
            {**_read_cache(), key: {"finding": verdict.finding, "version": verdict.version}}
        )
    return verdict


def _probe(variant: str, library: Library | None) -> tuple[Verdict, int]:
    """What it found, and the status with which it ended."""
    with temporary_folder() as kernels:
        # An empty kernel cache: the verdict must come from compiling, not from what another libLLVM compiled.
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
    told = said.get("llvm_version", [-1])
    version = ".".join(map(str, told)) if told[0] > 0 else (library.version if library else None)
    if done.returncode == 0 and said.get("works"):
        return Verdict("good", version), 0
    return Verdict(_what_went_wrong(done, said), version), done.returncode


def _what_went_wrong(done: subprocess.CompletedProcess[str], said: dict[str, Any]) -> str:
    if done.returncode == 0:
        return "gives wrong results"
    # A process that calls abort() ends by a signal, which Python tells by a negative status.
    if done.returncode < 0:
        return "aborts the process"
    if "is too old" in done.stderr:
        return "refused by Dr.Jit: too old"
    if "Unable to load" in done.stderr:
        return "cannot be loaded"
    if "the CUDA backend" in done.stderr:
        return "no CUDA driver or no GPU"
    lines = done.stderr.strip().splitlines()
    last = lines[-1] if lines else f"exit status {done.returncode}"
    return f"fails: {last[:200]}"


# -- memory --------------------------------------------------------------------------------------------------------


def cache_dir() -> Path:
    """Where rtradar keeps what it may lose: ``RTRADAR_CACHE``, else the platform's folder for that."""
    named = os.environ.get("RTRADAR_CACHE")
    if named:
        return Path(named)
    if sys.platform == "darwin":
        return Path("~/Library/Caches/rtradar").expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "rtradar"


def _key(variant: str, library: Library | None) -> str | None:
    """All that an answer depends on; None where that cannot be told."""
    try:
        versions = [f"{name} {importlib.metadata.version(name)}" for name in ("mitsuba", "drjit")]
        about = [] if library is None else [library.path, str(os.stat(library.path).st_mtime_ns)]
        about.append(f"probe {zlib.crc32(_PROBE.read_bytes()):08x}")
    except (importlib.metadata.PackageNotFoundError, OSError):
        return None
    return "; ".join([variant, platform.machine(), sys.executable, *versions, *about])


def _read_cache() -> dict[str, Any]:
    try:
        kept = json.loads((cache_dir() / "verdicts.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return kept if isinstance(kept, dict) else {}


def _write_cache(kept: dict[str, Any]) -> None:
    # A read-only home costs the next start half a second, no more.
    with contextlib.suppress(OSError, InputError):
        folder = cache_dir()
        folder.mkdir(parents=True, exist_ok=True)
        with atomic_file(folder / "verdicts.json") as file:
            file.write(json.dumps(kept, indent=1).encode())
