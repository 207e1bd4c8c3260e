"""Build a data set: make what is missing or damaged, on Dask, and nothing else."""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from rtradar.campaign.cluster import dask_client
from rtradar.campaign.plan import counts, recipes
from rtradar.campaign.sample import Recipe, make
from rtradar.campaign.spec_file import read_spec
from rtradar.campaign.work import Outcome, work
from rtradar.clouds.dataset_store import is_whole, sample_path, sweep, write_index
from rtradar.errors import InputError
from rtradar.system.files import unfinished
from rtradar.system.output_folder import alone_in


@dataclass(frozen=True)
class Store:
    """What of a data set is there.

    Parameters
    ----------
    folder : path
    missing : tuple of Recipe
        The damaged ones among them.
    whole, damaged : int
        Samples.
    """

    folder: Path
    missing: tuple[Recipe, ...]
    whole: int
    damaged: int

    @classmethod
    def look(cls, found: Sequence[Recipe], folder: Path) -> Store:
        """Read every sample that is there."""
        missing, damaged = [], 0
        for recipe in tqdm(
            found, desc="looking for samples", unit="sample", disable=None, leave=False
        ):
            path = sample_path(folder, recipe.identity)
            if not is_whole(path):
                missing.append(recipe)
                damaged += path.exists()
        return cls(folder, tuple(missing), len(found) - len(missing), damaged)


def build_dataset(
    spec: Path,
    out: Path,
    *,
    plan_only: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
) -> dict[str, Any]:
    """Make the samples of a data set that are missing or damaged.

    Parameters
    ----------
    spec : path
        TOML file; `rtradar.campaign.spec` says what stands in it.
    out : path
        Folder of the collection; workers on other machines must see it under the same name.
    plan_only : bool
        Whether to make only a few samples of each kind (radar, scene, fidelity), and to estimate the others by them.
    workers : int, optional
        Processes on this machine; as many as there are cores if left out.
    scheduler : str, optional
        Address of a Dask scheduler to use instead.

    Returns
    -------
    dict
        Plain JSON values: ``samples``, ``by`` (counts), ``whole`` before, ``damaged``, ``made``, ``missing`` after, ``bytes``,
        ``work_s`` a sample, ``wall_s``, ``workers``; for a plan ``estimated_s`` and ``estimated_bytes`` of what is missing.

    Raises
    ------
    InputError
        Where the specification has no meaning, the folder cannot be written, another build writes into it, or a sample cannot
        be made.
    CampaignError
        Where workers or their scheduler were lost.
    """
    found = recipes(read_spec(spec))
    folder = out.resolve()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot make folder '{out}': {error.strerror}; give another one (--out)"
        ) from None
    with alone_in(folder):
        sweep(folder)
        store = Store.look(found, folder)
        write_index(folder, [recipe.identity for recipe in found])
        report: dict[str, Any] = {
            "samples": len(found),
            "by": counts(found),
            "whole": store.whole,
            "damaged": store.damaged,
        }
        began = time.perf_counter()
        done: list[Outcome] = []
        count = 0
        if store.missing:
            # What own workers leave goes with them, also where this process is told to end; those of others may still write.
            leftovers = unfinished(lambda: sweep(folder)) if scheduler is None else nullcontext()
            try:
                with leftovers, dask_client(workers, scheduler) as client:
                    count = len(client.scheduler_info(n_workers=-1)["workers"])
                    chosen = (
                        _first_of_each_kind(store.missing, count) if plan_only else store.missing
                    )
                    done = work(client, chosen, folder, made=make)
            except BaseException:
                if scheduler is None:
                    sweep(folder)
                raise
            sweep(folder)
    troubles = [outcome for outcome in done if outcome.trouble]
    good = [outcome for outcome in done if not outcome.trouble]
    if troubles:
        raise InputError(
            f"{len(troubles)} of {len(found)} samples cannot be made, the other {store.whole + len(good)} are there; "
            f"the first of them, {_told(found, troubles[0])}"
        )
    left = len(store.missing) - len(good)
    report |= {
        "made": len(good),
        "missing": left,
        "bytes": sum(outcome.size for outcome in good),
        "work_s": sum(outcome.work_s for outcome in good) / max(len(good), 1),
        "wall_s": time.perf_counter() - began,
        "workers": count,
    }
    if plan_only:
        report |= _estimate(store.missing, good, count)
    return report


def _told(found: Sequence[Recipe], outcome: Outcome) -> str:
    told = next(recipe.parameters for recipe in found if recipe.identity == outcome.identity)
    where = f"{told['recording']} from {told['start_s']:g} s, {told['radar']}, {told['scene']}"
    return f"{outcome.identity} ({where}): {outcome.trouble}"


def _first_of_each_kind(missing: Sequence[Recipe], workers: int) -> list[Recipe]:
    """As many as keep all workers busy, so that they are measured as they will run, and their second ones: the first are slow."""
    most = 2 * math.ceil(workers / len({recipe.kind for recipe in missing}))
    seen: Counter[tuple[str, str, str]] = Counter()
    chosen = []
    for recipe in missing:
        seen[recipe.kind] += 1
        if seen[recipe.kind] <= most:
            chosen.append(recipe)
    return chosen


def _estimate(missing: Sequence[Recipe], good: Sequence[Outcome], workers: int) -> dict[str, float]:
    """Time and bytes of what is still missing: of each kind the quickest that was measured, times the interval."""
    measured = {outcome.identity: outcome for outcome in good}
    rates: defaultdict[tuple[str, str, str], list[float]] = defaultdict(list)
    for recipe in missing:
        if recipe.identity in measured:
            rates[recipe.kind].append(measured[recipe.identity].work_s / recipe.interval_s)
    left = [recipe for recipe in missing if recipe.identity not in measured]
    seconds = sum(recipe.interval_s * min(rates[recipe.kind]) for recipe in left)
    size = sum(outcome.size for outcome in good) / max(len(good), 1)
    return {"estimated_s": seconds / max(workers, 1), "estimated_bytes": size * len(left)}
