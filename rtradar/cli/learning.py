"""``rtradar dataset``, ``train``, ``evaluate`` and ``predict``: labelled clouds, classifiers."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from rtradar.cli.values import (
    OVERWRITE_HELP,
    QUIET_HELP,
    OneLineParser,
    add_command,
    add_files,
    count,
    number,
    numbers,
    path,
    say,
    shard,
    there,
    whole,
)
from rtradar.errors import InputError
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import Subcommands


def add(commands: Subcommands) -> None:
    """Add the four commands."""
    add_command(
        commands,
        "dataset",
        "make labelled point clouds of many recordings, radars, scenes and fidelities",
        _add_dataset,
        (
            "rtradar dataset init set.toml",
            "rtradar dataset build set.toml --out out/clouds",
            "rtradar dataset export out/clouds --out clouds.zarr",
        ),
    )
    add_command(
        commands,
        "train",
        "learn to tell activities apart from a folder of clouds; started again it goes on",
        _add_train,
        ("rtradar train out/clouds --out out/trained --split subject",),
    )
    add_command(
        commands,
        "evaluate",
        "say how well trained classifiers do, in tables and pictures",
        _add_evaluate,
        ("rtradar evaluate out/trained --baselines",),
    )
    add_command(
        commands,
        "predict",
        "say which activity a run shows, by weights that have learnt from synthetic actors",
        _add_predict,
        ("rtradar predict out/walk", "rtradar predict out/walk --json answer.json"),
    )


def _add_dataset(dataset: OneLineParser) -> None:
    commands = dataset.commands()
    init = commands.add_parser("init", help="write a file that says what a collection shall hold")
    init.add_argument(
        "spec",
        metavar="FILE",
        nargs="?",
        type=path,
        default="dataset.toml",
        help="new file, with comments on all keys (default: %(default)s)",
    )
    init.set_defaults(command=_dataset_init)
    build = commands.add_parser(
        "build",
        help="make the samples of a collection that are missing or damaged; may be run again",
    )
    build.option("spec", "SPEC.toml", "file that says what the collection shall hold", type=there)
    build.option("--out", "DIR", "folder of the collection", type=path, required=True)
    build.flag("--changed", "go on where a file that a collection.toml lists is another one now")
    build.option(
        "--shard",
        "I/N",
        "make only every N-th sample, from the I-th on, as one of N jobs, each with a folder of "
        "its own; whoever takes a collection takes several folders",
        type=shard,
    )
    build.flag("--plan", "make a sample of each kind, and say how long the others will take")
    place = build.add_mutually_exclusive_group()
    place.add_argument(
        "--workers",
        type=count,
        metavar="N",
        help="processes that share the cores (default: one a core)",
    )
    place.add_argument(
        "--scheduler", metavar="ADDRESS", help="a Dask scheduler to use, such as tcp://host:8786"
    )
    add_files(build, json="write what was made there as JSON")
    build.flag("--quiet", QUIET_HELP)
    build.set_defaults(
        command=_dataset_build,
        stopped="the same command goes on with the samples that '{out}' has not yet",
    )
    export = commands.add_parser(
        "export", help="copy a whole collection into one Zarr group, with a data card"
    )
    export.option("data", "DIR", "folders of one collection or several", type=there, nargs="+")
    export.option("--out", "X.zarr", "new group; nothing is replaced", type=path, required=True)
    export.set_defaults(command=_dataset_export)


def _add_train(train: OneLineParser) -> None:
    train.option(
        "data", "DIR", "folders of clouds, made by rtradar dataset build", type=there, nargs="+"
    )
    train.option(
        "--out",
        "OUT",
        "folder for the trainings; one that is there is gone on with",
        type=path,
        required=True,
    )
    train.add_argument(
        "--recipe",
        default="lean",
        help="lean, our own, paper, small, edges or spectrogram (default: %(default)s)",
    )
    train.option(
        "--split",
        "HOW",
        "folds (the paper's, over clouds), recording, subject, leave-one-subject-out, recorded "
        "(learn from synthetic motion), or across:COLUMN, which learns from one value of a "
        "column, such as fidelity, and asks about all (default: %(default)s)",
        default="folds",
    )
    train.option(
        "--folds",
        "N",
        "number of folds (default: 10; across: 5; fewer where a class has fewer groups)",
        type=whole,
    )
    train.option("--fold", "N,M,...", "only these trainings, from 1 (default: all)", type=numbers)
    train.option(
        "--points",
        "N",
        "points of each cloud (default: lean and paper 1000, small and edges 128, spectrogram 0)",
        type=whole,
    )
    train.option(
        "--epochs",
        "N",
        "number of epochs (default: lean 30, paper 200, the others 50)",
        type=whole,
    )
    train.option("--rate", "X", "learning rate (default: lean 2e-3, paper 1e-4)", type=number)
    train.flag("--all-epochs", "with paper: go on when the halved rate is below 1e-6")
    train.add_argument(
        "--augmentation",
        help="none, physical, wide, or rotation, which is the paper's "
        "(default: lean physical, paper none)",
    )
    train.add_argument(
        "--scaling",
        help="scale of the axes of a cloud: physical, each by its own number, or unit-sphere, "
        "all by one (default: physical)",
    )
    train.add_argument(
        "--precision",
        help="number format of the search for maxima: bfloat16 or float32 "
        "(default: the faster one here)",
    )
    train.add_argument(
        "--device",
        choices=("auto", "cpu", "cuda"),
        default="auto",
        help="where to compute (default: %(default)s)",
    )
    train.option(
        "--seed", "N", "seed of splits and trainings (default: %(default)s)", type=whole, default=0
    )
    train.flag("--quiet", QUIET_HELP)
    train.set_defaults(
        command=_train, stopped="the same command goes on where the last checkpoint in '{out}' is"
    )


def _add_evaluate(evaluate: OneLineParser) -> None:
    evaluate.option(
        "trained",
        "OUT",
        "folders that rtradar train made, of the same clouds",
        type=there,
        nargs="+",
    )
    evaluate.flag(
        "--baselines", "also evaluate simple classifiers, on the clouds and the split of the first"
    )
    evaluate.option(
        "--data", "DIR", "clouds for --baselines (default: where they were)", type=path, nargs="+"
    )
    evaluate.option(
        "--out", "DIR", "folder for tables and pictures (default: the first OUT)", type=path
    )
    evaluate.flag("--overwrite", OVERWRITE_HELP)
    add_files(evaluate, json="write the numbers there too")
    evaluate.flag("--quiet", QUIET_HELP)
    evaluate.set_defaults(command=_evaluate)


def _add_predict(predict: OneLineParser) -> None:
    predict.option("folder", "DIR", "folder that 'rtradar run --out DIR' made", type=there)
    add_files(predict, json="write the answer there")
    predict.flag("--quiet", QUIET_HELP)
    predict.set_defaults(command=_predict)


def _dataset_init(options: argparse.Namespace) -> int:
    from rtradar.campaign import write_template

    write_template(options.spec)
    print(f"see {options.spec}; build it with: rtradar dataset build {options.spec} --out DIR")
    return 0


def _dataset_export(options: argparse.Namespace) -> int:
    from rtradar.campaign import export_dataset

    print(f"{export_dataset(options.data, options.out)} samples, described in its README.md")
    print(f"see {options.out}")
    return 0


def _dataset_build(options: argparse.Namespace) -> int:
    check_place(options.json)
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
    if options.json is not None:
        write_json(options.json, report)
    say(options, in_words(report))
    say(options, f"see {options.out}")
    return 0


def _train(options: argparse.Namespace) -> int:
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
        from rtradar.clouds.collection import Collection

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
    say(options, f"{table}\n\nsee {out}")
    return 0


def _predict(options: argparse.Namespace) -> int:
    check_place(options.json)
    from rtradar.recognition import predict_run

    answer = predict_run(options.folder)
    if options.json is not None:
        write_json(options.json, answer)
    chances = sorted(answer["probabilities"].items(), key=lambda one: -one[1])
    shown = ", ".join(f"{name} {chance:.0%}" for name, chance in chances)
    windows = f"{answer['windows']} window{'' if answer['windows'] == 1 else 's'}"
    say(options, f"{answer['activity']} ({shown}; {windows})")
    for warning in answer["warnings"]:
        print(f"rtradar: warning: {warning}", file=sys.stderr)
    return 0
