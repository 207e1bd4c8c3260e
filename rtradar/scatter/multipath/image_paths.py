"""Paths from antennas to the body over walls: which there are, and where their legs run.

A leg over walls is straight from the mirror image of its antenna (image method). A wall has two
faces: its front is the rectangle itself, and waves from behind meet the back, one thickness deeper.
All of this is closed form in float64; nothing is traced.

**Large flat faces of furniture** reflect a person as walls do. A face is a set of triangles in one
plane that hang together and fill a rectangle. It reflects as the surface of a half-space of its
material, with the extent of that rectangle (`rtradar.scatter.multipath.wall_edges`). Nothing passes
through it: furniture occludes. Faces that are smaller than a Fresnel zone, or are no rectangles,
send no ghosts.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate, chain, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.radar import Radar
from rtradar.scatter.common.polarization import POLARIZATIONS
from rtradar.scene import Furniture, Scene, Wall, reflection
from rtradar.scene.objects import Opening
from rtradar.trace.occluders import Occluders

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Face(NamedTuple):
    """A wall, and whether its back reflects, not its front."""

    wall: Wall
    back: bool


Leg = tuple[Face, ...]
"""Faces that reflect on the way from an antenna, in this order; none where the leg is straight."""


@dataclass(frozen=True)
class WallPath:
    """A path: the leg from Tx to the body, and the leg from Rx to the body."""

    out: Leg
    back: Leg

    @property
    def order(self) -> int:
        """Number of reflections at walls."""
        return len(self.out) + len(self.back)

    @property
    def name(self) -> str:
        """Walls in the order in which the wave meets them, as in ``floor > body``."""
        out, back = ([face.wall.name for face in leg] for leg in (self.out, self.back))
        return " > ".join([*out, "body", *reversed(back)])


def wall_paths(
    walls: Sequence[Wall], place: Array, order: int, others: Sequence[Face] = ()
) -> tuple[WallPath, ...]:
    """List all paths with up to ``order`` reflections at walls, the direct one first.

    The middle of the array, ``place (3,)`` [m], or its image, settles which face of a wall
    reflects. Each of the ``others``, faces of furniture, reflects once on a path, without walls.
    """
    # Each leg is extended by every wall but the one that it met last; the image of the array
    # settles which face it meets.
    legs: list[Leg] = [()]
    for depth in range(1, order + 1):
        legs += [
            (*leg, Face(wall, bool(height(wall, images(leg, place)) < 0)))
            for leg in legs
            if len(leg) == depth - 1
            for wall in walls
            if not leg or leg[-1].wall is not wall
        ]
    # Any leg out may go with any leg back.
    paths = [WallPath(*both) for both in product(legs, legs)]
    for face in others if order else ():
        paths += [WallPath((), (face,)), WallPath((face,), ())]
    return tuple(
        sorted((path for path in paths if path.order <= order), key=lambda path: path.order)
    )


# -- geometry of one wall --------------------------------------------------------------------------


def height(wall: Wall, points: Array, *, back: bool = False) -> Array:
    """Height of points (..., 3) [m] above the front or the back, away from the slab (...) [m]."""
    above = (np.asarray(points) - np.array(wall.corner_m)) @ wall.normal
    return np.asarray(-above - wall.thickness_m if back else above)


def image(wall: Wall, points: Array, *, back: bool = False) -> Array:
    """Mirror images (..., 3) of points (..., 3) in the plane of the front or the back [m].

    Equation :eq:`image` of the theory page.
    """
    normal = -wall.normal if back else wall.normal
    return np.asarray(points - 2 * height(wall, points, back=back)[..., None] * normal)


def inside(wall: Wall, points: Array, margin_m: float | Array = 0.0) -> Bools:
    """Whether points (..., 3) [m], projected onto the front, lie in its rectangle and a margin."""
    away = np.asarray(points) - np.array(wall.corner_m)
    within = np.ones(away.shape[:-1], dtype=bool)
    for edge in (np.array(wall.edge_u_m), np.array(wall.edge_v_m)):
        length = np.linalg.norm(edge)
        along = away @ (edge / length)
        within &= (along >= -margin_m) & (along <= length + margin_m)
    return within


def specular_point(
    wall: Wall,
    origins: Array,
    targets: Array,
    *,
    back: bool = False,
    margin_m: float = 0.0,
    beside_m: float = 0.0,
) -> tuple[Array, Bools]:
    """Find where a wall reflects a wave from origins to targets (..., 3) [m].

    The margin [m] is added to the rectangle; the target may also be behind the face by the margin.
    Returned are the point on the plane of the front, or of the back (..., 3) [m], which is NaN
    where the ends are on different sides, and whether both ends are before that face and the point
    lies in the rectangle, or at most ``beside_m`` (...) beside it.
    """
    origins, targets = np.broadcast_arrays(origins, targets)
    first, second = height(wall, origins, back=back), height(wall, targets, back=back)
    # The line from the origin to the image of the target crosses the face where the wave is
    # reflected.
    before = (first > abs(margin_m)) & (second > -margin_m)
    fraction = np.where(before, first, np.nan) / np.where(before, first + second, 1.0)
    point = origins + fraction[..., None] * (image(wall, targets, back=back) - origins)
    return point, before & inside(wall, point, margin_m + beside_m)


# -- legs over several walls -----------------------------------------------------------------------


def image_chain(leg: Leg, antennas: Array) -> list[Array]:
    """Return antennas (..., 3) and their images after each face of a leg [m]."""
    return list(
        accumulate(
            leg,
            lambda points, face: image(face.wall, points, back=face.back),
            initial=np.asarray(antennas),
        )
    )


def images(leg: Leg, antennas: Array) -> Array:
    """Return the images (..., 3) of antennas (..., 3) over all faces of a leg [m]."""
    return image_chain(leg, antennas)[-1]


def corners(
    leg: Leg, antennas: Array, points: Array, margin_m: float = 0.0, *, beside_m: float = 0.0
) -> tuple[list[Array], Bools]:
    """Find where a leg from antennas to points (..., 3) [m] runs.

    Returned are the antenna, the places of reflection and the point at the other end, a list of
    (..., 3) [m], and whether each place of reflection lies in its rectangle, before the face (...),
    with the margins of `specular_point`. Where both ends are on different sides of a face, the next
    corner takes the place of the missing one.
    """
    antennas, points = np.broadcast_arrays(antennas, points)
    valid = np.ones(points.shape[:-1], dtype=bool)
    along = [points]
    # From the point back to the antenna: seen from there, each wall shows the image of the antenna
    # over the walls before it.
    sources = image_chain(leg, antennas)[:-1]
    for (wall, back), source in zip(reversed(leg), reversed(sources), strict=True):
        margins = {"margin_m": margin_m, "beside_m": beside_m}
        place, holds = specular_point(wall, source, along[-1], back=back, **margins)
        along.append(np.where(np.isnan(place), along[-1], place))
        valid &= holds
    return [antennas, *reversed(along)], valid


# -- the radar over a path -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, repr=False)
class ImageRadar(Radar):
    """A radar whose Tx stand at their images over one leg, and whose Rx at those over another.

    What walls do to polarisation and to the patterns of antennas belongs to the legs: here the
    antennas are isotropic, and turned as those of the radar are.
    """

    out: Leg = ()
    back: Leg = ()

    @classmethod
    def over(cls, radar: Radar, path: WallPath) -> Radar:
        """Return the radar as it is seen over a path."""
        given = {field.name: getattr(radar, field.name) for field in dataclasses.fields(radar)}
        isotropic = {"tx_antenna": None, "rx_antenna": None}
        return cls(**{**given, **isotropic}, out=path.out, back=path.back)

    def __post_init__(self) -> None:
        """Check nothing: the radar was checked, and its legs are no fields of a radar."""

    @cached_property
    def tx(self) -> NDArray[np.float64]:
        """Images of the transmitters (tx, 3) [m], world."""
        return images(self.out, self._in_world(self.tx_m))

    @cached_property
    def rx(self) -> NDArray[np.float64]:
        """Images of the receivers (rx, 3) [m], world."""
        return images(self.back, self._in_world(self.rx_m))


# -- faces of furniture ----------------------------------------------------------------------------


_TIMES = 50
"""Number of poses at which faces are looked for."""
FAINT_DB = 40.0
"""Faces whose ghosts are expected further below the direct echoes are left out [dB]."""
_FILLED = 0.9
"""Least part of its rectangle that a facet fills; it reflects by that part."""
_KEPT_PIECES = 64
"""Pieces of furniture whose faces are kept for the next run."""
_NARROWEST_M = 0.03
"""Faces that are narrower are not listed at all [m]."""
_SIDES = (("front", "back"), ("left", "right"), ("top", "bottom"))
"""Names of faces that look along +x and -x of the mesh, +y and -y, +z and -z."""


@dataclass(frozen=True, kw_only=True)
class SolidFace(Wall):
    """A face of a piece of furniture, with a half-space of material behind it.

    The face consists of ``patches`` in its rectangle, given as openings are, and fills the
    ``fraction`` of them. A thin ``sheet`` reflects on both sides.
    """

    thickness_m: float = 0.0
    patches: tuple[Opening, ...]
    fraction: float = 1.0
    sheet: bool = False

    @property
    def filled_m2(self) -> float:
        """Area of the face itself [m^2]."""
        return self.fraction * sum(wide * high for _, _, wide, high in self.patches)


class FaceSummary(NamedTuple):
    """What became of a face: its area [m^2], and the ``reason`` why it was left out, "" if not."""

    name: str
    area_m2: float
    reason: str


def reflecting_faces(
    scene: Scene, radar: Radar, place: Array, body: Body, room: Occluders | None
) -> tuple[tuple[Face, ...], tuple[FaceSummary, ...]]:
    """Find the faces of furniture over which the radar may see parts of a body at some time.

    The specular points on such a face, for the middle of the array at a place (3,) [m], are at most
    the radius of the Fresnel zone beside it, the face is as wide as that radius, and furniture
    leaves both legs free. In the mean over the parts and `_TIMES` poses the ghosts are expected at
    most `FAINT_DB` below the direct echoes. Returned are these faces, and what became of every
    face.
    """
    points = body.at(np.linspace(0.0, body.duration_s, _TIMES)).centres.reshape(-1, 3)
    found, summaries = [], []
    # A face is worth paths over it if the ghosts that it sends are expected above a level.
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
    # Where the face would reflect each point, if it were endless.
    (_, met, _), valid = corners((face,), place, points, beside_m=np.inf)
    met, points = met[valid], points[valid]
    first, last = np.linalg.norm(met - place, axis=1), np.linalg.norm(met - points, axis=1)
    cosine = np.abs((met - place) @ wall.normal) / first
    # Only places within the Fresnel zone of the face count, and only if the face is as wide.
    zone = np.sqrt(radar.wavelength_m * first * last / (first + last))
    near = (zone <= narrow) & inside(wall, met, zone / cosine)
    if room is not None:
        near[near] = room.clear(place, met[near]) & room.clear(met[near], points[near])
    eta = wall.material.eta(radar.centre_frequency_hz)
    reflected = [np.abs(reflection(eta, cosine, kind)) ** 2 for kind in POLARIZATIONS]
    # The longer path, and the part of the rectangle that the face fills, take from the field.
    lost = np.linalg.norm(points - place, axis=1) / (first + last) * near
    return np.asarray(np.max(reflected, axis=0) * (lost * filled) ** 2)


def faces_of(piece: Furniture) -> Iterator[SolidFace]:
    """Yield the flat faces of a piece, the largest first: `wardrobe front`, `wardrobe front 2`."""
    triangles = piece.triangles()
    faces = np.asarray(triangles.faces, dtype=np.int64)
    found = _flat_faces(triangles.vertices.tobytes(), faces.tobytes())
    count = Counter[str]()
    for own in found:
        # The side of the piece that the face is on gives its name.
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
    # Facets in one plane are one surface: they are found by their rounded normal and distance.
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
    """Make the rectangle and the patches of facets in one plane, the largest facet first.

    ``corners`` are the corners (corner, 3) of the triangles of each facet. A facet that is no
    rectangle along the axes of the largest one is left out.
    """
    from trimesh.bounds import oriented_bounds_2D

    least_box: Any = oriented_bounds_2D  # has no types
    # The axes of the smallest rectangle around the largest facet.
    along = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    axes = np.stack([along, np.cross(normal, along)]) / np.linalg.norm(along)
    turn = least_box(corners[0] @ axes.T)[0][:2, :2]
    # A proper rotation: the second axis is a quarter turn on from the first.
    axes = np.stack([turn[0], [-turn[0, 1], turn[0, 0]]]) @ axes
    # Only facets that nearly fill a rectangle along these axes, and are not too narrow.
    boxes = []
    for own, area in zip(corners, areas, strict=True):
        low, high = (end(own @ axes.T, axis=0) for end in (np.min, np.max))
        if area >= _FILLED * np.prod(high - low) and (high - low).min() >= _NARROWEST_M:
            boxes.append((low, high, area))
    if not boxes:
        return None
    # One rectangle around all, with the facets as patches in it.
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
