"""``rtradar view``: body, room, paths and echoes, linked to the maps and the cloud of the same moment, on one page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rtradar.report.figures.part_groups import GROUPS, group_of_parts
from rtradar.report.pages.frame import player, write_page
from rtradar.report.view.run_view import Linked
from rtradar.report.view.snapshots import Moments
from rtradar.report.view.three_d import packed_floats, posed_figure, rdt_data, spatial_data

COLOURS = ("part", "power", "velocity")
"""What colours may mean."""

VELOCITY_COLOURS = (
    (0.0, "#0b2e6b"),
    (0.25, "#1f6fd6"),
    (0.44, "#79b4f0"),
    (0.5, "#9a9aa2"),
    (0.56, "#f0a184"),
    (0.75, "#d9371f"),
    (1.0, "#6b0f0f"),
)
"""From approaching to receding; slow rates, which most of a body has, differ from rest at sight."""

_BODY = """<div class="linked">
<section><h2>Body and paths</h2><div class="scene" id="scene-figure"></div></section>
<section><h2>Range-Doppler map of this window, and where echoes are</h2><div class="scene" id="scene-map"></div></section>
<section><h2>Range-Doppler-time cloud</h2>$cloud</section>
<section><h2>Spectrogram</h2>$spectrogram</section>
</div>
<p class="note">Each ellipsoid is a body part of the echo model. Lines are paths from the middle of the array to where the part
mirrors it, and back; dots on the map are the same echoes, diamonds those over walls. Shown is what stands above the floor of the
map. Grey parts are hidden from the radar; grey points of the cloud are far from any echo. A click on the spectrogram goes to its
time.</p>
"""


def _controls(colour: str) -> str:
    options = "".join(
        f'<option value="{name}"{" selected" if name == colour else ""}>{name}</option>'
        for name in COLOURS
    )
    legend = "".join(
        f'<span><i style="background:{tint}"></i>{name}</span>' for name, tint in GROUPS.items()
    )
    return player(
        f'<label>Colour by <select id="colour">{options}</select></label>'
        '<label>Paths <select id="paths"><option value="all">all</option><option value="direct">direct</option>'
        '<option value="none">none</option></select></label>'
        '<button type="button" id="save">Save as PNG</button>'
        f'<div class="groups" id="groups">{legend}</div>'
    )


def write_view(
    path: str | Path, linked: Linked, *, name: str = "view", colour: str = "part"
) -> None:
    """Write the page, in one file that opens without a network.

    Parameters
    ----------
    path : path
        HTML file; replaced whole or not at all.
    linked : Linked
    name : str
        Of pictures that the page saves, without ``.png``.
    colour : {"part", "power", "velocity"}
        What colours mean when it opens.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    scene = '<div class="scene" id="scene-{}"></div>'
    cloud = (
        scene.format("rdt")
        if len(linked.rdt_points)
        else '<p class="empty">Nothing was detected.</p>'
    )
    long_enough = linked.spectrogram.level.size > 0
    spectrogram = (
        scene.format("spectrogram")
        if long_enough
        else '<p class="empty">The capture is too short for one.</p>'
    )
    write_page(
        path,
        kind="rtradar view",
        heading=linked.heading,
        subtitle=linked.subtitle,
        top=_controls(colour),
        body=(_BODY.replace("$cloud", cloud).replace("$spectrogram", spectrogram),),
        data=linked_data(linked) | {"name": name},
        scripts=("plots.js", "figure.js", "linked.js"),
    )


def linked_data(linked: Linked) -> dict[str, Any]:
    """All that the page's script draws, ready for JSON."""
    moments, radar = linked.moments, linked.radar
    figure = posed_figure(moments.part_names.tolist(), moments.times, moments.poses, radar)
    figure["ranges"] = _with_room(figure["ranges"], moments)
    group = linked.rdt_group()
    shown = rdt_data(linked.rdt_points)
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
            "power_db": packed_floats(linked.power_db),
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
        "power_label": linked.power_unit.label("of an echo"),
        "power_unit": linked.power_unit.name,
        "power_range_db": list(linked.power_range_db),
        "fastest_mps": linked.fastest_mps,
        "max_velocity_mps": radar.max_velocity_mps,
        "map": linked.range_doppler.packed() | {"box": linked.shown_box()},
        "spectrogram": linked.spectrogram.packed(),
        "rdt": shown
        | {
            "power_db": packed_floats(linked.rdt_power_db[::every]),
            "group": group[::every].tolist(),
        },
        "spatial": spatial_data(linked.spatial),
    }


def _with_room(ranges: list[list[float]], moments: Moments) -> list[list[float]]:
    """A box that holds walls and furniture, too, in half metres."""
    places = np.concatenate(
        [moments.walls.reshape(-1, 3), moments.furniture_vertices, np.array(ranges).T]
    )
    low, high = (
        np.floor(2 * places.min(axis=0) - 1e-6) / 2,
        np.ceil(2 * places.max(axis=0) + 1e-6) / 2,
    )
    low[2] = 0.0 if low[2] > -0.6 else low[2]
    return [[float(a), float(b)] for a, b in zip(low, high, strict=True)]
