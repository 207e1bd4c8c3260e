"""Studies: all trainings of one recipe on the splits of one data set, in one folder."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

from rtradar.classify.pointnet import PointNet
from rtradar.classify.prepare import stack_clouds
from rtradar.classify.recipes import Recipe
from rtradar.classify.splits import chosen, make_splits, values_of
from rtradar.classify.store import (
    PLAN,
    Outcome,
    check_plan,
    load_checkpoint,
    load_outcome,
    outcome_of,
    read_plan,
    save_outcome,
    write_plan,
)
from rtradar.classify.training import Examples, check_points, predict, train_network
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError
from rtradar.system.files import remove_parts

_CHECKPOINT, _OUTCOME = "checkpoint.pt", "outcome.json"
_MADE = (
    "recording_digest",
    "radar",
    "radar_parameters",
    "scene",
    "scene_digest",
    "fidelity",
    "snr_db",
    "heading_deg",
    "person_position_m",
    "radar_position_m",
    "pfa",
    "clutter_removal",
    "version",
)
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
        ``classes``, ``recipe``, ``split``, ``folds``, ``seed``, ``trainings`` (names).
    outcomes : list of Outcome
        Outcomes of the finished trainings, in order.
    """

    folder: Path
    plan: dict[str, Any]
    outcomes: list[Outcome]

    @property
    def title(self) -> str:
        """Title of the study in tables."""
        return f"{self.plan['recipe']['name']}, {self.plan['recipe']['points']} points"


def train_study(
    clouds: Collection,
    out: Path,
    recipe: Recipe,
    *,
    data: Sequence[str] = (),
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
    data : sequence of str
        Folders of the clouds, to be stated in the plan.
    split, folds, seed
        Arguments of `rtradar.classify.splits.make_splits`. The seed is used for the trainings too.
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
        "data": list(data),
        "clouds": len(clouds),
        "fingerprint": fingerprint(clouds),
        "made": made(clouds),
        "classes": list(names),
        "recipe": recipe.as_dict(),
        "split": split,
        "folds": folds,
        "seed": seed,
        "trainings": [one.name for one in splits],
    }
    check_plan(out, plan)
    values = values_of(clouds, split)
    missing = [
        number for number in numbers if not (training_folder(out, number) / _OUTCOME).exists()
    ]
    if missing:
        examples = Examples(stack_clouds(clouds, seed=seed), torch.from_numpy(truth), names)
        check_points(examples, recipe)
    write_plan(out, plan)
    with tqdm(total=len(numbers) * recipe.epochs_run, unit="epoch", disable=None) as bar:
        bar.update((len(numbers) - len(missing)) * recipe.epochs_run)
        for number in missing:
            one, folder = splits[number], training_folder(out, number)
            folder.mkdir(exist_ok=True)
            if folder.is_symlink():
                raise InputError(
                    f"'{folder}' is a link, and its training would be written elsewhere; "
                    "give another folder (--out)"
                )
            remove_parts(folder, rf"{re.escape(_CHECKPOINT)}|{re.escape(_OUTCOME)}")
            start = bar.n

            def show(
                epoch: int, row: dict[str, float], start: int = start, name: str = one.name
            ) -> None:
                bar.set_description(name)
                bar.set_postfix_str(
                    f"loss {row['train_loss']:.2f}, test {row['test_accuracy']:.0%}", refresh=False
                )
                bar.update(start + epoch - bar.n)

            train, test = examples.of(one.train), examples.of(one.test)
            network, history = train_network(
                train,
                test,
                recipe,
                seed=seed,
                device=device,
                checkpoint=folder / _CHECKPOINT,
                on_epoch=show,
            )
            predicted = predict(network, test, recipe).argmax(axis=1)
            save_outcome(
                folder / _OUTCOME, outcome_of(clouds, one, values, truth, predicted, history)
            )
    return load_study(out)


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


def load_network(folder: Path, number: int = 1) -> tuple[PointNet, Recipe, tuple[str, ...]]:
    """Load a trained network, to classify other clouds.

    Parameters
    ----------
    folder : path
        Folder of the trainings.
    number : int
        Number of the training, from 1.

    Returns
    -------
    network : PointNet
        Network in evaluation mode, see `rtradar.classify.training.predict`.
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
    recipe, classes = Recipe(**plan["recipe"]), tuple(plan["classes"])
    path = training_folder(folder, number - 1) / _CHECKPOINT
    network = PointNet(len(classes), recipe)
    try:
        network.load_state_dict(load_checkpoint(path).network)
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
    return _digest(
        [
            clouds.labels,
            *(clouds.column(name) for name in ("recording", "start_s", "duration_s", "seed")),
        ]
    )


def made(clouds: Collection) -> str:
    """Hash of how the clouds were made: radar, scene, echo model and so on."""
    columns = []
    for name in _MADE:
        with suppress(KeyError, InputError):
            columns += [np.full(len(clouds), name), clouds.column(name)]
    return _digest(columns)


def learnt_from(plan: dict[str, Any], clouds: Collection) -> bool:
    """Return whether these are the clouds of the plan."""
    return bool(
        plan["fingerprint"] == fingerprint(clouds) and plan.get("made") in (None, made(clouds))
    )


def _digest(columns: Sequence[NDArray[Any]]) -> str:
    rows = "\n".join(
        "\t".join(map(str, row))
        for row in zip(*(column.tolist() for column in columns), strict=True)
    )
    return hashlib.sha256(rows.encode()).hexdigest()[:16]


def training_folder(out: Path, number: int) -> Path:
    """Folder of a training, numbered from 0."""
    return out / f"training-{number + 1:02d}"
