"""The fidelity ladder: rungs by their names."""

from __future__ import annotations

import inspect
from importlib import import_module
from typing import Any, NamedTuple

from rtradar.body import Body
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.poses import Rung


class _Home(NamedTuple):
    """Where a rung is: module and class within this package, what is fixed of it, and whether it traces."""

    module: str
    kind: str
    fixed: dict[str, Any]
    traces: bool


RUNGS: dict[str, _Home] = {
    "analytic-paper": _Home("analytic", "Analytic", {"paper": True}, traces=False),
    "analytic": _Home("analytic", "Analytic", {"paper": False}, traces=False),
    "specular": _Home("specular", "Specular", {}, traces=True),
    "fresnel": _Home("fresnel", "Fresnel", {}, traces=True),
    "physical-optics": _Home("physical_optics", "PhysicalOptics", {}, traces=True),
    "rays": _Home("rays", "Rays", {}, traces=True),
    "reference": _Home("reference", "Reference", {}, traces=True),
    "auto": _Home("auto", "Auto", {}, traces=True),
}
"""Every rung, cheapest first, and the one that chooses among them."""

_COMMON = ("self", "radar", "body", "variant", "spreading")


def build_rung(fidelity: str, radar: Radar, body: Body, *, variant: str = "auto", spreading: bool = True, **dials: Any) -> Rung:
    """The rung of that name, for this body and radar.

    Parameters
    ----------
    fidelity : str
        One of `RUNGS`.
    radar : Radar
    body : Body
    variant : {"auto", "llvm", "scalar", "cuda"}
        Mitsuba's backend, for rungs that trace.
    spreading : bool
        Whether amplitudes hold 1 / (R1 R2).
    **dials
        Of the rung, such as ``shadow_rays`` of ``fresnel``; its class documents them.

    Returns
    -------
    Rung

    Raises
    ------
    InputError
        Where there is no such rung, or it has no such dial.
    BackendError
        Where it traces and no backend of that kind works here.
    """
    if fidelity not in RUNGS:
        raise InputError(f"fidelity '{fidelity}' is unknown; allowed: {', '.join(RUNGS)}")
    home = RUNGS[fidelity]
    # On use: what traces brings Mitsuba, which the closed forms do without.
    kind = getattr(import_module(f"rtradar.scatter.{home.module}"), home.kind)
    known = [name for name in inspect.signature(kind).parameters if name not in (*_COMMON, *home.fixed)]
    for dial in dials:
        if dial not in known:
            raise InputError(f"fidelity '{fidelity}' has no dial '{dial}'; it has: {', '.join(known) or 'none'}")
    backend = {"variant": variant} if home.traces else {}
    rung: Rung = kind(radar, body, spreading=spreading, **home.fixed, **backend, **dials)
    return rung
