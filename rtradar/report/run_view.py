"""Run view: data of a run for ``rtradar view`` and its still pictures, and its page.

The page has body, room, paths and echoes beside the maps and the cloud of the same time.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds.spatial import SpatialCloud
from rtradar.radar import Radar
from rtradar.report.canvas import FieldUnit, central_limits, field_unit
from rtradar.report.html import write_page
from rtradar.report.maps import Levels
from rtradar.report.snapshots import Snapshots
from rtradar.report.three_d import (
    packed,
    posed_figure,
    rdt_data,
    spatial_data,
)

COLOURS = ("person", "part", "power", "velocity")
"""Quantities that colours may show."""

_TINTS = tomllib.loads(Path(__file__).with_name("colours.toml").read_text(encoding="utf-8"))

VELOCITY_COLOURS: list[tuple[float, str]] = _TINTS["velocity"]
"""Colour scale from approaching to receding."""

GROUPS: dict[str, str] = _TINTS["groups"]
"""Names and colours of the groups of body parts; the last is for what belongs to none."""

_ARM = ("clavicle", "upper arm", "forearm", "hand")


def group_of_parts(parts: Sequence[str]) -> list[int]:
    """Return the index in `GROUPS` of each part's group."""
    names = list(GROUPS)
    found = []
    for part in parts:
        # Of several people, "NAME: part".
        side, _, limb = part.rpartition(": ")[2].partition(" ")
        group = "torso" if "torso" in part else "head, neck"
        if side in ("left", "right"):
            group = f"{side} {'arm' if limb in _ARM else 'leg'}"
        found.append(names.index(group))
    return found


_LOOKED_AT = 40  # snapshots at which moving meshes must be inside of the axes

_NEAREST_BINS = 4.0  # a point of the cloud farther from any echo belongs to none


@dataclass(frozen=True, kw_only=True, eq=False)
class RunView:
    """Data of a run that the view page and its still pictures show.

    ``snapshots`` show body and echoes, and ``radar`` is at its position in the scene.
    ``range_doppler`` has one map, the mean of the channels, for each snapshot; ``spectrogram`` one
    map, time across and velocity up, without columns if the capture is too short. ``rdt_points``
    (point, 3) are time [s], range [m] and velocity [m/s], and ``rdt_power_db`` (point,) the power
    of the range-Doppler map there, in its unit [dB]. ``rdt_source`` (point,) is who returned most
    of the point, as an index of `Snapshots.sources`, -1 for the room or nobody.
    """

    heading: str
    subtitle: str
    snapshots: Snapshots
    radar: Radar
    range_doppler: Levels
    spectrogram: Levels
    rdt_points: NDArray[np.float64]
    rdt_power_db: NDArray[np.float64]
    rdt_source: NDArray[np.int64]
    spatial: SpatialCloud
    spreading: bool = True

    @property
    def colour(self) -> str:
        """Which of `COLOURS` tells most: the person of several, the body part of one."""
        return "person" if len(self.snapshots.sources) > 1 else "part"

    @property
    def source_names(self) -> list[str]:
        """Names of people, then of objects, and at the end what is of neither."""
        return [*self.snapshots.sources, "room or noise"]

    @property
    def source_colours(self) -> list[str]:
        """Colours of `source_names`."""
        count = len(self.snapshots.sources)
        return [*islice(cycle(_TINTS["sources"]), count), GROUPS["no part near"]]

    @property
    def power_unit(self) -> FieldUnit:
        """Unit of the power of each echo (step, echo), the same as of the range-Doppler map."""
        return field_unit(self.radar, spreading=self.spreading, range_m=self.snapshots.range_m)

    @property
    def power_db(self) -> NDArray[np.float64]:
        """Power of each echo (step, echo) in `power_unit` [dB]; NaN if it is occluded."""
        power = self.snapshots.power_m2
        return np.where(power > 0, self.power_unit.level(power), np.nan)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Whether each echo (step, echo) is above the floor of the maps."""
        return np.asarray(np.nan_to_num(self.power_db, nan=-np.inf) >= self.range_doppler.low_db)

    @property
    def power_range_db(self) -> tuple[float, float]:
        """Limits of the colour scale [dB], from the floor of the maps to the strongest echo."""
        low_db = self.range_doppler.low_db
        return low_db, float(np.nanmax(self.power_db, initial=low_db + 1.0))

    @property
    def fastest_mps(self) -> float:
        """Largest range rate of the colour scale [m/s]."""
        rates = np.append(self.snapshots.velocity_mps[self.seen], self.rdt_points[:, 2])
        return float(np.abs(rates).max(initial=0.1))

    def thinned(self, most_steps: int, rate_hz: float) -> RunView:
        """Return a copy of at most so many snapshots, at no more than this rate [Hz]."""
        every = self.snapshots.stride(most_steps, rate_hz)
        levels = replace(self.range_doppler, level=self.range_doppler.level[::every])
        return replace(self, snapshots=self.snapshots.every(every), range_doppler=levels)

    def shown_box(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the limits in velocity [m/s] and range [m] of echoes and points, with a margin.

        One point in a hundred at either end, such as a false alarm, does not set them.
        """
        snapshots, levels = self.snapshots, self.range_doppler

        def box(
            values: NDArray[np.float64], column: int, margin: float, axis: tuple[float, float]
        ) -> tuple[float, float]:
            (first, step), count = axis, levels.level.shape[column]
            least, most = first - step / 2, first + step * (count - 0.5)
            points = self.rdt_points[:, column]
            # Echoes and points that are on the axis set the limits; without any, the whole axis is
            # shown.
            if len(points):
                points = central_limits(points)
            inside = np.concatenate([values[self.seen], points])
            inside = inside[(inside >= least) & (inside <= most)]
            if not len(inside):
                return least, most
            low, high = float(inside.min()) - margin, float(inside.max()) + margin
            return max(least, low), min(most, high)

        velocity = box(self.shown_velocity(), 2, 1.0, levels.across)
        return velocity, box(snapshots.range_m, 1, 0.5, levels.up)

    def shown_velocity(self) -> NDArray[np.float64]:
        """Return the aliased velocity of each echo (step, echo) [m/s], as on the velocity axis."""
        most = self.radar.max_velocity_mps
        return np.asarray((self.snapshots.velocity_mps + most) % (2 * most) - most)

    def rdt_group(self) -> NDArray[np.int64]:
        """Return the group of body parts of each point (point,), that of the nearest echo."""
        snapshots, radar = self.snapshots, self.radar
        # The echo nearest to a point, in bins, among those that are seen in the snapshot nearest in
        # time.
        steps = np.abs(self.rdt_points[:, :1] - snapshots.times).argmin(axis=1)
        groups = np.array(group_of_parts(snapshots.part_names.tolist()))[snapshots.echo_part]
        seen, velocity = self.seen, self.shown_velocity()
        found = np.full(len(steps), len(GROUPS) - 1)
        for point, step in enumerate(steps):
            own = np.flatnonzero(seen[step])
            if len(own):
                bins = np.hypot(
                    (snapshots.range_m[step, own] - self.rdt_points[point, 1]) / radar.range_bin_m,
                    (velocity[step, own] - self.rdt_points[point, 2]) / radar.velocity_bin_mps,
                )
                if bins.min() <= _NEAREST_BINS:
                    found[point] = groups[own[bins.argmin()]]
        return found


def linked_views(run_view: RunView, colour: str | None = None, layout: str = "") -> dict[str, Any]:
    """Return the values of the template ``linked.html``, the linked views with their controls.

    Colours show ``colour``, one of `COLOURS`, until the reader chooses another; by default the view
    has one. ``layout`` is another class of the element for the page's style sheet.
    """
    return {
        "view": run_view,
        "colours": COLOURS,
        "colour": colour or run_view.colour,
        "groups": GROUPS,
        "layout": layout,
    }


def write_view(
    path: str | Path, run_view: RunView, *, name: str = "view", colour: str | None = None
) -> None:
    """Write the view page as one file that opens without a network.

    Pictures that the page saves are called ``name``. When it opens, colours show ``colour``, one of
    `COLOURS`, by default that of the view. InputError if the file cannot be written.
    """
    titles = {
        "kind": "rtradar view",
        "heading": run_view.heading,
        "subtitle": run_view.subtitle,
    }
    write_page(
        path,
        "view.html",
        titles | linked_views(run_view, colour, layout="whole"),
        data=view_data(run_view) | {"name": name},
        scripts=("plots.js", "figure.js", "linked.js", "view.js"),
    )


def view_data(run_view: RunView) -> dict[str, Any]:
    """Return the data of the page's script as plain values for JSON."""
    snapshots, radar = run_view.snapshots, run_view.radar
    # The body, whose parts are drawn unless a mesh stands for them, with room for everything around
    # it.
    figure = posed_figure(snapshots.part_names.tolist(), snapshots.times, snapshots.poses, radar)
    figure["drawn"] = snapshots.drawn_parts.tolist()
    moments = snapshots.times if radar.is_moving else np.zeros(1)
    figure["ranges"] = _with_room(figure["ranges"], snapshots)
    # Colours of the points that are left after thinning.
    shown = rdt_data(run_view.rdt_points)
    every = -(-shown["count"] // max(shown["shown"], 1)) or 1
    points = {
        "power_db": packed(run_view.rdt_power_db[::every]),
        "group": run_view.rdt_group()[::every].tolist(),
        "source": run_view.rdt_source[::every].tolist(),
    }
    return {
        "figure": figure,
        "echoes": {
            "paths": snapshots.path_names.tolist(),
            "path": snapshots.echo_path.tolist(),
            "part": snapshots.echo_part.tolist(),
            "bounces": snapshots.echo_bounces.tolist(),
            "range_m": packed(snapshots.range_m),
            "velocity_mps": packed(snapshots.velocity_mps),
            "power_db": packed(run_view.power_db),
            "corners": packed(snapshots.corners),
            "radar_m": np.round(radar.poses_at(moments)[1], 4).tolist(),
        },
        "room": {
            "walls": np.round(snapshots.walls, 4).tolist(),
            "furniture": snapshots.furniture_names.tolist(),
            "vertices": packed(snapshots.furniture_vertices),
            "faces": snapshots.furniture_faces.ravel().tolist(),
            "piece": snapshots.furniture_piece.tolist(),
        },
        "groups": {
            "names": list(GROUPS),
            "colours": list(GROUPS.values()),
            "of_part": group_of_parts(snapshots.part_names.tolist()),
        },
        "people": {
            "names": run_view.source_names,
            "colours": run_view.source_colours,
            "of_part": snapshots.part_person.tolist(),
            "position_m": packed(snapshots.person_position),
            "speed_mps": packed(snapshots.person_speed),
        },
        "n_objects": len(snapshots.object_names),
        "meshes": _meshes(snapshots),
        "velocity_colours": VELOCITY_COLOURS,
        "power_label": run_view.power_unit.label("of an echo"),
        "power_unit": run_view.power_unit.name,
        "power_range_db": list(run_view.power_range_db),
        "fastest_mps": run_view.fastest_mps,
        "max_velocity_mps": radar.max_velocity_mps,
        "map": run_view.range_doppler.packed() | {"box": run_view.shown_box()},
        "spectrogram": run_view.spectrogram.packed(),
        "rdt": shown | points,
        "spatial": spatial_data(run_view.spatial, radar),
    }


def _meshes(snapshots: Snapshots) -> dict[str, Any]:
    """Return the moving meshes: vertices are sums of rows that change from step to step."""
    names = ["mesh_faces", "mesh_of_vertex", "mesh_part", "mesh_rows"]
    names += ["blend_vertex", "blend_row", "blend_weight"]
    arrays = {name: packed(getattr(snapshots, name)) for name in names}
    return {"source": snapshots.mesh_source.tolist(), **arrays}


def _with_room(ranges: list[list[float]], snapshots: Snapshots) -> list[list[float]]:
    """Extend the limits of the axes to walls and furniture, rounded to half metres."""
    walls, furniture = snapshots.walls.reshape(-1, 3), snapshots.furniture_vertices
    steps = range(0, len(snapshots.times), max(len(snapshots.times) // _LOOKED_AT, 1))
    moving = np.concatenate([snapshots.mesh_vertices(step) for step in steps])
    places = np.concatenate([walls, furniture, moving, np.array(ranges).T])
    # A floor a little below 0 is still the floor z = 0.
    low = np.floor(2 * places.min(axis=0) - 1e-6) / 2
    high = np.ceil(2 * places.max(axis=0) + 1e-6) / 2
    low[2] = 0.0 if low[2] > -0.6 else low[2]
    return [[float(a), float(b)] for a, b in zip(low, high, strict=True)]
