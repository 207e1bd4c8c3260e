"""Building of a data set: only missing and damaged samples are made, on Dask."""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
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

_MAX_SHOWN = 8  # values of each property in a report


@dataclass(frozen=True)
class Store:
    """Samples of a data set that exist and that are missing.

    Parameters
    ----------
    folder : path
        Folder of the data set.
    missing : tuple of Recipe
        Recipes of the samples that are missing or damaged.
    whole, damaged : int
        Number of complete and of damaged samples.
    """

    folder: Path
    missing: tuple[Recipe, ...]
    whole: int
    damaged: int

    @classmethod
    def look(cls, found: Sequence[Recipe], folder: Path) -> Store:
        """Check every sample that exists."""
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
        TOML file, whose keys are listed in `rtradar.campaign.spec`.
    out : path
        Folder of the data set, which workers on other machines must see under the same name.
    plan_only : bool
        Whether to make only a few samples of each kind (radar, scene, fidelity), from which the
        cost of the others is estimated.
    workers : int, optional
        Number of processes on this machine, by default as many as there are cores.
    scheduler : str, optional
        Address of a Dask scheduler to use instead.

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
            # Partial files of local workers are removed, even if this process is terminated. The
            # workers of another scheduler may still be writing.
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
            f"{len(troubles)} of {len(found)} samples cannot be made, "
            f"the other {store.whole + len(good)} are there; "
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
    """Choose enough samples of each kind to keep all workers busy, twice: the first are slow."""
    most = 2 * math.ceil(workers / len({recipe.kind for recipe in missing}))
    seen: Counter[tuple[str, str, str]] = Counter()
    chosen = []
    for recipe in missing:
        seen[recipe.kind] += 1
        if seen[recipe.kind] <= most:
            chosen.append(recipe)
    return chosen


def _estimate(missing: Sequence[Recipe], good: Sequence[Outcome], workers: int) -> dict[str, float]:
    """Estimate time and bytes of the missing samples from the fastest sample of each kind."""
    measured = {outcome.identity: outcome for outcome in good}
    rates: defaultdict[tuple[str, str, str], list[float]] = defaultdict(list)
    for recipe in missing:
        if recipe.identity in measured:
            rates[recipe.kind].append(measured[recipe.identity].work_s / recipe.interval_s)
    left = [recipe for recipe in missing if recipe.identity not in measured]
    seconds = sum(recipe.interval_s * min(rates[recipe.kind]) for recipe in left)
    size = sum(outcome.size for outcome in good) / max(len(good), 1)
    return {"estimated_s": seconds / max(workers, 1), "estimated_bytes": size * len(left)}


def in_words(report: Mapping[str, Any]) -> str:
    """Describe the report of `rtradar.campaign.build_dataset` in a few lines of text.

    Parameters
    ----------
    report : mapping
        Result of `rtradar.campaign.build_dataset`.

    Returns
    -------
    str
    """
    lines = [f"{report['samples']} samples"]
    for key, counted in report["by"].items():
        shown = [f"{name} {count}" for name, count in list(counted.items())[:_MAX_SHOWN]]
        more = [f"and {len(counted) - _MAX_SHOWN} more"] if len(counted) > _MAX_SHOWN else []
        lines.append(f"  by {key}: {', '.join(shown + more)}")
    workers = f"{report['workers']} worker{'' if report['workers'] == 1 else 's'}"
    damaged = f", {report['damaged']} were damaged" if report["damaged"] else ""
    there = f"{report['whole']} were there{damaged}"
    if report["made"]:
        there += (
            f", {report['made']} made in {_time(report['wall_s'])} by {workers} "
            f"({report['work_s']:.1f} s and {_size(report['bytes'] / report['made'])} each)"
        )
    lines.append(there)
    if "estimated_s" in report:
        lines.append(
            f"{report['missing']} are missing: about {_time(report['estimated_s'])} on {workers}, "
            f"and {_size(report['estimated_bytes'])}"
            if report["missing"]
            else "none is missing"
        )
    return "\n".join(lines)


def _time(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def _size(size: float) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.1f} MB"
