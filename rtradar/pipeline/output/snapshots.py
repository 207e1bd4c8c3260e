"""Snapshots of body, room and echoes at the middle of frames, which `rtradar view` shows."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.output.moving_meshes import moving_meshes, thinned_mesh
from rtradar.pipeline.output.truth import truth_of
from rtradar.radar import Radar
from rtradar.report.view.snapshots import Snapshots
from rtradar.report.view.three_d import semi_axis_poses
from rtradar.scatter import EchoModel
from rtradar.scatter.multipath.image_paths import WallPath, corners, images
from rtradar.scatter.multipath.room_model import RoomModel
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.scatter.world import World
from rtradar.scene import Scene

MAX_STEPS = 400
"""Largest number of snapshots, those of 10 s; of longer captures fewer frames are kept."""

STEPS_HZ = 40.0
"""Largest number of snapshots per second."""

MAX_ECHOES = 400
"""Number of echoes kept, the strongest; a person has 273 over single walls in a room of six."""

MAX_FACES = 2000
"""Largest number of faces of a piece of furniture or of what moves; finer ones are thinned."""

_AT_ONCE = 16
_RATE_CYCLES = 2
"""Cycles before and after a snapshot, over which range rates are taken."""

Key = tuple[int, int, int]


class _Observed(NamedTuple):
    """Some snapshots: path, part and bounces of each echo, and its values, (step, key)."""

    keys: list[Key]
    range_m: NDArray[np.float64]
    velocity_mps: NDArray[np.float64]
    power_m2: NDArray[np.float64]


def snapshots(capture: Capture) -> Snapshots:
    """Return body, room and echoes of a capture at the middle of evenly chosen frames.

    There are as many for any length of the capture. Echoes from the Tx nearest to the middle of the
    array are summed by path, part and number of reflections.
    """
    model, radar, body, scene = capture.model, capture.radar, capture.body, capture.scene
    # The view follows the parts of people.
    model = model.person if isinstance(model, World) else model
    frame_starts = capture.frame_starts
    hop_s = radar.frame_hop_s
    if len(frame_starts) > 1:
        hop_s = radar.frame_period_s or (
            float(np.diff(frame_starts).mean()) * radar.cycle_duration_s
        )
    every = max(math.ceil(len(frame_starts) / MAX_STEPS), math.ceil(1 / (STEPS_HZ * hop_s) - 1e-6))
    window = np.arange(0, len(frame_starts), every)
    times = np.minimum(radar.window_times(frame_starts[window]), body.duration_s)
    direct = (WallPath((), ()),)
    paths = model.paths_in_world(radar) if isinstance(model, RoomModel) else direct
    cycles = frame_starts[window] + radar.cycles_per_frame // 2
    keys, observed = _observe(model, radar, cycles, capture.n_chirps // radar.n_tx)
    chosen = _strongest(keys, observed.power_m2)
    keys = [keys[number] for number in chosen]
    used = sorted({path for path, _, _ in keys})
    vertices, faces, piece = _furniture(scene)
    truth = truth_of(body, times)
    return Snapshots(
        times=times,
        window=window,
        part_names=np.array(body.part_names),
        poses=semi_axis_poses(body, times).astype(np.float32),
        path_names=np.array([paths[number].name for number in used], dtype=np.str_),
        echo_path=np.array([used.index(path) for path, _, _ in keys], dtype=np.int64),
        echo_part=np.array([part for _, part, _ in keys], dtype=np.int64),
        echo_bounces=np.array([bounces for _, _, bounces in keys], dtype=np.int64),
        range_m=observed.range_m[:, chosen],
        velocity_mps=observed.velocity_mps[:, chosen],
        power_m2=observed.power_m2[:, chosen],
        corners=_corners(radar, body, paths, keys, times).astype(np.float32),
        wall_names=np.array([wall.name for wall in scene.walls], dtype=np.str_),
        walls=np.array([wall.corners for wall in scene.walls]).reshape(-1, 4, 3),
        furniture_names=np.array([one.name for one in scene.furniture], dtype=np.str_),
        furniture_vertices=vertices,
        furniture_faces=faces,
        furniture_piece=piece,
        part_person=body.owner,
        person_names=np.array(body.names, dtype=np.str_),
        person_position=truth["person_position"],
        person_speed=truth["person_speed"],
        **moving_meshes(body, scene.objects, times, MAX_FACES),
    )


# -- echoes ----------------------------------------------------------------------------------------


def _observe(
    model: EchoModel, radar: Radar, cycles: NDArray[np.int64], n_cycles: int
) -> tuple[list[Key], _Observed]:
    """Return the echoes about some cycles, with one column for each key that ever comes."""
    observed = [
        _observe_block(model, radar, cycles[first : first + _AT_ONCE], n_cycles)
        for first in range(0, len(cycles), _AT_ONCE)
    ]
    keys = list(dict.fromkeys(key for one in observed for key in one.keys))
    place = {key: column for column, key in enumerate(keys)}
    names = "range_m", "velocity_mps", "power_m2"
    tables = {name: np.zeros((len(cycles), len(keys))) for name in names}
    for number, one in enumerate(observed):
        columns = [place[key] for key in one.keys]
        for name, table in tables.items():
            table[number * _AT_ONCE : (number + 1) * _AT_ONCE, columns] = getattr(one, name)
    return keys, _Observed(keys, **tables)


def _observe_block(
    model: EchoModel, radar: Radar, cycles: NDArray[np.int64], n_cycles: int
) -> _Observed:
    middle = int(np.linalg.norm(radar.tx - np.asarray(radar.position_m), axis=1).argmin())
    ends = np.clip(cycles[:, None] + [-_RATE_CYCLES, _RATE_CYCLES], 0, n_cycles - 1)
    if radar.in_frames:
        first = cycles[:, None] - cycles[:, None] % radar.cycles_per_frame
        ends = np.clip(ends, first, first + radar.cycles_per_frame - 1)
    chirps, where = np.unique((ends * radar.n_tx + middle).astype(np.int64), return_inverse=True)
    where = where.reshape(ends.shape)
    echoes = model.echoes(chirps)
    # (cycle, before and after, rx, echo)
    power = (np.abs(echoes.amplitude) ** 2).mean(axis=0)[where]
    length = echoes.length[where]
    # Weighted by the smaller power of both ends: where a receiver has an echo at one end only, its
    # length jumps to one of no meaning.
    weight = power.min(axis=1)
    power = np.where(weight > 0, power.mean(axis=1), 0.0).mean(axis=1)
    weight = np.where(weight.sum(axis=1, keepdims=True) > 0, weight, 1.0)
    weight /= weight.sum(axis=1, keepdims=True)
    before, after = (weight * length[:, 0]).sum(axis=1), (weight * length[:, 1]).sum(axis=1)
    apart_s = np.diff(ends, axis=1) * radar.cycle_duration_s
    rate = np.divide(after - before, apart_s, out=np.zeros_like(before), where=apart_s > 0)
    paths = _path_of_echoes(model, len(echoes.part))
    owned = list(zip(paths, echoes.part.tolist(), echoes.bounces.tolist(), strict=True))
    places = {key: number for number, key in enumerate(dict.fromkeys(owned))}
    keys, column = list(places), np.array([places[key] for key in owned], dtype=np.int64)
    shape = (len(cycles), len(keys))
    total = np.zeros(shape)
    np.add.at(total.T, column, power.T)
    fraction = np.where(total[:, column] > 0, power, 1.0)
    sums = np.zeros((3, *shape))
    averaged = fraction, fraction * (before + after) / 4, fraction * rate / 2
    for table, values in zip(sums, averaged, strict=True):
        np.add.at(table.T, column, values.T)
    return _Observed(keys, sums[1] / sums[0], sums[2] / sums[0], total)


def _path_of_echoes(model: EchoModel, n_echoes: int) -> list[int]:
    """Return the number of each echo's path; without walls there is one."""
    if not isinstance(model, RoomModel):
        return [0] * n_echoes
    numbers = {path.name: number for number, path in enumerate(model.paths)}
    return [numbers[name] for name in model.path_names]


def _strongest(keys: list[Key], power_m2: NDArray[np.float64]) -> list[int]:
    """Choose direct echoes and the strongest of the others, in the order in which they came."""
    mean = power_m2.mean(axis=0)
    mean[[bounces == 1 for _, _, bounces in keys]] = np.inf
    order = np.argsort(-mean, kind="stable")[:MAX_ECHOES]
    return sorted(int(number) for number in order if mean[number] > 0)


# -- paths and furniture ---------------------------------------------------------------------------


def _corners(
    radar: Radar,
    body: Body,
    paths: tuple[WallPath, ...],
    keys: list[Key],
    times: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the reflection points (step, echo, corner, 3) on the path from and to the array.

    The specular point is that of both images of the middle of the array. NaN if it is not known.
    """
    centre = radar.poses_at(times)[1]
    poses = body.at(times)
    most = max(paths[path].order for path, _, _ in keys) + 1
    out = np.full((len(times), len(keys), most, 3), np.nan)
    for number in {path for path, _, _ in keys}:
        path = paths[number]
        out_and_back = images(path.out, centre), images(path.back, centre)[:, None]
        _, _, point = solve_specular_points(Geometry(*out_and_back, *poses), points=True)
        legs = path.out, path.back
        there, back = (corners(leg, centre[:, None], point[:, 0])[0][1:] for leg in legs)
        course = np.stack([*there, *reversed(back[:-1])], axis=2)
        for echo, (other, part, bounces) in enumerate(keys):
            if other == number and bounces == path.order + 1:
                out[:, echo, : course.shape[2]] = course[:, part]
    return out


def _furniture(scene: Scene) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.int64]]:
    """Return vertices (vertex, 3), faces (face, 3) and the piece of each vertex (vertex,)."""
    vertices, piece = [np.zeros((0, 3))], [np.zeros(0, dtype=np.int64)]
    faces = [np.zeros((0, 3), dtype=np.int64)]
    for number, one in enumerate(scene.furniture):
        triangles = one.triangles()
        kept, own = thinned_mesh(triangles.vertices, triangles.faces, MAX_FACES)
        faces.append(own + sum(map(len, vertices)))
        vertices.append(triangles.vertices[kept])
        piece.append(np.full(len(kept), number))
    return np.concatenate(vertices).astype(np.float32), np.concatenate(faces), np.concatenate(piece)
