"""Studies: all trainings of one recipe on the splits of one data set, in one folder.

The folder has a plan, and a folder for each training with its checkpoint and its outcome. Every
file is written beside its place and then renamed, so that it is either complete or absent.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from tqdm import tqdm

from rtradar.classify import training
from rtradar.classify.outcomes import Outcome, load_outcome, outcome_of, save_outcome
from rtradar.classify.pointnet import build_network
from rtradar.classify.prepare import stacked_for
from rtradar.classify.recipes import Recipe
from rtradar.classify.splits import chosen, make_splits, values_of
from rtradar.classify.training import Examples
from rtradar.clouds.collection import Collection
from rtradar.clouds.sample_files import MADE_FROM
from rtradar.description import made_from
from rtradar.errors import InputError
from rtradar.system.files import atomic_file, read_json, remove_parts

PLAN = "plan.json"
"""Name of the file that states what is trained in a folder."""

_PLAN_KEYS = (
    "data", "clouds", "fingerprint", "classes", "recipe", "split", "folds", "seed", "trainings",
)  # fmt: skip
_MAX_NAMES = 10_000  # of classes and of trainings
_CHECKPOINT, _OUTCOME = "checkpoint.pt", "outcome.json"
_MADE = (
    "recording_digest", "radar", "radar_parameters", "scene", "scene_digest", "fidelity", "snr_db",
    "heading_deg", "person_position_m", "radar_position_m", "pfa", "clutter_removal",
    "detector", "range_window", "doppler_window", "spectrogram_window_s",
    "spectrogram_overlap", "body_material", "order", "keep_all", "spreading",
    "version",
)  # fmt: skip
"""Provenance entries by which clouds of the same intervals may differ, if the data set has them."""


@dataclass(frozen=True)
class Study:
    """Plan and outcomes of a folder of trainings.

    Parameters
    ----------
    folder : path
        Folder of the trainings.
    plan : dict
        ``data`` (folders of the clouds), ``clouds`` (their number), ``fingerprint`` (hash of labels
        and intervals), ``made`` (hash of how the clouds were made, None in older folders),
        ``classes``, ``recipe``, ``split``, ``folds``, ``seed``, ``trainings`` (names); in the file
        also ``made_from``, the `MADE_FROM` of the data with their digests, and versions.
    outcomes : list of Outcome
        Outcomes of the finished trainings, in order.
    """

    folder: Path
    plan: dict[str, Any]
    outcomes: list[Outcome]

    @property
    def title(self) -> str:
        """Title of the study in tables."""
        recipe = self.plan["recipe"]
        return (
            f"{recipe['name']}, {recipe['points']} points" if recipe["points"] else recipe["name"]
        )


def check_plan(out: Path, plan: dict[str, Any]) -> None:
    """Raise InputError if the folder holds another plan.

    Only where the clouds are and by which versions they are learnt from may differ.
    """
    path = out / PLAN
    if not os.path.lexists(path):
        if os.path.isdir(out) and (found := sorted(out.glob("training-*"))):
            raise InputError(
                f"'{out}' holds '{found[0].name}', but no {PLAN} of rtradar; "
                "give another folder (--out)"
            )
        return
    try:
        known = read_json(path)
        free = {"data", "made_from"} | ({"made"} - known.keys())
        others = [name for name in plan if name not in free and known.get(name) != plan[name]]
    except (OSError, ValueError, AttributeError):
        raise InputError(f"'{path}' is damaged; give another folder (--out)") from None
    for name in others:
        was, now = _difference(known.get(name), plan[name])
        raise InputError(
            f"'{out}' holds other trainings ({name}: {was}, not {now}); give another folder (--out)"
        )


def write_plan(out: Path, plan: dict[str, Any]) -> None:
    """Write the plan into the folder, which is made if it does not exist."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:  # such as a name that is too long
        raise InputError(
            f"cannot write to '{out}': {error.strerror}; give a folder that can be written (--out)"
        ) from None
    with atomic_file(out / PLAN) as file:
        file.write((json.dumps(plan, indent=1) + "\n").encode())


def read_plan(folder: Path) -> dict[str, Any]:
    """Read the plan of a folder; InputError if it is missing or damaged."""
    try:
        plan = read_json(folder / PLAN)
        Recipe.from_dict(plan["recipe"])
        for name in ("data", "classes", "trainings"):
            names = plan[name]
            strings = len(names) <= _MAX_NAMES and all(isinstance(one, str) for one in names)
            if not strings or (name != "data" and not names):
                raise ValueError
        return {name: plan[name] for name in _PLAN_KEYS} | {"made": plan.get("made")}
    except OSError as error:
        raise InputError(
            f"'{folder}' holds no trainings ({PLAN}: {error.strerror}); "
            "make them with: rtradar train"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"'{folder / PLAN}' is damaged; train into another folder") from None


def _difference(was: Any, now: Any) -> tuple[Any, Any]:
    """Both values, or the first entry in which two dictionaries differ."""
    if isinstance(was, dict) and isinstance(now, dict):
        name = next(name for name in {**was, **now} if was.get(name) != now.get(name))
        return f"{name} {was.get(name)}", f"{now.get(name)}"
    return was, now


def train_study(
    clouds: Collection,
    out: Path,
    recipe: Recipe,
    *,
    split: str = "folds",
    folds: int | None = None,
    seed: int = 0,
    only: Sequence[int] | None = None,
    device: torch.device | None = None,
) -> Study:
    """Run the trainings of a study that are not finished yet.

    Parameters
    ----------
    clouds : Collection
        Labelled clouds.
    out : path
        Output folder, which is created if necessary. A folder of the same plan is continued.
    recipe : Recipe
        Hyperparameters of the trainings.
    split, folds, seed
        Arguments of `rtradar.classify.make_splits`. The seed is used for the trainings too.
    only : sequence of int, optional
        Numbers of the trainings to run, from 1; all by default.
    device : torch.device, optional
        Device of the network, the CPU by default.

    Returns
    -------
    Study

    Raises
    ------
    InputError
        If the folder holds another plan or cannot be written, or the split is impossible.
    """
    splits = make_splits(clouds, split, folds=folds, seed=seed)
    numbers = chosen(splits, only)
    names, truth = classes_of(clouds)
    plan = {
        "data": [str(folder.resolve()) for folder in clouds.folders],
        "clouds": len(clouds),
        "fingerprint": fingerprint(clouds),
        "made": made(clouds),
        "classes": list(names),
        "recipe": recipe.as_dict(),
        "split": split,
        "folds": folds,
        "seed": seed,
        "trainings": [one.name for one in splits],
        "made_from": made_from(*(folder.resolve() / MADE_FROM for folder in clouds.folders)),
    }
    check_plan(out, plan)
    values = values_of(clouds, split)
    missing = [n for n in numbers if not os.path.exists(training_folder(out, n) / _OUTCOME)]
    if missing:
        examples = Examples(stacked_for(clouds, recipe, seed=seed), torch.from_numpy(truth), names)
        training.check_points(examples, recipe)
    write_plan(out, plan)
    with tqdm(total=len(numbers) * recipe.epochs_run, unit="epoch", disable=None) as bar:
        bar.update((len(numbers) - len(missing)) * recipe.epochs_run)
        for number in missing:
            one, folder = splits[number], _made_folder(training_folder(out, number))
            test = examples[one.test]
            network, history = training.train_network(
                examples[one.train],
                test,
                recipe,
                seed=seed,
                device=device,
                checkpoint=folder / _CHECKPOINT,
                on_epoch=_shown(bar, one.name),
            )
            chances = np.exp(training.predict(network, test, recipe))
            outcome = outcome_of(clouds, one, values, truth, chances, history)
            save_outcome(folder / _OUTCOME, outcome)
    return load_study(out)


def _made_folder(folder: Path) -> Path:
    """Make the folder of a training, without partial files of an earlier one."""
    folder.mkdir(exist_ok=True)
    if folder.is_symlink():
        raise InputError(
            f"'{folder}' is a link, and its training would be written elsewhere; "
            "give another folder (--out)"
        )
    remove_parts(folder, rf"{re.escape(_CHECKPOINT)}|{re.escape(_OUTCOME)}")
    return folder


def _shown(bar: Any, name: str) -> Callable[[int, dict[str, float]], None]:
    """Return what moves the progress bar after each epoch of a training."""
    start = bar.n

    def show(epoch: int, row: dict[str, float]) -> None:
        bar.set_description(name)
        scores = f"loss {row['train_loss']:.2f}, test {row['test_accuracy']:.0%}"
        bar.set_postfix_str(scores, refresh=False)
        bar.update(start + epoch - bar.n)

    return show


def load_study(folder: Path) -> Study:
    """Read the plan of a folder and the outcomes of its finished trainings.

    Parameters
    ----------
    folder : path
        Folder of the trainings.

    Returns
    -------
    Study

    Raises
    ------
    InputError
        If the plan is missing or damaged, or no training is finished.
    """
    plan = read_plan(folder)
    names = plan["trainings"]
    paths = [training_folder(folder, number) / _OUTCOME for number in range(len(names))]
    outcomes = [load_outcome(path) for path in paths if path.exists()]
    if any(max(one.truth.max(), one.predicted.max()) >= len(plan["classes"]) for one in outcomes):
        raise InputError(
            f"'{folder}': answers name more classes than '{PLAN}' does; train into another folder"
        )
    if not outcomes:
        raise InputError(
            f"'{folder}': none of its {len(names)} trainings is done; "
            "start rtradar train again, it goes on"
        )
    return Study(folder, plan, outcomes)


def load_network(folder: Path, number: int = 1) -> tuple[nn.Module, Recipe, tuple[str, ...]]:
    """Load a trained network, to classify other clouds.

    Parameters
    ----------
    folder : path
        Folder of the trainings.
    number : int
        Number of the training, from 1.

    Returns
    -------
    network : torch.nn.Module
        Network in evaluation mode, see `rtradar.classify.predict`.
    recipe : Recipe
        Recipe by which clouds are sampled and scaled for the network.
    classes : tuple of str
        Names of the classes.

    Raises
    ------
    InputError
        If there is no such training, or its checkpoint cannot be read safely.
    """
    plan = read_plan(folder)
    recipe, classes = Recipe.from_dict(plan["recipe"]), tuple(plan["classes"])
    path = training_folder(folder, number - 1) / _CHECKPOINT
    network = build_network(len(classes), recipe)
    try:
        network.load_state_dict(training.load_checkpoint(path).network)
    except (RuntimeError, TypeError, AttributeError):
        raise InputError(
            f"'{path}' is of another network than '{folder / PLAN}' says; "
            "train anew, in another folder"
        ) from None
    return network.eval(), recipe, classes


def classes_of(clouds: Collection) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    """Return the class names in alphabetical order and the class number of each cloud, (cloud,)."""
    names, places = np.unique(clouds.labels, return_inverse=True)
    if len(names) < 2:
        raise InputError(
            f"all {len(clouds)} clouds show the same activity ({', '.join(names)}); "
            "it takes two to tell them apart"
        )
    return tuple(names.tolist()), places.astype(np.int64)


def fingerprint(clouds: Collection) -> str:
    """Hash of the order, labels and intervals of the clouds."""
    names = ("recording", "start_s", "duration_s", "seed")
    return _digest([clouds.labels, *map(clouds.column, names)])


def made(clouds: Collection) -> str:
    """Hash of how the clouds were made: radar, scene, echo model and so on."""
    columns = []
    for name in _MADE:
        with suppress(InputError):  # no sample has this entry
            columns += [np.full(len(clouds), name), clouds.column(name)]
    return _digest(columns)


def learnt_from(plan: dict[str, Any], clouds: Collection) -> bool:
    """Return whether these are the clouds of the plan."""
    same = plan["fingerprint"] == fingerprint(clouds)
    return bool(same and plan.get("made") in (None, made(clouds)))


def _digest(columns: Sequence[NDArray[Any]]) -> str:
    rows = zip(*(column.tolist() for column in columns), strict=True)
    text = "\n".join("\t".join(map(str, row)) for row in rows)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def training_folder(out: Path, number: int) -> Path:
    """Folder of a training, numbered from 0."""
    return out / f"training-{number + 1:02d}"
