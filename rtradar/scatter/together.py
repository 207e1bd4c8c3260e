"""Several targets as one: the echoes of people and of objects that move, on common frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import interpolation_weights
from rtradar.scatter.common.poses import EchoModel, account_of
from rtradar.scatter.echo_models import build_model
from rtradar.scatter.multipath.room_model import RoomModel
from rtradar.scatter.rigid import Past, RigidEchoes
from rtradar.scatter.validity import Limit
from rtradar.scene import Scene
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer
from rtradar.trace.room_tracer import RoomTracer


def together(several: Sequence[Echoes]) -> Echoes:
    """Put the echoes of several targets, of the same chirps, one after the other.

    The nodes are those of the echoes with the most of them; the polynomials of the others are
    evaluated there, which changes nothing. Parts keep their numbers.
    """
    first = several[0]
    nodes = max((own.frequency for own in several), key=len)
    amplitudes = []
    for own in several:
        same = np.array_equal(own.frequency, nodes)
        weights = None if same else interpolation_weights(own.frequency, nodes)
        amplitude = own.amplitude
        if weights is not None:
            amplitude = np.tensordot(weights.astype(amplitude.real.dtype), amplitude, axes=1)
        amplitudes.append(amplitude)
    return Echoes(
        length=np.concatenate([own.length for own in several], axis=2),
        amplitude=np.concatenate(amplitudes, axis=3),
        frequency=nodes,
        tx=first.tx,
        part=np.concatenate([own.part for own in several]),
        bounces=np.concatenate([own.bounces for own in several]),
    )


class World:
    """The echoes of people, by the model ``person``, and those of moving objects.

    The part of an object comes after the ``parts`` of the people, in the order of the objects.
    ``limits`` are those of the objects.
    """

    def __init__(
        self, person: EchoModel, parts: int, radar: Radar, objects: Sequence[RigidEchoes]
    ) -> None:
        self.person, self.objects = person, tuple(objects)
        self._parts, self._radar = parts, radar
        self.variant = person.variant

    @property
    def limits(self) -> tuple[Limit, ...]:
        """Limits of validity that the objects come near or go past."""
        return tuple(limit for own in self.objects for limit in own.limits)

    def account(self) -> dict[str, Any] | None:
        """Report what the model of the people did."""
        return account_of(self.person)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps, those of the people first."""
        chirps = np.asarray(chirps, dtype=np.int64)
        tx, found = self._radar.tx_of_chirp(chirps), [self.person.echoes(chirps)]
        for number, own in enumerate(self.objects):
            length, amplitude = own.echoes(chirps)
            count = length.shape[2]
            found.append(
                Echoes(
                    length=length,
                    amplitude=amplitude,
                    frequency=own.frequency,
                    tx=tx,
                    part=np.full(count, self._parts + number),
                    bounces=np.ones(count, dtype=np.int64),
                )
            )
        return together(found)


def build_world(
    fidelity: str,
    radar: Radar,
    body: Body,
    *,
    scene: Scene,
    variant: str = "auto",
    spreading: bool = True,
    **options: Any,
) -> EchoModel:
    """Build the model of that name for the people, and that of the objects of the scene.

    Without objects it is what `build_model` makes, whose parameters and errors these are. A level
    that traces nothing lets nothing occlude an object either.
    """
    given: dict[str, Any] = {"scene": scene, "variant": variant, "spreading": spreading, **options}
    model = build_model(fidelity, radar, body, **given)
    if not scene.objects:
        return model
    past = None
    if model.variant is not None:
        mi = use(select(variant))
        past = Past(RoomTracer(mi, scene), body, BodyTracer(mi, body.semi_axes))
    objects = [
        RigidEchoes(radar, moving, body.duration_s, past, spreading=spreading)
        for moving in scene.objects
    ]
    return World(model, len(body.part_names), radar, objects)


def model_of_people(model: EchoModel) -> EchoModel:
    """Return the model of the people alone, without objects and without a room."""
    person = model.person if isinstance(model, World) else model
    return person.person if isinstance(person, RoomModel) else person
