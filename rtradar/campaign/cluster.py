"""Where samples are made: a Dask cluster on this machine, or one that is there already."""

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

from rtradar.errors import InputError
from rtradar.kernels.jit import check_cache
from rtradar.system.files import temporary_folder
from rtradar.system.threads import environment_of, thread_limit

if TYPE_CHECKING:
    from distributed import Client

_PATIENCE_S = 30
"""How long a scheduler may take to answer, and its first worker to come."""


@contextmanager
def dask_client(workers: int | None = None, scheduler: str | None = None) -> Iterator[Client]:
    """A client of a cluster with at least one worker.

    Parameters
    ----------
    workers : int, optional
        Processes on this machine, of one task each, that share its cores (or have as many threads each as `RTRADAR_THREADS`
        says); as many as there are cores if left out.
    scheduler : str, optional
        Address of a scheduler that is there already, such as ``tcp://host:8786``; its workers are taken as they are.

    Raises
    ------
    InputError
        Where Dask is not installed, or there is no scheduler or no worker.
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
    # What goes wrong is said in one line, and once. Loggers of Dask and of what it talks through have levels of their own.
    for name in [
        name
        for name in logging.root.manager.loggerDict
        if name.split(".")[0] in ("asyncio", "distributed", "tornado")
    ]:
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
    environment = environment_of(thread_limit() or max(1, CPU_COUNT // count))
    settings = {
        # A process that is forked inherits locks of Dr.Jit's threads, but not the threads.
        "distributed.worker.multiprocessing-method": "spawn",
        "distributed.nanny.pre-spawn-environ": environment,  # linear algebra looks as it is loaded
        "distributed.nanny.environ": environment,
    }
    with (
        _place_for_kernels(environment),
        _environment_kept(),  # Dask puts what it starts workers with into that of this process
        _silent_tracker(),
        dask.config.set(settings),
    ):
        with _deaf_children():
            local = LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                processes=True,
                memory_limit=0,  # a worker that is held for want of memory would never say so
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
        with local as cluster, Client(cluster, set_as_default=False) as client:
            yield client


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Have processes that are started meanwhile, and by threads that are, not hear Ctrl-C, which a terminal tells all.

    This process ends its workers itself. One that is still loading its modules as Ctrl-C comes would say where it was.
    """
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # it would let the thread that starts it hear again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _place_for_kernels(environment: dict[str, str]) -> Iterator[None]:
    """Where Dr.Jit can keep no kernels, have workers share a folder meanwhile; otherwise each of them would tell."""
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


@contextmanager
def _silent_tracker() -> Iterator[None]:
    """Have semaphores that a killed build leaves taken away without a word: Python's process for that starts with this."""
    os.environ["PYTHONWARNINGS"] = ",".join(
        filter(None, (os.environ.get("PYTHONWARNINGS"), "ignore:resource_tracker"))
    )
    yield


@contextmanager
def _environment_kept() -> Iterator[None]:
    """Let the environment of this process be afterwards what it was."""
    before = dict(os.environ)
    try:
        yield
    finally:
        for name in os.environ.keys() - before.keys():
            del os.environ[name]
        os.environ.update(before)
