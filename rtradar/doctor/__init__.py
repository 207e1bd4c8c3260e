"""What this machine offers rtradar, what is missing, and how to mend it."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import sys
import warnings
from pathlib import Path
from typing import Any

from rtradar.errors import BackendError
from rtradar.kernels.jit import CacheWarning, try_cache
from rtradar.system.files import write_json
from rtradar.system.templates import templates
from rtradar.trace.backend import VARIANTS, BackendWarning, Kind, select
from rtradar.trace.probe import candidates, probe_backend

PACKAGES = (
    *("rtradar", "mitsuba", "drjit", "numpy", "scipy", "numba", "scikit-image", "trimesh"),
    *("h5py", "zarr", "matplotlib", "jinja2"),
)
"""Packages whose versions tell most when something goes wrong."""

Report = dict[str, Any]


def examine() -> Report:
    """Examine this machine, which takes some seconds.

    Every backend is probed anew, in a process of its own, and a function is compiled, kept and
    loaded again.

    Returns
    -------
    dict
        Plain values, for JSON. ``python`` and ``system`` name the interpreter, the operating system
        and the processor; ``cores`` are those that this process may use. The memory of the machine
        [MiB] is None where the system does not report it, and a version where one of `PACKAGES` is
        not installed. ``llvm`` has each libLLVM in the order of trial, ``backends`` says ``good``
        or what is wrong with each, ``compiled_code`` where compiled code was kept and loaded again,
        or why not. ``chosen`` is Mitsuba's variant that ``--variant auto`` takes, None where
        nothing works; ``advice`` says what to do, most urgent first.
    """
    # Every libLLVM that is found is tried, not only the one that a run would take.
    libraries = candidates()
    results = [probe_backend(VARIANTS["llvm"], library, fresh=True) for library in libraries]
    tried = list(zip(libraries, results, strict=True))
    good = next((library for library, result in tried if result.good), None)
    backends: dict[Kind, str] = {"llvm": "good" if good else "no libLLVM that works"}
    for kind in ("scalar", "cuda"):
        backends[kind] = probe_backend(VARIANTS[kind], good, fresh=True).finding
    chosen, advice = _chosen(backends)
    packages = {name: _version(name) for name in PACKAGES}
    if missing := [name for name, version in packages.items() if version is None]:
        advice.append(f"packages are missing; install them: pip install {' '.join(missing)}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CacheWarning)
        compiled_code, what_to_do = try_cache()
    if what_to_do:
        advice.append(what_to_do)
    total, available = _memory_mb()
    implementation = platform.python_implementation()
    return {
        "python": f"{platform.python_version()} ({implementation}, {sys.executable})",
        "system": platform.platform(),
        "cores": len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1,
        "memory_total_mb": total,
        "memory_available_mb": available,
        "packages": packages,
        "llvm": [
            {
                "path": library.path,
                "origin": library.origin,
                "version": result.version,
                "finding": result.finding,
                "chosen": library is good and chosen == VARIANTS["llvm"],
            }
            for library, result in tried
        ],
        "backends": backends,
        "compiled_code": compiled_code,
        "chosen": chosen,
        "advice": advice,
    }


def _chosen(backends: dict[Kind, str]) -> tuple[str | None, list[str]]:
    """The variant that is chosen where it works, and advice about it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BackendWarning)
            backend = select("auto")
    except BackendError as error:
        return None, [str(error)]
    finding, advice = backends[backend.kind], [backend.warning] if backend.warning else []
    if finding == "good":
        return backend.variant, advice
    remedy = "reinstall it: pip install --force-reinstall mitsuba"
    return None, [f"{backend.variant}: {finding}; {remedy}", *advice]


def report_text(found: Report) -> str:
    """The report for a person at a terminal."""
    template = templates(Path(__file__).parent, escaped=False).get_template("report.txt")
    return template.render(found, variants=VARIANTS)


def report(json_path: str | Path | None = None) -> int:
    """Examine the machine, print the report, and return 0 where a backend works, else 1.

    The report is written as JSON where a path is given; an `InputError` is raised where it cannot
    be.
    """
    found = examine()
    if json_path is not None:
        write_json(json_path, found)
    print(report_text(found))
    return 0 if found["chosen"] else 1


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _memory_mb() -> tuple[float | None, float | None]:
    """Total and available memory [MiB], None for what the system does not tell."""
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**20
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except (AttributeError, ValueError, OSError):
        return None, None
    available = next((line.split()[1] for line in lines if line.startswith("MemAvailable:")), None)
    return total, float(available) / 1024 if available else None
