"""The settings of a run: one frozen object, validated once and handed on as it is."""

from __future__ import annotations

import dataclasses
import inspect
import math
import sys
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from textwrap import indent
from typing import Annotated, Any, Literal, TypedDict, TypeVar, get_type_hints

from rtradar.errors import InputError
from rtradar.system.checks import brief, check_path, is_real
from rtradar.system.fields import Angle, Limits, check_fields, rules_of
from rtradar.system.registries import DETECTORS, MODELS
from rtradar.system.seeds import Seed

_Function = TypeVar("_Function", bound=Callable[..., Any])

MAX_SNR_DB = 200.0
"""The largest ratio of echo and noise power, either way [dB]: float32 samples hold no more."""


@dataclass(frozen=True)
class Breathing:
    """Breathing of a person, and heartbeat: the chest moves forward and back as sines of time.

    The front of the chest moves by ``amplitude_mm * sin(2 pi rate_hz t + phase)``, with t from the
    start of the interval that is simulated, and by that of the heart, which begins at phase 0. In
    quiet breathing the chest walls of adults move by 4
    to 12 mm from end to end (A. De Groote et al., Chest wall motion during tidal breathing, J.
    Appl. Physiol. 83 (1997) 1531-1537), an amplitude of 2 to 6 mm, and less under clothes or in
    shallow breath, 12 to 20 times a minute at rest, 0.2 to 0.33 Hz, and faster after exercise. The
    heart moves the skin of the chest by 0.2 to 0.5 mm from end to end, 50 to 90 times a minute at
    rest (G. Ramachandran and M. Singh, Three-dimensional reconstruction of cardiac displacement
    patterns on the chest wall, Med. Biol. Eng. Comput. 27 (1989) 525-530).

    Parameters
    ----------
    amplitude_mm : float
        Amplitude of the front of the chest, half of its way from end to end [mm], 0 to 50.
    rate_hz : float
        Breaths per second [Hz], 0 to 5.
    phase_deg : float
        Phase at the start, -360 to 360 [degree]; at 0 the person begins to breathe in.
    heart_mm : float
        Amplitude of the heartbeat [mm], 0 to 10; 0 is none.
    heart_hz : float
        Heartbeats per second [Hz], 0 to 5.

    Raises
    ------
    InputError
        Where a value is out of range.
    """

    amplitude_mm: Annotated[float, Limits(0, 50)]
    rate_hz: Annotated[float, Limits(0, 5)]
    phase_deg: Angle = 0.0
    heart_mm: Annotated[float, Limits(0, 10)] = 0.0
    heart_hz: Annotated[float, Limits(0, 5)] = 1.2

    def __post_init__(self) -> None:
        check_fields(self, "breathing: ")


class _OfBoth(TypedDict, total=False):
    seed: int
    slow_time: str


class SimulationOptions(_OfBoth, total=False):
    """The options that `simulate` takes by name; `RunSettings` documents them."""

    fidelity: str
    start_s: float
    duration_s: float | None
    heading_deg: float
    snr_db: float | Literal["physical"]
    variant: str
    spreading: bool
    model_options: Mapping[str, Any] | None
    body_material: str
    breathing: Breathing | None
    order: int
    keep_all: bool
    path_tolerance_db: float | None
    noise_power_m2: float | None


class ProcessingOptions(_OfBoth, total=False):
    """The options that `process_samples` takes by name; `RunSettings` documents them."""

    pfa: float
    clutter_removal: str
    background: str | None
    detector: str
    detector_options: Mapping[str, Any] | None
    range_window: str | tuple[str, float]
    doppler_window: str | tuple[str, float]
    spectrogram_window_s: float | None
    spectrogram_overlap: float


class RunOptions(SimulationOptions, ProcessingOptions, total=False):
    """The options that `run` and `compare` take by name; `RunSettings` documents them."""

    save_if: bool


_DECIBELS = Limits(
    -MAX_SNR_DB,
    math.inf,
    f"it must be a number of decibels within +-{MAX_SNR_DB:g}, inf or physical (--snr-db)",
)
_TOLERANCE = Limits(
    -MAX_SNR_DB,
    0,
    f"it must lie within {-MAX_SNR_DB:g} to 0 dB, or be -inf (--path-tolerance-db)",
)
_LEAST, _LONGEST_S = 5e-324, 60.0
_POWER = Limits(0, sys.float_info.max, "it must be a finite number, not negative")
_RATE = Limits(
    _LEAST, 1 - 2**-53, "a false-alarm rate is a number between 0 and 1, both excluded (--pfa)"
)
_SECONDS = Limits(
    _LEAST,
    _LONGEST_S,
    f"it must be a number of seconds up to {_LONGEST_S:g} (--spectrogram-window)",
)
_Window = Annotated[
    str | tuple[str, float], Limits(wanted="it must be a name, or a list of a name and a number")
]


@cache
def setting_texts() -> Mapping[str, Mapping[str, Any]]:
    """Return what ``settings.toml`` says of each setting."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def _documented(names: Collection[str]) -> str:
    """What is said of some settings, in numpydoc form."""
    return "".join(
        f"{name} : {own['type']}\n{indent(own['text'].strip(), '    ')}\n"
        for name, own in setting_texts().items()
        if name in names
    )


@dataclass(frozen=True)
class RunSettings:
    """The settings of a run, from motion to point cloud.

    Whether there is a window function of a name, and a model has an option, is checked where these
    are built.

    Parameters
    ----------
    {settings}

    Raises
    ------
    InputError
        Where a value is not allowed.
    """

    fidelity: str = "specular"
    start_s: float = 0.0
    duration_s: float | None = None
    heading_deg: float = 0.0
    snr_db: Annotated[float | Literal["physical"], _DECIBELS] = 20.0
    pfa: Annotated[float, _RATE] = 1e-6
    seed: Seed = 0
    variant: Annotated[str, Limits(allowed=("auto", "cpu", "llvm", "scalar", "cuda"))] = "auto"
    spreading: bool = True
    model_options: Mapping[str, Any] | None = field(default_factory=dict)
    clutter_removal: Annotated[str, Limits(allowed=("none", "mean", "exponential", "mti"))] = "none"
    background: Annotated[str | None, Limits(any_text=True)] = None
    body_material: Annotated[str, Limits(allowed=("perfect-conductor", "skin"))] = (
        "perfect-conductor"
    )
    breathing: Breathing | None = None
    order: Annotated[int, Limits(0, 3)] = 1
    keep_all: bool = False
    path_tolerance_db: Annotated[float | None, _TOLERANCE] = -35.0
    save_if: bool = False
    detector: str = "os-cfar"
    detector_options: Mapping[str, Any] | None = field(default_factory=dict)
    range_window: _Window = "hann"
    doppler_window: _Window = "hann"
    spectrogram_window_s: Annotated[float | None, _SECONDS] = None
    spectrogram_overlap: Annotated[float, Limits(0, 0.999)] = 0.95
    slow_time: Annotated[str, Limits(allowed=("frame", "capture"))] = "frame"
    noise_power_m2: Annotated[float | None, _POWER] = None

    def __post_init__(self) -> None:
        # A tolerance of -inf dB stands for none at all, because TOML has no word for None.
        if is_real(self.path_tolerance_db) and self.path_tolerance_db == -math.inf:
            object.__setattr__(self, "path_tolerance_db", None)
        for name in ("model_options", "detector_options"):
            try:
                # A copy, which no one else can change.
                object.__setattr__(self, name, dict(getattr(self, name) or {}))
            except (TypeError, ValueError):
                value = brief(getattr(self, name))
                raise InputError(f"{name} = {value}; it must be names with values") from None
        if self.background is not None:
            object.__setattr__(self, "background", str(check_path("background", self.background)))
        check_fields(self)
        MODELS.check(self.fidelity)
        DETECTORS.check(self.detector)
        if not isinstance(self.snr_db, str) and MAX_SNR_DB < self.snr_db < math.inf:
            raise InputError(f"snr_db = {self.snr_db}; {rules_of(RunSettings)['snr_db'].wanted}")
        if self.snr_db == "physical" and not self.spreading:
            raise InputError(
                "snr_db = physical needs the loss with distance; "
                "leave out --no-spreading (spreading=False)"
            )

    def parameters(self) -> dict[str, Any]:
        """Return the settings as ``summary.json`` lists them under ``parameters``.

        Returns
        -------
        dict
            All settings but seed and noise power, which the summary has one level up.
        """
        listed = dataclasses.asdict(self)
        del listed["seed"], listed["noise_power_m2"]
        return listed | {"snr_db": "inf" if self.snr_db == math.inf else self.snr_db}


if RunSettings.__doc__:  # Python may have left them out
    RunSettings.__doc__ = inspect.cleandoc(RunSettings.__doc__).replace(
        "{settings}\n", _documented(setting_texts())
    )


def takes_settings(function: _Function) -> _Function:
    """Show the settings in the signature and the text of a function that takes ``**options``.

    Those are the options that the annotation ``Unpack[...]`` names, with the defaults and the texts
    of `RunSettings`.
    """
    # The module postpones the evaluation of annotations, so they are text here.
    written = inspect.signature(function)
    *others, options = written.parameters.values()
    name = str(options.annotation).removeprefix("Unpack[").removesuffix("]")
    taken = function.__globals__[name]
    kinds = get_type_hints(RunSettings)
    usual = {one.name: one.default for one in dataclasses.fields(RunSettings)}
    # Each setting that the options have becomes a parameter.
    named = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=None if usual[name] is dataclasses.MISSING else usual[name],
            annotation=kinds[name],
        )
        for name in kinds
        if name in taken.__annotations__
    ]
    own: Any = function
    own.__signature__ = written.replace(parameters=[*others, *named])
    if function.__doc__:  # Python may have left them out
        texts = _documented(taken.__annotations__)
        before, _, after = inspect.cleandoc(function.__doc__).partition("**options\n")
        own.__doc__ = before + texts + after[after.index("\n\n") + 1 :]
    return function


def settings_of(caller: str, taken: type, options: Mapping[str, Any]) -> RunSettings:
    """Return the settings that a function is given; InputError if one is none of those it takes.

    ``taken`` is a class of options, such as `ProcessingOptions`.
    """
    for name in options:
        if name not in taken.__annotations__:
            allowed = ", ".join(taken.__annotations__)
            raise InputError(f"{caller} has no option '{name}'; allowed: {allowed}")
    return RunSettings(**options)


def check_fidelities(names: Sequence[str]) -> None:
    """Raise InputError unless these are two echo models or more to compare, each once."""
    for name in names:
        MODELS.check(name)
    if len(names) < 2 or len(set(names)) < len(names):
        raise InputError(
            f"fidelities {', '.join(names) or '(none)'}; name two or more, each once (--fidelities)"
        )
