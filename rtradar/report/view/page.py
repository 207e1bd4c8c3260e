"""View page: body, room, paths and echoes beside the maps and the cloud of the same time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rtradar.report.pages.html import Titles, player, write_page
from rtradar.report.view.run_view import GROUPS, RunView, group_of_parts
from rtradar.report.view.snapshots import Moments
from rtradar.report.view.three_d import packed_floats, posed_figure, rdt_data, spatial_data

COLOURS = ("part", "power", "velocity")
"""Quantities that colours may show."""

VELOCITY_COLOURS = (
    (0.0, "#0b2e6b"),
    (0.25, "#1f6fd6"),
    (0.44, "#79b4f0"),
    (0.5, "#9a9aa2"),
    (0.56, "#f0a184"),
    (0.75, "#d9371f"),
    (1.0, "#6b0f0f"),
)
"""Colour scale from approaching to receding, in which slow motion differs clearly from rest."""

_BODY = """<div class="linked">
<section><h2>Body and paths</h2><div class="scene" id="scene-figure"></div></section>
<section><h2>Range-Doppler map of this window, and where echoes are</h2>
<div class="scene" id="scene-map"></div></section>
<section><h2>Range-Doppler-time cloud</h2>$cloud</section>
<section><h2>Spectrogram</h2>$spectrogram</section>
</div>
<p class="note">Each ellipsoid is a body part of the echo model. Lines are paths from the middle of
the array to the specular point of the part, and back; dots on the map are the same echoes,
diamonds those over walls. Shown are echoes above the floor of the map. Grey parts are hidden from
the radar; grey points of the cloud are far from any echo. A click on the spectrogram goes to its
time.</p>
"""


def _controls(colour: str) -> str:
    chosen = {name: " selected" if name == colour else "" for name in COLOURS}
    options = "".join(f'<option value="{n}"{mark}>{n}</option>' for n, mark in chosen.items())
    tints = (
        f'<span><i style="background:{tint}"></i>{name}</span>' for name, tint in GROUPS.items()
    )
    legend = "".join(tints)
    return player(
        f'<label>Colour by <select id="colour">{options}</select></label>'
        '<label>Paths <select id="paths"><option value="all">all</option>'
        '<option value="direct">direct</option><option value="none">none</option></select></label>'
        '<button type="button" id="save">Save as PNG</button>'
        f'<div class="groups" id="groups">{legend}</div>'
    )


def write_view(
    path: str | Path, run_view: RunView, *, name: str = "view", colour: str = "part"
) -> None:
    """Write the view page as one file that opens without a network.

    Pictures that the page saves are called ``name``. When it opens, colours show ``colour``, one of
    `COLOURS`. InputError if the file cannot be written.
    """
    cloud, spectrogram = (
        f'<div class="scene" id="scene-{view}"></div>' for view in ("rdt", "spectrogram")
    )
    if not len(run_view.rdt_points):
        cloud = '<p class="empty">Nothing was detected.</p>'
    if not run_view.spectrogram.level.size:
        spectrogram = '<p class="empty">The capture is too short for one.</p>'
    write_page(
        path,
        Titles("rtradar view", run_view.heading, run_view.subtitle),
        _controls(colour),
        (_BODY.replace("$cloud", cloud).replace("$spectrogram", spectrogram),),
        data=view_data(run_view) | {"name": name},
        scripts=("plots.js", "figure.js", "linked.js"),
    )


def view_data(run_view: RunView) -> dict[str, Any]:
    """Return the data of the page's script as plain values for JSON."""
    moments, radar = run_view.moments, run_view.radar
    figure = posed_figure(moments.part_names.tolist(), moments.times, moments.poses, radar)
    figure["ranges"] = _with_room(figure["ranges"], moments)
    group = run_view.rdt_group()
    shown = rdt_data(run_view.rdt_points)
    every = -(-shown["count"] // max(shown["shown"], 1)) or 1
    return {
        "figure": figure,
        "echoes": {
            "paths": moments.path_names.tolist(),
            "path": moments.echo_path.tolist(),
            "part": moments.echo_part.tolist(),
            "bounces": moments.echo_bounces.tolist(),
            "range_m": packed_floats(moments.range_m),
            "velocity_mps": packed_floats(moments.velocity_mps),
            "power_db": packed_floats(run_view.power_db),
            "corners": packed_floats(moments.corners),
            "radar_m": list(radar.position_m),
        },
        "room": {
            "walls": np.round(moments.walls, 4).tolist(),
            "furniture": moments.furniture_names.tolist(),
            "vertices": packed_floats(moments.furniture_vertices),
            "faces": moments.furniture_faces.ravel().tolist(),
            "piece": moments.furniture_piece.tolist(),
        },
        "groups": {
            "names": list(GROUPS),
            "colours": list(GROUPS.values()),
            "of_part": group_of_parts(moments.part_names.tolist()),
        },
        "velocity_colours": VELOCITY_COLOURS,
        "power_label": run_view.power_unit.label("of an echo"),
        "power_unit": run_view.power_unit.name,
        "power_range_db": list(run_view.power_range_db),
        "fastest_mps": run_view.fastest_mps,
        "max_velocity_mps": radar.max_velocity_mps,
        "map": run_view.range_doppler.packed() | {"box": run_view.shown_box()},
        "spectrogram": run_view.spectrogram.packed(),
        "rdt": shown
        | {
            "power_db": packed_floats(run_view.rdt_power_db[::every]),
            "group": group[::every].tolist(),
        },
        "spatial": spatial_data(run_view.spatial),
    }


def _with_room(ranges: list[list[float]], moments: Moments) -> list[list[float]]:
    """Extend the limits of the axes to walls and furniture, rounded to half metres."""
    places = np.concatenate(
        [moments.walls.reshape(-1, 3), moments.furniture_vertices, np.array(ranges).T]
    )
    low = np.floor(2 * places.min(axis=0) - 1e-6) / 2
    high = np.ceil(2 * places.max(axis=0) + 1e-6) / 2
    low[2] = 0.0 if low[2] > -0.6 else low[2]
    return [[float(a), float(b)] for a, b in zip(low, high, strict=True)]
