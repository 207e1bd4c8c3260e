"""Dask clusters on which samples are made: one on this machine, or an existing one."""

from __future__ import annotations

import logging
import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING
from unittest import mock

from rtradar.errors import InputError
from rtradar.kernels.jit import check_cache
from rtradar.system.files import temporary_folder
from rtradar.system.threads import thread_environment, thread_limit

if TYPE_CHECKING:
    from distributed import Client

_PATIENCE_S = 30  # time within which a scheduler must answer, and its first worker join


@contextmanager
def dask_client(workers: int | None = None, scheduler: str | None = None) -> Iterator[Client]:
    """Yield a client of a cluster with at least one worker.

    ``workers`` processes on this machine share its cores, or have as many threads each as
    `RTRADAR_THREADS` says; by default there are as many as cores. ``scheduler`` is the address of
    an existing one, such as ``tcp://host:8786``. InputError if Dask or any worker is missing.
    """
    try:
        import dask
        from dask.system import CPU_COUNT
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise InputError(
            f"data sets are built on Dask ({error}); "
            "install the extra 'campaign' of rtradar, in a checkout: pip install -e '.[campaign]'"
        ) from None
    # Errors are reported once and in one line. Loggers of Dask have levels of their own.
    for name in logging.root.manager.loggerDict:
        if name.split(".")[0] in ("asyncio", "distributed", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_PATIENCE_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            why = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise InputError(
                f"--scheduler {scheduler}: nothing answers there ({why}); start one: dask scheduler"
            ) from None
        with client:
            try:
                client.wait_for_workers(1, timeout=_PATIENCE_S)
            except TimeoutError:
                raise InputError(
                    f"--scheduler {scheduler} has no workers; start some: dask worker {scheduler}"
                ) from None
            yield client
        return
    check_cache()
    count = workers or CPU_COUNT
    environment = thread_environment(thread_limit() or max(1, CPU_COUNT // count))
    settings = {
        # A forked process would inherit the locks of Dr.Jit's threads, but not the threads.
        "distributed.worker.multiprocessing-method": "spawn",
        "distributed.nanny.pre-spawn-environ": environment,  # read as linear algebra is loaded
        "distributed.nanny.environ": environment,
    }
    with (
        _place_for_kernels(environment),
        mock.patch.dict(os.environ),  # Dask changes it to that of its workers
        dask.config.set(settings),
    ):
        # Python's process that removes semaphores of a killed build starts with this, silently.
        silent = (os.environ.get("PYTHONWARNINGS"), "ignore:resource_tracker")
        os.environ["PYTHONWARNINGS"] = ",".join(filter(None, silent))
        with _interrupts_blocked():
            try:
                local = LocalCluster(
                    n_workers=count,
                    threads_per_worker=1,
                    processes=True,
                    memory_limit=0,  # a worker paused for lack of memory would never report it
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                )
            except RuntimeError:
                raise InputError(
                    "the workers of the data set did not start; in a script, which they import, "
                    "put what builds it under: if __name__ == '__main__':"
                ) from None
        with local as cluster, Client(cluster, set_as_default=False) as client:
            yield client


def refuse_in_worker() -> None:
    """Exit where a worker imports the user's script, which would build there once more."""
    imported = sys.modules.get("__mp_main__")
    if imported is not None and imported is not sys.modules["__main__"]:
        raise SystemExit(1)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C, which a terminal sends to all, in processes and threads that are started here.

    This process ends its workers itself. A worker that is interrupted while it loads its modules
    would print a traceback.
    """
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # it would unblock the signal in the thread that starts it
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _place_for_kernels(environment: dict[str, str]) -> Iterator[None]:
    """Give workers a temporary folder for Dr.Jit's kernels, if it cannot write to its own."""
    home = os.environ.get("HOME")
    folder = os.environ.get("DRJIT_CACHE_DIR") or (home and os.path.join(home, ".drjit"))
    with ExitStack() as stack:
        if sys.platform != "win32" and not (folder and _can_be_written(folder)):
            environment["DRJIT_CACHE_DIR"] = str(stack.enter_context(temporary_folder()))
        yield


def _can_be_written(folder: str) -> bool:
    try:
        os.makedirs(folder, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True
