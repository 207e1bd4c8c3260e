"""What `rtradar bench` measures, and how often."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter import MODELS
from rtradar.scatter.echo_models import affordable_models

PARTS = ("models", "growth")
"""Parts that may be measured alone: models with baseline and bounds, and growth with the size of
the problem."""

CHEAPEST = "analytic"
"""Model with which all others are compared."""


@dataclass(frozen=True)
class Plan:
    """What to measure.

    Parameters
    ----------
    radars : tuple of str
        Presets or TOML files, the first for what is measured with one only: first use, growth.
    fidelities : tuple of str
        Names of models; by default those that take less than minutes for seconds of radar.
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
        Where a part, radar or model is unknown, a name is given twice, a number has no meaning, or
        the capture holds no frame.
    """

    radars: tuple[str, ...] = ("paper-12ghz", "paper-77ghz")
    fidelities: tuple[str, ...] = tuple(affordable_models(12.0))
    repeats: int = 3
    duration_s: float = 3.0
    quick: bool = False
    parts: tuple[str, ...] = PARTS

    def __post_init__(self) -> None:
        for option, names in (("--radar", self.radars), ("--fidelity", self.fidelities)):
            if not all(names) or len(set(names)) < len(names):
                raise InputError(f"{option} {','.join(names)}: name each once, with commas between")
        for name in self.fidelities:
            MODELS.refuse_gone(name)
        for option, names, what, allowed in (
            ("--fidelity", self.fidelities, "model", MODELS),
            ("--only", self.parts, "part", PARTS),
        ):
            for name in names:
                if name not in allowed:
                    raise InputError(
                        f"{option} {name}: there is no such {what}; allowed: {', '.join(allowed)}"
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


class Case(NamedTuple):
    """One whole run: options of the command line, and the length of the capture [s]."""

    radar: str
    fidelity: str
    duration_s: float


def model_cases(plan: Plan) -> list[Case]:
    """Every model with every radar."""
    return [Case(one, own, plan.duration_s) for one in plan.radars for own in plan.fidelities]


def plan_of(*, quick: bool, **options: Any) -> Plan:
    """The plan of the options of the command line, by the names of `Plan`.

    Radars and models are separated by commas; None leaves a value to `Plan` or to ``quick``.
    InputError where `Plan` refuses a value.
    """
    given = {name: value for name, value in options.items() if value is not None}
    for name in given.keys() & {"radars", "fidelities"}:
        given[name] = tuple(one.strip() for one in given[name].split(","))
    # The models of a quick measurement: the paper's, the cheapest, and the one that runs take.
    models = ("analytic-paper", CHEAPEST, "specular")
    less = Plan(Plan.radars[:1], models, repeats=1, duration_s=0.5, quick=True)
    return replace(less if quick else Plan(), **given)
