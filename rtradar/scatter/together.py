"""Several targets as one: the echoes of people and of objects that move, on common frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.echo_sets import together
from rtradar.scatter.common.poses import EchoModel, account_of
from rtradar.scatter.echo_models import build_model
from rtradar.scatter.multipath.room_model import RoomModel
from rtradar.scatter.rigid import RigidEchoes
from rtradar.scatter.rigid_legs import Past
from rtradar.scatter.validity import Limit
from rtradar.scene import Scene
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer
from rtradar.trace.room_tracer import RoomTracer


class World:
    """The echoes of people, by the model ``person``, and those of moving objects.

    The part of an object comes after the ``parts`` of the people, in the order of the objects.
    ``limits`` are those of the objects.
    """

    def __init__(self, person: EchoModel, parts: int, objects: Sequence[RigidEchoes]) -> None:
        self.person, self.objects, self._parts = person, tuple(objects), parts
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
        found = [self.person.echoes(chirps)]
        for number, own in enumerate(self.objects, start=self._parts):
            echoes = own.echoes(chirps)
            found.append(replace(echoes, part=echoes.part + number))
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
    objects = []
    tracers = None
    if model.variant is not None:
        mi = use(select(variant))
        tracers = mi, RoomTracer(mi, scene), BodyTracer(mi, body.semi_axes)
    for moving in scene.objects:
        past = None
        if tracers is not None:
            mi, room, people = tracers
            others = tuple(other for other in scene.objects if other is not moving)
            past = Past(mi, room, RoomTracer(mi, replace(scene, objects=others)), body, people)
        own = RigidEchoes(
            radar, moving, body.duration_s, past, walls=scene.walls, spreading=spreading
        )
        objects.append(own)
    return World(model, len(body.part_names), objects)


def model_of_people(model: EchoModel) -> EchoModel:
    """Return the model of the people alone, without objects and without a room."""
    person = model.person if isinstance(model, World) else model
    return person.person if isinstance(person, RoomModel) else person
