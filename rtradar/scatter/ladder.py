"""The fidelity ladder: rungs by their names."""

from __future__ import annotations

from collections.abc import Callable

from rtradar.body import Body
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.analytic import Analytic
from rtradar.scatter.poses import Rung


def _analytic(radar: Radar, body: Body, variant: str, spreading: bool) -> Rung:
    return Analytic(radar, body, spreading=spreading)


def _analytic_paper(radar: Radar, body: Body, variant: str, spreading: bool) -> Rung:
    return Analytic(radar, body, paper=True, spreading=spreading)


def _specular(radar: Radar, body: Body, variant: str, spreading: bool) -> Rung:
    # On use: it brings Mitsuba, which the closed forms do without.
    from rtradar.scatter.specular import Specular

    return Specular(radar, body, variant=variant, spreading=spreading)


RUNGS: dict[str, Callable[[Radar, Body, str, bool], Rung]] = {
    "analytic-paper": _analytic_paper,
    "analytic": _analytic,
    "specular": _specular,
}
"""Every rung, cheapest first: name to a function of radar, body, variant and spreading."""


def build_rung(fidelity: str, radar: Radar, body: Body, *, variant: str = "auto", spreading: bool = True) -> Rung:
    """The rung of that name, for this body and radar.

    Raises
    ------
    InputError
        Where there is no such rung.
    BackendError
        Where it traces and no backend of that kind works here.
    """
    if fidelity not in RUNGS:
        raise InputError(f"fidelity '{fidelity}' is unknown; allowed: {', '.join(RUNGS)}")
    return RUNGS[fidelity](radar, body, variant, spreading)
