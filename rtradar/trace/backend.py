"""The choice of Mitsuba's variant, and of the libLLVM behind it: the only place that makes either.

Dr.Jit loads libLLVM when it is imported, whatever the variant, and keeps it for the life of the
process. Versions 15 and 16 are loaded and then abort the process, so a library is tried in another
process before it is loaded here.

Dr.Jit has one thread in this process until many rays come at once; threads are then added and never
taken away. Its threads stay awake for 20 ms while they wait for work, on cores on which our threads
have other work: for few rays that costs more than it saves. Threads cannot be taken away again.
Dr.Jit 1.5.0 tells a thread to stop and then looks whether it sleeps, without a fence in between. A
thread that falls asleep in that moment gets no message, and `set_thread_count` waits for it for
ever.
"""

from __future__ import annotations

import os
import sys
import threading
import warnings
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from types import ModuleType
from typing import Any, Literal

from rtradar.errors import BackendError, InputError
from rtradar.system.clock import warming_up
from rtradar.system.threads import thread_count
from rtradar.trace.probe import (
    ENVIRONMENT_VARIABLE,
    WHEEL,
    Library,
    ProbeResult,
    candidates,
    probe_backend,
)

Kind = Literal["llvm", "scalar", "cuda"]

# The RGB variants: the only scalar one without spectra, so all have the same plugins.
VARIANTS: dict[Kind, str] = {"llvm": "llvm_ad_rgb", "scalar": "scalar_rgb", "cuda": "cuda_ad_rgb"}
"""Mitsuba's variant of each kind of backend."""

TROUBLE = "no libLLVM that works with Dr.Jit was found"
CURE = "install one: " + (
    "brew install llvm"
    if sys.platform == "darwin"
    else f"pip install {WHEEL} (x86-64 Linux), or the system's libllvm 19 or newer"
)


class BackendWarning(UserWarning):
    """A slower backend serves because the one that was wanted does not work."""


@dataclass(frozen=True)
class Backend:
    """A Mitsuba variant that works on this machine.

    ``kind`` is the name that users give it, ``variant`` is Mitsuba's name. ``llvm_path`` is the
    libLLVM for Dr.Jit, whatever the kind: it is loaded once and must work if the kind is changed
    later; ``llvm_version`` is the version of this library. ``warning`` says in one line why the
    variant is slower than it could be, and what to install.
    """

    kind: Kind
    variant: str
    llvm_path: str | None
    llvm_version: str | None
    warning: str | None = None


@warming_up()
def select(variant: str = "auto") -> Backend:
    """Choose the backend to use.

    ``auto`` and ``cpu`` take llvm with the first libLLVM that works, or scalar where none does,
    with a `BackendWarning`. A GPU traces rays only where ``cuda`` is named. An `InputError` is
    raised if there is no such variant; a `BackendError` that says what to install where the variant
    was asked for by name and does not work, or Mitsuba is missing.
    """
    if variant not in ("auto", "cpu", *VARIANTS):
        raise InputError(
            f"variant '{variant}' is unknown; allowed: auto, cpu, {', '.join(VARIANTS)}"
        )
    for package in ("mitsuba", "drjit"):
        if find_spec(package) is None:
            raise BackendError(
                f"the package {package} is not installed; install it: pip install mitsuba"
            )
    # A libLLVM is settled whatever the kind, because Dr.Jit loads one when it is imported and keeps
    # it.
    library, result, trouble = _first_good()
    kind = next((name for name in VARIANTS if name == variant), "llvm" if library else "scalar")
    if kind == "llvm" and library is None:
        raise BackendError(trouble)
    # A GPU has to be tried each time; it may have gone.
    if kind == "cuda":
        probed = probe_backend(VARIANTS["cuda"], library)
        if not probed.good:
            raise BackendError(
                f"no CUDA GPU that works was found ({probed.finding}); it needs an NVIDIA driver "
                "with OptiX; use --variant auto to run on the CPU"
            )
    path, version = (library.path, result.version) if library and result else (None, None)
    # Only a choice that fell to scalar by itself is warned of.
    warning = None
    if kind == "scalar" and variant != "scalar":
        warning = f"{trouble}; until then {VARIANTS['scalar']} serves, and is many times slower"
        warnings.warn(warning, BackendWarning, stacklevel=2)
    return Backend(kind, VARIANTS[kind], path, version, warning)


@warming_up()
def use(backend: Backend) -> ModuleType:
    """Set Mitsuba's variant and return Mitsuba; may be called again, also with another backend.

    Objects made under one variant belong to it: drop them before the next is set. Dr.Jit has one
    thread until many rays come (`grow_for`); where it was imported before, it keeps the threads it
    has. A `BackendError` is raised if Dr.Jit was imported with another libLLVM since the backend
    was selected, or the variant cannot be set.
    """
    # What Dr.Jit has loaded stays for the life of the process.
    loaded = loaded_llvm_version()
    first = "drjit" not in sys.modules
    if backend.kind == "llvm" and loaded not in (None, backend.llvm_version):
        raise BackendError(_loaded_before(loaded))
    # Dr.Jit reads the variable when it is imported: what the user named there is put back
    # afterwards.
    named = os.environ.get(ENVIRONMENT_VARIABLE)
    try:
        if backend.llvm_path is not None:
            os.environ[ENVIRONMENT_VARIABLE] = backend.llvm_path
        import mitsuba as mi

        # A program that imported Dr.Jit before us may have computed with it: its threads stay.
        if first:
            import drjit as dr

            dr.set_thread_count(1)
        if mi.variant() != backend.variant:
            mi.set_variant(backend.variant)
    except ImportError as error:
        reason = str(error).splitlines()[0]
        raise BackendError(
            f"Mitsuba's variant {backend.variant} cannot be used ({reason}); see: rtradar doctor"
        ) from error
    finally:  # the variable was meant for Dr.Jit alone
        os.environ.pop(ENVIRONMENT_VARIABLE, None)
        if named is not None:
            os.environ[ENVIRONMENT_VARIABLE] = named
    return mi


def available() -> tuple[Kind, ...]:
    """The backends that work here, of llvm, scalar and cuda."""
    found: list[Kind] = []
    for kind in VARIANTS:
        with suppress(BackendError):
            found.append(select(kind).kind)
    return tuple(found)


def loaded_llvm_version() -> str | None:
    """Version of the libLLVM that Dr.Jit has, ``none`` if it has none; None before its import."""
    if "drjit" not in sys.modules:
        return None
    import drjit as dr

    version = dr.detail.llvm_version()
    return ".".join(map(str, version)) if version[0] > 0 else "none"


def _first_good() -> tuple[Library | None, ProbeResult | None, str]:
    """The first library that works and its result, or None twice and what is wrong."""
    loaded = loaded_llvm_version()
    refused = []
    # The first candidate that works is taken, unless Dr.Jit has loaded another one already.
    for library in candidates():
        result = probe_backend(VARIANTS["llvm"], library)
        if result.good and loaded in (None, result.version):
            return library, result, ""
        if result.good:
            return None, None, _loaded_before(loaded)
        named = f", named by {ENVIRONMENT_VARIABLE}" if library.origin == "environment" else ""
        refused.append(f"{library.path}{named}, {result.finding}")
    return None, None, f"{TROUBLE} ({'; '.join(refused) or 'there is none'}); {CURE}"


def _loaded_before(loaded: str | None) -> str:
    what = "without a libLLVM" if loaded == "none" else f"with libLLVM {loaded}"
    return (
        f"Dr.Jit was imported {what} before; let rtradar import it first, "
        f"or set {ENVIRONMENT_VARIABLE} before Python starts"
    )


# -- threads of Dr.Jit -----------------------------------------------------------------------------

MANY_RAYS = 1 << 16
"""Least number of rays traced at once that all cores share."""

_ONE_AT_A_TIME = threading.Lock()


def grow_for(mi: Any, rays: int) -> None:
    """Give Dr.Jit all threads that this process may use, if so many rays are to be traced."""
    if rays < MANY_RAYS or not mi.variant().startswith("llvm"):
        return
    import drjit as dr

    # Threads are added once, by whichever thread of ours comes first.
    with _ONE_AT_A_TIME:
        if dr.thread_count() < thread_count():
            dr.set_thread_count(thread_count())
