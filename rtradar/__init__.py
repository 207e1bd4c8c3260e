"""From motion capture of a person to what a 4D MIMO FMCW radar receives, and on to point clouds.

Everything named here loads on first use, so that ``import rtradar`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rtradar import (
        classify as classify,
        exchange as exchange,
        process as process,
        rcs as rcs,
        signal as signal,
    )
    from rtradar.body import (
        Body as Body,
        Ellipsoids as Ellipsoids,
        HumanMesh as HumanMesh,
        Person as Person,
    )
    from rtradar.clouds import Collection as Collection
    from rtradar.echoes import Echoes as Echoes
    from rtradar.errors import (
        BackendError as BackendError,
        ExtensionError as ExtensionError,
        InputError as InputError,
        ValidityWarning as ValidityWarning,
    )
    from rtradar.front_end import (
        Antenna as Antenna,
        Chip as Chip,
        Interferer as Interferer,
        Receiver as Receiver,
    )
    from rtradar.motion import (
        Motion as Motion,
        load_motion as load_motion,
        register_reader as register_reader,
        synthetic_motion as synthetic_motion,
    )
    from rtradar.pipeline import (
        Comparison as Comparison,
        Experiment as Experiment,
        Result as Result,
        Simulation as Simulation,
        Sweep as Sweep,
        compare as compare,
        compare_recordings as compare_recordings,
        process_samples as process_samples,
        run as run,
        simulate as simulate,
        sweep as sweep,
    )
    from rtradar.process import register_detector as register_detector
    from rtradar.radar import Radar as Radar, register_radar as register_radar
    from rtradar.scatter import (
        register_model as register_model,
        scattering_length as scattering_length,
    )
    from rtradar.scene import (
        FollowingPath as FollowingPath,
        Object as Object,
        Scene as Scene,
        Swinging as Swinging,
        Turning as Turning,
    )
    from rtradar.settings import Breathing as Breathing, RunSettings as RunSettings

__version__ = "0.2.0"

_NAMES = {
    "body": "Body Ellipsoids HumanMesh Person",
    "clouds": "Collection",
    "echoes": "Echoes",
    "errors": "BackendError ExtensionError InputError ValidityWarning",
    "front_end": "Antenna Chip Interferer Receiver",
    "motion": "Motion load_motion register_reader synthetic_motion",
    "pipeline": "Comparison Experiment Result Simulation Sweep compare "
    "compare_recordings process_samples run simulate sweep",
    "process": "register_detector",
    "radar": "Radar register_radar",
    "scatter": "register_model scattering_length",
    "scene": "FollowingPath Object Scene Swinging Turning",
    "settings": "Breathing RunSettings",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}
_MODULES = ("classify", "exchange", "process", "rcs", "signal")

__all__ = sorted([*_HOME, *_MODULES])


if not TYPE_CHECKING:  # checkers of types refuse names that are not imported above

    def __getattr__(name: str) -> Any:
        if name in _MODULES:
            return import_module(f"rtradar.{name}")
        if name in _HOME:
            return getattr(import_module(f"rtradar.{_HOME[name]}"), name)
        raise AttributeError(f"module 'rtradar' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
