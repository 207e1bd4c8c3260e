"""``rtradar run`` and ``rtradar compare``: one recording, by one model or by several."""

from __future__ import annotations

import argparse
import dataclasses
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtradar.cli.values import (
    QUIET_HELP,
    add_command,
    add_files,
    add_pose,
    add_radar,
    add_reading,
    assignment,
    breathing,
    decibels,
    decibels_below,
    number,
    path,
    place_at,
    say,
    seconds,
    setting,
    show_page,
    whole,
    window,
)
from rtradar.errors import InputError
from rtradar.recordings import ACTOR_S, SYNTHETIC
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import OneLineParser, Subcommands
    from rtradar.settings import RunSettings


_FLAGS: dict[str, tuple[str, dict[str, Any]]] = {
    "fidelity": ("--fidelity", {"metavar": "NAME"}),
    "clutter_removal": ("--clutter-removal", {}),
    "background": ("--background", {"metavar": "DIR"}),
    "body_material": ("--body-material", {}),
    "breathing": ("--breathing", {"type": breathing, "metavar": "AMPLITUDE_MM,RATE_HZ"}),
    "detector": ("--detector", {"metavar": "NAME"}),
    "order": ("--order", {"type": whole, "metavar": "N"}),
    "keep_all": ("--keep-all", {}),
    "path_tolerance_db": ("--path-tolerance-db", {"type": decibels_below, "metavar": "X|-inf"}),
    "save_if": ("--save-if", {}),
    "start_s": ("--start", {"type": seconds, "metavar": "S"}),
    "duration_s": ("--duration", {"type": seconds, "metavar": "S"}),
    "heading_deg": ("--heading", {"type": number, "metavar": "DEG"}),
    "snr_db": ("--snr-db", {"type": decibels, "metavar": "X|inf|physical"}),
    "pfa": ("--pfa", {"type": number, "metavar": "X"}),
    "range_window": ("--range-window", {"type": window, "metavar": "NAME[:X]"}),
    "doppler_window": ("--doppler-window", {"type": window, "metavar": "NAME[:X]"}),
    "spectrogram_window_s": ("--spectrogram-window", {"type": seconds, "metavar": "S"}),
    "spectrogram_overlap": ("--spectrogram-overlap", {"type": number, "metavar": "X"}),
    "seed": ("--seed", {"type": whole, "metavar": "N"}),
    "variant": ("--variant", {}),
}
"""Option of each setting; `RunSettings` has the texts, choices and defaults."""

_ONLY_RUN = ("fidelity", "save_if")
"""Settings that `compare` does not take."""


def add(commands: Subcommands) -> None:
    """Add both commands."""
    add_command(
        commands,
        "run",
        "simulate one recording, and write maps, clouds, pictures, a report and a summary",
        _add_run,
        (
            "rtradar run synthetic:walk --duration 3 --out out/walk",
            "rtradar run walk.amc --skeleton walk.asf --scene living-room --out out/room",
            "rtradar run synthetic:walk synthetic:kick --at 0.5,1 --at -1,-0.5,90 --out out/two",
            "rtradar run kick.bvh --radar paper-77ghz --fidelity analytic --out out/kick",
            "rtradar run synthetic:walk --as-paper --out out/as-paper",
        ),
    )
    add_command(
        commands,
        "compare",
        "simulate recordings, each by several models with the same noise, or take folders of run "
        "and process, and show what differs",
        _add_compare,
        (
            "rtradar compare synthetic:kick --out out/kick",
            "rtradar compare walk.bvh --fidelities specular,physical-optics --out out/levels",
            "rtradar compare walk.bvh kick.bvh jump.bvh --out out/mean  # mean and interval",
            "rtradar compare out/measured out/simulated --out out/both",
        ),
    )


def _add_run(run: OneLineParser) -> None:
    _add_capture(run)
    add_settings(run, _ONLY_RUN)
    run.option(
        "--tolerance-db",
        "X",
        "largest error of a frame's power that the level auto accepts [dB] (default: 0.5)",
        type=number,
    )
    run.option(
        "--tolerance-complex",
        "X",
        "largest rms error of the field, over its rms, that the level auto accepts",
        type=number,
    )
    run.add_argument(
        "--no-pictures",
        dest="pictures",
        action="store_false",
        help="draw no PNG files, for many runs; the report is made without them",
    )
    run.flag("--as-paper", "make the paper's own choices, with a warning for each that is a fault")
    run.set_defaults(command=_run)


def _add_compare(compare: OneLineParser) -> None:
    _add_capture(compare)
    compare.option(
        "--fidelities",
        "A,B,...",
        "two levels or more, of which the last is the reference (default: %(default)s)",
        default="analytic-paper,analytic,specular",
    )
    compare.set_defaults(command=_compare)


def _add_capture(command: OneLineParser) -> None:
    """Add what every command that simulates a capture takes."""
    from rtradar.system.registries import RADARS, scene_files

    command.option(
        "motion",
        "MOTION",
        "an .amc, .bvh, .c3d, .npz or .csv file; or synthetic:walk, or another of "
        "`list activities`; several for several people, none where the scene has its own; or a run "
        "file, such as the run.toml of a folder",
        nargs="*",
    )
    command.intermixed = True
    command.option(
        "--at",
        "X,Y[,HEADING]",
        "place [m] and heading [degree] of a person in the scene, once for each MOTION, in order",
        type=place_at,
        action="append",
        default=[],
    )
    command.option(
        "--placement",
        "PLACE",
        "standard: the middle of the interval where the scene has its person, facing the radar; "
        "recorded: where the recording has it, as people recorded together need (default: "
        "standard)",
        choices=("standard", "recorded"),
    )
    command.option(
        "--skeleton",
        "ASF",
        "the .asf file that an .amc recording needs; one for all, or one for each, in order",
        type=path,
        action="append",
        default=[],
    )
    add_reading(command)
    add_radar(
        command,
        f"radar: {', '.join(RADARS)}, a TOML file, or a .cfg file of TI's mmWave SDK (default: "
        "paper-12ghz)",
    )
    add_pose(command)
    command.option(
        "--scene",
        "NAME|TOML",
        f"scene: {', '.join(scene_files())}, random:SEED, or a TOML file (default: free-space)",
    )
    command.option(
        "--set",
        "KEY=VALUE",
        "value of a key of the run file, such as radar.pitch_deg=-15; several values of one key "
        "are a run each, with a table of all",
        type=assignment,
        action="append",
        default=[],
    )
    command.flag("--changed", "go on where a file that the run file names is another one now")
    add_settings(command, [*(name for name in _FLAGS if name not in _ONLY_RUN), "detector_options"])
    command.add_argument(
        "--model-option",
        type=setting,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="option of the model, such as visibility=gradual of specular; may be given again",
    )
    command.add_argument(
        "--no-spreading",
        dest="spreading",
        action="store_false",
        default=argparse.SUPPRESS,
        help="leave out the loss with distance, as the paper does",
    )
    add_files(command, out="folder for the results", json="write the summary there too")
    command.flag("--open", "open the page of the results in the browser")
    add_amount(command)


def add_amount(command: OneLineParser) -> None:
    """Add the options that say how much is printed."""
    amount = command.add_mutually_exclusive_group()
    amount.add_argument("--quiet", action="store_true", help=QUIET_HELP)
    amount.add_argument(
        "--verbose",
        action="store_true",
        help="also print the time of each stage, the versions of packages and the backend",
    )


def add_settings(command: OneLineParser, names: Iterable[str]) -> None:
    """Add the options of some settings."""
    from rtradar.settings import RunSettings, setting_texts
    from rtradar.system.registries import DETECTORS, MODELS

    defaults, texts = RunSettings(), setting_texts()
    named = {"fidelity": ("echo model", MODELS), "detector": ("detector", DETECTORS)}
    for name in names:
        if name == "detector_options":
            command.option(
                "--detector-option",
                "NAME=VALUE",
                "option of the detector, such as max_points=64 of ti-oob; may be given again",
                dest=name,
                type=setting,
                action="append",
                default=argparse.SUPPRESS,
            )
            continue
        # What is not given is left to the run file.
        default, left_out = getattr(defaults, name), {"default": argparse.SUPPRESS}
        flag, how = _FLAGS[name]
        kind, text = texts.get(name, ("", ""))  # Python may have left docstrings out
        if name in named:
            noun, registry = named[name]
            text = f"{noun}: {', '.join(registry)}"
        options = {**left_out, **how}
        if default is False:
            options["action"] = "store_true"
        elif name == "duration_s":
            text += f" (default: to the end; synthetic: {ACTOR_S:g})"
        else:
            text += f" (default: {default})"
        if kind.startswith("{"):
            options["choices"] = re.findall(r'"([^"]+)"', kind)
        command.add_argument(flag, dest=name, help=text, **options)


def _run(options: argparse.Namespace) -> int:
    if options.as_paper:
        _choose_as_paper(options)
    if several := _several(options):
        return _sweep(options, several)
    capture = _capture(options)
    from rtradar.pipeline import run
    from rtradar.pipeline.timing import lines_shown

    with lines_shown():
        summary = run(**capture, pictures=options.pictures).summary
    tell(options, summary)
    return 0


def _choose_as_paper(options: argparse.Namespace) -> None:
    """Set the paper's choices and warn of its faults; InputError where another choice is given."""
    from rtradar.paper.choices import AS_PAPER, paper_warnings
    from rtradar.settings import RunSettings

    defaults = RunSettings()
    for name, value in AS_PAPER.items():
        given, default = getattr(options, name, None), getattr(defaults, name)
        if given and given not in (default, value):
            raise InputError(
                f"--as-paper sets {name} = {value!r}, and {given!r} is given; leave one of both out"
            )
        setattr(options, name, value)
    if not options.quiet:
        for text in paper_warnings():
            print(f"rtradar: warning: {text}", file=sys.stderr)


def tell(options: argparse.Namespace, summary: Mapping[str, Any]) -> None:
    """Print what a run found and how long it took, and name its page."""
    if options.json is not None:
        write_json(options.json, summary)
    if options.verbose:
        say(options, _details(summary["stages"], summary["versions"], summary.get("variant")))
    say(
        options,
        f"{summary['rdt_points']} points from {summary['detections']} detections "
        f"in {summary['windows']} windows; {summary['wall_s']:.1f} s "
        f"for {summary['capture_s']:.2f} s of radar, and {summary['warmup_s']:.1f} s to warm up",
    )
    _show(options, "report.html")


def _details(stages: Mapping[str, float], versions: Mapping[str, str], backend: str | None) -> str:
    """Return the time of each stage, the versions and the backend as lines of text."""
    times = ", ".join(f"{name} {seconds:.3f}" for name, seconds in stages.items())
    packages = ", ".join(f"{name} {version}" for name, version in versions.items())
    return f"stages [s]: {times}\nversions: {packages}\nray-tracing backend: {backend or 'none'}"


def _show(options: argparse.Namespace, page: str) -> None:
    """Name the page to open as the last line, and open it where that is asked for."""
    say(options, f"open {options.out / page}")
    if options.open:
        show_page(options.out / page)


def _compare(options: argparse.Namespace) -> int:
    if any(map(os.path.isdir, options.motion)):
        return _compare_folders(options)
    from rtradar.settings import check_fidelities

    fidelities = [name.strip() for name in options.fidelities.split(",")]
    check_fidelities(fidelities)
    several = len(options.motion) > 1 and not options.at
    capture = _capture(options, alone=several)
    from rtradar.pipeline import compare, compare_recordings
    from rtradar.pipeline.timing import lines_shown

    capture.pop("fidelity")
    with lines_shown():
        if several:
            found = compare_recordings(capture.pop("motion"), **capture, fidelities=fidelities)
        else:
            found = compare(**capture, fidelities=fidelities)
    if options.json is not None:
        write_json(options.json, found.summary)
    if options.verbose and not several:
        for name, figures in found.summary["fidelities"].items():
            details = figures["stages"], found.summary["versions"], figures["variant"]
            say(options, f"{name}:\n{_details(*details)}")
    say(options, found.table())
    if several:
        say(options, f"the table is {options.out / 'compare.csv'}, each recording in its folder")
    else:
        _show(options, "compare.html")
    return 0


def _compare_folders(options: argparse.Namespace) -> int:
    check_place(options.json)
    if others := [name for name in options.motion if not os.path.isdir(name)]:
        raise InputError(f"'{others[0]}' is no folder, and others are; give folders, or recordings")
    from rtradar.pipeline.compare_folders import compare_folders

    found = compare_folders(options.motion, out=options.out, overwrite=options.overwrite)
    if options.json is not None:
        write_json(options.json, found.summary)
    say(options, found.table())
    for key, values in found.summary["differ"].items():
        say(options, f"{key}: " + ", ".join(f"{own} ({name})" for name, own in values.items()))
    _show(options, "compare.html")
    return 0


def _capture(options: argparse.Namespace, *, alone: bool = False) -> dict[str, Any]:
    """Return the arguments that `run` and `compare` share; of several recordings each is alone."""
    table, folder = _tables(options, alone)
    if several := _several(options):
        raise InputError(f"--set {next(iter(several))}=... has several values; give it once")
    from rtradar.description import parts_of

    people, radar, scene, settings = parts_of(table, folder)
    files = {"out": options.out, "overwrite": options.overwrite}
    return {**vars(settings), "motion": people, "radar": radar, "scene": scene, **files}


def _several(options: argparse.Namespace) -> dict[str, list[Any]]:
    """Return the values of the keys that ``--set`` gives several."""
    values: dict[str, list[Any]] = {}
    for key, value in options.set:
        values.setdefault(key, []).append(value)
    return {key: own for key, own in values.items() if len(own) > 1}


def _tables(options: argparse.Namespace, alone: bool = False) -> tuple[Mapping[str, Any], Path]:
    """Return the tables of the run file and of the options, and the folder of their paths."""
    check_place(options.json)
    from rtradar.settings import RunSettings
    from rtradar.system.registries import radar_table, scene_table

    given = vars(options)
    names = [field.name for field in dataclasses.fields(RunSettings) if field.name in given]
    settings = {name: given[name] for name in names}
    # What is wrong is refused before anything slow is imported.
    RunSettings(**settings)
    for source, look_up in ((options.radar, radar_table), (options.scene, scene_table)):
        if source is not None:
            look_up(source)
    run_file = _run_file(options)
    skeletons = {} if run_file else _checked_people(options, alone)
    from rtradar.description import read_run_file, settings_of_table, with_value

    table = read_run_file(run_file, changed=options.changed) if run_file else {}
    for key, value in _described(options, settings):
        table = with_value(table, key, value)
    several = _several(options)
    once = [own for own in options.set if own[0] not in several]
    of_people = [own for own in once if own[0].startswith("people.")]
    for key, value in once:
        table = table if (key, value) in of_people else with_value(table, key, value)
    if not run_file:
        # Actors follow the settings, and what is said of them comes after.
        chosen = settings_of_table(table.get("settings", {}))
        table = {**table, "people": _people(options, chosen, skeletons)}
    for key, value in of_people:
        table = with_value(table, key, value)
    return table, run_file.parent if run_file else Path()


def _sweep(options: argparse.Namespace, values: Mapping[str, list[Any]]) -> int:
    """Run every combination of the values of keys that were given more than once."""
    from rtradar.pipeline import Experiment, sweep
    from rtradar.pipeline.timing import lines_shown

    written = {name: getattr(options, name) for name in ("out", "overwrite", "pictures")}
    with lines_shown():
        found = sweep(Experiment(*_tables(options)), values, **written)
    if options.json is not None:
        write_json(options.json, found.summary)
    say(options, found.table())
    say(options, f"the table is {options.out / 'sweep.csv'}, each run in its folder")
    if options.open:
        show_page(options.out / "sweep.png")
    return 0


def _run_file(options: argparse.Namespace) -> Path | None:
    """Return the run file that is given in place of a motion; InputError beside others."""
    files = [Path(name) for name in options.motion if name.lower().endswith(".toml")]
    for option in ("skeleton", "at", "up", "unit", "rate", "placement"):
        if files and getattr(options, option):
            raise InputError(
                f"run file '{files[0]}' says who moves; leave --{option} out, or set people.0...."
            )
    if files and len(options.motion) > 1:
        raise InputError(f"run file '{files[0]}': it says who moves; give it alone")
    return files[0] if files else None


def _described(
    options: argparse.Namespace, settings: Mapping[str, Any]
) -> Iterator[tuple[str, Any]]:
    """Yield keys of a run file and the values that options give them."""
    for name, value in settings.items():
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            value = dataclasses.asdict(value)
        yield f"settings.{name}", value
    tolerances = {
        name: getattr(options, name, None) for name in ("tolerance_db", "tolerance_complex")
    }
    for name, value in (*options.model_option, *tolerances.items()):
        if value is not None:
            yield f"settings.model_options.{name}", value
    for table in ("radar", "scene"):
        if (source := getattr(options, table)) is not None:
            # From here, not from the folder of a run file.
            own = str(Path(source).absolute()) if Path(source).suffix else source
            yield table, {"base": own}
    pose = {f"{name}_deg": getattr(options, name) for name in ("yaw", "pitch", "roll")}
    for key, value in {
        "board": options.board,
        "position_m": options.radar_position,
        **pose,
    }.items():
        if value is not None:
            yield f"radar.{key}", value


def _checked_people(options: argparse.Namespace, alone: bool) -> dict[str, Path]:
    """Return the skeletons of recordings by name; InputError where there cannot be such people."""
    names, places = options.motion, options.at
    apart = len(names) > 1 and options.placement != "recorded"
    if len(places) != len(names) and (places or apart) and not alone:
        raise InputError(
            f"{len(names)} MOTION and {len(places)} --at; several people need places: give "
            "--at X,Y once for each MOTION, in the same order"
        )
    from rtradar.system.registries import check_activity, reader_of

    skeletons = _skeletons(names, options.skeleton) if names else {}
    for name in names:
        if name.startswith(SYNTHETIC):
            check_activity(name.removeprefix(SYNTHETIC))
        else:
            reader_of(name, skeletons.get(name))
    return skeletons


def _people(
    options: argparse.Namespace, settings: RunSettings, skeletons: Mapping[str, Path]
) -> list[dict[str, Any]]:
    """Return the people of the command line as tables, whose motions are read."""
    from rtradar.description import load_mover

    said = {"up": options.up, "unit": options.unit, "rate_hz": options.rate}
    placed = {} if options.placement is None else {"placement": options.placement}
    people = []
    for index, name in enumerate(options.motion):
        motion = load_mover(name, index, settings, skeleton=skeletons.get(name), **said)
        place = options.at[index] if options.at else {}
        people.append({"motion": motion, **placed, **place})
    return people


def _skeletons(names: Sequence[str], skeletons: Sequence[Path]) -> dict[str, Path]:
    """Return the skeleton of each recording: the only one, or one for each in order."""
    if not skeletons:
        return {}
    recorded = [name for name in names if not name.startswith(SYNTHETIC)]
    needing = [name for name in recorded if name.lower().endswith(".amc")] or recorded
    if not needing:
        raise InputError(
            f"{names[0]}: a synthetic actor has its own skeleton; leave --skeleton out"
        )
    if len(skeletons) not in (1, len(needing)):
        raise InputError(
            f"{len(needing)} recordings need a skeleton, and {len(skeletons)} are given; give "
            "--skeleton once for all, or once for each, in order"
        )
    return dict(zip(needing, cycle(skeletons), strict=False))
