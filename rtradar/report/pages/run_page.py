"""Run page, ``report.html``: one run in one file that opens without a network."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from rtradar.body import Body
from rtradar.clouds.spatial import SHOWN_DB, SpatialCloud
from rtradar.radar import Radar
from rtradar.report.pages import html
from rtradar.report.pages.html import mapping_table, picture, table, write_page
from rtradar.report.view.three_d import figure_data, rdt_data, spatial_data

_FIGURE = f"""<section id="figure"><h2>The recording before the radar</h2>
<div class="scene tall" id="scene-figure"></div>
{html.player()}
<p class="note">Each ellipsoid is a body part of the echo model, the line inside it its bone.
Drag to turn, scroll to come nearer. World axes: x from the radar to the person, y to the left seen
from the radar, z up.</p></section>
"""


def write_report(
    path: str | Path,
    *,
    body: Body,
    radar: Radar,
    summary: Mapping[str, Any],
    pictures: Mapping[str, Path],
    rdt_points: ArrayLike,
    spatial: SpatialCloud | None = None,
) -> None:
    """Write a run as a page with a moving figure, rotatable clouds, pictures and tables.

    The file includes plotly.js (about 5 MB), and its content security policy forbids any request.

    Parameters
    ----------
    path : path
        HTML file.
    body : Body
        Body at its position before the radar.
    radar : Radar
        Radar of the run, whose limits and settings are listed.
    summary : mapping
        Values of ``summary.json``. ``parameters``, ``fidelity``, ``limits``, ``stages``,
        ``versions`` and ``part_power_m2`` have sections of their own; other numbers and texts are
        listed under their names.
    pictures : mapping of title to path
        PNG files in the order of the page.
    rdt_points : (point, 3)
        Time [s], range [m] and velocity [m/s] of each point.
    spatial : SpatialCloud, optional
        Spatial cloud, shown as a whole and frame by frame around the moving figure.

    Raises
    ------
    InputError
        If a picture is missing or is not a PNG file, or ``rdt_points`` has a wrong shape or values
        that are not finite.
    """
    parameters = summary.get("parameters", {})
    spreading = bool(parameters.get("spreading", True))
    figure = figure_data(body, radar, summary.get("part_power_m2"), spreading=spreading)
    data = {"figure": figure, "rdt": rdt_data(rdt_points)}
    if spatial is not None:
        data["spatial"] = spatial_data(spatial)
    fidelity = str(summary.get("fidelity", ""))
    subtitle = ", ".join(filter(None, (f"radar {radar.name}", fidelity and f"fidelity {fidelity}")))
    write_page(
        path,
        html.Titles("rtradar report", str(parameters.get("motion", "Recording")), subtitle),
        html.limits_box(summary.get("limits", ())) + "\n" + html.tiles(_headline(summary)),
        chain((_FIGURE, _clouds(data)), _pictures(pictures), (_tables(summary, radar),)),
        data=data,
        scripts=("plots.js", "figure.js", "report.js"),
    )


def _headline(summary: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    for name, form, caption in (
        ("capture_s", "{:.2f} s", "of radar"),
        ("wall_s", "{:.1f} s", "to compute"),
        ("real_time_factor", "{:.2g} s", "for each second of radar"),
        ("peak_memory_mb", "{:.0f} MB", "peak memory"),
        ("detections", "{:,}", "detections"),
    ):
        if name in summary:
            yield form.format(summary[name]).replace(",", "\u202f"), caption


def _clouds(data: Mapping[str, Any]) -> str:
    note = "The surface about the detections of all windows, sampled."
    views = [("rdt", "Range-Doppler-time cloud", note)]
    if "spatial" in data:
        note = f"Where detected cells are, down to {SHOWN_DB:g} dB below the strongest; world axes."
        measured = dict(zip("xyz", data["spatial"]["measured"], strict=True))
        if not all(measured.values()):
            angle = "azimuth" if measured["z"] else "elevation"
            note += (
                f" An array on one line does not measure {angle}: "
                "x is the distance from that line, added to the radar's x."
            )
        views.append(("spatial", "Spatial cloud", note))
    parts = []
    for name, title, note in views:
        cloud = data[name]
        shown, count = cloud["shown"], cloud["count"]
        thinned = "" if shown == count else f" {shown} of {count} points are shown."
        scene = f'<div class="scene" id="scene-{name}"></div>'
        if not count:
            scene = '<p class="empty">Nothing was detected.</p>'
        parts.append(
            f'<section id="{name}"><h2>{title}</h2>{scene}'
            f'<p class="note">{note}{thinned}</p></section>\n'
        )
    return f'<div class="clouds">{"".join(parts)}</div>\n'


def _pictures(pictures: Mapping[str, Path]) -> Iterator[str]:
    if pictures:
        yield '<section id="maps"><h2>Maps</h2><div class="pictures">'
        for title, path in pictures.items():
            yield picture(title, Path(path)) + "\n"
        yield "</div></section>\n"


def _tables(summary: Mapping[str, Any], radar: Radar) -> str:
    parameters = dict(summary.get("parameters", {}))
    settings = parameters.pop("radar", {})
    own = ("parameters", "limits", "stages", "versions", "part_power_m2", "modelled")
    modelled = summary.get("modelled", {})
    models = {**modelled.get("ways", {}), **modelled.get("why", {})}
    power = summary.get("part_power_m2", {})
    total = sum(power.values()) or 1.0
    powers = ((name, f"{value:.3g} m²", f"{value / total:.1%}") for name, value in power.items())
    versions = ((name, str(value)) for name, value in summary.get("versions", {}).items())
    others = {key: value for key, value in summary.items() if key not in own}
    fractions = ((name, f"{value:.1%}") for name, value in models.items())
    sections = (
        ("Derived limits of the radar", html.limits_table(radar)),
        ("Time of each stage", html.stages_table(summary.get("stages", {}))),
        ("How parts were modelled, of all parts and time", table(fractions)),
        ("Parameters", mapping_table(parameters)),
        ("Radar", mapping_table(settings)),
        ("Capture", mapping_table(others)),
        ("Echo power by part", table(powers)),
        ("Versions", table(versions)),
    )
    shown = (
        f"<section><h2>{title}</h2>{text}</section>\n" for title, text in sections if "<tr>" in text
    )
    return f'<div class="tables">{"".join(shown)}</div>\n'
