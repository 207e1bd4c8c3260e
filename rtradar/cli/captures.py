"""``rtradar run`` and ``rtradar compare``: one recording, by one model or by several."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from rtradar.cli.values import decibels, number, path, seconds, setting, whole, window
from rtradar.errors import InputError
from rtradar.radar import PRESETS
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import Subcommands

_SYNTHETIC = "synthetic:"


def add(commands: Subcommands) -> None:
    """Add both commands."""
    run = commands.add_parser(
        "run", help="one recording in; maps, clouds, pictures and a summary out"
    )
    run.add_argument(
        "--fidelity",
        default="specular",
        help="analytic-paper, analytic, specular, fresnel, physical-optics, rays, reference, auto, or of a package "
        "(default: specular)",
    )
    run.add_argument(
        "--tolerance-db",
        type=number,
        metavar="X",
        help="of auto: error of a frame's power that will do [dB] (default: 0.5)",
    )
    run.add_argument(
        "--tolerance-complex",
        type=number,
        metavar="X",
        help="of auto: rms error of the field that will do, over its rms",
    )
    run.add_argument(
        "--model-option",
        type=setting,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="setting of the fidelity level, such as shadow_rays=256 of fresnel; may be given again",
    )
    run.add_argument(
        "--clutter-removal",
        choices=("none", "mean", "exponential", "mti"),
        default="none",
        help="what takes static clutter out before Doppler (default: none)",
    )
    run.add_argument(
        "--body-material",
        choices=("perfect-conductor", "skin"),
        default="perfect-conductor",
        help="(default: perfect-conductor)",
    )
    run.add_argument(
        "--detector",
        default="os-cfar",
        metavar="NAME",
        help="os-cfar, ca-cfar, or of a package (default: os-cfar)",
    )
    run.add_argument(
        "--order",
        type=whole,
        default=1,
        metavar="N",
        help="most walls on the way of an echo, 0 to 3 (default: 1)",
    )
    run.add_argument(
        "--keep-all",
        action="store_true",
        help="model walls, furniture and paths though they stay below the noise",
    )
    run.add_argument("--save-if", action="store_true", help="keep the IF samples in DIR/if.zarr")
    _add_capture(run)
    run.set_defaults(command=_run)

    compare = commands.add_parser(
        "compare", help="one recording by several models, with the same noise, and what differs"
    )
    compare.add_argument(
        "--fidelities",
        default="analytic-paper,analytic,specular",
        metavar="A,B,...",
        help="two or more, the last is the reference (default: analytic-paper,analytic,specular)",
    )
    _add_capture(compare)
    compare.set_defaults(command=_compare)


def _add_capture(run: argparse.ArgumentParser) -> None:
    """What every command that simulates a capture asks for."""
    run.add_argument(
        "motion",
        metavar="MOTION",
        help="an .amc, .bvh or .c3d file, or synthetic:walk, :kick, :punch, :jumping_jack",
    )
    run.add_argument("--skeleton", type=path, metavar="ASF", help="the .asf of an .amc recording")
    run.add_argument(
        "--radar",
        default="paper-12ghz",
        metavar="NAME|TOML",
        help=f"{', '.join(PRESETS.built_in)}, a TOML file, or of a package (default: paper-12ghz)",
    )
    run.add_argument(
        "--scene",
        default="free-space",
        metavar="NAME|TOML",
        help="a scene by name, or a TOML file (default: free-space)",
    )
    run.add_argument(
        "--start",
        type=seconds,
        default=0.0,
        metavar="S",
        help="where the interval begins [s] (default: 0)",
    )
    run.add_argument(
        "--duration",
        type=seconds,
        metavar="S",
        help="how long it is [s] (default: to the end; synthetic: 3)",
    )
    run.add_argument(
        "--heading",
        type=number,
        default=0.0,
        metavar="DEG",
        help="turn the person, anticlockwise from above (default: 0)",
    )
    run.add_argument(
        "--snr-db",
        type=decibels,
        default=20.0,
        metavar="X|inf|physical",
        help="echo power over noise power per sample, or by the radar's watts (default: 20)",
    )
    run.add_argument(
        "--pfa", type=number, default=1e-6, help="false-alarm rate asked of CFAR (default: 1e-6)"
    )
    for axis, time in ("range", "fast time"), ("doppler", "slow time"):
        run.add_argument(
            f"--{axis}-window",
            type=window,
            default="hann",
            metavar="NAME[:X]",
            help=f"window function in {time}, such as blackman or chebwin:80 (default: hann)",
        )
    run.add_argument(
        "--seed",
        type=whole,
        default=0,
        metavar="N",
        help="of synthetic motion, noise and sampling (default: 0)",
    )
    run.add_argument(
        "--variant",
        choices=("auto", "cpu", "llvm", "scalar", "cuda"),
        default="auto",
        help="Mitsuba's backend for tracing rays; auto and cpu: llvm, or scalar where that does not work (default: auto)",
    )
    run.add_argument(
        "--no-spreading",
        action="store_true",
        help="leave out the loss with distance, as the paper does",
    )
    run.add_argument(
        "--out", type=path, required=True, metavar="DIR", help="folder for the results"
    )
    run.add_argument(
        "--overwrite",
        action="store_true",
        help="replace files of others that have the names of new ones",
    )
    run.add_argument("--json", type=path, metavar="FILE", help="write the summary there too")


def _run(options: argparse.Namespace) -> int:
    capture = _capture(options)
    from rtradar.pipeline import run

    model_options = dict(options.model_option)
    for name in ("tolerance_db", "tolerance_complex"):
        if getattr(options, name) is not None:
            model_options[name] = getattr(options, name)
    result = run(
        **capture,
        fidelity=options.fidelity,
        save_if=options.save_if,
        model_options=model_options,
        clutter_removal=options.clutter_removal,
        body_material=options.body_material,
        order=options.order,
        keep_all=options.keep_all,
        detector=options.detector,
    )
    if options.json is not None:
        write_json(options.json, result.summary)
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
        write_json(options.json, found.summary)
    print(found.table())
    print(f"see {options.out / 'compare.html'}")
    return 0


def _capture(options: argparse.Namespace) -> dict[str, Any]:
    """What `run` and `compare` take alike."""
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
        "range_window": options.range_window,
        "doppler_window": options.doppler_window,
        "seed": options.seed,
        "variant": options.variant,
        "spreading": not options.no_spreading,
        "overwrite": options.overwrite,
    }
