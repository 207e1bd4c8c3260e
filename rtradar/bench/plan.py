"""What `rtradar bench` measures, and how often."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rtradar.errors import InputError
from rtradar.radar import PRESETS, Radar
from rtradar.scatter import MODELS
from rtradar.scatter.echo_models import affordable_models

PARTS = ("models", "growth", "kernels")
"""Parts that may be measured alone: models with baseline and floors, growth with the size of the
problem, and compiled kernels beside their references."""

RADARS = tuple(PRESETS.built_in)
FIDELITIES = tuple(affordable_models(12.0))
"""Radars and models by default: those that take less than minutes for seconds of radar."""

CHEAPEST = "analytic"
"""The model that all others are compared with."""

SAME_AS_PAPER = "analytic-paper"
"""The model whose IF is that of the paper's method."""


@dataclass(frozen=True)
class Plan:
    """What to measure.

    Parameters
    ----------
    radars : tuple of str
        Presets or TOML files, the first for what is measured with one only: first use, one core, growth.
    fidelities : tuple of str
        Models.
    repeats : int
        Number of runs of everything except the first use.
    duration_s : float
        Length of the capture [s].
    quick : bool
        Shorter growth, and a part of a frame of the baseline.
    parts : tuple of str
        Names from `PARTS` that are measured.

    Raises
    ------
    InputError
        Where a radar or model is unknown or named twice, a number has no meaning, or the capture holds no frame.
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
                    f"--duration {self.duration_s:g}: it holds no whole frame of radar '{radar.name}'; give at least "
                    f"{radar.frame_duration_s:g} s"
                )

    @property
    def growing_fidelity(self) -> str:
        """The model that growth is measured by: `specular`, or the last named."""
        return "specular" if "specular" in self.fidelities else self.fidelities[-1]

    @property
    def growing_durations_s(self) -> tuple[float, ...]:
        """Lengths of recording that growth is measured over [s]."""
        return (
            (self.duration_s, 2 * self.duration_s) if self.quick else (3.0, 6.0, 12.0, 30.0, 60.0)
        )


@dataclass(frozen=True)
class Case:
    """One whole run.

    Parameters
    ----------
    radar, fidelity : str
        As the command line takes them.
    duration_s : float
    one_core : bool
        Whether the process may use one core only.
    """

    radar: str
    fidelity: str
    duration_s: float
    one_core: bool = False


def model_cases(plan: Plan, *, one_core: bool) -> list[Case]:
    """Every model with every radar; with ``one_core`` also the model of the paper's method on one core, with the first radar."""
    cases = [
        Case(radar, fidelity, plan.duration_s)
        for radar in plan.radars
        for fidelity in plan.fidelities
    ]
    if one_core and SAME_AS_PAPER in plan.fidelities:
        cases.append(replace(cases[0], fidelity=SAME_AS_PAPER, one_core=True))
    return cases


def plan_of(
    *,
    radar: str | None,
    fidelity: str | None,
    repeats: int | None,
    duration_s: float | None,
    quick: bool,
    only: str | None,
) -> Plan:
    """The plan that the options of the command line ask for; what is None is left to `Plan`, or with ``quick`` to less.

    Raises
    ------
    InputError
        As of `Plan`, or where there is no such part.
    """
    if only is not None and only not in PARTS:
        raise InputError(f"--only {only}: there is no such part; allowed: {', '.join(PARTS)}")
    plan = (
        Plan(RADARS[:1], FIDELITIES[:3], repeats=1, duration_s=0.5, quick=True) if quick else Plan()
    )
    return replace(
        plan,
        radars=plan.radars if radar is None else _named(radar),
        fidelities=plan.fidelities if fidelity is None else _named(fidelity),
        repeats=plan.repeats if repeats is None else repeats,
        duration_s=plan.duration_s if duration_s is None else duration_s,
        parts=PARTS if only is None else (only,),
    )


def _named(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(","))
