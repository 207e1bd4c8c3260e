"""What `rtradar bench` measures, and how often."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from rtradar.errors import InputError
from rtradar.radar import PRESETS, Radar
from rtradar.scatter import MODELS
from rtradar.scatter.echo_models import affordable_models

PARTS = ("models", "growth", "kernels")
"""Parts that may be measured alone: models with baseline and bounds, growth with the size of the
problem, and compiled kernels beside their references."""

RADARS, FIDELITIES = tuple(PRESETS.built_in), tuple(affordable_models(12.0))
"""Radars and models by default: models that take less than minutes for seconds of radar."""

CHEAPEST = "analytic"
"""Model with which all others are compared."""

QUICK = ("analytic-paper", CHEAPEST, "specular")
"""Models of a quick measurement: the paper's, the cheapest, and the one that runs take."""


@dataclass(frozen=True)
class Plan:
    """What to measure.

    Parameters
    ----------
    radars : tuple of str
        Presets or TOML files, the first for what is measured with one only: first use, growth.
    fidelities : tuple of str
        Names of models.
    repeats : int
        Number of runs of everything except the first use.
    duration_s : float
        Length of the capture [s].
    quick : bool
        Whether growth is shorter, and the baseline a part of a frame.
    parts : tuple of str
        Names from `PARTS` that are measured.

    Raises
    ------
    InputError
        Where a radar or model is unknown or named twice, a number has no meaning, or the capture
        holds no frame.
    """

    radars: tuple[str, ...] = RADARS
    fidelities: tuple[str, ...] = FIDELITIES
    repeats: int = 3
    duration_s: float = 3.0
    quick: bool = False
    parts: tuple[str, ...] = PARTS

    def __post_init__(self) -> None:
        for option, names in (("--radar", self.radars), ("--fidelity", self.fidelities)):
            if not all(names) or len(set(names)) < len(names):
                raise InputError(f"{option} {','.join(names)}: name each once, with commas between")
        for fidelity in self.fidelities:
            if fidelity not in MODELS:
                raise InputError(
                    f"--fidelity {fidelity}: there is no such model; allowed: {', '.join(MODELS)}"
                )
        if self.repeats < 1:
            raise InputError(f"--repeats {self.repeats}: it must be a whole number, at least 1")
        for radar in map(Radar.load, self.radars):
            if self.duration_s < radar.frame_duration_s:
                raise InputError(
                    f"--duration {self.duration_s:g}: it holds no whole frame of radar "
                    f"'{radar.name}'; give at least {radar.frame_duration_s:g} s"
                )

    @property
    def growing_fidelity(self) -> str:
        """Model whose growth is measured: `specular`, or the last named."""
        return "specular" if "specular" in self.fidelities else self.fidelities[-1]

    @property
    def growing_durations_s(self) -> tuple[float, ...]:
        """Lengths of recording over which growth is measured [s]."""
        few = self.duration_s, 2 * self.duration_s
        return few if self.quick else (3.0, 6.0, 12.0, 30.0, 60.0)


@dataclass(frozen=True)
class Case:
    """One whole run.

    Parameters
    ----------
    radar, fidelity : str
        Options of the command line.
    duration_s : float
    """

    radar: str
    fidelity: str
    duration_s: float


def model_cases(plan: Plan) -> list[Case]:
    """Every model with every radar."""
    return [Case(one, own, plan.duration_s) for one in plan.radars for own in plan.fidelities]


def plan_of(
    *,
    radar: str | None,
    fidelity: str | None,
    repeats: int | None,
    duration_s: float | None,
    quick: bool,
    only: str | None,
) -> Plan:
    """The plan of the options of the command line; None leaves a value to `Plan` or to ``quick``.

    Raises
    ------
    InputError
        Where there is no such part, or `Plan` refuses a value.
    """
    if only is not None and only not in PARTS:
        raise InputError(f"--only {only}: there is no such part; allowed: {', '.join(PARTS)}")
    given: dict[str, Any] = {
        "radars": None if radar is None else _named(radar),
        "fidelities": None if fidelity is None else _named(fidelity),
        "repeats": repeats,
        "duration_s": duration_s,
        "parts": None if only is None else (only,),
    }
    less = Plan(RADARS[:1], QUICK, repeats=1, duration_s=0.5, quick=True)
    named = {name: value for name, value in given.items() if value is not None}
    return replace(less if quick else Plan(), **named)


def _named(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(","))
