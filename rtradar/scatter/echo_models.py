"""The fidelity ladder: rungs by their names."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.antenna_gain import through_antennas
from rtradar.scatter.common.poses import Accountable, Rung
from rtradar.system.registry import Registry

RUNGS = Registry(
    "rtradar.rungs",
    "fidelity",
    {
        "analytic-paper": "rtradar.scatter.models.analytic:analytic_paper",
        "analytic": "rtradar.scatter.models.analytic:analytic",
        "specular": "rtradar.scatter.models.specular:Specular",
        "fresnel": "rtradar.scatter.models.fresnel:Fresnel",
        "physical-optics": "rtradar.scatter.models.physical_optics:PhysicalOptics",
        "rays": "rtradar.scatter.models.rays:Rays",
        "reference": "rtradar.scatter.models.reference:Reference",
        "auto": "rtradar.scatter.models.auto:Auto",
    },
)
"""Every rung, cheapest first, the one that chooses among them, and those of other packages."""

register_rung = RUNGS.register

_COMMON = ("radar", "body", "variant", "spreading")


def build_rung(fidelity: str, radar: Radar, body: Body, *, variant: str = "auto", spreading: bool = True, **dials: Any) -> Rung:
    """The rung of that name, for this body and radar, through the radar's antennas.

    Parameters
    ----------
    fidelity : str
        One of `RUNGS`.
    radar : Radar
    body : Body
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
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
    ExtensionError
        Where it is of another package, and fails.
    """
    kind = RUNGS.find(fidelity)
    with RUNGS.guarded(fidelity):
        taken = inspect.signature(kind).parameters
        known = [name for name in taken if name not in _COMMON]
        for dial in dials:
            if dial not in known:
                raise InputError(f"fidelity '{fidelity}' has no dial '{dial}'; it has: {', '.join(known) or 'none'}")
        # What traces nothing takes no backend.
        backend = {"variant": variant} if takes_backend(fidelity) else {}
        rung: Rung = kind(radar, body, spreading=spreading, **backend, **dials)
    return through_antennas(rung if fidelity in RUNGS.built_in else _Checked(fidelity, rung, radar, body), radar, body)


def takes_backend(fidelity: str) -> bool:
    """Whether the rung of that name asks Mitsuba.

    Parameters
    ----------
    fidelity : str
        One of `RUNGS`.

    Returns
    -------
    bool
    """
    kind = RUNGS.find(fidelity)
    with RUNGS.guarded(fidelity):
        return "variant" in inspect.signature(kind).parameters


class _Checked:
    """A rung of another package, which must give what the rest relies on."""

    account: Callable[[], dict[str, Any]]

    def __init__(self, name: str, rung: Rung, radar: Radar, body: Body) -> None:
        self._name, self._rung, self._radar, self._parts = name, rung, radar, len(body.part_names)
        with RUNGS.guarded(name):
            self.variant: str | None = getattr(rung, "variant", None)
            if isinstance(rung, Accountable):
                self.account = self._account
        if not isinstance(self.variant, str | None):
            raise RUNGS.refuse(name, f"has a variant that is a {type(self.variant).__name__}, not a string or None")

    def _account(self) -> dict[str, Any]:
        with RUNGS.guarded(self._name):
            told: dict[str, Any] = self._rung.account()  # type: ignore[attr-defined]
            json.dumps(told, allow_nan=False)  # as it will be written
        return told

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        with RUNGS.guarded(self._name):
            found = self._rung.echoes(chirps)
        if not isinstance(found, Echoes):
            raise RUNGS.refuse(self._name, f"gave a {type(found).__name__}, not Echoes")
        expected = len(chirps), self._radar.n_rx
        if found.length.shape[:2] != expected:
            raise RUNGS.refuse(self._name, f"gave lengths of shape {found.length.shape}, not {expected} and echoes")
        if not np.array_equal(found.tx, self._radar.tx_of_chirp(chirps)):
            raise RUNGS.refuse(self._name, "named other Tx than those of its chirps (radar.tx_of_chirp)")
        if len(found.part) and not 0 <= found.part.min() <= found.part.max() < self._parts:
            raise RUNGS.refuse(self._name, f"named parts outside 0 to {self._parts - 1}")
        if not (np.isfinite(found.length).all() and np.isfinite(found.amplitude).all()):
            raise RUNGS.refuse(self._name, "gave lengths or amplitudes that are not finite")
        return found
