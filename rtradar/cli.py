"""The command line: ``rtradar doctor``, ``run``, ``compare``, ``dataset``, ``train``, ``evaluate``, ``validate`` and ``bench``.

Exit status 0: done. 1: failed. 2: bad input, with one line on stderr that says what was wrong, where, what is allowed
and how to mend it.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import warnings
from importlib.metadata import version
from pathlib import Path
from typing import Any, NoReturn, TextIO

from rtradar.errors import BackendError, CampaignError, InputError
from rtradar.radar import PRESETS

_SYNTHETIC = "synthetic:"


class _OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one line, as everything else here does."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see '{self.prog} --help'\n")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; the exit status is returned.

    Parameters
    ----------
    arguments : list of str, optional
        Instead of those of the process.
    """
    warnings.showwarning = _show_warning
    try:
        options = _parser().parse_args(arguments)
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        status: int = options.command(options)
    except InputError as error:
        return _fail(2, error)
    except (BackendError, CampaignError) as error:
        return _fail(1, error)
    except KeyboardInterrupt:
        return _fail(1, "stopped by the user; nothing was left half-written")
    except MemoryError as error:
        return _fail(1, f"out of memory ({str(error) or 'no more to be had'}); nothing was left half-written")
    except BrokenPipeError:
        return 1
    return status


def _fail(status: int, why: object) -> int:
    print("rtradar: " + " ".join(str(why).split()), file=sys.stderr)
    return status


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    print(f"rtradar: warning: {message}", file=file or sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = _OneLineParser(
        prog="rtradar", description="From motion capture to what a 4D MIMO FMCW radar would receive, and to point clouds."
    )
    parser.add_argument("--version", action="version", version=f"rtradar {version('rtradar')}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_OneLineParser)

    doctor = commands.add_parser("doctor", help="which ray-tracing backends work on this machine, and what to install")
    doctor.add_argument("--json", type=Path, metavar="FILE", help="write the findings there as JSON")
    doctor.set_defaults(command=_doctor)

    run = commands.add_parser("run", help="one recording in; maps, clouds, pictures and a summary out")
    run.add_argument(
        "--fidelity",
        default="specular",
        help="analytic-paper, analytic, specular, fresnel, physical-optics, rays, reference or auto (default: specular)",
    )
    run.add_argument(
        "--tolerance-db", type=_number, metavar="X", help="of auto: error of a frame's power that will do [dB] (default: 0.5)"
    )
    run.add_argument(
        "--tolerance-complex", type=_number, metavar="X", help="of auto: rms error of the field that will do, over its rms"
    )
    run.add_argument(
        "--clutter-removal",
        choices=("none", "mean", "exponential", "mti"),
        default="none",
        help="what takes static clutter out before Doppler (default: none)",
    )
    run.add_argument(
        "--body-material", choices=("perfect-conductor", "skin"), default="perfect-conductor", help="(default: perfect-conductor)"
    )
    run.add_argument("--order", type=_whole, default=1, metavar="N", help="most walls on the way of an echo, 0 to 3 (default: 1)")
    run.add_argument("--keep-all", action="store_true", help="model walls, furniture and paths though they stay below the noise")
    run.add_argument("--save-if", action="store_true", help="keep the IF samples in DIR/if.zarr")
    _add_capture(run)
    run.set_defaults(command=_run)

    compare = commands.add_parser("compare", help="one recording by several rungs, with the same noise, and what differs")
    compare.add_argument(
        "--fidelities",
        default="analytic-paper,analytic,specular",
        metavar="A,B,...",
        help="two or more, the last is the reference (default: analytic-paper,analytic,specular)",
    )
    _add_capture(compare)
    compare.set_defaults(command=_compare)

    dataset = commands.add_parser("dataset", help="labelled point clouds of many recordings, radars, scenes and fidelities")
    build = dataset.add_subparsers(required=True, metavar="COMMAND", parser_class=_OneLineParser).add_parser(
        "build", help="make the samples of a collection that are missing or damaged; started again it goes on"
    )
    build.add_argument("spec", type=Path, metavar="SPEC.toml", help="what the collection shall hold")
    build.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the collection")
    build.add_argument("--plan", action="store_true", help="make a sample of each kind, and say how long the others will take")
    place = build.add_mutually_exclusive_group()
    place.add_argument("--workers", type=_count, metavar="N", help="processes that share the cores (default: one a core)")
    place.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler to use, such as tcp://host:8786")
    build.add_argument("--json", type=Path, metavar="FILE", help="write what was made there as JSON")
    build.set_defaults(command=_dataset_build)

    _add_train(
        commands.add_parser("train", help="learn to tell activities apart from a folder of clouds; started again it goes on")
    )
    _add_evaluate(commands.add_parser("evaluate", help="how well trained classifiers do: tables and pictures"))

    validate = commands.add_parser("validate", help="hold every claim against its reference; 1 where one fails")
    validate.add_argument("--quick", action="store_true", help="fewer cases of each claim")
    validate.add_argument("--only", metavar="NAME", help="one claim by its key (sphere, path, doppler, ...), or one script")
    validate.add_argument("--json", type=Path, metavar="FILE", help="write all rows there as JSON")
    validate.add_argument("--figure", type=Path, metavar="DIR", help="draw one picture a script there")
    validate.add_argument("--readme", type=Path, metavar="FILE", help="replace the table of figures in this markdown file")
    validate.set_defaults(command=_validate)

    bench = commands.add_parser("bench", help="how long every stage takes, beside other rungs, the paper's method and floors")
    bench.add_argument("--radar", metavar="A,B,...", help="presets or TOML files (default: both presets; with --quick the first)")
    bench.add_argument(
        "--fidelity",
        metavar="A,B,...",
        help="rungs (default: analytic-paper,analytic,specular,fresnel,physical-optics; with --quick without the last two)",
    )
    bench.add_argument("--repeats", type=_whole, metavar="N", help="of each measurement (default: 3; with --quick 1)")
    bench.add_argument("--duration", type=_seconds, metavar="S", help="of the capture [s] (default: 3; with --quick 0.5)")
    bench.add_argument("--only", metavar="PART", help="rungs (with the paper's method and floors), or growth")
    bench.add_argument("--quick", action="store_true", help="little of everything, in some minutes")
    bench.add_argument("--json", type=Path, metavar="FILE", help="write all that is measured there as JSON")
    bench.add_argument("--figure", type=Path, metavar="FILE", help="draw it there, as PNG")
    bench.set_defaults(command=_bench)
    return parser


def _add_capture(run: argparse.ArgumentParser) -> None:
    """What every command that simulates a capture asks for."""
    run.add_argument("motion", metavar="MOTION", help="an .amc or .bvh file, or synthetic:walk, :kick, :punch, :jumping_jack")
    run.add_argument("--skeleton", type=Path, metavar="ASF", help="the .asf of an .amc recording")
    run.add_argument(
        "--radar", default="paper-12ghz", metavar="NAME|TOML", help=f"{', '.join(PRESETS)}, or a TOML file (default: paper-12ghz)"
    )
    run.add_argument(
        "--scene", default="free-space", metavar="NAME|TOML", help="a scene by name, or a TOML file (default: free-space)"
    )
    run.add_argument("--start", type=_seconds, default=0.0, metavar="S", help="where the interval begins [s] (default: 0)")
    run.add_argument("--duration", type=_seconds, metavar="S", help="how long it is [s] (default: to the end; synthetic: 3)")
    run.add_argument(
        "--heading", type=_number, default=0.0, metavar="DEG", help="turn the person, anticlockwise from above (default: 0)"
    )
    run.add_argument(
        "--snr-db", type=_decibels, default=20.0, metavar="X|inf", help="echo power over noise power per sample (default: 20)"
    )
    run.add_argument("--pfa", type=_number, default=1e-6, help="false-alarm rate asked of CFAR (default: 1e-6)")
    run.add_argument("--seed", type=_whole, default=0, metavar="N", help="of synthetic motion, noise and sampling (default: 0)")
    run.add_argument(
        "--variant", choices=("auto", "llvm", "scalar", "cuda"), default="auto", help="Mitsuba's backend (default: auto)"
    )
    run.add_argument("--no-spreading", action="store_true", help="leave out the loss with distance, as the paper does")
    run.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the results")
    run.add_argument("--json", type=Path, metavar="FILE", help="write the summary there too")


def _add_train(train: argparse.ArgumentParser) -> None:
    train.add_argument("data", type=Path, metavar="DIR", help="a folder of clouds, as rtradar dataset build leaves it")
    train.add_argument(
        "--out", type=Path, required=True, metavar="OUT", help="folder for the trainings; one that is there is gone on with"
    )
    train.add_argument("--recipe", default="lean", help="lean, our own, or paper (default: lean)")
    train.add_argument(
        "--split",
        default="folds",
        metavar="HOW",
        help="folds (the paper's, over clouds), recording, subject, recorded (learn from synthetic motion), or across:COLUMN, "
        "which learns from one value of a column, such as fidelity, and asks about all (default: folds)",
    )
    train.add_argument("--folds", type=_whole, metavar="N", help="(default: 10; across: 5; fewer where a class has fewer groups)")
    train.add_argument("--fold", type=_numbers, metavar="N,M,...", help="only these trainings, from 1 (default: all)")
    train.add_argument("--points", type=_whole, metavar="N", help="of each cloud (default: 1000)")
    train.add_argument("--epochs", type=_whole, metavar="N", help="(default: lean 60, paper 200)")
    train.add_argument("--rate", type=_number, metavar="X", help="learning rate (default: lean 2e-3, paper 1e-4)")
    train.add_argument("--all-epochs", action="store_true", help="of paper: go on when the halved rate is below 1e-6")
    train.add_argument(
        "--augmentation", help="none, physical, or turned, which is the paper's (default: lean physical, paper none)"
    )
    train.add_argument("--precision", help="of the search for maxima: bfloat16 or float32 (default: what is faster here)")
    train.add_argument("--device", choices=("auto", "cpu", "cuda"), default="auto", help="where to compute (default: auto)")
    train.add_argument("--seed", type=_whole, default=0, metavar="N", help="of splits and trainings (default: 0)")
    train.set_defaults(command=_train)


def _add_evaluate(evaluate: argparse.ArgumentParser) -> None:
    evaluate.add_argument(
        "trained", type=Path, nargs="+", metavar="OUT", help="folders that rtradar train made, of the same clouds"
    )
    evaluate.add_argument(
        "--baselines", action="store_true", help="also simple classifiers, on the clouds and the split of the first"
    )
    evaluate.add_argument("--data", type=Path, metavar="DIR", help="of --baselines: the clouds (default: where they were)")
    evaluate.add_argument("--out", type=Path, metavar="DIR", help="folder for tables and pictures (default: the first OUT)")
    evaluate.add_argument("--json", type=Path, metavar="FILE", help="write the numbers there too")
    evaluate.set_defaults(command=_evaluate)


def _doctor(options: argparse.Namespace) -> int:
    from rtradar.doctor import report

    return report(options.json)


def _run(options: argparse.Namespace) -> int:
    capture = _capture(options)
    from rtradar.pipeline import run

    dials = {name: getattr(options, name) for name in ("tolerance_db", "tolerance_complex")}
    dials = {name: value for name, value in dials.items() if value is not None}
    result = run(
        **capture,
        fidelity=options.fidelity,
        save_if=options.save_if,
        dials=dials,
        clutter_removal=options.clutter_removal,
        body_material=options.body_material,
        order=options.order,
        keep_all=options.keep_all,
    )
    if options.json is not None:
        _write_json(options.json, result.summary)
    said = result.summary
    print(
        f"{said['rdt_points']} points from {said['detections']} detections in {said['windows']} windows; "
        f"{said['wall_s']:.1f} s for {said['capture_s']:.2f} s of radar, and {said['warmup_s']:.1f} s to warm up; "
        f"see {options.out}"
    )
    return 0


def _compare(options: argparse.Namespace) -> int:
    capture = _capture(options)
    from rtradar.pipeline import compare

    found = compare(**capture, fidelities=[name.strip() for name in options.fidelities.split(",")])
    if options.json is not None:
        _write_json(options.json, found.summary)
    print(found.table())
    print(f"see {options.out / 'compare.html'}")
    return 0


def _train(options: argparse.Namespace) -> int:
    from rtradar.classify.recipes import RECIPES
    from rtradar.classify.study import train_study
    from rtradar.classify.training import pick_device, pick_precision
    from rtradar.clouds.collection import Collection

    if options.recipe not in RECIPES:
        raise InputError(f"--recipe {options.recipe}: there is none of that name; give one of {', '.join(RECIPES)}")
    device = pick_device(options.device)
    recipe = RECIPES[options.recipe].changed(
        points=options.points,
        epochs=options.epochs,
        rate=options.rate,
        stop_below=0.0 if options.all_epochs else None,
        augmentation=options.augmentation,
        precision=options.precision or pick_precision(device),
    )
    try:
        study = train_study(
            Collection(options.data),
            options.out,
            recipe,
            data=str(options.data.resolve()),
            split=options.split,
            folds=options.folds,
            seed=options.seed,
            only=options.fold,
            device=device,
        )
    except KeyboardInterrupt:
        return _fail(1, f"stopped by the user; the same command goes on where the last checkpoint in '{options.out}' is")
    done, planned = len(study.outcomes), len(study.plan["trainings"])
    print(f"{done} of {planned} trained; see how well: rtradar evaluate {options.out}")
    return 0


def _evaluate(options: argparse.Namespace) -> int:
    _check_json_folder(options.json)
    from rtradar.classify.study import load_study
    from rtradar.report.evaluation import write_evaluation

    studies = [load_study(folder) for folder in options.trained]
    baselines = {}
    if options.baselines:
        from rtradar.classify.baselines import judge_baselines
        from rtradar.clouds.collection import Collection

        baselines = judge_baselines(Collection(options.data or studies[0].plan["data"]), studies[0])
    elif options.data is not None:
        raise InputError("--data: only --baselines reads clouds again; give both or neither")
    out = options.out or options.trained[0]
    table, content = write_evaluation(studies, baselines, out)
    if options.json is not None:
        _write_json(options.json, content)
    print(f"{table}\n\nsee {out}")
    return 0


def _dataset_build(options: argparse.Namespace) -> int:
    _check_json_folder(options.json)
    from rtradar.campaign import build_dataset, in_words

    report = build_dataset(
        options.spec, options.out, plan_only=options.plan, workers=options.workers, scheduler=options.scheduler
    )
    if options.json is not None:
        _write_json(options.json, report)
    print(in_words(report))
    print(f"see {options.out}")
    return 0


def _validate(options: argparse.Namespace) -> int:
    from rtradar.validate import validate

    return validate(quick=options.quick, only=options.only, json_path=options.json, figures=options.figure, readme=options.readme)


def _bench(options: argparse.Namespace) -> int:
    from rtradar.bench import bench, plan_of

    plan = plan_of(
        radar=options.radar,
        fidelity=options.fidelity,
        repeats=options.repeats,
        duration_s=options.duration,
        quick=options.quick,
        only=options.only,
    )
    return bench(plan, json_path=options.json, figure=options.figure)


def _capture(options: argparse.Namespace) -> dict[str, Any]:
    """What `run` and `compare` take alike."""
    _check_json_folder(options.json)
    from rtradar.motion import load_motion, synthetic_motion
    from rtradar.radar import Radar
    from rtradar.scene import Scene

    radar, scene = Radar.load(options.radar), Scene.load(options.scene)
    if options.motion.startswith(_SYNTHETIC):
        if options.skeleton is not None:
            raise InputError(f"{options.motion}: a synthetic actor has its own skeleton; leave --skeleton out")
        duration = 3.0 if options.duration is None else options.duration
        activity = options.motion.removeprefix(_SYNTHETIC)
        motion = synthetic_motion(activity, seed=options.seed, duration_s=options.start + duration)
    else:
        motion = load_motion(options.motion, skeleton=options.skeleton)

    return {
        "motion": motion,
        "radar": radar,
        "scene": scene,
        "out": options.out,
        "start_s": options.start,
        "duration_s": options.duration,
        "heading_deg": options.heading,
        "snr_db": options.snr_db,
        "pfa": options.pfa,
        "seed": options.seed,
        "variant": options.variant,
        "spreading": not options.no_spreading,
    }


def _check_json_folder(path: Path | None) -> None:
    """A JSON file that cannot be written is found out before the work, not after it."""
    if path is not None and not path.resolve().parent.is_dir():
        raise InputError(f"--json {path}: there is no folder '{path.resolve().parent}'; make it first")


def _write_json(path: Path, content: dict[str, Any]) -> None:
    try:
        path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write '{path}': {error.strerror}; give another file (--json)") from None


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError
    return value


def _seconds(text: str) -> float:
    value = _number(text)
    if value < 0:
        raise ValueError
    return value


def _decibels(text: str) -> float:
    value = float(text)
    if math.isnan(value) or value == -math.inf:
        raise ValueError
    return value


def _whole(text: str) -> int:
    value = int(text)
    if value < 0:
        raise ValueError
    return value


def _numbers(text: str) -> list[int]:
    return [_whole(part) for part in text.split(",")]


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise ValueError
    return value


for _kind, _name in (
    (_number, "finite number"),
    (_seconds, "number of seconds, not negative"),
    (_decibels, "number of decibels, or inf"),
    (_whole, "whole number, not negative"),
    (_numbers, "list of whole numbers, such as 1,2,3"),
    (_count, "whole number, at least 1"),
):
    _kind.__name__ = _name  # argparse says "invalid <name> value"
