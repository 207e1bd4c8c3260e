"""Run page, ``report.html``: one run in one file that opens without a network."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.clouds.spatial import SHOWN_DB, SpatialCloud
from rtradar.radar import Radar
from rtradar.report.figures.canvas import field_unit
from rtradar.report.figures.fitting import central_limits
from rtradar.report.pages import html
from rtradar.report.pages.html import mapping_table, picture, table, write_page
from rtradar.report.pages.labels import grouped, minus, signal_to_noise
from rtradar.report.pages.room_section import ROOM_PICTURES, room_section
from rtradar.report.view.run_view import RunView, linked_views, view_data
from rtradar.report.view.three_d import rdt_data, spatial_data

_MORE_VIEWS = """<p class="note">The same for every frame, on a page of its own:
<code>rtradar view DIR</code>, where DIR is the folder of this page.</p>"""


def write_report(
    path: str | Path,
    *,
    radar: Radar,
    summary: Mapping[str, Any],
    pictures: Mapping[str, Path],
    rdt_points: ArrayLike,
    spatial: SpatialCloud | None = None,
    run_view: RunView | None = None,
) -> None:
    """Write a run as a page: what was seen, body and maps that move together, pictures and tables.

    The file includes plotly.js (2.3 MB), and its content security policy forbids any request.

    Parameters
    ----------
    path : path
        HTML file.
    radar : Radar
        Radar of the run, whose limits and settings are listed.
    summary : mapping
        Values of ``summary.json``, any of which may be missing. Those that have no place of their
        own on the page are listed in words.
    pictures : mapping of title to path
        PNG files in the order of the page.
    rdt_points : (point, 3)
        Time [s], range [m] and velocity [m/s] of each point.
    spatial : SpatialCloud, optional
        Spatial cloud, shown as a whole.
    run_view : RunView, optional
        Data of the views that one slider moves, at as many moments as it has. Without it, as for
        samples that were measured, the page has no moving body.

    Raises
    ------
    InputError
        If a picture is missing or is not a PNG file, or ``rdt_points`` has a wrong shape or values
        that are not finite.
    """
    parameters = summary.get("parameters", {})
    data: dict[str, Any] = {"rdt": rdt_data(rdt_points)}
    if spatial is not None:
        data["spatial"] = spatial_data(spatial, radar)
    scripts = ["plots.js"]
    if run_view is not None:
        data |= view_data(run_view) | {"name": Path(path).stem}
        scripts += ["figure.js", "linked.js"]
    sections = _sections(summary, radar, data, pictures, run_view)
    links = {name: title for name, title, _ in sections}
    fidelity, scene = (str(summary.get("fidelity", "")), str(parameters.get("scene", "")))
    told = (f"radar {radar.name}", fidelity and f"fidelity {fidelity}", scene)
    write_page(
        path,
        html.Titles(
            "rtradar report",
            str(parameters.get("motion", "Recording")),
            ", ".join(filter(None, told)),
        ),
        html.tiles(_headline(summary, np.asarray(rdt_points, dtype=np.float64)))
        + html.contents(links),
        chain.from_iterable(
            chain((f'<section id="{name}"><h2>{escape(title)}</h2>',), text, ("</section>\n",))
            for name, title, text in sections
        ),
        data=data,
        scripts=(*scripts, "report.js"),
    )


def _sections(
    summary: Mapping[str, Any],
    radar: Radar,
    data: Mapping[str, Any],
    pictures: Mapping[str, Path],
    run_view: RunView | None,
) -> list[tuple[str, str, Iterable[str]]]:
    """Return identifier, title and HTML of the sections, in their order."""
    room = summary.get("room")
    of_room = {title: path for title, path in pictures.items() if Path(path).name in ROOM_PICTURES}
    others = {title: path for title, path in pictures.items() if not (room and title in of_room)}
    sections: list[tuple[str, str, Iterable[str]]] = []
    if run_view is not None:
        text = linked_views(run_view) + _MORE_VIEWS
        sections.append(("figure", "The moving body, its echoes and its maps", (text,)))
    else:
        sections.append(("rdt", "Range-Doppler-time cloud", (_rdt(data),)))
    if "spatial" in data:
        sections.append(("spatial", "Spatial cloud", (_spatial(data["spatial"]),)))
    if others:
        sections.append(("maps", "Maps", _pictures(others)))
    if room:
        text = room_section(room, radar, of_room)
        sections.append(("room", "The room", (text,)))
    limits = html.limits_list(summary.get("limits", ()))
    sections.append(("limits", "Limits of this result", (limits,)))
    sections.append(("parameters", "Radar and settings", (_parameters(summary, radar),)))
    cost = _cost(summary)
    if cost:
        sections.append(("cost", "Cost", (cost,)))
    return sections


def _headline(summary: Mapping[str, Any], points: NDArray[np.float64]) -> Iterator[tuple[str, str]]:
    """Yield what the radar saw, as figures with captions."""
    if len(points):
        low, high = central_limits(points)
        nearest, farthest = summary.get("detected_range_m") or (low[1], high[1])
        yield f"{nearest:.1f} to {farthest:.1f} m", "range of what was detected"
        yield (
            minus(f"{low[2]:+.1f} to {high[2]:+.1f} m/s"),
            "velocity of what was detected, positive: receding",
        )
    if ratio := signal_to_noise(summary):
        yield ratio, "signal to noise, of one IF sample"
    if "detections" in summary:
        frames = f" in {summary['windows']} frames" if "windows" in summary else ""
        yield grouped(summary["detections"]), f"detections{frames}"
    yield (
        grouped(len(points)),
        "points of the range-Doppler-time cloud, drawn on the surface about the detections",
    )
    if "capture_s" in summary:
        yield f"{summary['capture_s']:.2f} s", "of radar"


def _rdt(data: Mapping[str, Any]) -> str:
    return _scene("rdt", data["rdt"], "The surface about the detections of all frames, sampled.")


def _spatial(cloud: Mapping[str, Any]) -> str:
    note = f"Where detected cells are, down to {SHOWN_DB:g} dB below the strongest; world axes."
    measured = dict(zip("xyz", cloud["measured"], strict=True))
    if not all(measured.values()):
        angle = "azimuth" if measured["z"] else "elevation"
        note += (
            f" An array on one line does not measure {angle}: "
            "x is the distance from that line, added to the radar's x."
        )
    return _scene("spatial", cloud, note)


def _scene(name: str, cloud: Mapping[str, Any], note: str) -> str:
    if not cloud["count"]:
        return '<p class="empty">Nothing was detected.</p>'
    if cloud["shown"] != cloud["count"]:
        note += f" {cloud['shown']} of {cloud['count']} points are shown."
    return f'<div class="scene" id="scene-{name}"></div><p class="note">{note}</p>'


def _pictures(pictures: Mapping[str, Path]) -> Iterator[str]:
    yield '<div class="pictures">'
    for title, path in pictures.items():
        yield picture(title, Path(path)) + "\n"
    yield "</div>"


def _parameters(summary: Mapping[str, Any], radar: Radar) -> str:
    parameters = dict(summary.get("parameters", {}))
    settings = parameters.pop("radar", {})
    own = (
        "parameters",
        "limits",
        "stages",
        "versions",
        "part_power_m2",
        "modelled",
        "room",
        "people",
    )
    listed = (*own, *_COSTS, "fidelity", "seed", "files")
    others = {key: value for key, value in summary.items() if key not in listed}
    modelled = summary.get("modelled", {})
    models = {**modelled.get("ways", {}), **modelled.get("why", {})}
    power = summary.get("part_power_m2", {})
    total = sum(power.values()) or 1.0
    # In the unit of the picture of the parts.
    unit = field_unit(
        radar,
        spreading=parameters.get("spreading", True),
        strongest_m2=max(power.values(), default=1.0),
    )
    powers = (
        (name.capitalize(), f"{level:.1f}" if value else "-", f"{value / total:.1%}")
        for (name, value), level in zip(power.items(), unit.level([*power.values()]), strict=True)
    )
    fractions = ((name, f"{value:.1%}") for name, value in models.items())
    doubles = (
        (one["first"].capitalize(), one["last"], f"{one['over_single_reflections_db']:.1f} dB")
        for one in modelled.get("double_reflections", ())
    )
    if "seed" in summary:
        parameters["seed"] = summary["seed"]
    return _tables(
        ("What the radar can measure", html.limits_table(radar)),
        ("Settings of the run", mapping_table(parameters)),
        ("Radar", mapping_table(settings)),
        ("What was found", mapping_table(others)),
        ("People", _people(summary.get("people", ()))),
        ("How parts were modelled, of all parts and time", table(fractions)),
        (
            "Reflections from part to part",
            table(doubles, ("First", "Last", "Power over all single reflections")),
        ),
        ("Echo power by part", table(powers, ("", unit.label("mean"), "Of all"))),
    )


def _people(people: Sequence[Mapping[str, Any]]) -> str:
    """Make the table of who is where, and how strong their echoes are."""
    rows = (
        (
            one["name"],
            "({:g}, {:g}) m, {:g}°".format(*one["position_m"], one["heading_deg"]),
            one["material"],
            "-" if one["snr_db"] is None else f"{one['snr_db']:.1f} dB",
        )
        for one in people
    )
    return table(rows, ("", "Place, heading", "Material", "SNR"))


_COSTS = ("wall_s", "warmup_s", "capture_s", "real_time_factor", "peak_memory_mb")


def _cost(summary: Mapping[str, Any]) -> str:
    costs = {name: summary[name] for name in _COSTS if name in summary}
    versions = ((name, str(value)) for name, value in summary.get("versions", {}).items())
    return _tables(
        ("Time and memory", mapping_table(costs)),
        ("Time of each stage", html.stages_table(summary.get("stages", {}))),
        ("Versions", table(versions)),
    )


def _tables(*found: tuple[str, str]) -> str:
    shown = "".join(
        f'<div class="wide"><h3>{title}</h3>{text}</div>\n'
        for title, text in found
        if "<tbody></tbody>" not in text
    )
    return f'<div class="tables">{shown}</div>\n' if shown else ""
