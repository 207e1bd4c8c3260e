"""Antenna elements: their patterns and peak gains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.system.checks import brief
from rtradar.system.fields import Limits, check_fields

_HALF_WAVE_DIRECTIVITY = 1.640922376984585  # 4 / Cin(2 pi), Balanis, Antenna Theory, eq. 4-91
_Angles = Annotated[tuple[float, ...], Limits(-180, 180)]
_Levels = Annotated[tuple[float, ...], Limits(-300, 0)]


@dataclass(frozen=True, kw_only=True)
class Antenna:
    """One antenna element, in the radar's axes: boresight along x, y to the left, z up.

    Parameters
    ----------
    pattern : {"isotropic", "cosine", "dipole", "table"}
        ``cosine``: the power falls as cos^exponent of the angle from boresight, and is 0 behind the
        antenna. ``dipole``: half a wavelength along the polarisation, z for v and y for h.
        ``table``: the cuts below, one over azimuth and one over elevation; their decibels are
        added, and beyond its ends a cut keeps its last value.
    exponent : float, optional
        Exponent of ``cosine``.
    gain_dbi : float, optional
        Gain at the peak of the pattern [dBi]. The default follows from the pattern without losses:
        0 dBi for ``isotropic``, a ratio of 2 (exponent + 1) for ``cosine``, 2.15 dBi for
        ``dipole``. A ``table`` needs it.
    azimuth_deg, azimuth_db, elevation_deg, elevation_db : sequence of float, optional
        Cuts of ``table``: ascending angles [deg] and the power there relative to the peak [dB], 0
        or less. A cut that is left out is flat.

    Raises
    ------
    InputError
        Where a value has no meaning, is missing, or belongs to another pattern.
    """

    pattern: Literal["isotropic", "cosine", "dipole", "table"] = "isotropic"
    exponent: Annotated[float | None, Limits(0, 1e4)] = None
    gain_dbi: Annotated[float | None, Limits(-100, 100)] = None
    azimuth_deg: _Angles = ()
    azimuth_db: _Levels = ()
    elevation_deg: _Angles = ()
    elevation_db: _Levels = ()

    def __post_init__(self) -> None:
        check_fields(self, "antenna: ")
        cuts = {
            name: (getattr(self, f"{name}_deg"), getattr(self, f"{name}_db"))
            for name in ("azimuth", "elevation")
        }
        listed = self.pattern == "table"
        for wrong, complaint in (
            (
                (self.exponent is None) == (self.pattern == "cosine"),
                f"pattern = '{self.pattern}' with exponent = {brief(self.exponent)}; only "
                "'cosine' has one, and needs it",
            ),
            (
                listed and self.gain_dbi is None,
                "pattern = 'table' needs gain_dbi, the gain at its peak",
            ),
            (
                any(angles or levels for angles, levels in cuts.values()) != listed,
                f"pattern = '{self.pattern}'; 'table' needs azimuth_deg and azimuth_db, or "
                "elevation_deg and elevation_db, and others have none of these lists",
            ),
            *(
                (
                    len(angles) != len(levels) or list(angles) != sorted(set(angles)),
                    f"{name}_deg and {name}_db must be as many, and the angles ascend",
                )
                for name, (angles, levels) in cuts.items()
            ),
            *(
                (
                    max(levels, default=0) < 0,
                    f"the largest of {name}_db is {max(levels, default=0):g} dB; it must be 0, "
                    "for gain_dbi is the gain there",
                )
                for name, (_, levels) in cuts.items()
            ),
        ):
            if wrong:
                raise InputError(f"antenna: {complaint}")

    @property
    def peak_gain(self) -> float:
        """Gain over an isotropic antenna at the peak of the pattern, a ratio of powers."""
        if self.gain_dbi is not None:
            return float(10 ** (self.gain_dbi / 10))
        if self.exponent is not None:
            return 2 * (self.exponent + 1)
        return _HALF_WAVE_DIRECTIVITY if self.pattern == "dipole" else 1.0

    def relative(self, directions: NDArray[np.float64], polarization: str) -> NDArray[np.float64]:
        """Compute the power in some directions relative to that at the peak.

        Parameters
        ----------
        directions : (..., 3) float64
            Vectors of any length that point away from the antenna.
        polarization : {"v", "h"}
            Polarisation of the radar.

        Returns
        -------
        (...) float64
            Ratio of powers, 0 to 1.
        """
        unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
        if self.exponent is not None:
            ahead = unit[..., 0]
            return np.where(ahead > 0, np.maximum(ahead, 0) ** self.exponent, 0.0)
        if self.pattern == "dipole":
            along = unit[..., 2] if polarization == "v" else unit[..., 1]
            # On the axis itself the ratio is 0 / 0, and its limit is 0.
            across = np.maximum(1 - along**2, 1e-12)
            return np.asarray(np.cos(np.pi / 2 * along) ** 2 / across)
        level = np.zeros(unit.shape[:-1])
        if self.azimuth_deg:
            azimuth_deg = np.degrees(np.arctan2(unit[..., 1], unit[..., 0]))
            level += np.interp(azimuth_deg, self.azimuth_deg, self.azimuth_db)
        if self.elevation_deg:
            elevation_deg = np.degrees(np.arcsin(np.clip(unit[..., 2], -1, 1)))
            level += np.interp(elevation_deg, self.elevation_deg, self.elevation_db)
        return np.asarray(10 ** (level / 10))
