"""Static clutter of a room: traced once, for every Tx and every Rx kept with it.

It holds specular reflections by walls up to an order of images, furniture by physical optics over
facets, corner reflectors with several bounces, and the diffuse returns of rough walls. It does not
hold the direct coupling from Tx to Rx, which belongs to the radar and not to the room; bounces
between furniture and walls or other furniture; and what edges of walls send where no wall mirrors
the path, or later than the range resolution. Antennas look as their patterns say: isotropic
antennas receive what is right below, above and behind the radar, as no real antenna would. A room
at rest is the same in every TDM cycle: its IF is computed once.

**What walls return** is specular reflections by images, and diffuse returns of rough faces. A wall
reflects like an infinite one where the specular point lies well inside its rectangle, and fades at
edges that are free, by their diffraction (`rtradar.scatter.multipath.wall_edges`); only furniture
occludes it. The field on a path of length L is that of free space times what the walls do. So an
echo is F = -2 sqrt(pi) (p_rx . E) / L, whose square is a radar cross-section; with a conductor,
which reverses E, it is +2 sqrt(pi) / L. Waves that go to and fro inside one wall are in its slab's
coefficient, or are echoes of their own where no polynomial over the sweep follows that coefficient
(`rtradar.scatter.multipath.slabs`). Left out are waves between a wall and a pane right before it; a
reflection by the pane's back is in, once.

The fraction of the reflected power that roughness takes from the specular wave,
1 - exp(-(2 k s)^2 cos_i cos_s) (Ament, Proc. IRE 41 (1953) 142, made reciprocal by the mean of both
angles), goes into all directions before the wall by Lambert's law: the effective roughness of
Degli-Esposti, Fuschini, Vitucci and Falciasecca, IEEE Trans. Antennas Propag. 55 (2007) 143, with
S^2 from the height of the surface instead of a fit. So the power per area is

    sigma0 = 4 S^2 |R|^2 cos_i cos_s,

with R of the smooth slab at the angle of each leg, for the polarisation that arrives. Over half of
space this adds up to S^2 |R|^2 of what arrives, and specular and diffuse power together to what a
smooth wall reflects. All of it counts as co-polar. A point represents its cell of a jittered grid.
Cells are two range bins wide, 0.1 m at most, and wider where a face would have more than 40 000:
near cells give a grainier return than a real wall, with the right mean power.
"""

from __future__ import annotations

import copy
import hashlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise, product
from math import ceil, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.front_end import Antenna
from rtradar.radar import Radar
from rtradar.scatter.clutter.furniture import furniture_returns
from rtradar.scatter.clutter.returns import (
    ENOUGH,
    FREQUENCY_ERROR,
    RoomEchoes,
    behind_walls,
    delayed,
)
from rtradar.scatter.common.interpolation import sweep_nodes
from rtradar.scatter.common.polarization import Polarization, sent_field
from rtradar.scatter.multipath.image_paths import Face, Leg, height, image_chain, images
from rtradar.scatter.multipath.path_summary import MARGIN_DB
from rtradar.scatter.multipath.slabs import (
    DENSE_NODES,
    WHOLE,
    WallResponse,
    after_slab,
    whole_walls,
)
from rtradar.scatter.multipath.wall_edges import WallEdges
from rtradar.scene import Scene
from rtradar.system.checks import check_order
from rtradar.system.seeds import stream
from rtradar.trace.backend import Backend, select, use
from rtradar.trace.occluders import Occluders

Array = NDArray[np.float64]

# -- walls -----------------------------------------------------------------------------------------


_EDGE_M = 1e-9
"""Distance up to which a point lies on an edge [m]: rounding is a millionth of that."""
_FAINT = 0.1 * FREQUENCY_ERROR
"""Terms weaker than this fraction of the strongest of a reflection are left out."""

CELL_BINS, CELL_M = 2.0, 0.1
"""Width of a cell of a rough wall in range bins, and its largest width [m]."""
MOST_POINTS = 40_000
"""Largest number of points on one face of a wall; a larger face gets wider cells."""


def specular_returns(
    radar: Radar, scene: Scene, occluders: Occluders, order: int
) -> Iterator[RoomEchoes]:
    """Yield the specular reflections of up to ``order`` walls that some channel sees.

    There is one object for each sequence of walls. Furniture, which `Occluders` know, occludes
    legs.
    """
    # The first face must have a Tx before it, the last one an Rx.
    faces = [Face(wall, back) for wall in scene.walls for back in (False, True)]
    lit, received = (
        [face for face in faces if (height(face.wall, antennas, back=face.back) > 0).any()]
        for antennas in (radar.tx, radar.rx)
    )
    # All sequences of faces, in which no wall follows itself.
    for bounces in range(1, order + 1):
        choices = [lit, *[faces] * (bounces - 2), received]
        if bounces == 1:
            choices = [[face for face in lit if face in received]]
        for leg in product(*choices):
            if all(first.wall is not second.wall for first, second in pairwise(leg)):
                returns = _follow(radar, scene, occluders, leg)
                if returns is not None:
                    yield returns


def _follow(radar: Radar, scene: Scene, occluders: Occluders, leg: Leg) -> RoomEchoes | None:
    """Echoes over these faces, in as few terms as polynomials over the sweep follow."""
    tx, rx = radar.tx[:, None], radar.rx[radar.rx_of_tx]
    # At the edge of a right-angled corner the path goes over both walls in either order. With
    # margins of either sign each order gets half of its weight, so that both count as one.
    edges = WallEdges.of(scene.walls, radar)
    (stops, wide), (_, narrow) = (edges.leg(leg, tx, rx, margin) for margin in (_EDGE_M, -_EDGE_M))
    weight = (wide + narrow) / 2
    # The length is that from the image of the Tx over all faces.
    images = image_chain(leg, np.broadcast_to(tx, rx.shape))
    length = np.linalg.norm(rx - images[-1], axis=-1)
    which = np.flatnonzero(weight)
    ends = [stop.reshape(-1, 3)[which] for stop in stops]
    free = np.ones(len(which), dtype=bool)
    # Only channels whose sections are all free of furniture go on.
    for start, end in pairwise(ends):
        free &= occluders.clear(start, end)
    which, ends = which[free], [end[free] for end in ends]
    if not len(which):
        return None
    # Directions are taken from images, because in the crease of a corner a section has no length.
    sources = [image.reshape(-1, 3)[which] for image in images]
    ways = [end - source for source, end in zip(sources, ends[1:], strict=True)]
    ways = [way / np.linalg.norm(way, axis=-1, keepdims=True) for way in ways]
    # The field that is sent towards the first wall, and what the receiver would send back.
    polarization = Polarization(radar.polarization, radar.axes)
    ahead = sent_field(radar.tx_antenna, ways[0], polarization, x_for_steep=True)
    sent = ahead * weight.ravel()[which, None]
    received = sent_field(radar.rx_antenna, -ways[-1], polarization, x_for_steep=True)
    spread = -2 * sqrt(pi) / length.ravel()[which]
    frequency = sweep_nodes(radar, DENSE_NODES)
    best = None
    # First every wall as one term; if no polynomial follows that over the sweep, its terms as
    # delayed echoes.
    for series in (whole_walls, lambda walls: delayed(walls, radar)):
        walls = WallResponse(edges, series(scene.walls), frequency)
        waves = walls.along(leg, ends, ways, sent)
        returned = [spread * np.conj((wave.field * received).sum(axis=-1)) for wave in waves]
        # Faint terms are dropped; each of the others is an echo with its own length.
        sizes = [float(np.abs(one).max()) for one in returned]
        worth = [number for number, size in enumerate(sizes) if size > _FAINT * max(sizes)]
        amplitude = np.zeros((len(frequency), length.size, len(worth)), dtype=np.complex128)
        lengths = np.repeat(length.reshape(-1, 1), len(worth), axis=1)
        for echo, number in enumerate(worth):
            amplitude[:, which, echo] = returned[number]
            lengths[which, echo] += waves[number].extra_m
        if not amplitude.any():
            return None
        # At as few nodes as the error allows; the better of both attempts is kept.
        found = RoomEchoes(
            name=" + ".join(face.wall.name for face in leg),
            kind="mirror",
            length=lengths.reshape(*length.shape, -1),
            amplitude=amplitude.reshape(len(frequency), *length.shape, -1),
            frequency=frequency,
            bounces=np.full(len(worth), len(leg)),
            points=np.repeat(np.stack(stops[1:-1], axis=-2)[:, :, None], len(worth), axis=2),
            image=_image(leg),
        ).with_fewest_nodes(radar, FREQUENCY_ERROR if len(worth) == 1 else ENOUGH)
        if best is None or found.off_m < best.off_m:
            best = found
        if not best.off_m:
            break
    return best


def _image(leg: Leg) -> tuple[Array, Array]:
    """Rotation and shift that give the image of any point over a leg."""
    # Images of the origin and of the unit vectors give shift and rotation.
    origin = images(leg, np.zeros(3))
    return (images(leg, np.eye(3)) - origin).T, origin


# -- rough walls -----------------------------------------------------------------------------------


def rough_returns(radar: Radar, scene: Scene, occluders: Occluders) -> Iterator[RoomEchoes]:
    """Yield the diffuse returns of every face of a rough wall that has antennas before it.

    Furniture, which `Occluders` know, occludes points. Positions and phases belong to the wall's
    number and face, whatever the seed of a run: a room is the same for all who walk in it.
    """
    for (number, wall), back in product(enumerate(scene.walls), (False, True)):
        before = [(height(wall, places, back=back) > 0).any() for places in (radar.tx, radar.rx)]
        if wall.roughness_m > 0 and all(before):
            rng = np.random.default_rng(stream(0, number, int(back)))
            echoes = _rough_face(Face(wall, back), rng, radar, scene, occluders)
            if echoes.n_echoes:
                yield echoes


def _points(face: Face, cell_m: float, rng: np.random.Generator) -> tuple[Array, float, Array]:
    """Points (point, 3) of a jittered grid, the area of a cell [m^2] and phases (point,)."""
    wall = face.wall
    # One point at random in each cell, with a random phase, none in an opening.
    edges = np.array(wall.edge_u_m), np.array(wall.edge_v_m)
    cell_m = max(cell_m, np.sqrt(wall.area_m2 / MOST_POINTS))
    counts = [ceil(np.linalg.norm(edge) / cell_m) for edge in edges]
    cells = np.indices(counts).reshape(2, -1)
    u, v = (cells + rng.random(cells.shape)) / np.array(counts)[:, None]
    corner = np.array(wall.corner_m) - (wall.thickness_m if face.back else 0.0) * wall.normal
    points = corner + u[:, None] * edges[0] + v[:, None] * edges[1]
    phases, there = rng.uniform(0, 2 * np.pi, len(points)), ~wall.in_opening(points)
    return points[there], wall.area_m2 / len(points), phases[there]


def _rough_face(
    face: Face, rng: np.random.Generator, radar: Radar, scene: Scene, occluders: Occluders
) -> RoomEchoes:
    wall, cell_m = face.wall, min(CELL_BINS * radar.range_bin_m, CELL_M)
    points, area, phase = _points(face, cell_m, rng)
    frequency = np.array([radar.centre_frequency_hz])
    smooth = replace(wall, roughness_m=0.0)
    normal = -wall.normal if face.back else wall.normal
    polarization = Polarization(radar.polarization, radar.axes)

    def legs(antennas: Array, element: Antenna | None) -> tuple[Array, Array, Array]:
        """Distances, cosines and fields that a smooth wall would reflect, (antenna, point)."""
        # A point of the wall as each antenna sees it, with what a smooth wall would reflect there.
        ways = points - antennas[:, None]
        distance = np.linalg.norm(ways, axis=-1)
        ways /= distance[..., None]
        sent = sent_field(element, ways, polarization, x_for_steep=True)
        field = after_slab(smooth, sent.astype(np.complex128), ways, frequency, WHOLE[0])[0]
        clear = occluders.clear(antennas[:, None], points)
        strength = np.sqrt((np.abs(field) ** 2).sum(axis=-1)) * clear
        return distance, np.maximum(-(ways @ normal), 0.0), strength

    # Both legs of every channel: every Tx with the Rx that are kept with it.
    kept = radar.rx_of_tx
    far_t, cos_t, field_t = legs(radar.tx, radar.tx_antenna)
    far_r, cos_r, field_r = legs(radar.rx, radar.rx_antenna)
    cosines = cos_t[:, None] * cos_r[kept]
    # What roughness takes from the specular wave goes into all directions by Lambert's law.
    waves = 2 * np.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS * wall.roughness_m
    scattered = -np.expm1(-((2 * waves) ** 2) * cosines)
    # |R|^2 is the geometric mean of those of both legs.
    power = 4 * scattered * cosines * field_t[:, None] * field_r[kept] * area
    amplitude = np.sqrt(power) / (far_t[:, None] * far_r[kept]) * np.exp(1j * phase)
    returns = RoomEchoes(
        name=wall.name,
        kind="rough",
        length=far_t[:, None] + far_r[kept],
        amplitude=amplitude[None],
        frequency=frequency,
        bounces=np.ones(len(points), dtype=np.int64),
        points=points[None, None, :, None],
    ).received(radar)
    return behind_walls(returns, radar, scene).received(radar)


# -- all clutter of a room -------------------------------------------------------------------------


KEPT_ROOMS = 2
"""Rooms that stay in memory once they are traced; a furnished one may take 100 MB, to which
`rtradar.signal.clutter` adds its echoes once more, in groups."""


@dataclass(frozen=True)
class ClutterItem:
    """One line of the list of what a room returns.

    ``name`` and ``kind`` are those of `RoomEchoes`, ``bounces`` is the largest number of bounces,
    ``echoes`` the number of echoes. ``power_m2`` is the sum of the squared amplitudes, averaged
    over the channels, ``cell_m2`` the largest power that any channel has of it in one range bin
    [m^2]. ``reason`` says why it was dropped; it is empty if it is kept.
    """

    name: str
    kind: str
    bounces: int
    echoes: int
    power_m2: float
    cell_m2: float
    reason: str = ""

    @classmethod
    def of(cls, echoes: RoomEchoes, radar: Radar) -> ClutterItem:
        """Describe the echoes of an object."""
        own = int(echoes.bounces.max()), echoes.n_echoes, echoes.power_m2()
        return cls(echoes.name, echoes.kind, *own, echoes.strongest_cell_m2(radar))


def _meshes(scene: Scene) -> bytes:
    """Hash the triangles of furniture, whose files may change."""
    digest = hashlib.sha256()
    for piece in scene.furniture:
        triangles = piece.triangles()
        digest.update(np.ascontiguousarray(triangles.vertices).data)
        digest.update(np.ascontiguousarray(triangles.faces).data)
    return digest.digest()


@lru_cache(maxsize=KEPT_ROOMS)
def _returns(
    radar: Radar, scene: Scene, meshes: bytes, backend: Backend, order: int
) -> tuple[tuple[ClutterItem, RoomEchoes], ...]:
    """Trace walls as mirrors, furniture, and the diffuse returns of rough walls.

    The scene has nothing but these, and ``meshes`` are those of its furniture: equal rooms are one
    key, whoever is in them.
    """
    mi = use(backend)
    occluders = Occluders(mi, scene)
    found = (
        *specular_returns(radar, scene, occluders, order),
        *furniture_returns(mi, radar, scene),
        *rough_returns(radar, scene, occluders),
    )
    # What lies outside of every antenna's pattern, or behind all else, returns nothing.
    some = (echoes for echoes in found if echoes.n_echoes)
    return tuple((ClutterItem.of(echoes, radar), echoes) for echoes in some)


class Clutter:
    """Static clutter of a scene.

    Traced rooms are kept, `KEPT_ROOMS` of them: the next recording in one finds it traced.

    The radar is at its position in the scene, where `Scene.place` puts it; ``variant`` is Mitsuba's
    backend, ``order`` the largest number of walls on a specular path, 0 to 3. ``objects`` are
    the echoes that are kept, the strongest object first; ``kept`` and ``dropped`` the same in
    figures, and what is too far for the radar or was taken out by `prune`.

    An `InputError` is raised if an option is out of range, a mesh cannot be used, or walls change a
    return faster over the sweep than a polynomial follows to a thousandth of the strongest.
    """

    def __init__(
        self, radar: Radar, scene: Scene, *, variant: str = "auto", order: int = 2
    ) -> None:
        check_order(order)
        self.radar = radar
        # Only what stands still.
        still = Scene(name=scene.name, walls=scene.walls, furniture=scene.furniture)
        found = _returns(radar, still, _meshes(scene), select(variant), order)
        _refuse_not_followed([echoes for _, echoes in found], scene)
        # The strongest first, without what lies beyond the sampled range.
        ranked = sorted(found, key=lambda one: -one[0].cell_m2)
        self.objects = tuple(echoes for _, echoes in ranked)
        self.kept, self.dropped = tuple(item for item, _ in ranked), tuple[ClutterItem, ...]()
        far = f"farther than the {radar.max_range_m:.3g} m that the sampling reaches"
        self._drop(lambda item: far if item.cell_m2 == 0 else "")

    def _drop(self, reason: Callable[[ClutterItem], str]) -> None:
        """Leave out the objects for which there is a reason."""
        reasons = [reason(item) for item in self.kept]
        self.objects = tuple(one for one, why in zip(self.objects, reasons, strict=True) if not why)
        dropped = [replace(item, reason=why) for item, why in zip(self.kept, reasons, strict=True)]
        self.kept = tuple(item for item in dropped if not item.reason)
        self.dropped = (*self.dropped, *(item for item in dropped if item.reason))

    @property
    def n_echoes(self) -> int:
        """Number of echoes of all objects."""
        return sum(echoes.n_echoes for echoes in self.objects)

    def prune(self, noise_power_m2: float, margin_db: float = MARGIN_DB) -> Clutter:
        """Return a copy without objects that stay below the noise in every cell.

        It lists what it lacks in ``dropped``, with the reason. The noise is the complex power per
        sample [m^2]; 0 keeps all. An object stays up to the margin [dB] below it, for its strongest
        range bin after the gain of all samples of a frame and of all channels.
        """
        gain = self.radar.samples_per_chirp * self.radar.cycles_per_frame * self.radar.n_channels

        def reason(item: ClutterItem) -> str:
            ratio = item.cell_m2 * gain / noise_power_m2 if noise_power_m2 > 0 else math.inf
            if ratio >= 10 ** (-margin_db / 10):
                return ""
            below = -10 * math.log10(ratio)
            return f"{below:.0f} dB below the noise in its strongest cell, after all gain"

        pruned = copy.copy(self)
        pruned._drop(reason)
        return pruned

    def behind(self) -> tuple[float, str]:
        """Return the fraction of the power from behind the antennas, and the object with most.

        That is what leaves or arrives at an angle of more than 90 degrees from boresight.
        """
        # The first and the last point of a path say whether it leaves or arrives from behind.
        whole, of_objects = 0.0, {"": 0.0}
        for own in self.objects:
            power = np.abs(own.amplitude[len(own.frequency) // 2]) ** 2
            ends = (own.points[..., [0, -1], :] - self.radar.position_m) @ self.radar.axes[:, 0]
            whole += float(power.sum())
            of_objects[own.name] = float((power * (ends < 0).any(axis=-1)).sum())
        leader = max(of_objects, key=of_objects.__getitem__)
        return sum(of_objects.values()) / whole if whole > 0 else 0.0, leader

    def cycle(self) -> Iterator[Echoes]:
        """Yield the echoes of one TDM cycle, object by object, each at as few nodes as it needs.

        ``part`` is -1 for the first object, -2 for the second, and so on: body parts count from 0.
        """
        for index, own in enumerate(self.objects):
            yield Echoes(
                length=own.length,
                amplitude=own.amplitude,
                frequency=own.frequency,
                tx=np.arange(self.radar.n_tx),
                part=np.full(own.n_echoes, -1 - index),
                bounces=own.bounces,
            )


def _refuse_not_followed(found: Sequence[RoomEchoes], scene: Scene) -> None:
    """Refuse a room that has echoes with too large an error over the sweep."""
    strongest = max((echoes.strongest_m() for echoes in found), default=0.0)
    for echoes in found:
        if echoes.off_m > FREQUENCY_ERROR * strongest:
            raise InputError(
                f"clutter of scene '{scene.name}': over the sweep the return '{echoes.name}' is "
                f"off by {echoes.off_m / strongest:.2g} of the strongest, allowed is "
                f"{FREQUENCY_ERROR:g}; take a thinner wall, one of a permittivity that changes "
                "less over the sweep, or a narrower sweep"
            )
