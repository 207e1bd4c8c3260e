"""``rtradar run``, ``compare``, ``process`` and ``export``: what makes captures and uses them."""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtradar.cli.values import say, settings_in, show_page
from rtradar.errors import InputError
from rtradar.recordings import SYNTHETIC

if TYPE_CHECKING:
    from rtradar.exchange import Dca1000Layout
    from rtradar.radar import Radar
    from rtradar.settings import RunSettings


def run(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar run``."""
    if options.as_paper:
        _choose_as_paper(options)
    if several := _several(options):
        yield from _sweep(options, several)
        return
    capture = _capture(options)
    from rtradar import pipeline
    from rtradar.pipeline.timing import lines_shown

    with lines_shown():
        summary = pipeline.run(**capture, pictures=options.pictures).summary
    yield summary
    tell(options, summary)


def _choose_as_paper(options: argparse.Namespace) -> None:
    """Set the paper's choices and warn of its faults; InputError where another choice is given."""
    from rtradar.paper.items import AS_PAPER, paper_warnings
    from rtradar.settings import RunSettings

    # An option that has its default does not contradict the paper.
    defaults = RunSettings()
    for name, value in AS_PAPER.items():
        key, default = f"settings.{name}", getattr(defaults, name)
        given = vars(options).get(key)
        if given and given not in (default, value):
            raise InputError(
                f"--as-paper sets {name} = {value!r}, and {given!r} is given; leave one of both out"
            )
        setattr(options, key, value)
    if not options.quiet:
        for text in paper_warnings():
            print(f"rtradar: warning: {text}", file=sys.stderr)


def tell(options: argparse.Namespace, summary: Mapping[str, Any]) -> None:
    """Print what a run found and how long it took, and name its page."""
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


def compare(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar compare``."""
    # The names are folders of results, or several recordings to compare at one level, or one
    # recording to compare across levels.
    folders = any(map(os.path.isdir, options.motion))
    several = len(options.motion) > 1 and not options.at
    planned = options.plan or options.advise is not None
    if planned and (folders or several):
        raise InputError("--plan and --advise are of one recording; give one, or people with --at")
    if folders:
        yield from _compare_folders(options)
        return
    from rtradar.settings import check_fidelities

    fidelities = [name.strip() for name in options.fidelities.split(",")]
    check_fidelities(fidelities)
    capture = _capture(options, alone=several)
    from rtradar import pipeline
    from rtradar.pipeline.timing import lines_shown

    capture.pop("fidelity")
    capture["fidelities"] = fidelities
    if planned:
        yield from _plan(options, capture)
        return
    capture["pictures"] = options.pictures
    with lines_shown():
        if several:
            found = pipeline.compare_recordings(capture.pop("motion"), **capture)
        else:
            found = pipeline.compare(**capture)
    yield found.summary
    if options.verbose and not several:
        for name, figures in found.summary["fidelities"].items():
            details = figures["stages"], found.summary["versions"], figures["variant"]
            say(options, f"{name}:\n{_details(*details)}")
    say(options, found.table())
    if several:
        say(options, f"the table is {options.out / 'compare.csv'}, each recording in its folder")
    else:
        _show(options, "compare.html")


def _plan(options: argparse.Namespace, capture: dict[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Say what a run by each level will take, and which level to take."""
    from rtradar.cards import text_table
    from rtradar.pipeline import plan_levels

    for name in ("out", "overwrite"):
        capture.pop(name)
    found = plan_levels(**capture, tolerance_db=options.advise)
    yield found
    rows = [("", "Run [s]", "Memory [MB]")]
    rows += [
        (name, f"{one['wall_s']:.3g}", f"{one['peak_memory_mb']:.0f}")
        for name, one in found["levels"].items()
    ]
    say(options, text_table(rows))
    if advice := found["advice"]:
        say(options, f"take {advice['level']}: {advice['why']}")


def _compare_folders(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    if others := [name for name in options.motion if not os.path.isdir(name)]:
        raise InputError(f"'{others[0]}' is no folder, and others are; give folders, or recordings")
    from rtradar.pipeline import compare_folders

    found = compare_folders(options.motion, out=options.out, overwrite=options.overwrite)
    yield found.summary
    say(options, found.table())
    for key, values in found.summary["differ"].items():
        say(options, f"{key}: " + ", ".join(f"{own} ({name})" for name, own in values.items()))
    _show(options, "compare.html")


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
    from rtradar.settings import RunSettings
    from rtradar.system.registries import radar_table, scene_table

    settings = settings_in(options)
    # What is wrong is refused before anything slow is imported.
    RunSettings(**settings)
    for source, look_up in ((options.radar, radar_table), (options.scene, scene_table)):
        if source is not None:
            look_up(source)
    run_file = _run_file(options)
    skeletons = {} if run_file else _checked_people(options, alone)
    from rtradar.description import read_run_file, settings_of_table, with_value

    # Options overrule the run file, and --set overrules both. What is set of people is left for
    # later, when the people are known.
    table = read_run_file(run_file, changed=options.changed) if run_file else {}
    for key, value in _described(options):
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


def _sweep(
    options: argparse.Namespace, values: Mapping[str, list[Any]]
) -> Iterator[Mapping[str, Any]]:
    """Run every combination of the values of keys that were given more than once."""
    from rtradar.pipeline import Experiment, sweep
    from rtradar.pipeline.timing import lines_shown

    written = {name: getattr(options, name) for name in ("out", "overwrite", "pictures")}
    with lines_shown():
        found = sweep(Experiment(*_tables(options)), values, **written)
    yield found.summary
    say(options, found.table())
    say(options, f"the table is {options.out / 'sweep.csv'}, each run in its folder")
    if options.open:
        show_page(options.out / "sweep.png")


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


def _described(options: argparse.Namespace) -> Iterator[tuple[str, Any]]:
    """Yield keys of a run file and the values that options give them."""
    for table in ("radar", "scene"):
        if (source := getattr(options, table)) is not None:
            # From here, not from the folder of a run file.
            own = str(Path(source).absolute()) if Path(source).suffix else source
            yield table, {"base": own}
    # An option of its own goes before the same --model-option.
    for key, value in sorted(vars(options).items(), key=lambda one: one[0].count(".")):
        if key == "settings.model_options":
            yield from ((f"{key}.{name}", own) for name, own in value)
        elif "." in key:
            yield key, vars(value) if dataclasses.is_dataclass(value) else value


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
    # Only .amc files need a skeleton. If there are none, a skeleton that is given goes to every
    # recording, whose reader can refuse it.
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


# -- IF samples from files of others, and for others -----------------------------------------------


def _layout(options: argparse.Namespace) -> Dca1000Layout | None:
    """Return the order of words that the options ask for, None if they say nothing of it."""
    from rtradar.exchange import Dca1000Layout

    # The options are named like the fields of the layout.
    names = [field.name for field in dataclasses.fields(Dca1000Layout)]
    said = {name: getattr(options, name) for name in names}
    given = {
        name: value for name, value in said.items() if value is not None and value is not False
    }
    asked = given or getattr(options, "format", None) == "dca1000"
    file = getattr(options, "samples", None)
    if (
        given
        and file is not None
        and (suffix := Path(file).suffix) in (".npy", ".nc", ".mat", ".zarr")
    ):
        first = "--" + next(iter(given)).replace("_", "-")
        raise InputError(
            f"{first} is of the .bin of a DCA1000, and not of a {suffix}; leave it out"
        )
    return Dca1000Layout(**given) if asked else None


def _radar_and_layout(options: argparse.Namespace) -> tuple[Radar | None, Dca1000Layout | None]:
    """Return the radar, and the order of words by the options, else by the .cfg file.

    Where a JSON file lies beside the samples it says the order, because rtradar wrote both.
    """
    from rtradar.exchange import Dca1000Layout
    from rtradar.radar import Radar
    from rtradar.radar.ti_cfg import read_ti_cfg

    layout = _layout(options)
    if options.radar is None or not options.radar.endswith(".cfg"):
        radar = None if options.radar is None else Radar.load(options.radar, board=options.board)
        return radar, layout
    said = read_ti_cfg(options.radar, getattr(options, "board", None))
    if layout is None and not options.samples.with_suffix(".json").exists():
        layout = Dca1000Layout(real=said.real, q_first=said.q_first, rx_mask=said.rx_mask)
    return said.radar, layout


def process(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar process``."""
    from rtradar.settings import RunSettings

    settings = settings_in(options)
    RunSettings(**settings)  # refuses what is wrong before anything slow is imported
    from rtradar.exchange import open_samples

    samples = open_samples(options.samples, *_radar_and_layout(options))
    if samples.radar is None:
        raise InputError(f"'{options.samples}' does not tell of its radar; name it (--radar)")
    from rtradar.pipeline import process_samples
    from rtradar.pipeline.timing import lines_shown

    with lines_shown():
        found = process_samples(
            samples,
            samples.radar,
            options.out,
            overwrite=options.overwrite,
            pictures=options.pictures,
            unit=samples.unit,
            **settings,
        )
    yield found.summary
    tell(options, found.summary)


def export(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar export``."""
    if options.format == "int16" and _layout(options) is not None:
        raise InputError("--format int16 is no file of a DCA1000; leave its options out")
    from rtradar import exchange

    written = exchange.export(options.source, options.out, dca1000=_layout(options))
    yield written
    axes, shape = written["axes"], written["shape"]
    if len(axes) == len(shape):
        size = ", ".join(f"{axis} {length}" for axis, length in zip(axes, shape, strict=True))
    else:
        size = f"{shape[0]} points: {', '.join(axes)}"
    print(f"{size}; {written['type']}; see {options.out}")
