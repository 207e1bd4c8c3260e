"""The echo model `auto`: the cheapest level that keeps a tolerance, one for the whole run.

Two numbers decide, which `validation/cost/auto.py` measured as rms errors of the received field
against `reference`. What `specular` leaves is taken to be, as :eq:`auto-estimate` of the theory
page,

    hypot(0.4 lambda^(1/4), 1 / (k rho)),   lambda in metres,

because a specular point is visible or not, while an edge takes the longer to cross a part the wider
the Fresnel zone is. The other term is twice the next order of geometric optics, for the mean radius
rho of a person's parts. For a punch at 3, 6, 12 and 24 GHz the error is 1.08, 0.94, 0.94 and 0.95
of the estimate. `physical-optics`, which sums at keyframes and at some places of the array, is
taken to leave 0.03.

A tolerance on power allows a field that is off by 1.5 times as large a fraction: a frame holds many
looks at how echoes interfere, and in the worst frame of four activities the power is off by 0.56
and 0.59 of these estimates by `specular` at 12 and 77 GHz, and by 0.47 by `physical-optics`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.poses import BuiltInModel, check_option, owners_of
from rtradar.scatter.models.physical_optics import PhysicalOptics, Reference
from rtradar.scatter.models.specular import Specular
from rtradar.scatter.target import ellipsoid_areas

Array = NDArray[np.float64]

CANDIDATES = {"specular": Specular, "physical-optics": PhysicalOptics, "reference": Reference}
"""Levels, cheapest first."""

_SHARP, _INTERPOLATED = 0.4, 0.03
"""Error of the field by `specular` over lambda^(1/4), with lambda in metres, and that by
`physical-optics`."""

_FIELD_OVER_POWER = 1.5
"""Error of the field over that of the power of a frame that goes with it, both as fractions."""

_MARGIN = 0.9
"""Fraction of a complex tolerance that the estimate may use, which may be as much too low."""

_LEAST_COMPLEX = 1e-3


def optics_error(radar: Radar, body: Body) -> float:
    """Estimate the rms error of the received field by `specular`, over the rms field.

    Among several people the one with the smallest parts decides. Averaged over directions, a convex
    part returns a quarter of its surface 4 pi rho^2; a person's error is the mean over the parts
    with these weights.
    """
    wavelength_m = SPEED_OF_LIGHT_MPS / radar.centre_frequency_hz
    # Each part's squared radius is its surface over 4 pi; the person with the smallest mean
    # decides.
    squares, owner = ellipsoid_areas(body.semi_axes) / (4 * math.pi), owners_of(body)
    rho = math.sqrt((np.bincount(owner, squares) / np.bincount(owner)).min())
    return math.hypot(_SHARP * wavelength_m**0.25, wavelength_m / (2 * math.pi * rho))


def choose_level(
    radar: Radar, body: Body, tolerance_db: float, tolerance_complex: float | None
) -> tuple[str, str]:
    """Return the cheapest level that keeps the tolerances, those of `Auto`, and why it was taken.

    An `InputError` is raised where a tolerance is out of range.
    """
    allowed_db = "positive (--tolerance-db, --advise)"
    check_option("auto", "tolerance_db", tolerance_db, 0 < tolerance_db < math.inf, allowed_db)
    fine = tolerance_complex is None or _LEAST_COMPLEX <= tolerance_complex < math.inf
    least = f"at least {_LEAST_COMPLEX}, a fraction of the rms field (--tolerance-complex)"
    check_option("auto", "tolerance_complex", tolerance_complex, fine, least)
    # A decibel down is a smaller fraction than one up.
    allowed = _FIELD_OVER_POWER * (1 - 10 ** (-tolerance_db / 10))
    if tolerance_complex is not None:
        allowed = min(allowed, _MARGIN * tolerance_complex)
    # The first level, from the cheapest on, whose expected error is allowed; `reference` if none
    # is.
    left = {"specular": optics_error(radar, body), "physical-optics": _INTERPOLATED}
    enough = (name for name, error in left.items() if error <= allowed)
    why = "a field off by {:.3f} is allowed; estimated are {}".format(
        allowed, ", ".join(f"{error:.3f} by {name}" for name, error in left.items())
    )
    return next(enough, "reference"), why


class Auto(BuiltInModel):
    """`auto`: for a whole run, the cheapest level that keeps a tolerance.

    It is `specular`, `physical-optics` or `reference`, by what each is known to leave wrong.

    Occlusion: as that level. It asks as that level does alone.

    Parameters
    ----------
    tolerance_db : float
        Largest error of the power of a frame, of each person [dB], above 0.
    tolerance_complex : float, optional
        Largest rms error of the received field over its rms, of each person, 0.001 and more; None:
        only the power matters.

    Raises
    ------
    InputError
        Where a tolerance is out of range.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        tolerance_db: float = 0.5,
        tolerance_complex: float | None = None,
    ) -> None:
        self.level, self._why = choose_level(radar, body, tolerance_db, tolerance_complex)
        self._parts = body.part_names
        self._model = CANDIDATES[self.level](radar, body, variant=variant, spreading=spreading)
        self.variant: str | None = self._model.variant
        self.fast_over_walls = self._model.fast_over_walls

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps: those of the level that was taken."""
        return self._model.echoes(chirps)

    def account(self) -> dict[str, Any]:
        """Which level was taken, and why, as fractions of all parts and time, for JSON."""
        ways = {name: float(name == self.level) for name in CANDIDATES}
        return {
            "ways": ways,
            "why": {self._why: 1.0},
            "parts": {part: dict(ways) for part in self._parts},
        }
