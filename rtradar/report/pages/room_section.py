"""Section of a run's page about its room: plan, clutter, ghosts, and what was left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rtradar.radar import Radar
from rtradar.report.figures.canvas import field_unit
from rtradar.report.pages.html import picture, table, tiles
from rtradar.report.pages.labels import minus

ROOM_PICTURES = ("plan.png", "range_azimuth_walls.png", "clutter_removal.png")
"""Files of pictures that belong to a room, in the order of the section."""

_MOST_ROWS = 16
_KINDS = {
    "mirror": "specular reflection",
    "rough": "diffuse reflection",
    "furniture": "furniture",
    "reflector": "reflector",
}


def room_section(room: Mapping[str, Any], radar: Radar, pictures: Mapping[str, Path]) -> str:
    """Return the HTML of what was found out about a room, from ``summary["room"]``.

    ``pictures`` are those of `ROOM_PICTURES` by their titles.
    """
    clutter = room.get("clutter", {})
    order = sorted(pictures.items(), key=lambda item: ROOM_PICTURES.index(Path(item[1]).name))
    drawn = "".join(picture(title, Path(path)) for title, path in order)
    parts = [
        tiles(_figures(room, clutter)),
        _HOW if "after_removal_db" in clutter else "",
        f'<div class="pictures">{drawn}</div>' if drawn else "",
        _ghosts(room, radar),
        _static(clutter),
        _left_out(room, clutter),
    ]
    return "\n".join(filter(None, parts))


_HOW = """<p class="note">Signal to clutter is the power of the person's direct echoes over that of
all that does not move, in one IF sample. What removal gains is measured in one frame, over the
cells within two Doppler bins of rest; a person who moves slowly is among them, so that it may be
more.</p>"""


def _figures(room: Mapping[str, Any], clutter: Mapping[str, Any]) -> list[tuple[str, str]]:
    found = []
    before = clutter.get("signal_to_clutter_db")
    if before is not None:
        found.append((minus(f"{before:.1f} dB"), "signal to clutter, as received"))
    after = clutter.get("after_removal_db")
    if after is not None:
        found.append((minus(f"\u2265 {after:.1f} dB"), "signal to clutter, after removal"))
    paths = [path for path in room.get("paths", ()) if path["order"]]
    kept = sum(1 for path in paths if path["kept"])
    if paths:
        found.append((f"{kept} of {len(paths)}", "paths over walls are above the noise"))
    if "ghosts" in room:
        ghosts = room["ghosts"]
        found.append((str(len(ghosts["paths"])), f"ghosts at {ghosts['time_s']:.2f} s"))
    return found


def _ghosts(room: Mapping[str, Any], radar: Radar) -> str:
    ghosts = room.get("ghosts")
    if not ghosts or not ghosts["paths"]:
        return ""
    paths = sorted(ghosts["paths"], key=lambda ghost: -ghost["power_m2"])
    unit = field_unit(radar, range_m=np.array([ghost["range_m"] for ghost in paths]))
    levels = unit.level([ghost["power_m2"] for ghost in paths])
    rows = [
        (
            str(ghost["path"]),
            minus(f"{level:.1f}"),
            f"{ghost['range_m']:.2f}",
            minus(f"{ghost['velocity_mps']:+.2f}"),
            minus(f"{ghost['azimuth_deg']:+.1f}"),
        )
        for ghost, level in zip(paths, levels, strict=True)
    ]
    units = f"Power [{unit.name}]", "Range [m]", "Velocity [m/s]", "Azimuth [°]"
    return (
        f"<h3>Ghosts at {ghosts['time_s']:.2f} s</h3>"
        + _first(rows, ("Path, out and back", *units))
        + '<p class="note">A ghost is the person over a wall: it shows where the length of the '
        "path and the direction of its last leg put it, not where anybody is. Each is the mean of "
        "its parts, weighted by power.</p>"
    )


def _static(clutter: Mapping[str, Any]) -> str:
    kept = sorted(clutter.get("kept", ()), key=lambda item: -item["power_m2"])
    if not kept:
        return ""
    total = sum(item["power_m2"] for item in kept) or 1.0
    rows = [
        (item["name"], _KINDS.get(item["kind"], item["kind"]), f"{item['power_m2'] / total:.1%}")
        for item in kept
    ]
    return "<h3>What does not move, by power</h3>" + _first(rows, ("", "Kind", "Of all clutter"))


def _left_out(room: Mapping[str, Any], clutter: Mapping[str, Any]) -> str:
    rows = []
    for path in room.get("paths", ()):
        lacking, all_parts = len(path["dropped"]), len(path["dropped"]) + len(path["kept"])
        if lacking:
            rows.append((path["path"], f"{lacking} of {all_parts} parts", str(path["why"])))
    rows += [
        (item["name"], _KINDS.get(item["kind"], item["kind"]), str(item["reason"]))
        for item in clutter.get("dropped", ())
    ]
    rows += [
        (face["name"], "ghosts over a face", str(face["reason"]))
        for face in room.get("faces", ())
        if face["reason"]
    ]
    if not rows:
        return '<h3>What was left out</h3><p class="note">Nothing was left out.</p>'
    return "<h3>What was left out, and why</h3>" + _first(rows, ("", "What", "Why"))


def _first(rows: Sequence[Sequence[str]], head: Sequence[str]) -> str:
    """Make a table of the first rows, and say how many more there are."""
    more = len(rows) - _MOST_ROWS
    said = f'<p class="note">{more} more are in summary.json.</p>' if more > 0 else ""
    return f'<div class="wide">{table(rows[:_MOST_ROWS], head)}</div>{said}'
