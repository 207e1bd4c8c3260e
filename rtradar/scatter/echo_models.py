"""The echo models by their names."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.common.poses import EchoModel, account_of, has_mesh
from rtradar.scene import Scene
from rtradar.system.registries import MODELS

register_model = MODELS.register

_COMMON = ("radar", "body", "variant", "spreading")


def build_model(
    fidelity: str,
    radar: Radar,
    body: Body,
    *,
    scene: Scene | None = None,
    order: int = 1,
    variant: str = "auto",
    spreading: bool = True,
    materials: Sequence[str] = (),
    **model_options: Any,
) -> EchoModel:
    """Build the model of that name for this body, radar and scene, through the radar's antennas.

    A model answers for a conductor before isotropic antennas. Patterns of antennas, the material of
    the body, and what walls and furniture do come from the legs, the same for every model.

    Parameters
    ----------
    fidelity : str
        One of `MODELS`.
    radar : Radar
        Radar whose chirps and antennas the model uses.
    body : Body
        Person, or another moving body of ellipsoids.
    scene : Scene, optional
        Walls, furniture and moving objects. With any of them the model is a `RoomModel` around the
        one of that name.
    order : int
        Largest number of reflections at walls on a path, 0 to 3.
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend, for models that trace.
    spreading : bool
        Whether amplitudes hold 1 / (R1 R2).
    materials : (part,) sequence of str, optional
        Material of each part, ``perfect-conductor`` or ``skin``; by default perfect conductors.
    **model_options
        Settings of that model, such as ``visibility`` of ``specular``; its class documents them.

    Returns
    -------
    EchoModel

    Raises
    ------
    InputError
        If there is no such model, it has no such option, or a body is not made of that material.
    BackendError
        Where it traces and no backend of that kind works here.
    ExtensionError
        Where it is of another package, and fails.
    """
    kind = _kind_for(fidelity, body, model_options)
    room = None if scene is None or scene.is_empty else scene
    if room is not None and not spreading:
        raise InputError(
            f"scene '{room.name}': spreading may be off in free space only; leave --no-spreading "
            "out"
        )
    # A model that traces nothing takes no backend.
    backend = {"variant": variant} if takes_backend(fidelity) else {}

    # Walls, patterns and materials are put around a model of a conductor before given antennas, so
    # each path of a room may build one of its own.
    def conductor(before: Radar) -> EchoModel:
        with MODELS.guarded(fidelity):
            model: EchoModel = kind(before, body, spreading=spreading, **backend, **model_options)
        # A room recognises a formula by the attributes of the model, which a wrapper would hide.
        formula = getattr(model, "fast_over_walls", False) and hasattr(model, "conductor_echo")
        if fidelity in MODELS.built_in or formula:
            return model
        return _Checked(fidelity, model, before, body)

    from rtradar.scatter.multipath.room_model import RoomModel, in_free_space  # slow to import

    if room is None:
        return in_free_space(conductor, radar, body, materials)
    return RoomModel(conductor, room, radar, body, materials, order=order, **backend)


def _kind_for(fidelity: str, body: Body, model_options: Iterable[str]) -> Callable[..., EchoModel]:
    """Return what makes the model of that name for such a body; refuse options it does not have."""
    kind: Callable[..., EchoModel] = MODELS.find(fidelity)
    if has_mesh(body) and not getattr(kind, "accepts_meshes", False):
        raise InputError(
            f"fidelity '{fidelity}' takes people of ellipsoids, not body = 'mesh': it needs "
            "curvature in closed form; allowed for a mesh: "
            f"{', '.join(models_that('accepts_meshes'))}"
        )
    with MODELS.guarded(fidelity):
        refuse_options(f"fidelity '{fidelity}'", kind, model_options, _COMMON)
    return kind


def refuse_options(
    what: str, called: Callable[..., Any], options: Iterable[str], common: Iterable[str]
) -> None:
    """Raise InputError where what is called has no such option besides its common parameters."""
    known = [name for name in inspect.signature(called).parameters if name not in common]
    for option in options:
        if option not in known:
            raise InputError(
                f"{what} has no option '{option}'; it has: {', '.join(known) or 'none'}"
            )


def models_that(ability: str) -> list[str]:
    """List the built-in models with an ability, an attribute of `BuiltInModel` that holds."""
    return [name for name in MODELS.built_in if getattr(MODELS[name], ability, False)]


def affordable_models(most: float) -> list[str]:
    """Names of the built-in models that cost at most so many times as much as `analytic`."""
    priced = models_that("relative_cost")
    return [name for name in priced if MODELS[name].relative_cost <= most]


def takes_backend(fidelity: str) -> bool:
    """Whether the model of that name asks Mitsuba.

    Parameters
    ----------
    fidelity : str
        One of `MODELS`.

    Returns
    -------
    bool
    """
    kind = MODELS.find(fidelity)
    with MODELS.guarded(fidelity):
        return "variant" in inspect.signature(kind).parameters


class _Checked:
    """A model of another package, which must give what the rest relies on."""

    def __init__(self, name: str, model: EchoModel, radar: Radar, body: Body) -> None:
        self._name, self._model, self._radar, self._parts = name, model, radar, len(body.part_names)
        with MODELS.guarded(name):
            self.variant: str | None = getattr(model, "variant", None)
        if not isinstance(self.variant, str | None):
            raise MODELS.refuse(
                name, f"has a variant that is a {type(self.variant).__name__}, not a string or None"
            )

    def account(self) -> dict[str, Any] | None:
        """Report what the model did, if it can be written."""
        with MODELS.guarded(self._name):
            found = account_of(self._model)
            # It fails here, and not when the summary is written.
            json.dumps(found, allow_nan=False)
        return found

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        with MODELS.guarded(self._name):
            found = self._model.echoes(chirps)
        # What the stages after it rely on: shapes, the order of Tx, parts that exist, finite
        # numbers.
        if not isinstance(found, Echoes):
            raise MODELS.refuse(self._name, f"gave a {type(found).__name__}, not Echoes")
        expected = len(chirps), self._radar.n_rx
        if found.length.shape[:2] != expected:
            raise MODELS.refuse(
                self._name, f"gave lengths of shape {found.length.shape}, not {expected} and echoes"
            )
        if not np.array_equal(found.tx, self._radar.tx_of_chirp(chirps)):
            raise MODELS.refuse(
                self._name, "named other Tx than those of its chirps (radar.tx_of_chirp)"
            )
        if len(found.part) and not 0 <= found.part.min() <= found.part.max() < self._parts:
            raise MODELS.refuse(self._name, f"named parts outside 0 to {self._parts - 1}")
        if not (np.isfinite(found.length).all() and np.isfinite(found.amplitude).all()):
            raise MODELS.refuse(self._name, "gave lengths or amplitudes that are not finite")
        return found
