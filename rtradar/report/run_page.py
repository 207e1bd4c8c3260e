"""Run page, ``report.html``: one run in one file that opens without a network."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rtradar.clouds.spatial import SHOWN_DB, SpatialCloud
from rtradar.radar import Radar
from rtradar.report.canvas import central_limits, field_unit
from rtradar.report.html import signal_to_noise, write_page
from rtradar.report.run_view import RunView, linked_views, view_data
from rtradar.report.three_d import rdt_data, spatial_data

ROOM_PICTURES = ("plan.png", "range_azimuth_walls.png", "clutter_removal.png")
"""Files of pictures that belong to a room, in the order of the section."""

_COSTS = ("wall_s", "warmup_s", "capture_s", "real_time_factor", "peak_memory_mb")
_ELSEWHERE = (
    *("parameters", "limits", "stages", "versions", "part_power_m2", "modelled", "room", "people"),
    *(*_COSTS, "fidelity", "seed", "files"),
)
"""Keys of a summary that have a place of their own on the page."""


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
    parameters = dict(summary.get("parameters", {}))
    data: dict[str, Any] = {"rdt": rdt_data(rdt_points)}
    points = np.asarray(rdt_points, dtype=np.float64)
    if spatial is not None:
        data["spatial"] = spatial_data(spatial, radar)
    clouds = dict(data)
    values = _summary(summary, radar) | _room(summary.get("room"), radar, pictures)
    scripts = ["plots.js"]
    if run_view is not None:
        data |= view_data(run_view) | {"name": Path(path).stem}
        scripts += ["figure.js", "linked.js"]
        values |= linked_views(run_view)
    shown = {
        "figure": ("The moving body, its echoes and its maps", run_view),
        "rdt": ("Range-Doppler-time cloud", run_view is None),
        "spatial": ("Spatial cloud", spatial),
        "maps": ("Maps", values["pictures"]),
        "room": ("The room", values["room"]),
        "limits": ("Limits of this result", True),
        "parameters": ("Radar and settings", True),
        "cost": ("Cost", values["costs"] or values["stages"] or values["versions"]),
    }
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


def _room(
    room: Mapping[str, Any] | None, radar: Radar, pictures: Mapping[str, Path]
) -> dict[str, Any]:
    """Return what the page tells about a room, and the pictures that are none of a room."""
    if not room:
        return {"room": None, "pictures": pictures}
    own = {title: path for title, path in pictures.items() if Path(path).name in ROOM_PICTURES}
    ghosts = sorted(room.get("ghosts", {}).get("paths", ()), key=lambda one: -one["power_m2"])
    unit = field_unit(radar, range_m=np.array([ghost["range_m"] for ghost in ghosts]))
    levels = unit.level([ghost["power_m2"] for ghost in ghosts])
    clutter = room.get("clutter", {})
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
        "room_pictures": dict(
            sorted(own.items(), key=lambda one: ROOM_PICTURES.index(Path(one[1]).name))
        ),
        "pictures": {title: path for title, path in pictures.items() if title not in own},
        "ghosts": list(zip(ghosts, levels, strict=True)),
        "ghost_unit": unit,
        "left_out": left_out,
    }
