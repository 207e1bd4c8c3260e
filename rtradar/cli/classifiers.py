"""``rtradar train`` and ``rtradar evaluate``: what tells activities apart, and how well."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from rtradar.cli.values import number, numbers, path, whole
from rtradar.errors import InputError
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import Subcommands


def add(commands: Subcommands) -> None:
    """Add both commands."""
    _add_train(
        commands.add_parser(
            "train",
            help="learn to tell activities apart from a folder of clouds; started again it goes on",
        )
    )
    _add_evaluate(
        commands.add_parser("evaluate", help="how well trained classifiers do: tables and pictures")
    )


def _add_train(train: argparse.ArgumentParser) -> None:
    train.add_argument(
        "data",
        type=path,
        nargs="+",
        metavar="DIR",
        help="folders of clouds, as rtradar dataset build leaves them",
    )
    train.add_argument(
        "--out",
        type=path,
        required=True,
        metavar="OUT",
        help="folder for the trainings; one that is there is gone on with",
    )
    train.add_argument("--recipe", default="lean", help="lean, our own, or paper (default: lean)")
    train.add_argument(
        "--split",
        default="folds",
        metavar="HOW",
        help="folds (the paper's, over clouds), recording, subject, recorded (learn from synthetic motion), or across:COLUMN, "
        "which learns from one value of a column, such as fidelity, and asks about all (default: folds)",
    )
    train.add_argument(
        "--folds",
        type=whole,
        metavar="N",
        help="(default: 10; across: 5; fewer where a class has fewer groups)",
    )
    train.add_argument(
        "--fold",
        type=numbers,
        metavar="N,M,...",
        help="only these trainings, from 1 (default: all)",
    )
    train.add_argument("--points", type=whole, metavar="N", help="of each cloud (default: 1000)")
    train.add_argument("--epochs", type=whole, metavar="N", help="(default: lean 30, paper 200)")
    train.add_argument(
        "--rate", type=number, metavar="X", help="learning rate (default: lean 2e-3, paper 1e-4)"
    )
    train.add_argument(
        "--all-epochs",
        action="store_true",
        help="of paper: go on when the halved rate is below 1e-6",
    )
    train.add_argument(
        "--augmentation",
        help="none, physical, or rotation, which is the paper's (default: lean physical, paper none)",
    )
    train.add_argument(
        "--scaling",
        help="of the axes of a cloud: physical, each by its own number, or unit-sphere, all by one (default: physical)",
    )
    train.add_argument(
        "--precision",
        help="of the search for maxima: bfloat16 or float32 (default: what is faster here)",
    )
    train.add_argument(
        "--device",
        choices=("auto", "cpu", "cuda"),
        default="auto",
        help="where to compute (default: auto)",
    )
    train.add_argument(
        "--seed", type=whole, default=0, metavar="N", help="of splits and trainings (default: 0)"
    )
    train.set_defaults(
        command=_train, stopped="the same command goes on where the last checkpoint in '{out}' is"
    )


def _add_evaluate(evaluate: argparse.ArgumentParser) -> None:
    evaluate.add_argument(
        "trained",
        type=path,
        nargs="+",
        metavar="OUT",
        help="folders that rtradar train made, of the same clouds",
    )
    evaluate.add_argument(
        "--baselines",
        action="store_true",
        help="also simple classifiers, on the clouds and the split of the first",
    )
    evaluate.add_argument(
        "--data",
        type=path,
        nargs="+",
        metavar="DIR",
        help="of --baselines: the clouds (default: where they were)",
    )
    evaluate.add_argument(
        "--out",
        type=path,
        metavar="DIR",
        help="folder for tables and pictures (default: the first OUT)",
    )
    evaluate.add_argument(
        "--overwrite",
        action="store_true",
        help="replace files of others that have the names of new ones",
    )
    evaluate.add_argument("--json", type=path, metavar="FILE", help="write the numbers there too")
    evaluate.set_defaults(command=_evaluate)


def _train(options: argparse.Namespace) -> int:
    from rtradar.classify.recipes import RECIPES
    from rtradar.classify.study import train_study
    from rtradar.classify.training import pick_device, pick_precision
    from rtradar.clouds.dataset_store import Collection

    if options.recipe not in RECIPES:
        raise InputError(
            f"--recipe {options.recipe}: there is none of that name; give one of {', '.join(RECIPES)}"
        )
    device = pick_device(options.device)
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
    print(f"{done} of {planned} trained; see how well: rtradar evaluate {options.out}")
    return 0


def _evaluate(options: argparse.Namespace) -> int:
    check_place(options.json)
    from rtradar.classify.study import load_study
    from rtradar.report.pages.evaluation import EVALUATION_FILES, write_evaluation
    from rtradar.system.output_folder import atomic_folder

    studies = [load_study(folder) for folder in options.trained]
    baselines = {}
    if options.baselines:
        from rtradar.classify.baselines import evaluate_baselines
        from rtradar.clouds.dataset_store import Collection

        baselines = evaluate_baselines(
            Collection(*(options.data or studies[0].plan["data"])), studies[0]
        )
    elif options.data is not None:
        raise InputError("--data: only --baselines reads clouds again; give both or neither")
    out = options.out or options.trained[0]
    with atomic_folder(out, EVALUATION_FILES, overwrite=options.overwrite) as folder:
        table, content = write_evaluation(studies, baselines, folder)
    if options.json is not None:
        write_json(options.json, content)
    print(f"{table}\n\nsee {out}")
    return 0
