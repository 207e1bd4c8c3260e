"""Several targets as one, people and objects that move, and all Tx of binary phase modulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import field_of, together
from rtradar.scatter.common.poses import EchoModel, account_of, one_echo_a_part
from rtradar.scatter.echo_models import build_model, takes_backend
from rtradar.scatter.multipath.image_paths import WallPath, wall_paths
from rtradar.scatter.multipath.path_summary import MARGIN_DB
from rtradar.scatter.multipath.room_model import RoomModel
from rtradar.scatter.rigid_echoes import DIRECT, RigidEchoes
from rtradar.scatter.rigid_sheets import RigidSheet
from rtradar.scatter.validity import Limit, objects_inside
from rtradar.scene import Object, Scene
from rtradar.trace.backend import select, use
from rtradar.trace.occluders import Occluders

_INSTANTS = 8
"""Chirps of a capture at which the power of an object over a wall is looked at."""

_GLANCES = 64
"""Chirps of a capture at which the largest power of an object is looked for."""

LEAST_GHOST_DB = -25.0
"""Power of a ghost over that of the object's direct echoes, below which it is left out: each ghost
takes as long to compute as the direct echoes."""


class Nobody:
    """A model of nobody in a scene, without echoes; ``variant`` is the backend for its objects."""

    def __init__(self, radar: Radar, variant: str | None) -> None:
        self._radar, self.variant = radar, variant

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """No echoes at these chirps."""
        tx = self._radar.tx_of_chirp(chirps)
        none = np.empty((len(tx), self._radar.n_rx, 0))
        return one_echo_a_part(tx, none, none, self._radar.centre_frequency_hz)


class PeopleAndObjects:
    """The echoes of people, by the model ``person``, and those of moving objects.

    The ``objects (object, path)`` answer over several paths, the direct one first. The part of an
    object comes after the ``parts`` of the people, in the order of the objects. ``limits`` are the
    limits of validity that the objects come near or go past. ``variant`` is the backend that traces
    for the people. ``people_alone`` is their model without objects and without a room; ``room`` is
    the one in a room, None without a room or with nobody in it. ``paths`` are the paths of their
    echoes, by the number that an echo has.
    """

    def __init__(
        self,
        person: EchoModel,
        parts: int,
        objects: Sequence[Sequence[RigidEchoes]],
        limits: Sequence[Limit] = (),
    ) -> None:
        self.person, self.objects, self._parts = person, list(map(list, objects)), parts
        self.limits, self.variant = tuple(limits), person.variant
        room = person if isinstance(person, RoomModel) else None
        # Free space may be a room without walls, in which the people are alone.
        self.room = None if room is None or room.person is room else room
        self.people_alone = person if self.room is None else self.room.person
        self.paths = (DIRECT,) if self.room is None else self.room.paths

    @property
    def path_names(self) -> tuple[str, ...]:
        """Name of each path, by the number that an echo has of it: those of the people first."""
        every = [*self.paths, *(path.path for own in self.objects for path in own)]
        return tuple(dict.fromkeys(path.name for path in every))

    def with_person(self, person: EchoModel) -> PeopleAndObjects:
        """Return the same objects with another model of the people."""
        return PeopleAndObjects(person, self._parts, self.objects, self.limits)

    def account(self) -> dict[str, Any] | None:
        """Report what the model of the people did."""
        return account_of(self.person)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps, those of the people first."""
        chirps = np.asarray(chirps, dtype=np.int64)
        if not self.objects:
            return self.person.echoes(chirps)
        found, names = [self.person.echoes(chirps)], self.path_names
        # Objects count as parts after those of the people, and their paths have the numbers of the
        # names.
        for number, own in enumerate(self.objects, start=self._parts):
            for path in own:
                echoes = path.echoes(chirps)
                over = np.full(len(echoes.part), names.index(path.path.name))
                found.append(replace(echoes, part=echoes.part + number, path=over))
        return together(found)

    def movers(self, n_chirps: int) -> list[tuple[float, float]]:
        """Largest power of each object over some instants [m^2], and its delay then [s].

        A corner or a sheet of metal that turns towards the radar answers far above its mean.
        """
        # A flash may last a few chirps, so the largest power is looked for at more instants than a
        # mean would need.
        chirps = np.unique(np.linspace(0, n_chirps - 1, _GLANCES).astype(np.int64))
        found = []
        for direct, *_ in self.objects:
            echoes = direct.echoes(chirps)
            powers = _powers(echoes)
            delay_s = float(echoes.length[powers.argmax()].mean()) / SPEED_OF_LIGHT_MPS
            found.append((float(powers.max()), delay_s))
        return found

    def prune(self, radar: Radar, n_chirps: int, noise_power_m2: float) -> list[dict[str, Any]]:
        """Leave out ghosts of objects that are not worth their cost.

        Left out are ghosts that stay more than `MARGIN_DB` below the noise of an IF sample [m^2],
        after the gain of a frame, or `LEAST_GHOST_DB` below the direct echoes of their object;
        without noise, only those that are never seen. Returned are the ``name`` of each object and
        its ``paths``, with the ``path``, its ``power_m2`` and whether it is ``kept``.
        """
        # The gain of a frame over the noise of one sample, if all its samples, cycles and channels
        # add up.
        gain = radar.samples_per_chirp * radar.cycles_per_frame * radar.n_channels
        least = noise_power_m2 / gain * 10 ** (-MARGIN_DB / 10)
        chirps = np.unique(np.linspace(0, n_chirps - 1, _INSTANTS).astype(np.int64))
        found = []
        for number, own in enumerate(self.objects):
            # The mean power of every path of this object, the direct one first.
            powers = [float(_powers(path.echoes(chirps)).mean()) for path in own]
            enough = max(least, powers[0] * 10 ** (LEAST_GHOST_DB / 10)) if least else 0.0
            worth = [not place or 0 < power >= enough for place, power in enumerate(powers)]
            rows = [
                {"path": path.path.name.replace("body", "object"), "power_m2": power, "kept": kept}
                for path, power, kept in zip(own, powers, worth, strict=True)
            ]
            found.append({"name": own[0].moving.name, "paths": rows})
            self.objects[number] = [path for path, kept in zip(own, worth, strict=True) if kept]
        return found


def _powers(echoes: Echoes) -> NDArray[np.float64]:
    """Power of echoes (chirp,) [m^2]; they are summed as fields, because neighbours interfere."""
    fields = field_of(echoes, echoes.frequency)
    return np.asarray((np.abs(fields) ** 2).mean(axis=(0, 2)))


def build_model_of_all(
    fidelity: str,
    radar: Radar,
    body: Body,
    *,
    scene: Scene,
    order: int = 1,
    variant: str = "auto",
    spreading: bool = True,
    **options: Any,
) -> PeopleAndObjects:
    """Build the model of that name for the people, and that of the objects of the scene.

    Parameters and errors are those of `build_model`. A level that traces nothing lets nothing
    occlude an object either.
    """
    overlaps = objects_inside(scene, body.duration_s) if scene.objects else []
    # The people first, who may be nobody: then only the backend for the objects is settled.
    settled: dict[str, Any] = {"scene": scene, "order": order, "variant": variant, **options}
    if len(body.part_names):
        model = build_model(fidelity, radar, body, spreading=spreading, **settled)
    else:
        model = Nobody(radar, select(variant).kind if takes_backend(fidelity) else None)
    if scene.objects and radar.is_moving and (scene.walls or scene.furniture):
        raise InputError(
            f"scene '{scene.name}': objects that move, in a room before a radar that moves, are "
            f"not simulated; leave out '{scene.objects[0].name}', the walls and furniture, or "
            "path_times_s"
        )
    # What may occlude an object, if the level traces anything at all.
    past = None
    if scene.objects and model.variant is not None:
        past = Occluders(use(select(variant)), scene, body)
    given: dict[str, Any] = {"past": past, "walls": scene.walls, "spreading": spreading}
    # Every object answers over every path.
    paths = wall_paths(scene.walls, np.array(radar.position_m), order)

    def echoes(moving: Object, path: WallPath) -> RigidEchoes:
        # Rays follow several bounces on a sheet.
        sheet = past is not None and not (moving.shape.closed or path.order)
        kind = RigidSheet if sheet else RigidEchoes
        return kind(radar, moving, body.duration_s, path=path, **given)

    objects = [[echoes(moving, path) for path in paths] for moving in scene.objects]
    limits = [*overlaps, *(limit for own in objects for path in own for limit in path.limits)]
    return PeopleAndObjects(model, len(body.part_names), objects, limits)


class BinaryPhaseModel:
    """The echoes of every Tx at every chirp, with their signs (:eq:`bpm`).

    There are as many models as Tx, which ``build`` makes. Each answers for a radar under TDM whose
    order of Tx begins with another Tx, so that at any chirp each of them has a different Tx.
    """

    def __init__(self, radar: Radar, build: Callable[[Radar], EchoModel]) -> None:
        self._radar = radar
        # Rolled by s, the order gives the Tx of slot i + s at slot i, so all models together have
        # all Tx.
        order = range(radar.n_tx) if radar.tx_order is None else radar.tx_order
        orders = [np.roll(order, -shift).tolist() for shift in range(radar.n_tx)]
        self._models = [build(replace(radar, multiplexing="tdm", tx_order=own)) for own in orders]
        self.variant = self._models[0].variant

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps, those of all Tx one after the other."""
        slot, found = self._radar.tx_of_chirp(chirps), []
        for shift, model in enumerate(self._models):
            own = model.echoes(chirps)
            sign = self._radar.tx_signs[slot, (slot + shift) % self._radar.n_tx]
            amplitude = own.amplitude * sign.astype(own.amplitude.real.dtype)[:, None, None]
            found.append(replace(own, amplitude=amplitude))
        return together(found)
