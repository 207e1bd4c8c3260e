"""Large flat faces of furniture, over which a person is seen as over walls.

A face is a set of triangles in one plane that hang together and fill a rectangle. It reflects as
the surface of a half-space of its material, by the extent of that rectangle
(`rtradar.scatter.multipath.wall_edges`). Nothing passes through it: furniture occludes. Faces that
are smaller than a Fresnel zone, or no rectangles, send no ghosts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.radar import Radar
from rtradar.scatter.multipath.image_paths import Face, corners, height
from rtradar.scatter.multipath.slab_series import POLARIZATIONS
from rtradar.scene import Furniture, Scene, Wall, reflection
from rtradar.trace.room_tracer import RoomTracer

Array = NDArray[np.float64]

_TIMES = 50
"""Number of poses at which faces are looked for."""
FAINT_DB = 40.0
"""Faces whose ghosts are expected further below the direct echoes are left out [dB]."""
_FILLED = 0.9
"""Least part of its rectangle that a face fills; it is reflected by that part."""
_NARROWEST_M = 0.03
"""Faces that are narrower are not listed at all [m]."""
_SIDES = (("front", "back"), ("left", "right"), ("top", "bottom"))
"""Names of faces that look along +x and -x of the mesh, +y and -y, +z and -z."""


@dataclass(frozen=True, kw_only=True)
class SolidFace(Wall):
    """A face of a piece of furniture: a rectangle with a half-space of material behind it.

    The face fills ``fraction`` of the rectangle. A thin ``sheet`` reflects on both sides.
    """

    thickness_m: float = 0.0
    fraction: float = 1.0
    sheet: bool = False

    def _check_slab(self, where: str) -> None:
        """A half-space has no thickness to be checked."""


def reflecting_faces(
    scene: Scene, radar: Radar, body: Body, room: RoomTracer | None
) -> tuple[Face, ...]:
    """Find the faces of furniture over which the radar may see parts of a body at some time.

    Their specular points, for the middle of the array, lie on the face, the face is as wide as the
    radius of the Fresnel zone, furniture leaves both legs free, and the ghosts are not expected
    more than `FAINT_DB` below the direct echoes, in the mean over the parts and
    `_TIMES` poses.
    """
    place = np.asarray(radar.position_m, dtype=np.float64)
    points = body.at(np.linspace(0.0, body.duration_s, _TIMES)).centres.reshape(-1, 3)
    found = []
    for piece in scene.furniture:
        for own in faces_of(piece):
            above = float(height(own, place))
            face = Face(own, back=above < 0)
            if above > 0 or own.sheet:
                expected = _expected(face, place, points, radar, room)
                if expected.sum() > 10 ** (-FAINT_DB / 10) * len(points):
                    found.append(face)
    return tuple(found)


def _expected(
    face: Face, place: Array, points: Array, radar: Radar, room: RoomTracer | None
) -> Array:
    """Power of a ghost at points that are seen over a face, over that of the direct echo there."""
    wall = face.wall
    narrow = float(min(np.linalg.norm(edge) for edge in (wall.edge_u_m, wall.edge_v_m)))
    (_, met, _), valid = corners((face,), place, points)
    met, points = met[valid], points[valid]
    first, last = np.linalg.norm(met - place, axis=1), np.linalg.norm(met - points, axis=1)
    zone = np.sqrt(radar.wavelength_m * first * last / (first + last))
    near = zone <= narrow
    if room is not None:
        near[near] = ~(room.blocked(place, met[near]) | room.blocked(met[near], points[near]))
    cosine = np.abs((met - place) @ wall.normal) / first
    eta = wall.material.eta(radar.centre_frequency_hz)
    reflected = [np.abs(reflection(eta, cosine, kind)) ** 2 for kind in POLARIZATIONS]
    straight = np.linalg.norm(points - place, axis=1)
    return np.asarray(np.max(reflected, axis=0) * (straight / (first + last)) ** 2 * near)


def faces_of(piece: Furniture) -> Iterator[SolidFace]:
    """Yield the flat faces of a piece, the largest first: `wardrobe front`, `wardrobe front 2`."""
    from trimesh import Trimesh, bounds  # slow to import

    least_box: Any = bounds.oriented_bounds_2D  # has no types
    triangles = piece.triangles()
    mesh = Trimesh(triangles.vertices, triangles.faces, process=False)
    count = Counter[str]()
    for number in np.argsort(-mesh.facets_area, kind="stable"):
        normal, area = mesh.facets_normal[number], float(mesh.facets_area[number])
        own = piece.yaw.T @ normal
        axis = int(np.abs(own).argmax())
        along = np.eye(3)[(axis + 1) % 3] @ piece.yaw.T
        along -= (along @ normal) * normal
        along /= np.linalg.norm(along)
        axes = np.stack([along, np.cross(normal, along)])
        corner = triangles.corners[mesh.facets[number]].reshape(-1, 3)
        to_box, extent = least_box(corner @ axes.T)
        if area < _FILLED * np.prod(extent) or extent.min() < _NARROWEST_M:
            continue
        # The transform turns points so that the box is about the origin.
        turn = to_box[:2, :2]
        edges = turn @ axes
        if np.linalg.det(turn) < 0:
            edges, extent = edges[::-1], extent[::-1]
        middle = turn.T @ -to_box[:2, 2] @ axes + (corner[0] @ normal) * normal
        start = middle - (edges * extent[:, None]).sum(axis=0) / 2
        side = _SIDES[axis][int(own[axis] < 0)]
        count[side] += 1
        yield SolidFace(
            name=f"{piece.name} {side}" + (f" {count[side]}" if count[side] > 1 else ""),
            corner_m=tuple(start.tolist()),
            edge_u_m=tuple((edges[0] * extent[0]).tolist()),
            edge_v_m=tuple((edges[1] * extent[1]).tolist()),
            material=piece.material,
            fraction=min(area / float(np.prod(extent)), 1.0),
            sheet=not triangles.closed,
        )
