"""Large flat faces of furniture, over which a person is seen as over walls.

A face is a set of triangles in one plane that hang together and fill a rectangle. It reflects as
the surface of a half-space of its material, by the extent of that rectangle
(`rtradar.scatter.multipath.wall_edges`). Nothing passes through it: furniture occludes. Faces that
are smaller than a Fresnel zone, or no rectangles, send no ghosts.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.radar import Radar
from rtradar.scatter.multipath.image_paths import Face, corners, height, inside
from rtradar.scatter.multipath.slab_series import POLARIZATIONS
from rtradar.scene import Furniture, Scene, Wall, reflection
from rtradar.scene.objects import Opening
from rtradar.trace.occluders import Occluders

Array = NDArray[np.float64]

_TIMES = 50
"""Number of poses at which faces are looked for."""
FAINT_DB = 40.0
"""Faces whose ghosts are expected further below the direct echoes are left out [dB]."""
_FILLED = 0.9
"""Least part of its rectangle that a facet fills; it is reflected by that part."""
_KEPT_PIECES = 64
"""Pieces of furniture whose faces are kept for the next run."""
_NARROWEST_M = 0.03
"""Faces that are narrower are not listed at all [m]."""
_SIDES = (("front", "back"), ("left", "right"), ("top", "bottom"))
"""Names of faces that look along +x and -x of the mesh, +y and -y, +z and -z."""


@dataclass(frozen=True, kw_only=True)
class SolidFace(Wall):
    """A face of a piece of furniture, with a half-space of material behind it.

    The face consists of ``patches`` in its rectangle, as openings are given, and fills ``fraction``
    of these. A thin ``sheet`` reflects on both sides.
    """

    thickness_m: float = 0.0
    patches: tuple[Opening, ...]
    fraction: float = 1.0
    sheet: bool = False

    @property
    def filled_m2(self) -> float:
        """Area of the face itself [m^2]."""
        return self.fraction * sum(wide * high for _, _, wide, high in self.patches)

    def _check_slab(self, where: str) -> None:
        """A half-space has no thickness to be checked."""


class FaceSummary(NamedTuple):
    """What became of a face: its area [m^2], and the ``reason`` why it was left out, "" if not."""

    name: str
    area_m2: float
    reason: str


def reflecting_faces(
    scene: Scene, radar: Radar, place: Array, body: Body, room: Occluders | None
) -> tuple[tuple[Face, ...], tuple[FaceSummary, ...]]:
    """Find the faces of furniture over which the radar may see parts of a body at some time.

    Their specular points, for the middle of the array at a place (3,) [m], are at most the radius
    of the Fresnel zone beside the face, the face is as wide as that, furniture leaves both legs
    free, and the ghosts are not expected more than `FAINT_DB` below the direct echoes, in the mean
    over the parts and `_TIMES` poses. Returned are these faces, and what became of every face.
    """
    points = body.at(np.linspace(0.0, body.duration_s, _TIMES)).centres.reshape(-1, 3)
    found, summaries = [], []
    for own in chain.from_iterable(map(faces_of, scene.furniture)):
        above = float(height(own, place))
        face, expected, reason = Face(own, back=above < 0), 0.0, "looks away from the radar"
        if above > 0 or own.sheet:
            filled = own.filled_m2 / own.area_m2
            seen = _expected(face, filled, place, points, radar, room)
            expected = float(seen.sum()) / len(points)
            reason = "nobody is seen over it, or it is narrower than a Fresnel zone"
        if expected > 10 ** (-FAINT_DB / 10):
            found.append(face)
            reason = ""
        elif expected > 0:
            below = -10 * math.log10(expected)
            reason = f"ghosts over it are expected {below:.0f} dB below the direct echoes"
        summaries.append(FaceSummary(own.name, own.filled_m2, reason))
    return tuple(found), tuple(summaries)


def _expected(
    face: Face, filled: float, place: Array, points: Array, radar: Radar, room: Occluders | None
) -> Array:
    """Power of a ghost at points that are seen over a face, over that of the direct echo there."""
    wall = face.wall
    narrow = float(min(np.linalg.norm(edge) for edge in (wall.edge_u_m, wall.edge_v_m)))
    (_, met, _), valid = corners((face,), place, points, beside_m=np.inf)
    met, points = met[valid], points[valid]
    first, last = np.linalg.norm(met - place, axis=1), np.linalg.norm(met - points, axis=1)
    cosine = np.abs((met - place) @ wall.normal) / first
    zone = np.sqrt(radar.wavelength_m * first * last / (first + last))
    near = (zone <= narrow) & inside(wall, met, zone / cosine)
    if room is not None:
        near[near] = room.clear(place, met[near]) & room.clear(met[near], points[near])
    eta = wall.material.eta(radar.centre_frequency_hz)
    reflected = [np.abs(reflection(eta, cosine, kind)) ** 2 for kind in POLARIZATIONS]
    lost = np.linalg.norm(points - place, axis=1) / (first + last) * near
    return np.asarray(np.max(reflected, axis=0) * (lost * filled) ** 2)


def faces_of(piece: Furniture) -> Iterator[SolidFace]:
    """Yield the flat faces of a piece, the largest first: `wardrobe front`, `wardrobe front 2`."""
    triangles = piece.triangles()
    faces = np.asarray(triangles.faces, dtype=np.int64)
    found = _flat_faces(triangles.vertices.tobytes(), faces.tobytes())
    count = Counter[str]()
    for own in found:
        looks = piece.axes.T @ np.cross(own["edge_u_m"], own["edge_v_m"])
        axis = int(np.abs(looks).argmax())
        side = _SIDES[axis][int(looks[axis] < 0)]
        count[side] += 1
        yield SolidFace(
            name=f"{piece.name} {side}" + (f" {count[side]}" if count[side] > 1 else ""),
            material=piece.material,
            sheet=not triangles.closed,
            **own,
        )


@lru_cache(maxsize=_KEPT_PIECES)
def _flat_faces(vertices: bytes, faces: bytes) -> tuple[dict[str, Any], ...]:
    """Find the faces of a mesh, by its arrays float64 and int64, the largest first.

    Every run in a room asks for them again, and they take half a second.
    """
    from trimesh import Trimesh  # slow to import

    places = np.frombuffer(vertices).reshape(-1, 3)
    mesh = Trimesh(places, np.frombuffer(faces, dtype=np.int64).reshape(-1, 3), process=False)
    planes: dict[tuple[float, ...], list[int]] = {}
    for number in np.argsort(-mesh.facets_area, kind="stable").tolist():
        normal, origin = mesh.facets_normal[number], mesh.facets_origin[number]
        key = *(normal + 0.0).round(3).tolist(), float(round(origin @ normal, 3))
        planes.setdefault(key, []).append(number)
    found = []
    for numbers in planes.values():
        corners = [places[mesh.faces[mesh.facets[number]]].reshape(-1, 3) for number in numbers]
        made = _face(corners, mesh.facets_area[numbers], mesh.facets_normal[numbers[0]])
        if made is not None:
            found.append(made)
    found.sort(key=lambda own: -own["fraction"] * own.pop("area"))
    return tuple(found)


def _face(corners: Sequence[Array], areas: Array, normal: Array) -> dict[str, Any] | None:
    """Make the rectangle and the patches of what lies in one plane, the largest facet first.

    ``corners`` are those (corner, 3) of the triangles of each facet; what is no rectangle along the
    largest one is left out.
    """
    from trimesh.bounds import oriented_bounds_2D

    least_box: Any = oriented_bounds_2D  # has no types
    along = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    axes = np.stack([along, np.cross(normal, along)]) / np.linalg.norm(along)
    turn = least_box(corners[0] @ axes.T)[0][:2, :2]
    # A proper rotation: the second axis is a quarter turn on from the first.
    axes = np.stack([turn[0], [-turn[0, 1], turn[0, 0]]]) @ axes
    boxes = []
    for own, area in zip(corners, areas, strict=True):
        low, high = (end(own @ axes.T, axis=0) for end in (np.min, np.max))
        if area >= _FILLED * np.prod(high - low) and (high - low).min() >= _NARROWEST_M:
            boxes.append((low, high, area))
    if not boxes:
        return None
    lows, highs, filled = (np.array(column) for column in zip(*boxes, strict=True))
    least, size = lows.min(axis=0), highs.max(axis=0) - lows.min(axis=0)
    start = least @ axes + (corners[0][0] @ normal) * normal
    rectangles = np.concatenate([lows - least, highs - lows], axis=1)
    area = float(np.prod(highs - lows, axis=1).sum())
    return {
        "corner_m": tuple(start.tolist()),
        "edge_u_m": tuple((axes[0] * size[0]).tolist()),
        "edge_v_m": tuple((axes[1] * size[1]).tolist()),
        "patches": tuple(tuple(rectangle) for rectangle in rectangles.tolist()),
        "fraction": min(float(filled.sum()) / area, 1.0),
        "area": area,
    }
