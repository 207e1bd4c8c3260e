"""Samples made on a cluster: what a worker does, and who hands out the work."""

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
"""Samples for each worker that are with the scheduler: one at work, one to begin with next. The others wait here."""

_AT_LEAST = 8
"""Samples with the scheduler in any case: workers may come later."""

_one_at_a_time = threading.Lock()


class Outcome(NamedTuple):
    """What came of one sample: ``work_s`` and ``size`` in bytes where it was made, ``trouble`` in one line where not."""

    identity: str
    work_s: float
    size: int
    trouble: str = ""


def work(
    client: Client, missing: Sequence[Recipe], folder: Path, made: Callable[[Recipe], Made]
) -> list[Outcome]:
    """Make and store samples on a cluster, in whatever order.

    Raises
    ------
    InputError
        Where the folder cannot be written.
    CampaignError
        Where a sample's workers died again and again, or the scheduler was lost.
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
                f"{error.allowed_failures + 1} workers died one after the other at the same sample, for want of memory perhaps; "
                f"{_kept(done, missing)}, with fewer --workers"
            ) from None
        except ImportError as error:
            raise CampaignError(
                f"a worker cannot load what it needs ({error}); install rtradar with its extra 'campaign' there, the same version"
            ) from None
        except (CancelledError, CommClosedError, TimeoutError, OSError):
            raise CampaignError(f"the scheduler was lost; {_kept(done, missing)}") from None
        except InputError as error:
            raise InputError(f"{error}; {_kept(done, missing)}") from None
    return done


def make_and_store(recipe: Recipe, folder: str, made: Callable[[Recipe], Made]) -> Outcome:
    """Make one sample where this runs, and store it: what a worker does."""
    told = recipe.parameters.get("version")
    if told != __version__:
        return Outcome(
            recipe.identity,
            0.0,
            0,
            f"this worker has rtradar {__version__}, not {told}: install the same everywhere",
        )
    # Two at a time in one process would share Mitsuba, and what it says of the other's warnings.
    with _one_at_a_time:
        try:
            sample, spatial, work_s = made(recipe)
        except (InputError, OSError) as error:  # such as a mesh file that this machine has not
            return Outcome(recipe.identity, 0.0, 0, str(error))
    return Outcome(
        recipe.identity, work_s, write_sample(Path(folder), recipe.identity, sample, spatial)
    )


def _kept(done: Sequence[Outcome], missing: Sequence[Recipe]) -> str:
    return f"{len(done)} of {len(missing)} samples were made and are kept: run the same command again for the others"
