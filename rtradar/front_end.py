"""Front end of a radar: antennas, what a receiver adds to the IF, and how a chip detects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.system.checks import brief
from rtradar.system.fields import Limits, check_fields
from rtradar.system.seeds import Seed

_HALF_WAVE_DIRECTIVITY = 1.640922376984585  # 4 / Cin(2 pi), Balanis, Antenna Theory, eq. 4-91
_Angles = Annotated[tuple[float, ...], Limits(-180, 180)]
_Levels = Annotated[tuple[float, ...], Limits(-300, 0)]


@dataclass(frozen=True, kw_only=True)
class Antenna:
    """One antenna element, in axes of its own: boresight along x, y to the left, z up.

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

    angles_deg : (float, float, float)
        Yaw, pitch and roll by which the antenna is turned in the radar's axes [deg].

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
    angles_deg: Annotated[tuple[float, float, float], Limits(-360, 360)] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        check_fields(self, "antenna: ")
        # A cut is a list of angles with as many levels, and only a table has cuts.
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
        if any(self.angles_deg):
            unit = unit @ rotation(np.array(self.angles_deg))
        if self.exponent is not None:
            ahead = unit[..., 0]
            return np.where(ahead > 0, np.maximum(ahead, 0) ** self.exponent, 0.0)
        # The power of a half-wave dipole is (cos(pi/2 cos(a)) / sin(a))^2 at an angle a to its
        # axis.
        if self.pattern == "dipole":
            along = unit[..., 2] if polarization == "v" else unit[..., 1]
            # On the axis itself the ratio is 0 / 0, and its limit is 0.
            across = np.maximum(1 - along**2, 1e-12)
            return np.asarray(np.cos(np.pi / 2 * along) ** 2 / across)
        # The decibels of both cuts add up. Beyond its ends a cut keeps its last value.
        level = np.zeros(unit.shape[:-1])
        if self.azimuth_deg:
            azimuth_deg = np.degrees(np.arctan2(unit[..., 1], unit[..., 0]))
            level += np.interp(azimuth_deg, self.azimuth_deg, self.azimuth_db)
        if self.elevation_deg:
            elevation_deg = np.degrees(np.arcsin(np.clip(unit[..., 2], -1, 1)))
            level += np.interp(elevation_deg, self.elevation_deg, self.elevation_db)
        return np.asarray(10 ** (level / 10))


def rotation(angles_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations (..., 3, 3) of axes by (..., 3) yaw, pitch and roll [deg].

    About x by roll, then up by pitch, then left by yaw.
    """
    (cy, cp, cr), (sy, sp, sr) = (
        np.moveaxis(part(np.radians(angles_deg)), -1, 0) for part in (np.cos, np.sin)
    )
    # Columns of Rz(yaw) Ry(-pitch) Rx(roll), written out.
    boresight = [cp * cy, cp * sy, sp]
    left = [-cr * sy - sr * sp * cy, cr * cy - sr * sp * sy, sr * cp]
    up = [sr * sy - cr * sp * cy, -sr * cy - cr * sp * sy, cr * cp]
    return np.stack([np.stack(axis, axis=-1) for axis in (boresight, left, up)], axis=-1)


# -- receivers ------------------------------------------------------------------------------------

_Dbm = Annotated[float, Limits(-300, 100)]
_Ramp = Annotated[float, Limits(1e-9, 1e3)]
_RightAngle = Annotated[float, Limits(-90, 90)]
_Hertz = Annotated[tuple[float, ...], Limits(1, 1e12)]


@dataclass(frozen=True, kw_only=True)
class Interferer:
    """Another FMCW radar, whose ramps cross our own.

    Each of its ramps begins with the same phase, as ours do.

    Parameters
    ----------
    start_frequency_hz : float
        Frequency at which its ramps begin [Hz].
    slope_hz_per_s : float
        Sweep rate of its ramps [Hz/s], negative where they fall.
    ramp_s, period_s : float
        Duration of a ramp, and the time from the start of one to that of the next [s].
    start_s : float
        Start of its first ramp since the start of the capture [s].
    power_dbm : float
        Its power at the port of an antenna of the receiver while it transmits [dBm].
    azimuth_deg, elevation_deg : float
        Direction that it comes from [deg], as a plane wave.

    Raises
    ------
    InputError
        Where a value has no meaning.
    """

    start_frequency_hz: Annotated[float, Limits(1, 1e15)]
    slope_hz_per_s: Annotated[float, Limits(-1e18, 1e18)]
    ramp_s: _Ramp
    period_s: _Ramp
    power_dbm: _Dbm
    start_s: Annotated[float, Limits(0, 1e6)] = 0.0
    azimuth_deg: _RightAngle = 0.0
    elevation_deg: _RightAngle = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "receiver: interferer: ")
        if self.period_s < self.ramp_s:
            raise InputError(
                f"receiver: interferer: period_s = {self.period_s:g} is shorter than its ramp of "
                f"{self.ramp_s:g} s; ramps follow each other, so give at least that"
            )


@dataclass(frozen=True, kw_only=True)
class Receiver:
    """What a receiver adds; what is left out is ideal. Levels are those at the antenna's port.

    Parameters
    ----------
    phase_noise_hz, phase_noise_dbc_hz : sequence of float
        Ascending offsets from the carrier [Hz], and the single-sideband phase noise L(f) of the
        oscillator there [dBc/Hz]; lines over log f between them, and its ends beyond.
    iq_gain_db, iq_phase_deg : float
        Gain of Q over I [dB], and how much less than 90 degrees they are apart [deg].
    adc_bits : int, optional
        Bits of the ADCs of I and of Q; without them only clipping is modelled.
    adc_full_scale_dbm : float, optional
        Power of the tone that just fills the ADCs [dBm]; what is beyond is clipped.
    leakage_db : float, optional
        Power that gets from a Tx to an Rx on the board, over that transmitted [dB].
    leakage_length_m : float
        Length of its path beyond the distance of both antennas [m].
    dc_dbm : float, optional
        Power of a constant at the ADC, as if received [dBm].
    channel_gain_db, channel_phase_deg : float or sequence of float
        Errors of the channels: one for each virtual channel, tx * n_rx + rx, or the standard
        deviation of those drawn from `seed`, half of whose variance is the Tx's, half the Rx's.
    seed : int
        Seed of the errors of the channels, which one device keeps.
    highpass_hz : sequence of float
        Corner frequencies of high-pass filters of first order in the IF, in a row [Hz].
    interferer : Interferer, optional
        Another radar, a table in TOML.

    Raises
    ------
    InputError
        Where a value has no meaning.
    """

    phase_noise_hz: _Hertz = ()
    phase_noise_dbc_hz: Annotated[tuple[float, ...], Limits(-300, 0)] = ()
    iq_gain_db: Annotated[float, Limits(-20, 20)] = 0.0
    iq_phase_deg: Annotated[float, Limits(-80, 80)] = 0.0
    adc_bits: Annotated[int | None, Limits(1, 24)] = None
    adc_full_scale_dbm: _Dbm | None = None
    leakage_db: Annotated[float | None, Limits(-200, 0)] = None
    leakage_length_m: Annotated[float, Limits(0, 100)] = 0.0
    dc_dbm: _Dbm | None = None
    channel_gain_db: (
        Annotated[float, Limits(0, 60)] | Annotated[tuple[float, ...], Limits(-60, 60)]
    ) = 0.0
    channel_phase_deg: (
        Annotated[float, Limits(0, 360)] | Annotated[tuple[float, ...], Limits(-360, 360)]
    ) = 0.0
    seed: Seed = 0
    highpass_hz: _Hertz = ()
    interferer: Interferer | None = None

    def __post_init__(self) -> None:
        check_fields(self, "receiver: ")
        offsets = self.phase_noise_hz
        if len(offsets) != len(self.phase_noise_dbc_hz) or list(offsets) != sorted(set(offsets)):
            raise InputError(
                "receiver: phase_noise_hz and phase_noise_dbc_hz must be as many, and the offsets "
                "ascend"
            )
        if self.adc_bits is not None and self.adc_full_scale_dbm is None:
            raise InputError(
                f"receiver: adc_bits = {self.adc_bits} needs adc_full_scale_dbm; give both"
            )

    @property
    def in_dbm(self) -> tuple[str, ...]:
        """Names of the fields that are given in dBm, which need the power of the radar."""
        named = {
            "adc_full_scale_dbm": self.adc_full_scale_dbm,
            "dc_dbm": self.dc_dbm,
            "interferer": self.interferer,
        }
        return tuple(name for name, value in named.items() if value is not None)

    @property
    def in_baseband(self) -> tuple[str, ...]:
        """Names of the fields that act on everything that one ADC samples at once."""
        named = {
            "iq_gain_db": self.iq_gain_db,
            "iq_phase_deg": self.iq_phase_deg,
            "adc_full_scale_dbm": self.adc_full_scale_dbm is not None,
            "dc_dbm": self.dc_dbm is not None,
            "highpass_hz": self.highpass_hz,
        }
        return tuple(name for name, value in named.items() if value)


_Cells = Annotated[int, Limits(1, 64)]
_Mode = Literal["ca", "cago", "caso"]
_ThresholdDb = Annotated[float, Limits(1e-3, 200, "it must be above 0 dB, and at most 200")]


@dataclass(frozen=True, kw_only=True)
class Chip:
    """How a chip of Texas Instruments makes points of a frame: the lines of its configuration file.

    The defaults are those of the "out of box" profiles of the mmWave SDK.

    Parameters
    ----------
    cfar_axes : {"both", "range", "doppler"}
        Axes over which a cell must exceed the noise beside it, one for each line ``cfarCfg``.
    threshold_db, doppler_threshold_db : float
        Level of a cell above the noise beside it, over range and over Doppler [dB].
    range_mode, doppler_mode : {"ca", "cago", "caso"}
        Noise beside a cell: the mean of both sides, or of that with the greatest or the smallest.
    range_noise, doppler_noise : int
        Number of cells on either side whose mean is the noise.
    range_guard, doppler_guard : int
        Number of cells between them and the cell itself, on either side.
    grouping : {"both", "range", "doppler", "none"}
        Axes along which a cell that is weaker than its neighbour is left out. Along others a strong
        echo gives a point for every cell of its main lobe.
    max_points : int
        Largest number of points of a frame.

    Raises
    ------
    InputError
        Where a value is out of its range.
    """

    cfar_axes: Literal["both", "range", "doppler"] = "both"
    threshold_db: _ThresholdDb = 15.0
    doppler_threshold_db: _ThresholdDb = 15.0
    range_mode: _Mode = "caso"
    doppler_mode: _Mode = "ca"
    range_noise: _Cells = 8
    doppler_noise: _Cells = 4
    range_guard: Annotated[int, Limits(0, 64)] = 4
    doppler_guard: Annotated[int, Limits(0, 64)] = 2
    grouping: Literal["both", "range", "doppler", "none"] = "both"
    max_points: Annotated[int, Limits(1, 10_000)] = 100

    def __post_init__(self) -> None:
        check_fields(self, "chip: ")
