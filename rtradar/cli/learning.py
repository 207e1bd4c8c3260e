"""``rtradar dataset``, ``train``, ``evaluate``, ``recogniser`` and ``predict``: classifiers."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from typing import Any

from rtradar.cli.values import say
from rtradar.errors import InputError


def recogniser_build(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar recogniser build``."""
    from rtradar.campaign.recogniser import RecogniserPlan, build_recogniser, card_in_words
    from rtradar.radar import Radar

    plan = RecogniserPlan(
        radar=Radar.load(options.radar),
        activities=options.activities,
        unknown=options.unknown,
        scene=options.scene,
        motions=options.motions,
        takes=options.takes,
        window_s=options.window,
        clutter_removal=options.clutter_removal,
        seed=options.seed,
    )
    made = build_recogniser(plan, options.out, workers=options.workers)
    yield {key: value for key, value in made.card.items() if key != "usual"}
    say(options, f"{card_in_words(made)}\n\nsee {options.out}")


def dataset_init(options: argparse.Namespace) -> None:
    """Do ``rtradar dataset init``."""
    from rtradar.campaign import write_template

    write_template(options.spec)
    print(f"see {options.spec}; build it with: rtradar dataset build {options.spec} --out DIR")


def dataset_export(options: argparse.Namespace) -> None:
    """Do ``rtradar dataset export``."""
    from rtradar.campaign import export_dataset

    print(f"{export_dataset(options.data, options.out)} samples, described in its README.md")
    print(f"see {options.out}")


def dataset_build(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar dataset build``."""
    from rtradar.system.checks import read_toml

    read_toml(options.spec, "data set", "give a TOML file")  # what follows is slow to import
    from rtradar.campaign import build_dataset, in_words

    report = build_dataset(
        options.spec,
        options.out,
        plan_only=options.plan,
        workers=options.workers,
        scheduler=options.scheduler,
        changed=options.changed,
        shard=options.shard,
    )
    yield report
    say(options, in_words(report))
    say(options, f"see {options.out}")


def train(options: argparse.Namespace) -> None:
    """Do ``rtradar train``."""
    from rtradar.classify.recipes import RECIPES
    from rtradar.classify.study import train_study
    from rtradar.classify.training import pick_device, pick_precision
    from rtradar.clouds.collection import Collection

    if options.recipe not in RECIPES:
        raise InputError(
            f"--recipe {options.recipe}: there is none of that name; "
            f"give one of {', '.join(RECIPES)}"
        )
    device = pick_device(options.device)
    # Options that are not given leave the recipe as it is. No learning rate is below 0, so that
    # limit lets all epochs run.
    recipe = RECIPES[options.recipe].changed(
        points=options.points,
        epochs=options.epochs,
        rate=options.rate,
        stop_below=0.0 if options.all_epochs else None,
        augmentation=options.augmentation,
        scaling=options.scaling,
        precision=options.precision or pick_precision(device),
    )
    study = train_study(
        Collection(*options.data),
        options.out,
        recipe,
        split=options.split,
        folds=options.folds,
        seed=options.seed,
        only=options.fold,
        device=device,
    )
    done, planned = len(study.outcomes), len(study.plan["trainings"])
    say(options, f"{done} of {planned} trained; see how well: rtradar evaluate {options.out}")


def evaluate(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar evaluate``."""
    from rtradar.classify.study import load_study
    from rtradar.report.evaluation import EVALUATION_FILES, write_evaluation
    from rtradar.system.output_folder import atomic_folder

    studies = [load_study(folder) for folder in options.trained]
    baselines = {}
    if options.baselines:
        from rtradar.classify.baselines import evaluate_baselines
        from rtradar.clouds.collection import Collection

        baselines = evaluate_baselines(
            Collection(*(options.data or studies[0].plan["data"])), studies[0]
        )
    elif options.data is not None:
        raise InputError("--data: only --baselines reads clouds again; give both or neither")
    # By default the evaluation goes into the folder of the first training.
    out = options.out or options.trained[0]
    with atomic_folder(out, EVALUATION_FILES, overwrite=options.overwrite) as folder:
        table, content = write_evaluation(studies, baselines, folder)
    yield content
    say(options, f"{table}\n\nsee {out}")


def predict(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar predict``."""
    from rtradar.recognition import predict as answer_to

    answer = answer_to(options.place, options.weights, ahead=options.ahead)
    yield answer
    chances = sorted(answer["probabilities"].items(), key=lambda one: -one[1])
    shown = ", ".join(f"{name} {chance:.0%}" for name, chance in chances)
    count = len(answer["windows"])
    windows = f"{count} window{'' if count == 1 else 's'}"
    say(options, f"{answer['activity']} ({shown}; {windows})")
    for warning in answer["warnings"]:
        print(f"rtradar: warning: {warning}", file=sys.stderr)
