"""Static clutter of a room: traced once, for every Tx and every Rx kept with it.

It holds specular reflections by walls up to an order of images, furniture by physical optics over
facets, corner reflectors with several bounces, and the diffuse returns of rough walls. It does not
hold the direct coupling from Tx to Rx, which is the radar's and not the room's; bounces between
furniture and walls or other furniture; waves diffracted at edges of walls. Antennas look as their
patterns say: isotropic ones receive what is right below, above and behind the radar as no real ones
would. A room at rest is the same in every TDM cycle: its IF is computed once.
"""

from __future__ import annotations

import copy
import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.clutter.furniture import furniture_returns
from rtradar.scatter.clutter.returns import FREQUENCY_ERROR, RoomEchoes
from rtradar.scatter.clutter.wall_returns import rough_returns, specular_returns
from rtradar.scatter.multipath.path_summary import MARGIN_DB
from rtradar.scene import Scene
from rtradar.trace.backend import Backend, select, use
from rtradar.trace.occluders import Occluders

MOST_ORDER = 3
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


def _meshes(scene: Scene) -> bytes:
    """Hash the triangles of furniture, whose files may change."""
    digest = hashlib.sha256()
    for piece in scene.furniture:
        triangles = piece.triangles()
        digest.update(triangles.vertices.tobytes())
        digest.update(triangles.faces.tobytes())
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
    return tuple((_item(echoes, radar), echoes) for echoes in found)


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
        if isinstance(order, bool) or not (isinstance(order, int) and 0 <= order <= MOST_ORDER):
            raise InputError(
                f"clutter: order = {order}; allowed are 0 to {MOST_ORDER} walls on a path"
            )
        self.radar = radar
        # Without what does not stand still.
        still = Scene(name=scene.name, walls=scene.walls, furniture=scene.furniture)
        found = _returns(radar, still, _meshes(scene), select(variant), order)
        _refuse_not_followed([echoes for _, echoes in found], scene)
        ranked = sorted(found, key=lambda one: -one[0].cell_m2)
        self.objects = tuple(echoes for item, echoes in ranked if item.cell_m2 > 0)
        self.kept = tuple(item for item, _ in ranked if item.cell_m2 > 0)
        far = f"farther than the {radar.max_range_m:.3g} m that the sampling reaches"
        self.dropped = tuple(replace(item, reason=far) for item, _ in ranked if item.cell_m2 == 0)

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
        kept, dropped = [], []
        for item, own in zip(self.kept, self.objects, strict=True):
            ratio = item.cell_m2 * gain / noise_power_m2 if noise_power_m2 > 0 else math.inf
            if ratio >= 10 ** (-margin_db / 10):
                kept.append((item, own))
                continue
            below = -10 * math.log10(ratio)
            reason = f"{below:.0f} dB below the noise in its strongest cell, after all gain"
            dropped.append(replace(item, reason=reason))
        pruned = copy.copy(self)
        pruned.kept = tuple(item for item, _ in kept)
        pruned.objects = tuple(own for _, own in kept)
        pruned.dropped = (*self.dropped, *dropped)
        return pruned

    def behind(self) -> tuple[float, str]:
        """Return the fraction of the power from behind the antennas, and the object with most.

        That is what leaves or arrives at an angle of more than 90 degrees from boresight.
        """
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
    strongest = max(
        (float(np.abs(echoes.amplitude).max(initial=0.0)) for echoes in found), default=0.0
    )
    for echoes in found:
        if echoes.off_m > FREQUENCY_ERROR * strongest:
            raise InputError(
                f"clutter of scene '{scene.name}': over the sweep the return '{echoes.name}' is "
                f"off by {echoes.off_m / strongest:.2g} of the strongest, allowed is "
                f"{FREQUENCY_ERROR:g}; take a thinner wall, one of a permittivity that changes "
                "less over the sweep, or a narrower sweep"
            )


def _item(echoes: RoomEchoes, radar: Radar) -> ClutterItem:
    power, cell = echoes.power_m2(), echoes.strongest_cell_m2(radar)
    most = int(echoes.bounces.max())
    return ClutterItem(echoes.name, echoes.kind, most, echoes.n_echoes, power, cell)
