"""Static clutter of a room: traced once, for every Tx and every Rx kept with it.

What is in it: mirror reflections by walls up to an order of images, furniture by physical optics over facets, corner
reflectors with several bounces, and the diffuse returns of rough walls. What is not: the direct coupling from Tx to Rx, which
is the radar's and not the room's; bounces between furniture and walls or other furniture; waves diffracted at edges of walls.
Antennas send and hear alike in all directions: what is right below, above and behind the radar is louder than with real ones.
A room that stands still is the same in every TDM cycle: its IF is made once, and added to each.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.clutter.diffuse import rough_returns
from rtradar.scatter.clutter.furniture import furniture_returns
from rtradar.scatter.clutter.returns import FREQUENCY_ERROR, RoomEchoes
from rtradar.scatter.clutter.specular_walls import mirror_returns
from rtradar.scatter.common.nodes import sweep_nodes
from rtradar.scatter.multipath.path_summary import MARGIN_DB
from rtradar.scene import Scene
from rtradar.trace.backends.backend import select, use
from rtradar.trace.room_tracer import RoomTracer

MOST_ORDER = 3


@dataclass(frozen=True)
class ClutterItem:
    """One line of the list of what a room returns.

    Parameters
    ----------
    name : str
        Name of the wall, of the walls in the order of reflection, or of the piece of furniture.
    kind : {"mirror", "furniture", "reflector", "rough"}
    bounces : int
        The most.
    echoes : int
    power_m2 : float
        Sum of the squared amplitudes, mean over the channels [m^2].
    cell_m2 : float
        The most that any channel has of it in one range bin [m^2].
    reason : str
        Why it was dropped; empty where it is kept.
    """

    name: str
    kind: str
    bounces: int
    echoes: int
    power_m2: float
    cell_m2: float
    reason: str = ""


class Clutter:
    """Static clutter of a scene.

    Parameters
    ----------
    radar : Radar
        Where it stands in the scene: `Scene.place` puts it there.
    scene : Scene
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend.
    spreading : bool
        Must be True where there is anything to reflect: a mirror without spreading has no meaning.
    seed : int
        Seed of the positions and phases of diffuse returns.
    order : int
        The most walls of a mirrored path, 0 to 3.

    Attributes
    ----------
    radar : Radar
    variant : str
        Kind of the backend in use.
    objects : tuple of RoomEchoes
        What is kept, the strongest first.
    kept, dropped : tuple of ClutterItem
        The same in figures, and what is too far for the radar or was taken out by `prune`.

    Raises
    ------
    InputError
        Where an option is out of range, a mesh cannot be used, or walls change a return faster over the sweep than a polynomial
        follows to a thousandth of the strongest.
    BackendError
        Where no backend of that kind works here.
    """

    def __init__(
        self,
        radar: Radar,
        scene: Scene,
        *,
        variant: str = "auto",
        spreading: bool = True,
        seed: int = 0,
        order: int = 2,
    ) -> None:
        if isinstance(order, bool) or not (isinstance(order, int) and 0 <= order <= MOST_ORDER):
            raise InputError(
                f"clutter: order = {order}; allowed are 0 to {MOST_ORDER} walls on a path"
            )
        if not spreading and (scene.walls or scene.furniture):
            raise InputError(
                f"clutter: no spreading in scene '{scene.name}'; it can be left out in free space only"
            )
        backend = select(variant)
        mi = use(backend)
        self.radar, self.variant = radar, backend.kind
        tracer = RoomTracer(mi, scene)
        found = [
            *mirror_returns(radar, scene, tracer, order),
            *furniture_returns(mi, radar, scene),
            *rough_returns(radar, scene, tracer, seed),
        ]
        _refuse_not_followed(found, scene)
        items = [_item(echoes, radar) for echoes in found]
        heard = [index for index, item in enumerate(items) if item.cell_m2 > 0]
        ranks = sorted(heard, key=lambda index: -items[index].cell_m2)
        self.objects = tuple(found[index] for index in ranks)
        self.kept = tuple(items[index] for index in ranks)
        far = f"farther than the {radar.max_range_m:.3g} m that the sampling reaches"
        self.dropped = tuple(replace(item, reason=far) for item in items if item.cell_m2 == 0)

    @property
    def n_echoes(self) -> int:
        """Of all objects."""
        return sum(echoes.n_echoes for echoes in self.objects)

    def prune(self, noise_power_m2: float, margin_db: float = MARGIN_DB) -> Clutter:
        """Without what stays below the noise, in every cell that is looked at, by a margin.

        Parameters
        ----------
        noise_power_m2 : float
            Complex noise power per sample [m^2]; 0 keeps all.
        margin_db : float
            An object goes where its strongest range bin, after the gain of all samples of a frame and of all channels, is
            lower than the noise by more than this.

        Returns
        -------
        Clutter
            Another one; what it lacks is in its ``dropped``, with the reason.
        """
        gain = self.radar.samples_per_chirp * self.radar.cycles_per_frame * self.radar.n_channels
        over = [
            item.cell_m2 * gain / noise_power_m2 if noise_power_m2 > 0 else math.inf
            for item in self.kept
        ]
        above = [index for index, ratio in enumerate(over) if ratio >= 10 ** (-margin_db / 10)]
        pruned = copy.copy(self)
        pruned.objects, pruned.kept = (
            tuple(self.objects[index] for index in above),
            tuple(self.kept[index] for index in above),
        )
        pruned.dropped = self.dropped + tuple(
            replace(
                item,
                reason=f"{-10 * math.log10(ratio):.0f} dB below the noise in its strongest cell, after all gain",
            )
            for index, (item, ratio) in enumerate(zip(self.kept, over, strict=True))
            if index not in above
        )
        return pruned

    def cycle(self) -> Iterator[Echoes]:
        """Echoes of one TDM cycle, chirps 0 to n_tx - 1, object by object, each at as few frequencies as serve it.

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

    def echoes(self) -> Echoes:
        """All echoes of one TDM cycle in one, at the frequencies of the object that needs most; ``part`` as in `cycle`."""
        frequency = sweep_nodes(
            self.radar, max((len(own.frequency) for own in self.objects), default=1)
        )
        shape = (self.radar.n_tx, self.radar.n_rx, 0)
        amplitudes = [own.at_nodes(frequency) for own in self.objects]
        return Echoes(
            length=np.concatenate(
                [np.empty(shape), *(own.length for own in self.objects)], axis=-1
            ),
            amplitude=np.concatenate(
                [np.empty((len(frequency), *shape), dtype=np.complex128), *amplitudes], axis=-1
            ),
            frequency=frequency,
            tx=np.arange(self.radar.n_tx),
            part=-1
            - np.repeat(np.arange(len(self.objects)), [own.n_echoes for own in self.objects]),
            bounces=np.concatenate(
                [np.empty(0, dtype=np.int64), *(own.bounces for own in self.objects)]
            ),
        )


def _refuse_not_followed(found: Sequence[RoomEchoes], scene: Scene) -> None:
    """Refuse a room whose strongest echoes are not followed over the sweep, by what is known to be wrong of all others."""
    strongest = max(
        (float(np.abs(echoes.amplitude).max(initial=0.0)) for echoes in found), default=0.0
    )
    for echoes in found:
        if echoes.off_m > FREQUENCY_ERROR * strongest:
            raise InputError(
                f"clutter of scene '{scene.name}': over the sweep the return '{echoes.name}' is off by "
                f"{echoes.off_m / strongest:.2g} of the strongest, allowed is {FREQUENCY_ERROR:g}; take a thinner wall, one of a "
                "permittivity that changes less over the sweep, or a narrower sweep"
            )


def _item(echoes: RoomEchoes, radar: Radar) -> ClutterItem:
    power, cell = echoes.power_m2(), echoes.strongest_cell_m2(radar)
    return ClutterItem(
        echoes.name, echoes.kind, int(echoes.bounces.max()), echoes.n_echoes, power, cell
    )
