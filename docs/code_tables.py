"""Tables of the pages that Sphinx writes from the code at each build."""

from __future__ import annotations

import dataclasses
import inspect
import re
import runpy
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList

from rtradar.body import Person
from rtradar.campaign.intervals import INTERVAL_KEYS, Augmented, Intervals
from rtradar.campaign.spec import DRAWN, EACH, RUN_KEYS
from rtradar.campaign.spec_file import RUN_LIMITS
from rtradar.clouds.sample_files import TABLES as ARRAY_TABLES
from rtradar.front_end import Antenna, Chip, Interferer, Receiver
from rtradar.motion import ACTIVITIES
from rtradar.radar import Radar
from rtradar.scene import (
    MATERIALS,
    Furniture,
    Object,
    Scene,
    Surface,
    Wall,
    material,
    own_material,
    room_walls,
)
from rtradar.scene.materials import PowerLaw
from rtradar.scene.tables import KEYS
from rtradar.settings import RunSettings
from rtradar.system.fields import Limits, annotations_of, found_in, rules_of

SCENES = Path(__file__).parents[1] / "scenes"
MESHES = Path(__file__).parents[1] / "meshes"
BOARDS = Path(__file__).parents[1] / "validation" / "closed_forms" / "boards.py"
PAPER = {
    "max_range_m": ("largest range", "9.6 m", "{:.3f} m"),
    "range_bin_m": ("range bin", "0.0375 m", "{:.5f} m"),
    "max_velocity_mps": ("unambiguous velocity", "8.33 m/s", "{:.3f} m/s"),
    "velocity_bin_mps": ("velocity bin", "0.125 m/s", "{:.4f} m/s"),
    "max_angle_deg": ("unambiguous angle", "±90°", "±{:.1f}°"),
    "angle_resolution_deg": (
        "beam width (-3 dB) of a uniform line, far field",
        "2.38°",
        "{:.2f}°",
    ),
}
"""Limits of a radar: name, value in the paper's Table 2, and format."""


SCENE_TABLES: dict[str, tuple[Callable[..., object], str]] = {
    "top": (Scene, ""),
    "[radar]": (Scene, "radar_"),
    "[person]": (Scene, "person_"),
    "[room]": (room_walls, ""),
    "a side of a room": (Surface, ""),
    "[[walls]]": (Wall, ""),
    "[[furniture]]": (Furniture, ""),
    "[[objects]]": (Object, ""),
    "[[people]]": (Person, ""),
    "[materials.NAME]": (own_material, ""),
}
"""What makes a table of a scene file: the code, and a prefix of its parameters."""

READ_AS = {
    "up": "axis of the recording that is up: `x`, `y`, `z`, `-x`, `-y` or `-z`; found if left out",
    "unit": "unit of its lengths: `m`, `cm`, `mm`, `in`, `cmu` or metres; found if left out",
    "rate_hz": "its frames a second [Hz]; as the file says",
}
"""Keys that say what a recording means."""

OF_RECORDINGS = {
    "traits": "traits of a synthetic actor by name, such as `{tempo = 0.9}`",
    "motion": "recording beside the scene file or below, or `synthetic:` and an activity",
    "skeleton": "the `.asf` of an `.amc`",
    **READ_AS,
    "seed": "number of the subject of a synthetic actor; 0",
    "duration_s": "duration of a recording from `start_s` on [s], to its end if left out; how long "
    "a synthetic actor moves [s], 10 if left out",
}
"""Keys of a person in a scene file that find their motion."""

DATA_SET_KEYS = {
    "top": {
        "keep": (
            "list of what is kept beside the clouds: `spectrograms`, `range_doppler`, "
            "`range_azimuth`, `joints`; intervals then have one `duration_s`, and radars one size "
            "of maps",
            "`[]`",
        ),
        "angles": ("`false` leaves spatial clouds empty, which saves the time of angles", "`true`"),
        "skip_short": (
            "`true` leaves out recordings that are too short for an interval, with a warning",
            "`false`",
        ),
        "clouds": (
            "`false` makes no clouds, which saves most of the time where only `keep` is wanted",
            "`true`",
        ),
        "whole_clouds": (
            "`true` keeps all spatial points, with the time and the velocity of each",
            "`false`",
        ),
        "random_rooms": (
            "`true` draws a room for each interval, as [`rt.Scene.random`](scenes.md) does, in "
            "place of a `scene` under `[each]`",
            "`false`",
        ),
        "folder": ("folder of the recordings, from the folder of this file", "`.`"),
    },
    "[windows]": {
        "start_s": ("start of the first interval [s]", None),
        "duration_s": (
            "length of each interval [s]; synthetic actors and `hop_s` need it",
            "to the end",
        ),
        "hop_s": ("step from one interval to the next [s]", "one interval"),
        "end_s": ("time by which the last interval must end [s]", "the end of the recording"),
        "place": (
            "`regular`: one every `hop_s`; `random`: anywhere; `strike`: such that a hand or a "
            "foot is fastest somewhere in the middle half of it",
            None,
        ),
        "count": (
            "largest number of intervals of a recording that are `random` or round a `strike`; "
            "they do not overlap",
            None,
        ),
    },
    "[each]": {
        "radar": ("list of presets or TOML files", None),
        "scene": ("list of names or TOML files", None),
        "fidelity": ("list of fidelity levels", None),
        "heading_deg": ("list of headings [deg]", "drawn"),
        "snr_db": ("list of signal-to-noise ratios [dB]", "drawn"),
        "person_position_m": ("list of places [x, y] [m]", "as the scene says"),
        "radar_position_m": ("list of places [x, y, z] [m]", "as the scene or the radar says"),
    },
    "[others]": {
        "count": ("number of people beside the one of the label, at most 8", "must be given"),
        "labels": ("list of what they do, drawn for each", "`['walk', 'stand']`"),
        "x_m": ("range [least, most] of their mean places [m]", "`[-1.0, 1.0]`"),
        "y_m": ("the same", "`[-1.5, 1.5]`"),
    },
    "[augmented]": {
        "copies": (
            "copies of each interval of a recording, half of them mirrored",
            "must be given",
        ),
        **{
            key: (f"range [least, most] of {what}", f"`{list(getattr(Augmented, key))}`")
            for key, what in (
                ("tempo", "their tempo, a factor"),
                ("height", "their height, a factor"),
                ("build", "their build, a factor"),
                ("drift_mps", "a drift in any direction [m/s]"),
                ("start_s", "by how much later they begin [s]"),
            )
        },
    },
    "[drawn]": {"": ("range [least, most] from which each interval draws one value", "as below")},
    "[[synthetic]]": {
        "label": (
            f"{', '.join(f'`{activity}`' for activity in ACTIVITIES)}; once in a style",
            "must be given",
        ),
        "count": ("number of takes; `count` or `seeds` is needed", ""),
        "seeds": ("list of the seeds of the takes", ""),
        "style": (
            "one of the activity's styles, of `rtradar list activities`",
            "the subject's own",
        ),
        "drawn": ("ranges of these actors, in place of those under `[drawn]`", ""),
        "subjects": (
            "number of subjects, or a list of their numbers; take k is of subject k modulo their "
            "number",
            "10",
        ),
    },
    "[[recordings]]": {
        "file": (
            "the recording, in `folder` or below, or a pattern of several (`*`, `?`, `**`, "
            "`{label}`, `{subject}`)",
            "must be given",
        ),
        "skeleton": ("the `.asf` of an `.amc`; may hold `{label}` and `{subject}`, too", ""),
        **{key: (meaning, "") for key, meaning in READ_AS.items()},
        "label": ("activity; must be given unless `file` has `{label}`", "as in `file`"),
        "subject": ("who moves", "as in `file`, or `unknown`"),
        "licence": ("terms of the recording", "`unknown`"),
        **dict.fromkeys(
            INTERVAL_KEYS,
            ("in place of that of `[windows]`", "that of `[windows]`"),
        ),
    },
}
"""Meanings of the keys of a data set; defaults of None follow from the code."""


def pipe_table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown; rows are of one length."""
    lines = [list(head), *map(list, rows)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def described(text: str) -> Iterable[tuple[list[str], str, str]]:
    """Names, type and meaning of each entry under Parameters of a numpydoc docstring."""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w+\n-+\n|\Z)", text, re.M | re.S)
    entries = re.split(r"^(?=\S)", section[1] if section else "", flags=re.M)
    for entry in filter(str.strip, entries):
        first, *rest = entry.strip().splitlines()
        names, _, kind = first.partition(" : ")
        yield [name.strip() for name in names.split(",")], kind, " ".join(map(str.strip, rest))


def keys(thing: type) -> str:
    """Keys of the TOML table of a dataclass, from its docstring and the defaults of its fields."""
    defaults = {field.name: field.default for field in dataclasses.fields(thing)}
    rows = []
    for names, kind, meaning in described(inspect.getdoc(thing) or ""):
        values = [
            "" if defaults[name] in (None, (), dataclasses.MISSING) else toml(defaults[name])
            for name in names
        ]
        rows.append(
            [
                ", ".join(f"`{name}`" for name in names),
                kind.removesuffix(", optional").replace("|", r"\|"),
                "; ".join(dict.fromkeys(allowed(thing, name) for name in names)),
                meaning,
                values[0] if len(set(values)) == 1 else ", ".join(values),
            ]
        )
    return pipe_table(["key", "type", "allowed", "meaning", "default"], rows)


def allowed(thing: type, name: str) -> str:
    """What a field may be beyond its type, in the words of the message about another value."""
    if found_in(annotations_of(thing)[name], Limits) is None:
        return ""
    wanted = rules_of(thing)[name].wanted
    return re.sub(r"^(it must be |allowed: )(an? |one )?", "", wanted)


def toml(value: object) -> str:
    """A default as a TOML file has it; nothing where there is none."""
    if value is None or value is inspect.Parameter.empty:
        return ""
    if isinstance(value, str):
        return f'`"{value}"`'
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple | list):
        return f"`{list(value)}`".replace("'", '"')
    number = float(str(value))
    if 0 < number < 1e-6:
        return f"`{number:g}`"
    power = 3 * int(np.floor(np.log10(number) / 3 + 1e-9)) if number > 0 else 0
    return f"`{number:g}`" if "e" not in f"{number:g}" else f"`{number / 10.0**power:g}e{power}`"


def scene_keys() -> str:
    """Keys of all tables of a scene file, with their ranges and defaults."""
    rows = []
    for table, (thing, prefix) in SCENE_TABLES.items():
        limits = annotations_of(PowerLaw if thing is own_material else thing)
        parameters = inspect.signature(thing).parameters
        texts = {
            name: meaning
            for names, _, meaning in described(inspect.getdoc(thing) or "")
            for name in names
        }
        if table == "[[people]]":
            texts |= OF_RECORDINGS
        texts["box"] = "lengths of a box along its x, y and z [m], in place of `mesh`"
        needed, others = KEYS[table]
        for key in (*needed, *others):
            name = prefix + key if prefix + key in parameters else key
            default = parameters[name].default if name in parameters else None
            usual = "must be given" if key in needed and name in parameters else toml(default)
            own = found_in(limits.get(name), Limits) or Limits()
            least, most = (toml(limit).strip("`") for limit in (own.least, own.most))
            allowed = f"{least} to {most}" if own.most < Limits().most and not own.wanted else ""
            rows.append([f"`{table}`", f"`{key}`", texts[name], allowed, usual])
    return pipe_table(["table", "key", "meaning", "allowed", "default"], rows)


def data_set_keys() -> str:
    """Keys of all tables of a data set; those of a run come from its settings."""
    usual: dict[str, object] = {key: values[0] for key, values in EACH.items()}
    for thing in (RunSettings, Intervals):
        usual |= {one.name: one.default for one in dataclasses.fields(thing)}
    rows = []
    for names, kind, meaning in described(inspect.getdoc(RunSettings) or ""):
        for key in names:
            limits = " to ".join(toml(limit).strip("`") for limit in RUN_LIMITS.get(key, ()))
            allowed = kind.strip("{}") if kind.startswith("{") else limits
            if key in ("seed", *RUN_KEYS):
                rows.append(["`top`", f"`{key}`", meaning, allowed, toml(usual[key])])
    for table, own in DATA_SET_KEYS.items():
        for key, (meaning, default) in own.items():
            shown = (
                toml([usual[key]] if key in EACH else usual[key]) if default is None else default
            )
            name = f"`{key}`" if key else "a name of the table below"
            rows.append([f"`{table}`", name, meaning, "", shown])
    return pipe_table(["table", "key", "meaning", "allowed", "default"], rows)


def radar_limits() -> str:
    """What follows from the paper's radars, beside what the paper states."""
    radars = {name: Radar.preset(name) for name in ("paper-12ghz", "paper-77ghz")}
    rows = [
        [name, paper, *(shown.format(getattr(radar, field)) for radar in radars.values())]
        for field, (name, paper, shown) in PAPER.items()
    ]
    return pipe_table(["limit", "paper", *(f"`{name}`" for name in radars)], rows)


def board_limits() -> str:
    """What follows from the files of boards, and in brackets what the datasheets allow or state."""
    rows = []
    for name, sheet in runpy.run_path(str(BOARDS))["DATASHEETS"].items():
        radar = Radar.preset(name)
        sweep = np.array([0, radar.bandwidth_hz]) + radar.start_frequency_hz
        sides = radar.azimuth_resolution_deg, radar.elevation_resolution_deg
        stated = f" ({sheet.beam_deg:g}°)" if sheet.beam_deg else ""
        rows.append(
            [
                f"`{name}`",
                "{:g} to {:g}".format(*sweep / 1e9) + " ({:g} to {:g})".format(*sheet.band_ghz),
                f"{radar.slope_hz_per_s / 1e12:g} ({sheet.slope_mhz_per_us or '?'})",
                f"{radar.sample_rate_hz / 1e6:g} ({sheet.rate_mhz:g})",
                f"{radar.chirp_period_s * 1e6:g} ({sheet.chirp_us or '?'})",
                f"{100 * radar.range_bin_m:.2f} cm, {radar.max_range_m:.1f} m",
                f"{radar.velocity_bin_mps:.3f}, ±{radar.max_velocity_mps:.2f} m/s",
                f"{sides[0]:.0f}°{stated} × {sides[1]:.0f}°",
                f"{radar.transmit_power_dbm:g} dBm, {radar.noise_figure_db:g} dB",
                sheet.source,
            ]
        )
    head = ["board", "sweep [GHz]", "slope [MHz/µs], at most", "samples [MHz], at most"]
    head += ["chirp and idle [µs], at least", "range", "velocity", "beam", "power, noise"]
    return pipe_table([*head, "datasheet"], rows)


def materials() -> str:
    """Constants of all materials; of those that are no power law, the frequencies alone."""
    rows = []
    for name, known in MATERIALS.items():
        for number, band in enumerate(known.bands):
            low, high = (f"{frequency / 1e9:g}" for frequency in (band.low_hz, band.high_hz))
            constants = [f"{getattr(band, key):g}" if hasattr(band, key) else "" for key in "abcd"]
            rows.append(
                [
                    "" if number else f"`{name}`",
                    f"{low} to {high}" if np.isfinite(band.high_hz) else "all",
                    *constants,
                ]
            )
    return pipe_table(["material", "band [GHz]", "a", "b", "c", "d"], rows)


def meshes() -> str:
    """Sizes of the meshes that come along."""
    rows = []
    for path in sorted(MESHES.glob("*.ply"), key=lambda path: path.stem):
        piece = Furniture(
            name=path.stem,
            mesh=path.stem,
            material=material("metal"),
            position_m=(0.0, 0.0, 0.0),
        ).triangles()
        size = np.ptp(piece.vertices, axis=0)
        rows.append(
            [
                f"`{path.stem}`",
                " × ".join(f"{length:.2f}" for length in size),
                str(len(piece.faces)),
                "closed" if piece.closed else "open sheet",
            ]
        )
    return pipe_table(["mesh", "along x, y, z [m]", "triangles", "kind"], rows)


def scenes() -> str:
    """Scenes that come along."""
    rows = []
    for path in sorted(SCENES.glob("*.toml")):
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        size = table.get("room", {}).get("size_m")
        place = table.get("radar", {}).get("position_m")
        rows.append(
            [
                f"`{path.stem}`",
                " × ".join(f"{length:g}" for length in size) if size else "none",
                re.sub(r"^[\d. by]+m, ", "", table["description"]),
                f"({', '.join(f'{x:g}' for x in place)})" if place else "where the radar says",
            ]
        )
    return pipe_table(["name", "size [m]", "what is in it", "radar at [m]"], rows)


def drawn() -> str:
    """Ranges of what a data set draws."""
    rows = [
        [f"`{name}`", f"{low:g} to {high:g}", f"{least:g} to {most:g}"]
        for name, ((low, high), least, most) in DRAWN.items()
    ]
    return pipe_table(["name under `[drawn]`", "range if left out", "allowed"], rows)


def arrays() -> str:
    """Data sets of the file of maps, with their axes and units."""
    groups = {"maps": "", "received": "", "people": "", "parts": "truth/", "owners": "truth/"}
    rows = [
        [f"`{place}{name}`", ", ".join(one.dims), one.unit.replace("m2", "m²"), one.meaning]
        for group, place in groups.items()
        for name, one in ARRAY_TABLES[group].items()
    ]
    return pipe_table(["data set", "axes", "unit", "content"], rows)


TABLES: dict[str, Callable[[], str]] = {
    "arrays": arrays,
    "radar-keys": lambda: keys(Radar),
    "antenna-keys": lambda: keys(Antenna),
    "receiver-keys": lambda: keys(Receiver),
    "interferer-keys": lambda: keys(Interferer),
    "chip-keys": lambda: keys(Chip),
    "radar-limits": radar_limits,
    "board-limits": board_limits,
    "scene-keys": scene_keys,
    "materials": materials,
    "meshes": meshes,
    "scenes": scenes,
    "drawn": drawn,
    "data-set-keys": data_set_keys,
}


class CodeTable(Directive):
    """The table of that name."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Write it in Markdown for the parser of the page, which is read anew at the next build."""
        self.state.document.settings.env.note_reread()
        node = nodes.container()
        lines = TABLES[self.arguments[0]]().splitlines()
        self.state.nested_parse(StringList(lines, source=__file__), self.content_offset, node)
        return node.children
