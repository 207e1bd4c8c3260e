"""What this machine offers rtradar, what is missing, and how to mend it."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import os
import platform
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rtradar.errors import BackendError
from rtradar.kernels.jit import CacheWarning, try_cache
from rtradar.system.files import write_json
from rtradar.trace.backends.backend import VARIANTS, BackendWarning, Kind, select
from rtradar.trace.backends.llvm import candidates
from rtradar.trace.backends.verdict import judge

PACKAGES = (
    "rtradar",
    "mitsuba",
    "drjit",
    "numpy",
    "scipy",
    "numba",
    "scikit-image",
    "trimesh",
    "h5py",
    "zarr",
    "matplotlib",
)
"""Packages whose versions tell most when something goes wrong."""

Row = dict[str, str | bool | None]


@dataclass(frozen=True)
class DoctorReport:
    """What was found; plain values throughout, so that it can go to JSON.

    Parameters
    ----------
    python, system : str
        The interpreter's version, the operating system and processor.
    cores : int
        Cores that this process may use.
    memory_total_mb, memory_available_mb : float or None
        Memory of the machine [MiB]; None where the system does not report it.
    packages : dict
        Version of each of `PACKAGES`; None where it is not installed.
    llvm : list of dict
        Each libLLVM in the order of trial: path, origin, version, finding, chosen.
    backends : dict
        ``good``, or what is wrong, for llvm, scalar and cuda.
    compiled_code : str
        Where code that is compiled was kept and loaded again, or why not.
    chosen : str or None
        Mitsuba's variant that ``--variant auto`` takes; None where nothing works.
    advice : list of str
        What to do, most urgent first; empty where all is well.
    """

    python: str
    system: str
    cores: int
    memory_total_mb: float | None
    memory_available_mb: float | None
    packages: dict[str, str | None]
    llvm: list[Row]
    backends: dict[Kind, str]
    compiled_code: str
    chosen: str | None
    advice: list[str]

    @property
    def exit_status(self) -> int:
        """0 where a backend works, else 1."""
        return 0 if self.chosen else 1

    def as_dict(self) -> dict[str, Any]:
        """The fields by their names."""
        return dataclasses.asdict(self)


def examine() -> DoctorReport:
    """Look at this machine. It takes some seconds.

    Every backend is probed anew, in processes of their own, and a function is compiled, kept and loaded again.
    """
    libraries = candidates()
    verdicts = [judge(VARIANTS["llvm"], library, fresh=True) for library in libraries]
    good = next(
        (library for library, verdict in zip(libraries, verdicts, strict=True) if verdict.good),
        None,
    )
    backends: dict[Kind, str] = {"llvm": "good" if good else "no libLLVM that works"}
    backends["scalar"] = judge(VARIANTS["scalar"], good, fresh=True).finding
    backends["cuda"] = judge(VARIANTS["cuda"], good, fresh=True).finding
    advice = []
    chosen = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BackendWarning)
            backend = select("auto")
    except BackendError as error:
        advice.append(str(error))
    else:
        if backends[backend.kind] == "good":
            chosen = backend.variant
        else:
            advice.append(
                f"{backend.variant}: {backends[backend.kind]}; reinstall it: pip install --force-reinstall mitsuba"
            )
        if backend.warning:
            advice.append(backend.warning)
    packages = {name: _version(name) for name in PACKAGES}
    missing = [name for name, version in packages.items() if version is None]
    if missing:
        advice.append(f"packages are missing; install them: pip install {' '.join(missing)}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CacheWarning)
        compiled_code, what_to_do = try_cache()
    if what_to_do:
        advice.append(what_to_do)
    total, available = _memory_mb()
    return DoctorReport(
        python=f"{platform.python_version()} ({platform.python_implementation()}, {sys.executable})",
        system=platform.platform(),
        cores=_cores(),
        memory_total_mb=total,
        memory_available_mb=available,
        packages=packages,
        llvm=[
            {
                "path": library.path,
                "origin": library.origin,
                "version": verdict.version,
                "finding": verdict.finding,
                "chosen": library is good and chosen == VARIANTS["llvm"],
            }
            for library, verdict in zip(libraries, verdicts, strict=True)
        ],
        backends=backends,
        compiled_code=compiled_code,
        chosen=chosen,
        advice=advice,
    )


def report_text(found: DoctorReport) -> str:
    """The report for a person at a terminal."""
    memory = "unknown"
    if found.memory_total_mb is not None:
        memory = f"{found.memory_total_mb / 1024:.1f} GiB"
        if found.memory_available_mb is not None:
            memory += f", {found.memory_available_mb / 1024:.1f} GiB available"
    lines = [
        f"Python    {found.python}",
        f"System    {found.system}",
        f"Cores     {found.cores}",
        f"Memory    {memory}",
        "Packages  "
        + ", ".join(f"{name} {version}" for name, version in found.packages.items() if version),
        "libLLVM   " + ("in the order of trial:" if found.llvm else "none found"),
        *(
            f"  {_arrow(row['chosen'])} {row['version'] or '?':<8} {row['finding']:<28} {row['origin']:<12} {row['path']}"
            for row in found.llvm
        ),
        "Backends",
        *(
            f"  {'->' if VARIANTS[kind] == found.chosen else '  '} {kind:<8} {finding}"
            for kind, finding in found.backends.items()
        ),
        f"Compiled  {found.compiled_code}",
        *(f"To do     {line}" for line in found.advice),
        f"Verdict   ready, on {found.chosen}"
        if found.chosen
        else "Verdict   no backend works: rays cannot be traced",
    ]
    return "\n".join(lines)


def report(json_path: str | Path | None = None) -> int:
    """Examine the machine, print the report, write it as JSON where a path is given, and return the exit status.

    Raises
    ------
    InputError
        Where the JSON file cannot be written.
    """
    found = examine()
    print(report_text(found))
    if json_path is not None:
        write_json(json_path, found.as_dict())
    return found.exit_status


def _arrow(chosen: str | bool | None) -> str:
    return "->" if chosen else "  "


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _memory_mb() -> tuple[float | None, float | None]:
    """Total and available memory [MiB], None for what the system does not tell."""
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**20
    except (AttributeError, ValueError, OSError):
        return None, None
    try:
        meminfo = Path("/proc/meminfo").read_text(encoding="ascii")
    except OSError:
        return total, None
    available = next(
        (line.split()[1] for line in meminfo.splitlines() if line.startswith("MemAvailable:")), None
    )
    return total, float(available) / 1024 if available else None
