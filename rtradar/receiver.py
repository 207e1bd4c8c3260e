"""What a real receiver adds to the IF: its fields, one table of a radar's TOML file."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rtradar.errors import InputError
from rtradar.system.checks import brief, check_keys, check_number
from rtradar.system.seeds import check_seed

_LEVEL_DBM = (-300.0, 100.0)
_LIMITS = {
    "iq_gain_db": (-20.0, 20.0),
    "iq_phase_deg": (-80.0, 80.0),
    "adc_full_scale_dbm": _LEVEL_DBM,
    "leakage_db": (-200.0, 0.0),
    "leakage_length_m": (0.0, 100.0),
    "dc_dbm": _LEVEL_DBM,
}
_LIST_LIMITS = {
    "phase_noise_hz": (1.0, 1e12),
    "phase_noise_dbc_hz": (-300.0, 0.0),
    "highpass_hz": (1.0, 1e12),
}
_CHANNEL_LIMITS = {"channel_gain_db": (-60.0, 60.0), "channel_phase_deg": (-360.0, 360.0)}
_MOST_BITS = 24


@dataclass(frozen=True, kw_only=True)
class Interferer:
    """Another FMCW radar, whose ramps cross those of ours.

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

    start_frequency_hz: float
    slope_hz_per_s: float
    ramp_s: float
    period_s: float
    power_dbm: float
    start_s: float = 0.0
    azimuth_deg: float = 0.0
    elevation_deg: float = 0.0

    def __post_init__(self) -> None:
        limits = {
            "start_frequency_hz": (1.0, 1e15),
            "slope_hz_per_s": (-1e18, 1e18),
            "ramp_s": (1e-9, 1e3),
            "period_s": (1e-9, 1e3),
            "power_dbm": _LEVEL_DBM,
            "start_s": (0.0, 1e6),
            "azimuth_deg": (-90.0, 90.0),
            "elevation_deg": (-90.0, 90.0),
        }
        _check(self, "receiver: interferer", limits)
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

    phase_noise_hz: tuple[float, ...] = ()
    phase_noise_dbc_hz: tuple[float, ...] = ()
    iq_gain_db: float = 0.0
    iq_phase_deg: float = 0.0
    adc_bits: int | None = None
    adc_full_scale_dbm: float | None = None
    leakage_db: float | None = None
    leakage_length_m: float = 0.0
    dc_dbm: float | None = None
    channel_gain_db: float | tuple[float, ...] = 0.0
    channel_phase_deg: float | tuple[float, ...] = 0.0
    seed: int = 0
    highpass_hz: tuple[float, ...] = ()
    interferer: Interferer | None = None

    def __post_init__(self) -> None:
        _check(self, "receiver", _LIMITS)
        for key, (least, most) in _LIST_LIMITS.items():
            object.__setattr__(self, key, _numbers(key, getattr(self, key), least, most))
        for key, (least, most) in _CHANNEL_LIMITS.items():
            value = getattr(self, key)
            if isinstance(value, Sequence) and not isinstance(value, str):
                object.__setattr__(self, key, _numbers(key, value, least, most))
            else:
                object.__setattr__(self, key, check_number("receiver", key, value, 0.0, most))
        check_seed("receiver: ", self.seed)
        offsets = self.phase_noise_hz
        if len(offsets) != len(self.phase_noise_dbc_hz) or list(offsets) != sorted(set(offsets)):
            raise InputError(
                "receiver: phase_noise_hz and phase_noise_dbc_hz must be as many, and the offsets "
                "ascend"
            )
        if self.adc_bits is not None:
            bits = check_number("receiver", "adc_bits", self.adc_bits, 1, _MOST_BITS)
            if bits != int(bits) or self.adc_full_scale_dbm is None:
                raise InputError(
                    "receiver: adc_bits is a whole number and needs adc_full_scale_dbm; here they "
                    f"are {bits:g} and {self.adc_full_scale_dbm}"
                )
            object.__setattr__(self, "adc_bits", int(bits))
        table: Any = self.interferer
        if isinstance(table, Mapping):
            fields = dataclasses.fields(Interferer)
            needed = [one.name for one in fields if one.default is dataclasses.MISSING]
            optional = [one.name for one in fields if one.name not in needed]
            check_keys("receiver: interferer: ", table, tuple(needed), tuple(optional))
            object.__setattr__(self, "interferer", Interferer(**table))
        elif not isinstance(table, Interferer | None):
            raise InputError(
                f"receiver: interferer = {brief(table)}; it must be a table of its fields"
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


def _check(values: Any, where: str, limits: Mapping[str, tuple[float, float]]) -> None:
    """Check the numbers of a dataclass, and set them as floats."""
    for key, (least, most) in limits.items():
        if (value := getattr(values, key)) is not None:
            object.__setattr__(values, key, check_number(where, key, value, least, most))


def _numbers(key: str, values: object, least: float, most: float) -> tuple[float, ...]:
    if not isinstance(values, Sequence) or isinstance(values, str):
        raise InputError(f"receiver: {key} = {brief(values)}; it must be a list of numbers")
    return tuple(check_number("receiver", key, value, least, most) for value in values)
