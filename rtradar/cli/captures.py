"""``rtradar run`` and ``rtradar compare``: one recording, by one model or by several."""

from __future__ import annotations

import argparse
import dataclasses
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from rtradar.cli.values import add_files, decibels, number, path, seconds, setting, whole, window
from rtradar.errors import InputError
from rtradar.radar import PRESETS
from rtradar.settings import RunSettings, setting_texts
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import OneLineParser, Subcommands

_SYNTHETIC = "synthetic:"
_SYNTHETIC_S = 3.0

_FLAGS: dict[str, tuple[str, dict[str, Any]]] = {
    "fidelity": ("--fidelity", {"metavar": "NAME"}),
    "clutter_removal": ("--clutter-removal", {}),
    "body_material": ("--body-material", {}),
    "detector": ("--detector", {"metavar": "NAME"}),
    "order": ("--order", {"type": whole, "metavar": "N"}),
    "keep_all": ("--keep-all", {}),
    "save_if": ("--save-if", {}),
    "start_s": ("--start", {"type": seconds, "metavar": "S"}),
    "duration_s": ("--duration", {"type": seconds, "metavar": "S"}),
    "heading_deg": ("--heading", {"type": number, "metavar": "DEG"}),
    "snr_db": ("--snr-db", {"type": decibels, "metavar": "X|inf|physical"}),
    "pfa": ("--pfa", {"type": number, "metavar": "X"}),
    "range_window": ("--range-window", {"type": window, "metavar": "NAME[:X]"}),
    "doppler_window": ("--doppler-window", {"type": window, "metavar": "NAME[:X]"}),
    "seed": ("--seed", {"type": whole, "metavar": "N"}),
    "variant": ("--variant", {}),
}
"""Option of each setting; `RunSettings` has the texts, choices and defaults."""

_ONLY_RUN = (
    "fidelity", "clutter_removal", "body_material", "detector", "order", "keep_all", "save_if",
)  # fmt: skip
_DEFAULTS = {field.name: field.default for field in dataclasses.fields(RunSettings)}


def add(commands: Subcommands) -> None:
    """Add both commands."""
    run = commands.add_parser(
        "run", help="one recording in; maps, clouds, pictures and a summary out"
    )
    _add_capture(run)
    _add_settings(run, _ONLY_RUN)
    run.option(
        "--tolerance-db",
        "X",
        "of auto: error of a frame's power that will do [dB] (default: 0.5)",
        type=number,
    )
    run.option(
        "--tolerance-complex",
        "X",
        "of auto: rms error of the field that will do, over its rms",
        type=number,
    )
    run.add_argument(
        "--model-option",
        type=setting,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="option of the model, such as shadow_rays=256 of fresnel; may be given again",
    )
    run.set_defaults(command=_run)

    compare = commands.add_parser(
        "compare", help="one recording by several models, with the same noise, and what differs"
    )
    _add_capture(compare)
    compare.option(
        "--fidelities",
        "A,B,...",
        "two or more, the last is the reference (default: %(default)s)",
        default="analytic-paper,analytic,specular",
    )
    compare.set_defaults(command=_compare)


def _add_capture(command: OneLineParser) -> None:
    """Add what every command that simulates a capture takes."""
    command.option(
        "motion",
        "MOTION",
        "an .amc, .bvh or .c3d file, or synthetic:walk, :kick, :punch, :jumping_jack",
    )
    command.option("--skeleton", "ASF", "the .asf of an .amc recording", type=path)
    command.option(
        "--radar",
        "NAME|TOML",
        f"{', '.join(PRESETS.built_in)}, a TOML file, or of a package (default: %(default)s)",
        default="paper-12ghz",
    )
    scene = command.add_argument("--scene", default="free-space", metavar="NAME|TOML")
    command.help_later(scene, lambda: f"{_scenes()}, or a TOML file (default: %(default)s)")
    _add_settings(command, [name for name in _FLAGS if name not in _ONLY_RUN])
    command.add_argument(
        "--no-spreading",
        dest="spreading",
        action="store_false",
        help="leave out the loss with distance, as the paper does",
    )
    add_files(command, out="folder for the results", json="write the summary there too")


def _add_settings(command: OneLineParser, names: Iterable[str]) -> None:
    """Add the options of some settings."""
    texts = setting_texts()
    for name in names:
        flag, how = _FLAGS[name]
        kind, text = texts.get(name, ("", ""))  # Python may have left docstrings out
        options = {"default": _DEFAULTS[name], **how}
        if _DEFAULTS[name] is False:
            options["action"] = "store_true"
        elif name == "duration_s":
            text += f" (default: to the end; synthetic: {_SYNTHETIC_S:g})"
        else:
            text += " (default: %(default)s)"
        if kind.startswith("{"):
            options["choices"] = re.findall(r'"([^"]+)"', kind)
        action = command.add_argument(flag, dest=name, help=text, **options)
        # The models and the detectors are slow to import.
        if name == "fidelity":
            command.help_later(action, lambda: _registered("rtradar.scatter", "MODELS"))
        elif name == "detector":
            command.help_later(action, lambda: _registered("rtradar.process", "DETECTORS"))


def _registered(module: str, registry: str) -> str:
    from importlib import import_module

    names = ", ".join(getattr(import_module(module), registry).built_in)
    return f"{names}, or of a package (default: %(default)s)"


def _scenes() -> str:
    from rtradar.scene.scene import scene_files

    return ", ".join(scene_files())


def _run(options: argparse.Namespace) -> int:
    capture = _capture(options)
    from rtradar.pipeline import run

    model_options = dict(options.model_option)
    for name in ("tolerance_db", "tolerance_complex"):
        if getattr(options, name) is not None:
            model_options[name] = getattr(options, name)
    summary = run(**capture, model_options=model_options).summary
    if options.json is not None:
        write_json(options.json, summary)
    print(
        f"{summary['rdt_points']} points from {summary['detections']} detections "
        f"in {summary['windows']} windows; {summary['wall_s']:.1f} s "
        f"for {summary['capture_s']:.2f} s of radar, and {summary['warmup_s']:.1f} s to warm up; "
        f"see {options.out}"
    )
    return 0


def _compare(options: argparse.Namespace) -> int:
    capture = _capture(options)
    from rtradar.pipeline import compare

    found = compare(**capture, fidelities=[name.strip() for name in options.fidelities.split(",")])
    if options.json is not None:
        write_json(options.json, found.summary)
    print(found.table())
    print(f"see {options.out / 'compare.html'}")
    return 0


def _capture(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments that `run` and `compare` share."""
    check_place(options.json)
    from rtradar.motion import load_motion, synthetic_motion
    from rtradar.radar import Radar
    from rtradar.scene import Scene

    radar, scene = Radar.load(options.radar), Scene.load(options.scene)
    if options.motion.startswith(_SYNTHETIC):
        if options.skeleton is not None:
            raise InputError(
                f"{options.motion}: a synthetic actor has its own skeleton; leave --skeleton out"
            )
        duration_s = _SYNTHETIC_S if options.duration_s is None else options.duration_s
        activity = options.motion.removeprefix(_SYNTHETIC)
        end_s = options.start_s + duration_s
        motion = synthetic_motion(activity, seed=options.seed, duration_s=end_s)
    else:
        motion = load_motion(options.motion, skeleton=options.skeleton)
    given = vars(options)
    return {name: given[name] for name in ("out", "overwrite", *_DEFAULTS) if name in given} | {
        "motion": motion,
        "radar": radar,
        "scene": scene,
    }
