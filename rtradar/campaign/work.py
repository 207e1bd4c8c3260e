"""Making of samples on a cluster: the task of a worker and the distribution of tasks."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tqdm import tqdm

from rtradar import __version__
from rtradar.campaign.sample import Made, Recipe
from rtradar.clouds.dataset_store import write_sample
from rtradar.errors import CampaignError, InputError

if TYPE_CHECKING:
    from distributed import Client

_QUEUED = 2
"""Samples submitted for each worker: one in progress and the next one. The others wait here."""

_AT_LEAST = 8
"""Smallest number of submitted samples, because workers may join later."""

_one_at_a_time = threading.Lock()


class Outcome(NamedTuple):
    """Outcome of one sample: ``work_s`` [s] and ``size`` [bytes], or ``trouble`` in one line."""

    identity: str
    work_s: float
    size: int
    trouble: str = ""


def work(
    client: Client, missing: Sequence[Recipe], folder: Path, made: Callable[[Recipe], Made]
) -> list[Outcome]:
    """Make and store samples on a cluster, in any order.

    Raises
    ------
    InputError
        If the folder cannot be written.
    CampaignError
        If workers died repeatedly at the same sample, or the scheduler was lost.
    """
    from distributed import CancelledError, KilledWorker, as_completed
    from distributed.comm.core import CommClosedError

    waiting = iter(missing)

    def submit(number: int) -> list[Any]:
        return [
            client.submit(make_and_store, recipe.packed(), str(folder), made, pure=False)
            for recipe in itertools.islice(waiting, number)
        ]

    done: list[Outcome] = []
    with tqdm(total=len(missing), desc="samples", unit="sample", disable=None) as bar:
        try:
            at_once = max(_AT_LEAST, _QUEUED * len(client.scheduler_info(n_workers=-1)["workers"]))
            futures = as_completed(submit(at_once), loop=client.loop)
            for future in futures:
                done.append(future.result())
                bar.update()
                futures.update(submit(1))
        except KilledWorker as error:
            raise CampaignError(
                f"{error.allowed_failures + 1} workers died one after the other at the same sample, "
                "for want of memory perhaps; "
                f"{_kept(done, missing)}, with fewer --workers"
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


def make_and_store(recipe: Recipe, folder: str, made: Callable[[Recipe], Made]) -> Outcome:
    """Make and store one sample, as a worker does."""
    told = recipe.parameters.get("version")
    if told != __version__:
        return Outcome(
            recipe.identity,
            0.0,
            0,
            f"this worker has rtradar {__version__}, not {told}: install the same everywhere",
        )
    # Two at a time in one process would share Mitsuba and record each other's warnings.
    with _one_at_a_time:
        try:
            sample, spatial, work_s = made(recipe)
        except (InputError, OSError) as error:  # such as a mesh file that this machine lacks
            return Outcome(recipe.identity, 0.0, 0, str(error))
    return Outcome(
        recipe.identity, work_s, write_sample(Path(folder), recipe.identity, sample, spatial)
    )


def _kept(done: Sequence[Outcome], missing: Sequence[Recipe]) -> str:
    return (
        f"{len(done)} of {len(missing)} samples were made and are kept: "
        "run the same command again for the others"
    )
