"""Run page, ``report.html``: one run in one file that opens without a network."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rtradar.clouds.spatial import SHOWN_DB
from rtradar.radar import Radar
from rtradar.report.canvas import central_limits, field_unit
from rtradar.report.html import signal_to_noise, write_page
from rtradar.report.maps import ShownMap
from rtradar.report.plots import Plots
from rtradar.report.rooms import CIRCLES, ShownRoom, key_of
from rtradar.report.run_view import RunView, linked_views, view_data
from rtradar.report.three_d import rdt_data, spatial_data

_COSTS = ("wall_s", "warmup_s", "capture_s", "real_time_factor", "peak_memory_mb")
_ELSEWHERE = (
    *("parameters", "limits", "stages", "versions", "part_power_m2", "modelled", "room", "people"),
    *(*_COSTS, "fidelity", "seed", "files"),
)
"""Keys of a summary that have a place of their own on the page."""


def write_report(
    path: str | Path,
    plots: Plots,
    *,
    room: ShownRoom | None = None,
    run_view: RunView | None = None,
) -> None:
    """Write a run as a page: what was seen, body and maps that move together, and tables.

    The file includes plotly.js (2.0 MB), and its content security policy forbids any request.

    Parameters
    ----------
    path : path
        HTML file.
    plots : Plots
        Maps, clouds, radar and summary of the run. Values of the summary that have no place of
        their own on the page are listed in words; any may be missing.
    room : ShownRoom, optional
        Room around the person.
    run_view : RunView, optional
        Data of the views that one slider moves, at as many moments as it has. Without it, as for
        samples that were measured, the page has no moving body.

    Raises
    ------
    InputError
        If the points of the cloud are not finite.
    """
    radar, summary, points = plots.radar, plots.summary, plots.points
    # Data of the script: both clouds, and all maps.
    parameters = dict(summary.get("parameters", {}))
    data: dict[str, Any] = {"rdt": rdt_data(points)}
    data["spatial"] = spatial_data(plots.spatial_cloud, radar)
    clouds = dict(data)
    values = _summary(summary, radar) | _room(summary.get("room"), radar)
    shown_maps = [_captioned(one) for one in plots.shown]
    of_room = [] if room is None else _maps_of(room)
    # The script draws all maps by their numbers.
    data["maps"] = [*shown_maps, *of_room]
    values |= {"maps": shown_maps, "room_maps": of_room}
    scripts = ["plots.js"]
    # With a moving body the page has the script of the linked views.
    if run_view is not None:
        data |= view_data(run_view) | {"name": Path(path).stem}
        scripts += ["figure.js", "linked.js"]
        values |= linked_views(run_view)
    # Sections in their order, each where there is something to show.
    shown = {
        "figure": ("The moving body, its echoes and its maps", run_view),
        "rdt": ("Range-Doppler-time cloud", run_view is None),
        "spatial": ("Spatial cloud", True),
        "maps": ("Maps", shown_maps),
        "room": ("The room", values["room"]),
        "limits": ("Limits of this result", True),
        "parameters": ("Radar and settings", True),
        "cost": ("Cost", values["costs"] or values["stages"] or values["versions"]),
    }
    # What the head of the page says.
    fidelity, scene = (str(summary.get("fidelity", "")), str(parameters.get("scene", "")))
    told = (f"radar {radar.name}", fidelity and f"fidelity {fidelity}", scene)
    values |= {
        "kind": "rtradar report",
        "heading": str(parameters.get("motion", "Recording")),
        "subtitle": ", ".join(filter(None, told)),
        "n_points": len(points),
        "spread": central_limits(points) if len(points) else None,
        "ratio": signal_to_noise(summary),
        "sections": {name: title for name, (title, there) in shown.items() if there},
        "radar": radar,
        "clouds": clouds,
        "shown_db": SHOWN_DB,
    }
    write_page(path, "report.html", values, data=data, scripts=(*scripts, "report.js"))


def _summary(summary: Mapping[str, Any], radar: Radar) -> dict[str, Any]:
    """Return the parts of a summary by their places on the page."""
    parameters = dict(summary.get("parameters", {}))
    power = summary.get("part_power_m2", {})
    strongest = max(power.values(), default=1.0)
    return {
        "summary": summary,
        "own_radar": parameters.pop("radar", {}),
        "settings": parameters | {key: summary[key] for key in ("seed",) if key in summary},
        "found": {key: value for key, value in summary.items() if key not in _ELSEWHERE},
        "powers": power,
        # That of the picture of the parts.
        "unit": field_unit(
            radar, spreading=parameters.get("spreading", True), strongest_m2=strongest
        ),
        "costs": {name: summary[name] for name in _COSTS if name in summary},
        "stages": summary.get("stages", {}),
        "versions": summary.get("versions", {}),
    }


def _captioned(shown: ShownMap, note: str = "") -> dict[str, Any]:
    """Return a map as plain values, with what is to be read below it."""
    made = shown.made.replace("\n", "; ")
    said = (made and f"{made[0].upper()}{made[1:]}.", shown.colours, note, shown.note)
    title = shown.heading.replace("\n", " ")
    return shown.packed() | {"title": title, "note": " ".join(filter(None, said))}


def _maps_of(room: ShownRoom) -> list[dict[str, Any]]:
    """Return plan and maps of a room as plain values, in the order of the section."""
    circles = key_of(CIRCLES, room.key)
    found = [_captioned(one, circles) for one in (*room.azimuth, *room.before_after)]
    return [room.plan() | {"title": "Plan of the room, with paths"}, *found]


def _room(room: Mapping[str, Any] | None, radar: Radar) -> dict[str, Any]:
    """Return what the page tells about a room."""
    if not room:
        return {"room": None}
    # The strongest ghosts first, with their levels.
    ghosts = sorted(room.get("ghosts", {}).get("paths", ()), key=lambda one: -one["power_m2"])
    unit = field_unit(radar, range_m=np.array([ghost["range_m"] for ghost in ghosts]))
    levels = unit.level([ghost["power_m2"] for ghost in ghosts])
    clutter = room.get("clutter", {})
    # Paths, pieces and faces that were left out, each with the reason.
    left_out: list[tuple[Any, ...]] = []
    for path in room.get("paths", ()):
        if lacking := len(path["dropped"]):
            parts = f"{lacking} of {lacking + len(path['kept'])} parts"
            left_out.append((path["path"], parts, path["why"]))
    left_out += [(one["name"], one["kind"], one["reason"]) for one in clutter.get("dropped", ())]
    faces = (face for face in room.get("faces", ()) if face["reason"])
    left_out += [(face["name"], "ghosts over a face", face["reason"]) for face in faces]
    return {
        "room": room,
        "ghosts": list(zip(ghosts, levels, strict=True)),
        "ghost_unit": unit,
        "left_out": left_out,
    }
