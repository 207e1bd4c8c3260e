"""The pictures of a run in a room: its plan, its walls in the range-azimuth map, and what the removal of clutter does."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from rtradar.body import Body
from rtradar.pipeline.indoors import Indoors
from rtradar.pipeline.pictures.run_pictures import busiest_window, removed
from rtradar.radar import Radar
from rtradar.report import draw_before_after, draw_plan, draw_range_azimuth_with_walls
from rtradar.scatter.multipath.path_summary import ghosts
from rtradar.scene import Scene

_TRACK_POINTS = 400


def draw_room_pictures(
    folder: Path, radar: Radar, body: Body, scene: Scene, inside: Indoors, title: str
) -> dict[str, Path]:
    """Draw them from ``maps.h5`` in this folder, into the same folder.

    Parameters
    ----------
    folder : path
    radar : Radar
        Where it stands in the room.
    body : Body
    scene : Scene
    inside : Indoors
    title : str
        Of the run.

    Returns
    -------
    dict of title to path
        PNG files.
    """
    drawn: dict[str, Path] = {}
    with h5py.File(folder / "maps.h5") as maps:
        if "range_doppler_received" in maps:
            received = maps["range_doppler_received"]
            time = float(received.attrs["time_s"])
            window = int(np.abs(maps["time"][:] - time).argmin())
            after = removed(maps["range_doppler"]).strip().capitalize()
            panels = {
                "As received": (received[:], maps["detections_received"][:].astype(bool)),
                after: (maps["range_doppler"][window], maps["detections"][window].astype(bool)),
            }
            azimuth_map = (
                maps["range_azimuth_received"][:] if "range_azimuth_received" in maps else None
            )
        else:
            window = busiest_window(maps)
            time = float(maps["time"][window])
            panels = {
                "As received": (
                    maps["range_doppler"][window],
                    maps["detections"][window].astype(bool),
                )
            }
            azimuth_map = maps["range_azimuth"][window] if "range_azimuth" in maps else None
        azimuth = maps["azimuth"][:] if "azimuth" in maps else None
    found = ghosts(inside.model, radar, time)
    moment = f"{title}, window at {time:.2f} s"
    # Out and back over the same walls is as far as the other way round: one mark, with their names.
    by_walls = {_walls(ghost.path): ghost for ghost in found}
    marked = [(walls, ghost.range_m, ghost.velocity_mps) for walls, ghost in by_walls.items()]
    shown = f"Range-Doppler{' before and after' if len(panels) > 1 else ''}, and ghosts"
    drawn[shown] = folder / "clutter_removal.png"
    draw_before_after(drawn[shown], panels, marked, radar, moment)
    if azimuth_map is not None and azimuth is not None:
        drawn["Range-azimuth with walls and ghosts"] = folder / "range_azimuth_walls.png"
        places = [(ghost.path, ghost.range_m, ghost.azimuth_rad) for ghost in found]
        draw_range_azimuth_with_walls(
            drawn["Range-azimuth with walls and ghosts"],
            azimuth_map,
            azimuth,
            scene,
            radar,
            places,
            moment,
        )
    times = np.linspace(0, body.duration_s, _TRACK_POINTS)
    track = body.motion.at(times)[0][:, 0, :2]
    middle = body.motion.at([min(time, body.duration_s)])[0][0, 0]
    paths = {ghost.path: inside.model.course(ghost.path, middle) for ghost in found}
    drawn["Plan of the room, with paths"] = folder / "plan.png"
    draw_plan(drawn["Plan of the room, with paths"], scene, radar, track, paths, moment)
    return drawn


def _walls(path: str) -> str:
    return " > ".join(sorted(name for name in path.split(" > ") if name != "body"))
