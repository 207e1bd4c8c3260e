"""The settings of a run: one frozen object, validated once and handed on as it is."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypedDict, TypeVar, get_type_hints

from rtradar.errors import InputError
from rtradar.system.checks import brief, check_number, check_order, check_path, is_real
from rtradar.system.registries import DETECTORS, MODELS
from rtradar.system.seeds import check_seed

_Function = TypeVar("_Function", bound=Callable[..., Any])

MAX_SNR_DB = 200.0
"""The largest ratio of echo and noise power, either way [dB]: float32 samples hold no more."""


@dataclass(frozen=True)
class Breathing:
    """Breathing of a person: the chest moves forward and back as a sine of time.

    The front of the chest moves by ``amplitude_mm * sin(2 pi rate_hz t + phase)``, with t from the
    start of the interval that is simulated. In quiet breathing the chest walls of adults move by 4
    to 12 mm from end to end (A. De Groote et al., Chest wall motion during tidal breathing, J.
    Appl. Physiol. 83 (1997) 1531-1537), an amplitude of 2 to 6 mm, and less under clothes or in
    shallow breath, 12 to 20 times a minute at rest, 0.2 to 0.33 Hz, and faster after exercise.

    Parameters
    ----------
    amplitude_mm : float
        Amplitude of the front of the chest, half of its way from end to end [mm], 0 to 50.
    rate_hz : float
        Breaths per second [Hz], 0 to 5.
    phase_deg : float
        Phase at the start, -360 to 360 [degree]; at 0 the person begins to breathe in.

    Raises
    ------
    InputError
        Where a value is out of range.
    """

    amplitude_mm: float
    rate_hz: float
    phase_deg: float = 0.0

    def __post_init__(self) -> None:
        limits = {"amplitude_mm": (0, 50), "rate_hz": (0, 5), "phase_deg": (-360, 360)}
        for name, allowed in limits.items():
            value = check_number("breathing", name, getattr(self, name), *allowed)
            object.__setattr__(self, name, value)


def check_breathing(where: str, value: object) -> None:
    """Raise an `InputError` if this is neither a `Breathing` nor None."""
    if value is not None and not isinstance(value, Breathing):
        raise InputError(
            f"{where}breathing = {brief(value)}; give rt.Breathing(amplitude_mm, rate_hz)"
        )


class _Seed(TypedDict, total=False):
    seed: int


class SimulationOptions(_Seed, total=False):
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


class ProcessingOptions(_Seed, total=False):
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


_LONGEST_S, _MOST_OVERLAP = 60.0, 0.999


@dataclass(frozen=True)
class RunSettings:
    """The settings of a run, from motion to point cloud.

    Names of window functions, and options of a model, are validated where these are built.

    Parameters
    ----------
    fidelity : str
        Name of the echo model. `rtradar.scatter.MODELS` has all.
    start_s : float
        Start of the simulated interval of the recording [s].
    duration_s : float, optional
        Length of the interval [s]. It extends to the end of the recording if left out.
    heading_deg : float
        Angle by which the person is turned from the standard placement, anticlockwise seen from
        above [degree].
    snr_db : float or "physical"
        Power of the person's visible echoes over complex noise power per sample [dB]; ``inf`` for
        no noise, ``physical`` for the noise that follows from the radar's transmit power, gains and
        noise figure.
    pfa : float
        False-alarm rate that the detector is designed for in each cell.
    seed : int
        Seed of noise, the sampling of clouds and, on the command line, of synthetic motion.
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend, for models that trace rays; ``auto`` and ``cpu`` take llvm, or scalar
        where that does not work, and ``cuda`` traces the rays on a GPU.
    spreading : bool
        Whether amplitudes hold the loss with distance 1 / (R1 R2).
    model_options : mapping, optional
        Options of the model, such as ``{"visibility": "gradual"}`` of ``specular``. The class of a
        model documents them.
    clutter_removal : {"none", "mean", "exponential", "mti"}
        Filter that removes static clutter before Doppler. See `rtradar.process.clutter`.
    background : str, optional
        The room alone, whose mean cycle is subtracted before Doppler: the folder of a run, which is
        simulated again unless it kept its IF samples, or a file of IF samples. The radar must have
        been the same, at the same place.
    body_material : {"perfect-conductor", "skin"}
        Material of the person's surface.
    breathing : Breathing, optional
        Amplitude [mm] and rate [Hz] of the breath that moves the person's chest; without it the
        person holds their breath.
    order : int
        Largest number of reflections at walls, floors and ceilings on the way of an echo, 0 to 3.
    keep_all : bool
        Whether paths, walls and furniture are kept even where they stay below the noise.
    path_tolerance_db : float, optional
        Largest power of the error of all ghosts, the echoes over walls, over that of the person
        [dB]. Ghosts are computed at anchors a few milliseconds apart as far as this allows. None
        or ``-inf`` computes every ghost at every chirp, as fidelity levels do that follow more
        than one echo for each part and path.
    save_if : bool
        Whether the IF samples are kept, in ``if.zarr``.
    detector : str
        Name of the detector that marks the cells of a map. `rtradar.process.DETECTORS` has all.
    detector_options : mapping, optional
        Options of the detector, such as ``{"max_points": 64}`` of ``ti-oob``. Its docstring has
        them.
    range_window, doppler_window : str or (str, float)
        Window function, such as ``blackman``, or its name and parameter. See
        `rtradar.process.WindowFunctions`.
    spectrogram_window_s : float, optional
        Length of a window of the spectrogram, at least two cycles [s]. By default that of 128
        cycles, or of a frame where there are gaps between frames.
    spectrogram_overlap : float
        Part of a window of the spectrogram that the next one shares, 0 to below 1.
    noise_power_m2 : float, optional
        Noise power per sample [m^2], in place of ``snr_db``: for runs with the same noise.

    Raises
    ------
    InputError
        If ``fidelity`` or ``detector`` is no such name, or ``snr_db``, ``noise_power_m2``, ``pfa``,
        ``seed``, ``order``, ``breathing`` or ``path_tolerance_db`` no such value.
    """

    fidelity: str = "specular"
    start_s: float = 0.0
    duration_s: float | None = None
    heading_deg: float = 0.0
    snr_db: float | Literal["physical"] = 20.0
    pfa: float = 1e-6
    seed: int = 0
    variant: str = "auto"
    spreading: bool = True
    model_options: Mapping[str, Any] | None = field(default_factory=dict)
    clutter_removal: str = "none"
    background: str | None = None
    body_material: str = "perfect-conductor"
    breathing: Breathing | None = None
    order: int = 1
    keep_all: bool = False
    path_tolerance_db: float | None = -35.0
    save_if: bool = False
    detector: str = "os-cfar"
    detector_options: Mapping[str, Any] | None = field(default_factory=dict)
    range_window: str | tuple[str, float] = "hann"
    doppler_window: str | tuple[str, float] = "hann"
    spectrogram_window_s: float | None = None
    spectrogram_overlap: float = 0.95
    noise_power_m2: float | None = None

    def __post_init__(self) -> None:
        _check_noise(self.snr_db, self.noise_power_m2)
        if not is_real(self.pfa) or not 0 < self.pfa < 1:
            raise InputError(
                f"pfa = {brief(self.pfa)}; a false-alarm rate is a number between 0 and 1, "
                "both excluded (--pfa)"
            )
        for name in ("spreading", "keep_all", "save_if"):
            if type(value := getattr(self, name)).__name__ not in ("bool", "bool_"):
                raise InputError(f"{name} = {brief(value)}; it must be True or False")
        for name in ("fidelity", "variant", "body_material", "clutter_removal", "detector"):
            if not isinstance(value := getattr(self, name), str):
                raise InputError(f"{name} = {brief(value)}; it must be a name, in quotes")
        for name in ("start_s", "heading_deg", "duration_s"):
            value = getattr(self, name)
            if not (is_real(value) or (value is None and name == "duration_s")):
                raise InputError(f"{name} = {brief(value)}; it must be a number")
        if self.background is not None:
            object.__setattr__(self, "background", str(check_path("background", self.background)))
        window_s, overlap = self.spectrogram_window_s, self.spectrogram_overlap
        if window_s is not None and not (is_real(window_s) and 0 < window_s <= _LONGEST_S):
            raise InputError(
                f"spectrogram_window_s = {brief(window_s)}; it must be a number of seconds up to "
                f"{_LONGEST_S:g} (--spectrogram-window)"
            )
        if not (is_real(overlap) and 0 <= overlap <= _MOST_OVERLAP):
            raise InputError(
                f"spectrogram_overlap = {brief(overlap)}; it is the part of a window that the next "
                f"one shares, 0 to {_MOST_OVERLAP} (--spectrogram-overlap)"
            )
        MODELS.check(self.fidelity)
        DETECTORS.check(self.detector)
        check_seed("", self.seed)
        check_order(self.order)
        check_breathing("", self.breathing)
        tolerance_db = self.path_tolerance_db
        if tolerance_db is not None and not is_real(tolerance_db):
            tolerance_db = math.nan
        if tolerance_db == -math.inf:
            object.__setattr__(self, "path_tolerance_db", None)
        elif tolerance_db is not None and not -MAX_SNR_DB <= tolerance_db <= 0:
            raise InputError(
                f"path_tolerance_db = {brief(self.path_tolerance_db)}; it must lie within "
                f"{-MAX_SNR_DB:g} to 0 dB, or be -inf for exact ghosts (--path-tolerance-db)"
            )
        if self.snr_db == "physical" and not self.spreading:
            raise InputError(
                "snr_db = physical needs the loss with distance; "
                "leave out --no-spreading (spreading=False)"
            )
        for name in ("model_options", "detector_options"):
            try:
                # A copy, which no one else can change.
                object.__setattr__(self, name, dict(getattr(self, name) or {}))
            except (TypeError, ValueError):
                value = brief(getattr(self, name))
                raise InputError(f"{name} = {value}; it must be names with values") from None

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


def takes_settings(function: _Function) -> _Function:
    """Show the settings in the signature and the text of a function that takes ``**options``.

    Those are the options that the annotation ``Unpack[...]`` names, with the defaults and the texts
    of `RunSettings`.
    """
    written = inspect.signature(function)
    *others, options = written.parameters.values()
    name = str(options.annotation).removeprefix("Unpack[").removesuffix("]")
    taken = function.__globals__[name]
    kinds = get_type_hints(RunSettings)
    usual = {one.name: one.default for one in dataclasses.fields(RunSettings)}
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
        texts = "".join(
            f"{', '.join(kept)} : {kind}\n{text}"
            for names, kind, text in _documented()
            if (kept := [name for name in names if name in taken.__annotations__])
        )
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


def _check_noise(snr_db: float | str, noise_power_m2: float | None) -> None:
    if isinstance(snr_db, str):
        if snr_db != "physical":
            raise InputError(
                f"snr_db = {snr_db!r}; it must be a number of decibels, inf, or physical (--snr-db)"
            )
    elif not is_real(snr_db) or not (-MAX_SNR_DB <= snr_db <= MAX_SNR_DB or snr_db == math.inf):
        raise InputError(
            f"snr_db = {brief(snr_db)}; it must lie within +-{MAX_SNR_DB:g} dB, or be inf for no "
            "noise (--snr-db)"
        )
    if noise_power_m2 is not None and not (
        is_real(noise_power_m2) and 0 <= noise_power_m2 < math.inf
    ):
        raise InputError(
            f"noise_power_m2 = {brief(noise_power_m2)}; it must be a number of square metres, "
            "at least 0"
        )


def check_fidelities(names: Sequence[str]) -> None:
    """Raise InputError unless these are two echo models or more to compare, each once."""
    for name in names:
        MODELS.check(name)
    if len(names) < 2 or len(set(names)) < len(names):
        raise InputError(
            f"fidelities {', '.join(names) or '(none)'}; name two or more, each once (--fidelities)"
        )


def setting_texts() -> dict[str, tuple[str, str]]:
    """Return the type and the first sentence of each parameter that `RunSettings` documents."""
    found: dict[str, tuple[str, str]] = {}
    for names, kind, text in _documented():
        sentence = re.split(r"\.(?: |$)", " ".join(text.split()))[0].replace("`", "")
        found |= dict.fromkeys(names, (kind, sentence))
    return found


def _documented() -> list[tuple[list[str], str, str]]:
    """Names, type and text of the parameters that `RunSettings` documents."""
    section = inspect.cleandoc(RunSettings.__doc__ or "").partition("----------\n")[2]
    found = re.findall(r"^(\w[\w, ]*) : (.+)\n((?:    .+\n)+)", section, re.M)
    return [(names.split(", "), kind, text) for names, kind, text in found]
