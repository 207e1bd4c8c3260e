"""Building of a data set on Dask: only samples that are missing or damaged are made.

The cluster on which they are made is one on this machine, or an existing one.
"""

from __future__ import annotations

import itertools
import logging
import math
import os
import signal
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from multiprocessing import resource_tracker
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from unittest import mock

from tqdm import tqdm

from rtradar import __version__
from rtradar.campaign.samples import Made, SamplePlan, counts, make_sample, plan_samples
from rtradar.campaign.spec_file import check_shard, read_spec, write_made
from rtradar.clouds.sample_files import (
    check_size,
    is_whole,
    sample_path,
    sweep,
    write_index,
    write_sample,
)
from rtradar.errors import CampaignError, InputError
from rtradar.kernels.jit import check_cache
from rtradar.system.files import cleanup_on_exit, temporary_folder
from rtradar.system.output_folder import exclusive_lock
from rtradar.system.templates import templates
from rtradar.system.threads import thread_environment, thread_limit

if TYPE_CHECKING:
    from distributed import Client

_PATIENCE_S = 30  # time within which a scheduler must answer, and its first worker join


class UnmadeSamplesError(InputError):
    """Some samples of a data set cannot be made; all others are there."""


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
    # A cluster that is there already, whose workers may join in a moment.
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
    # A cluster of processes on this machine, each with its share of the cores.
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


_QUEUED = 2  # submitted samples for each worker: one in progress and the next; others wait here
_AT_LEAST = 8  # smallest number of submitted samples, because workers may join later
_one_at_a_time = threading.Lock()


class Outcome(NamedTuple):
    """Outcome of one sample: ``work_s`` [s] and ``size`` [bytes], or ``trouble`` in one line."""

    identity: str
    work_s: float
    size: int
    trouble: str = ""


def missing_of(plans: Sequence[SamplePlan], folder: Path) -> tuple[list[SamplePlan], int]:
    """Check every sample that exists; return the missing or damaged, and how many are damaged."""
    bar = {"desc": "looking for samples", "unit": "sample", "leave": False}
    missing = [
        plan
        for plan in tqdm(plans, disable=None, **bar)
        if not is_whole(sample_path(folder, plan.identity), plan.parameters)
    ]
    return missing, sum(sample_path(folder, plan.identity).exists() for plan in missing)


def build_dataset(
    spec: Path,
    out: Path,
    *,
    plan_only: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    changed: bool = False,
    shard: tuple[int, int] | None = None,
) -> dict[str, Any]:
    """Make the samples of a data set that are missing or damaged.

    Parameters
    ----------
    spec : path
        TOML file, whose keys are on the page on data sets.
    out : path
        Folder of the data set, which workers on other machines must see under the same name.
    plan_only : bool
        Whether to make only a few samples of each kind (radar, scene, fidelity), from which the
        cost of the others is estimated.
    workers : int, optional
        Number of processes on this machine, by default as many as there are cores.
    scheduler : str, optional
        Address of a Dask scheduler to use instead.
    changed : bool
        Whether files that the ``collection.toml`` of a data set lists may have changed.
    shard : (int, int), optional
        Number i from 1 and count n: of every n samples the i-th is made (`Collection` joins them).

    Returns
    -------
    dict
        Plain JSON values: ``samples``, ``by`` (counts), ``whole`` before, ``damaged``, ``made``,
        ``missing`` after, ``bytes``, ``work_s`` for each sample, ``wall_s``, ``workers``; for a
        plan ``estimated_s`` and ``estimated_bytes`` of the missing samples.

    Raises
    ------
    InputError
        If the specification is invalid, the folder cannot be written, another build writes into it,
        or a sample cannot be made.
    CampaignError
        If workers or their scheduler were lost.
    """
    refuse_in_worker()
    read = read_spec(spec, changed=changed)
    if shard is not None:
        read = read._replace(shard=check_shard(shard))
    # The plan follows from the specification alone, so that a build that was killed goes on with
    # what is missing.
    plans = plan_samples(read)
    folder = out.resolve()
    with exclusive_lock(folder):
        sweep(folder)
        # Index and origin come first: they say what belongs here while samples are missing.
        missing, damaged = missing_of(plans, folder)
        write_index(folder, [plan.identity for plan in plans])
        write_made(spec, read, folder)
        began = time.perf_counter()
        done, n_workers = _make_missing(missing, folder, plan_only, workers, scheduler)
        wall_s = time.perf_counter() - began
        sweep(folder)
    # What can be made is made before an error is told.
    good = [outcome for outcome in done if not outcome.trouble]
    whole = len(plans) - len(missing)
    _tell_troubles(done, plans, whole)
    report = {
        "samples": len(plans),
        "by": counts(plans),
        "whole": whole,
        "damaged": damaged,
        "made": len(good),
        "missing": len(missing) - len(good),
        "bytes": sum(outcome.size for outcome in good),
        "work_s": sum(outcome.work_s for outcome in good) / max(len(good), 1),
        "wall_s": wall_s,
        "workers": n_workers,
    }
    return report | (_estimate(missing, good, n_workers) if plan_only else {})


def _tell_troubles(done: Sequence[Outcome], plans: Sequence[SamplePlan], whole: int) -> None:
    """Raise InputError about the first sample that cannot be made, and how many there are."""
    bad = [outcome for outcome in done if outcome.trouble]
    if bad:
        values = next(plan.parameters for plan in plans if plan.identity == bad[0].identity)
        where = f"{values['recording']} from {values['start_s']:g} s"
        raise UnmadeSamplesError(
            f"{len(bad)} of {len(plans)} samples cannot be made, the other "
            f"{whole + len(done) - len(bad)} are there; the first of them, {bad[0].identity} "
            f"({where}, {values['radar']}, {values['scene']}): {bad[0].trouble}"
        )


def _make_missing(
    missing: Sequence[SamplePlan],
    folder: Path,
    plan_only: bool,
    workers: int | None,
    scheduler: str | None,
) -> tuple[list[Outcome], int]:
    """Make the missing samples, or a few of each kind; return outcomes and number of workers."""

    def tidy() -> None:
        if scheduler is None:  # else workers may still be writing
            sweep(folder)

    if not missing:
        return [], 0
    try:
        # Partial files go even if this process is terminated.
        with cleanup_on_exit(tidy), dask_client(workers, scheduler) as client:
            count = len(client.scheduler_info(n_workers=-1)["workers"])
            # Enough of each kind to keep all workers busy, twice: the first are slow.
            kinds = list(_by_kind(missing).values())
            most = 2 * math.ceil(count / len(kinds))
            few = [plan for plans in kinds for plan in plans[:most]]
            return work(client, few if plan_only else missing, folder, make_sample), count
    finally:
        tidy()


def _by_kind(plans: Iterable[SamplePlan]) -> Mapping[tuple[str, str, str], list[SamplePlan]]:
    found = defaultdict(list)
    for plan in plans:
        found[plan.kind].append(plan)
    return found


def work(
    client: Client, missing: Sequence[SamplePlan], folder: Path, made: Callable[[SamplePlan], Made]
) -> list[Outcome]:
    """Make and store samples on a cluster, in any order.

    InputError if the folder cannot be written; CampaignError if workers died repeatedly at the same
    sample, or the scheduler was lost.
    """
    from distributed import CancelledError, KilledWorker, as_completed
    from distributed.comm.core import CommClosedError

    # Samples are handed out a few at a time: a scheduler with a million of them would hold all
    # their motions.
    waiting = iter(missing)

    def submit(number: int) -> list[Any]:
        return [
            client.submit(make_and_store, plan.packed(), str(folder), made, pure=False)
            for plan in itertools.islice(waiting, number)
        ]

    done: list[Outcome] = []
    with tqdm(total=len(missing), desc="samples", unit="sample", disable=None) as bar:
        try:
            # As one sample is done, the next is handed out.
            at_once = max(_AT_LEAST, _QUEUED * len(client.scheduler_info(n_workers=-1)["workers"]))
            futures = as_completed(submit(at_once), loop=client.loop)
            for future in futures:
                done.append(future.result())
                bar.update()
                futures.update(submit(1))
        except KilledWorker as error:
            raise CampaignError(
                f"{error.allowed_failures + 1} workers died one after the other at the same "
                f"sample, for want of memory perhaps; {_kept(done, missing)}, with fewer --workers"
            ) from None
        except ImportError as error:
            raise CampaignError(
                f"a worker cannot load what it needs ({error}); "
                "install rtradar with its extra 'campaign' there, the same version"
            ) from None
        except (CancelledError, CommClosedError, TimeoutError, OSError):
            raise CampaignError(f"the scheduler was lost; {_kept(done, missing)}") from None
        except InputError as error:
            raise InputError(f"{error}; {_kept(done, missing)}") from None
    return done


def make_and_store(plan: SamplePlan, folder: str, made: Callable[[SamplePlan], Made]) -> Outcome:
    """Make and store one sample, as a worker does."""
    wanted = plan.parameters.get("version")
    if wanted != __version__:
        trouble = (
            f"this worker has rtradar {__version__}, not {wanted}: install the same everywhere"
        )
        return Outcome(plan.identity, 0.0, 0, trouble)
    # Two at a time in one process would share Mitsuba and record each other's warnings.
    with _one_at_a_time:
        try:
            sample, spatial, work_s, maps = made(plan)
            check_size(maps)
        except (InputError, OSError) as error:  # such as a mesh file that this machine lacks
            return Outcome(plan.identity, 0.0, 0, str(error))
    size = write_sample(Path(folder), plan.identity, sample, spatial, maps)
    return Outcome(plan.identity, work_s, size)


def _kept(done: Sequence[Outcome], missing: Sequence[SamplePlan]) -> str:
    return (
        f"{len(done)} of {len(missing)} samples were made and are kept: "
        "run the same command again for the others"
    )


def _estimate(
    missing: Sequence[SamplePlan], good: Sequence[Outcome], workers: int
) -> dict[str, float]:
    """Estimate time and bytes of the missing samples from the fastest sample of each kind."""
    measured = {outcome.identity: outcome.work_s for outcome in good}
    seconds, count = 0.0, len(missing) - len(good)
    # Seconds for a second of radar, by the fastest of each kind: slower ones had to warm up.
    for plans in _by_kind(missing).values():
        made = [plan for plan in plans if plan.identity in measured]
        fastest = min(measured[plan.identity] / plan.interval_s for plan in made)
        left_s = [plan.interval_s for plan in plans if plan.identity not in measured]
        seconds += fastest * sum(left_s)
    size = sum(outcome.size for outcome in good) / max(len(good), 1)
    return {"estimated_s": seconds / max(workers, 1), "estimated_bytes": size * count}


def in_words(report: Mapping[str, Any]) -> str:
    """Describe the report of `build_dataset` in a few lines of text.

    Parameters
    ----------
    report : mapping
        Result of `build_dataset`.

    Returns
    -------
    str
    """
    template = templates(Path(__file__).parent, escaped=False).get_template("built.txt")
    return template.render(report=report).rstrip("\n")
