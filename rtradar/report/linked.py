"""``rtradar view``: body, room, paths and echoes, linked to the maps and the cloud of the same moment, on one page."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds.spatial import SpatialCloud
from rtradar.radar import Radar
from rtradar.report.moments import Moments
from rtradar.report.page import player, write_page
from rtradar.report.viewer import packed_floats, posed_figure, rdt_data, spatial_data

COLOURS = ("part", "power", "velocity")
"""What colours may mean."""

GROUPS = {
    "head, neck": "#cc79a7",
    "torso": "#3f7fd1",
    "left arm": "#56b4e9",
    "right arm": "#009e73",
    "left leg": "#e69f00",
    "right leg": "#d55e00",
    "no part near": "#8c8c94",
}
"""Names and colours of groups of parts; the last is of what belongs to none."""

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

_LIMBS = {"clavicle": "arm", "upper arm": "arm", "forearm": "arm", "hand": "arm"}
_NEAREST_BINS = 4.0
"""A point of the cloud farther than this from any echo is of none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Levels:
    """Maps in decibels, coarse enough to be small.

    Parameters
    ----------
    level : (map, row, column) uint8
        Power is ``low_db + step_db level``.
    low_db, step_db : float
        [dB re 1 m^2]
    across, up : (float, float)
        Value of the first column or row, and from one to the next.
    """

    level: NDArray[np.uint8]
    low_db: float
    step_db: float
    across: tuple[float, float]
    up: tuple[float, float]

    @property
    def high_db(self) -> float:
        """Of the highest level that colours reach."""
        return self.low_db + self.step_db * MOST_LEVEL

    def packed(self) -> dict[str, Any]:
        """Ready for JSON; ``levels`` is base64 of what zlib makes of them."""
        return {
            "levels": base64.b64encode(zlib.compress(self.level.tobytes(), 9)).decode(),
            "shape": list(self.level.shape[1:]),
            "x": list(self.across),
            "y": list(self.up),
            "low_db": self.low_db,
            "high_db": self.high_db,
            "step_db": self.step_db,
        }


MOST_LEVEL = 250


@dataclass(frozen=True, kw_only=True, eq=False)
class Linked:
    """What a run left, as the page and its stills show it.

    Parameters
    ----------
    heading, subtitle : str
    moments : Moments
    radar : Radar
        Where it stands in the scene.
    range_doppler : Levels
        One map a step, mean of the channels.
    spectrogram : Levels
        One map, time across and velocity up; without columns where the capture is too short for it.
    rdt_points : (point, 3) float64
        Time [s], range [m], velocity [m/s].
    rdt_power_db : (point,) float64
        Of the range-Doppler map there [dB re 1 m^2].
    spatial : SpatialCloud
    """

    heading: str
    subtitle: str
    moments: Moments
    radar: Radar
    range_doppler: Levels
    spectrogram: Levels
    rdt_points: NDArray[np.float64]
    rdt_power_db: NDArray[np.float64]
    spatial: SpatialCloud

    @property
    def power_db(self) -> NDArray[np.float64]:
        """Power of each echo (step, echo) [dB re 1 m^2]; NaN where hidden."""
        power = self.moments.power_m2
        return np.asarray(np.where(power > 0, 10 * np.log10(np.where(power > 0, power, 1.0)), np.nan))

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which echoes (step, echo) would stand above the floor of the maps."""
        return np.asarray(np.nan_to_num(self.power_db, nan=-np.inf) >= self.range_doppler.low_db)

    @property
    def power_range_db(self) -> tuple[float, float]:
        """Of colours, from the floor of the maps to the strongest echo [dB re 1 m^2]."""
        low_db = self.range_doppler.low_db
        return low_db, float(np.nanmax(self.power_db, initial=low_db + 1.0))

    @property
    def fastest_mps(self) -> float:
        """Largest rate of range that colours reach [m/s]."""
        rates = [*np.abs(self.moments.velocity_mps[self.seen]), *np.abs(self.rdt_points[:, 2]), 0.1]
        return float(max(rates))

    def shown_box(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Velocities [m/s] and ranges [m] where echoes and detections are at any time, with a margin, inside the map."""
        moments, levels = self.moments, self.range_doppler
        found = []
        for values, points, margin, (first, step), count in (
            (self.shown_velocity(), self.rdt_points[:, 2], 1.0, levels.across, levels.level.shape[2]),
            (moments.range_m, self.rdt_points[:, 1], 0.5, levels.up, levels.level.shape[1]),
        ):
            least, most = first - step / 2, first + step * (count - 0.5)
            inside = np.concatenate([values[self.seen], points])
            inside = inside[(inside >= least) & (inside <= most)]
            if len(inside):
                least, most = max(least, float(inside.min()) - margin), min(most, float(inside.max()) + margin)
            found.append((least, most))
        return found[0], found[1]

    def shown_velocity(self) -> NDArray[np.float64]:
        """Where echoes (step, echo) show on the velocity axis [m/s]: beyond the unambiguous velocity at another."""
        most = self.radar.max_velocity_mps
        return np.asarray((self.moments.velocity_mps + most) % (2 * most) - most)

    def rdt_group(self) -> NDArray[np.int64]:
        """Group of parts of each point of the cloud (point,): that of the nearest echo of its moment, by bins."""
        moments, radar = self.moments, self.radar
        steps = np.abs(self.rdt_points[:, :1] - moments.times).argmin(axis=1) if len(self.rdt_points) else np.zeros(0, int)
        groups = np.array(group_of_parts(moments.part_names.tolist()))[moments.echo_part]
        seen, velocity = self.seen, self.shown_velocity()
        found = np.full(len(steps), len(GROUPS) - 1)
        for point, step in enumerate(steps):
            own = np.flatnonzero(seen[step])
            if len(own):
                bins = np.hypot(
                    (moments.range_m[step, own] - self.rdt_points[point, 1]) / radar.range_bin_m,
                    (velocity[step, own] - self.rdt_points[point, 2]) / radar.velocity_bin_mps,
                )
                if bins.min() <= _NEAREST_BINS:
                    found[point] = groups[own[bins.argmin()]]
        return found


def group_of_parts(parts: Sequence[str]) -> list[int]:
    """Number of each part's group in `GROUPS`."""
    names = list(GROUPS)
    found = []
    for part in parts:
        side, _, limb = part.partition(" ")
        group = f"{side} {_LIMBS.get(limb, 'leg')}" if side in ("left", "right") else "torso" if "torso" in part else "head, neck"
        found.append(names.index(group))
    return found


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
    options = "".join(f'<option value="{name}"{" selected" if name == colour else ""}>{name}</option>' for name in COLOURS)
    legend = "".join(f'<span><i style="background:{tint}"></i>{name}</span>' for name, tint in GROUPS.items())
    return player(
        f'<label>Colour by <select id="colour">{options}</select></label>'
        '<label>Paths <select id="paths"><option value="all">all</option><option value="direct">direct</option>'
        '<option value="none">none</option></select></label>'
        '<button type="button" id="save">Save as PNG</button>'
        f'<div class="groups" id="groups">{legend}</div>'
    )


def write_view(path: str | Path, linked: Linked, *, name: str = "view", colour: str = "part") -> None:
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
    cloud = scene.format("rdt") if len(linked.rdt_points) else '<p class="empty">Nothing was detected.</p>'
    long_enough = linked.spectrogram.level.size > 0
    spectrogram = scene.format("spectrogram") if long_enough else '<p class="empty">The capture is too short for one.</p>'
    write_page(
        path,
        kind="rtradar view",
        heading=linked.heading,
        subtitle=linked.subtitle,
        top=_controls(colour),
        body=_BODY.replace("$cloud", cloud).replace("$spectrogram", spectrogram),
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
        "power_range_db": list(linked.power_range_db),
        "fastest_mps": linked.fastest_mps,
        "max_velocity_mps": radar.max_velocity_mps,
        "map": linked.range_doppler.packed() | {"box": linked.shown_box()},
        "spectrogram": linked.spectrogram.packed(),
        "rdt": shown | {"power_db": packed_floats(linked.rdt_power_db[::every]), "group": group[::every].tolist()},
        "spatial": spatial_data(linked.spatial),
    }


def _with_room(ranges: list[list[float]], moments: Moments) -> list[list[float]]:
    """A box that holds walls and furniture, too, in half metres."""
    places = np.concatenate([moments.walls.reshape(-1, 3), moments.furniture_vertices, np.array(ranges).T])
    low, high = np.floor(2 * places.min(axis=0) - 1e-6) / 2, np.ceil(2 * places.max(axis=0) + 1e-6) / 2
    low[2] = 0.0 if low[2] > -0.6 else low[2]
    return [[float(a), float(b)] for a, b in zip(low, high, strict=True)]
