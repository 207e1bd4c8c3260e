"""Snapshots of body, room and echoes at the middle of frames, which `rtradar view` shows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.pipeline.output.truth import EchoTable, Look, added_up, truth_of
from rtradar.radar import Radar
from rtradar.report.snapshots import Snapshots
from rtradar.report.three_d import semi_axis_poses
from rtradar.scatter.multipath.image_paths import WallPath, corners, images
from rtradar.scatter.specular_points import solve_specular_points
from rtradar.scene import Object, Scene

MAX_ECHOES = 400
"""Number of echoes kept, the strongest; a person has 273 over single walls in a room of six."""

MAX_FACES = 2000
"""Largest number of faces of a piece of furniture or of what moves; finer ones are thinned."""

_CELL_M, _COARSER = 0.005, 1.2  # of the grid that thins a mesh

Key = tuple[int, int, int]


def snapshots(table: EchoTable) -> Snapshots:
    """Return body, room and echoes of a capture at the middle of evenly chosen frames.

    There are as many for any length of the capture.
    """
    capture, window = table.capture, table.shown_frames
    radar, body, scene = capture.radar, capture.body, capture.scene
    # A frame may end after the recording, whose last pose is then held.
    times = np.minimum(radar.window_times(capture.frame_starts[window]), body.duration_s)
    paths = capture.model.paths
    # Of all echoes the strongest are shown, and only the paths that these take.
    keys, (power, ranges, rates) = _by_key(table.shown(), len(body.part_names))
    chosen = _strongest(keys, power)
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
        range_m=ranges[:, chosen],
        velocity_mps=rates[:, chosen],
        power_m2=power[:, chosen],
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


def _by_key(looks: list[Look], n_parts: int) -> tuple[list[Key], list[NDArray[np.float64]]]:
    """Return the keys of people's echoes at some instants, and power, range and rate (step, key).

    Echoes of one path, part and number of reflections are summed; of those that are not there range
    and rate are 0.
    """
    # Echoes of all instants are put side by side, each with the number of its instant.
    step = np.repeat(np.arange(len(looks)), [len(look.part) for look in looks])
    path, part, bounces, *values = (
        np.concatenate([getattr(look, name) for look in looks])
        for name in ("path", "part", "bounces", "power_m2", "range_m", "rate_mps")
    )
    # The view follows the parts of people, not objects.
    own = part < n_parts
    keys, column = np.unique(np.stack([path, part, bounces])[:, own], axis=1, return_inverse=True)
    # Each pair of an instant and a key is a cell, in which powers add up.
    shape = len(looks), keys.shape[1]
    found = added_up(
        step[own] * shape[1] + column.ravel(), shape, *(value[own] for value in values)
    )
    return [tuple(key) for key in keys.T.tolist()], [np.nan_to_num(one) for one in found]


def _strongest(keys: list[Key], power_m2: NDArray[np.float64]) -> list[int]:
    """Choose direct echoes and the strongest of the others, in the order of the keys."""
    mean = power_m2.mean(axis=0)
    # Direct echoes are always kept, ahead of any other.
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
    # One path for the whole array, from its middle.
    centre = radar.poses_at(times)[1]
    poses = body.at(times)
    most = max((paths[path].order for path, _, _ in keys), default=0) + 1
    out = np.full((len(times), len(keys), most, 3), np.nan)
    # By the method of images the specular point of a path over walls is that between the images of
    # both antennas.
    for number in {path for path, _, _ in keys}:
        path = paths[number]
        out_and_back = images(path.out, centre), images(path.back, centre)[:, None]
        _, _, point = solve_specular_points(Geometry(*out_and_back, *poses), points=True)
        # The images are folded back into the points at which each leg meets the walls: out to the
        # body and, in the reverse order, back.
        legs = path.out, path.back
        there, back = (corners(leg, centre[:, None], point[:, 0])[0][1:] for leg in legs)
        course = np.stack([*there, *reversed(back[:-1])], axis=2)
        # Other numbers of reflections, as those from part to part, have corners that are not known
        # here.
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


# -- what moves and is a mesh ----------------------------------------------------------------------


def moving_meshes(
    body: Body, objects: Sequence[Object], times: NDArray[np.float64], most_faces: int
) -> dict[str, NDArray[Any]]:
    """Return the fields of `Snapshots` of the meshes of people and objects at times (time,) [s].

    Each mesh is thinned to ``most_faces``. Breath, which moves a chest by millimetres, is left out.
    """
    from scipy.sparse import coo_matrix  # slow to import

    # Of each mesh: whose it is, its faces, the part of each vertex, weights, and rows over time.
    found: list[tuple[int, NDArray[Any], NDArray[Any], Any, NDArray[np.float64]]] = []
    # A skinned mesh: each vertex is a blend of the bones' places, so that the bones over time say
    # all.
    for number, person in enumerate(body.people):
        if (mesh := person.mesh) is not None:
            kept, faces = thinned_mesh(mesh.fit.vertices, mesh.faces(), most_faces)
            part = np.flatnonzero(body.owner == number)[mesh.weights()[kept].argmax(axis=1)]
            bones = mesh.bones(np.minimum(times, person.duration_s))
            found.append((number, faces, part, mesh.fit.skinning[kept].tocoo(), bones))
    # A rigid object in the same form: the blend of a vertex is its own (x, y, z, 1), and the rows
    # are the object's axes and its place.
    for number, one in enumerate(objects, start=len(body.people)):
        kept, faces = thinned_mesh(one.shape.vertices, one.shape.faces, most_faces)
        rotation, place = one.pose(times)
        corners = np.concatenate([one.shape.vertices[kept], np.ones((len(kept), 1))], axis=1)
        axes = np.concatenate([np.swapaxes(rotation, 1, 2), place[:, None]], axis=1)
        found.append((number, faces, np.full(len(kept), -1), coo_matrix(corners), axes))
    # Vertices and rows of a mesh come after those of the meshes before it.
    vertex = np.cumsum([0, *(len(part) for _, _, part, _, _ in found)])
    row = np.cumsum([0, *(rows.shape[1] for *_, rows in found)])
    blends = [blend for *_, blend, _ in found]

    def joined(values: Iterable[Any], shape: tuple[int, ...] = (0,)) -> NDArray[np.int64]:
        return np.concatenate([np.zeros(shape), *values]).astype(np.int64)

    return {
        "object_names": np.array([one.name for one in objects], dtype=np.str_),
        "mesh_source": np.array([source for source, *_ in found], dtype=np.int64),
        "mesh_faces": joined((one[1] + at for one, at in zip(found, vertex, strict=False)), (0, 3)),
        "mesh_of_vertex": np.repeat(np.arange(len(found)), np.diff(vertex)),
        "mesh_part": joined(part for _, _, part, _, _ in found),
        "mesh_rows": np.concatenate(
            [np.zeros((len(times), 0, 3)), *(rows for *_, rows in found)], axis=1
        ).astype(np.float32),
        "blend_vertex": joined(blend.row + at for blend, at in zip(blends, vertex, strict=False)),
        "blend_row": joined(blend.col + at for blend, at in zip(blends, row, strict=False)),
        "blend_weight": np.concatenate([[], *(blend.data for blend in blends)]).astype(np.float32),
    }


def thinned_mesh(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], most_faces: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return which vertices of a mesh to draw, and faces of these, ``most_faces`` or fewer.

    Vertices in one cell of a grid become one, the first; the cells grow until that is enough.
    """
    kept, cell_m = np.arange(len(vertices)), _CELL_M
    thinned = faces
    while len(thinned) > most_faces:
        cells = np.floor(vertices / cell_m).astype(np.int64)
        _, kept, number = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        # Faces of the vertices that are left; one with two equal corners has no area any more.
        thinned = number.reshape(-1)[faces]
        thinned = thinned[(thinned != np.roll(thinned, 1, axis=1)).all(axis=1)]
        cell_m *= _COARSER
    return kept, thinned
