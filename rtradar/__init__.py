"""From motion capture of a person to what a 4D MIMO FMCW radar receives, and on to point clouds.

Everything named here loads on first use, so that ``import rtradar`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rtradar import classify, exchange, process, rcs, signal
    from rtradar.antenna import Antenna
    from rtradar.body import Body, Ellipsoids, HumanMesh, Person
    from rtradar.clouds import Collection
    from rtradar.echoes import Echoes
    from rtradar.errors import BackendError, ExtensionError, InputError, ValidityWarning
    from rtradar.motion import Motion, load_motion, register_reader, synthetic_motion
    from rtradar.pipeline import (
        Comparison,
        Experiment,
        Result,
        Simulation,
        Sweep,
        compare,
        compare_recordings,
        process_samples,
        run,
        simulate,
        sweep,
    )
    from rtradar.process import register_detector
    from rtradar.radar import Radar, register_radar
    from rtradar.receiver import Interferer, Receiver
    from rtradar.scatter import register_model, scattering_length
    from rtradar.scene import FollowingPath, Object, Scene, Swinging, Turning
    from rtradar.settings import Breathing, RunSettings

__version__ = "0.2.0"

_NAMES = {
    "antenna": "Antenna",
    "body": "Body Ellipsoids HumanMesh Person",
    "clouds": "Collection",
    "echoes": "Echoes",
    "errors": "BackendError ExtensionError InputError ValidityWarning",
    "motion": "Motion load_motion register_reader synthetic_motion",
    "pipeline": "Comparison Experiment Result Simulation Sweep compare "
    "compare_recordings process_samples run simulate sweep",
    "process": "register_detector",
    "radar": "Radar register_radar",
    "receiver": "Interferer Receiver",
    "scatter": "register_model scattering_length",
    "scene": "FollowingPath Object Scene Swinging Turning",
    "settings": "Breathing RunSettings",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}
_MODULES = ("classify", "exchange", "process", "rcs", "signal")

__all__ = [
    "Antenna",
    "BackendError",
    "Body",
    "Breathing",
    "Collection",
    "Comparison",
    "Echoes",
    "Ellipsoids",
    "Experiment",
    "ExtensionError",
    "FollowingPath",
    "HumanMesh",
    "InputError",
    "Interferer",
    "Motion",
    "Object",
    "Person",
    "Radar",
    "Receiver",
    "Result",
    "RunSettings",
    "Scene",
    "Simulation",
    "Sweep",
    "Swinging",
    "Turning",
    "ValidityWarning",
    "classify",
    "compare",
    "compare_recordings",
    "exchange",
    "load_motion",
    "process",
    "process_samples",
    "rcs",
    "register_detector",
    "register_model",
    "register_radar",
    "register_reader",
    "run",
    "scattering_length",
    "signal",
    "simulate",
    "sweep",
    "synthetic_motion",
]


if not TYPE_CHECKING:  # checkers of types refuse names that are not imported above

    def __getattr__(name: str) -> Any:
        if name in _MODULES:
            return import_module(f"rtradar.{name}")
        if name in _HOME:
            return getattr(import_module(f"rtradar.{_HOME[name]}"), name)
        raise AttributeError(f"module 'rtradar' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
