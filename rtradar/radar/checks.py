"""What the fields of a radar may be: each by itself, and those that must fit each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rtradar.antenna import Antenna
from rtradar.errors import InputError
from rtradar.system.checks import shown

_POSITIVE = (
    "start_frequency_hz",
    "bandwidth_hz",
    "chirp_duration_s",
    "frame_duration_s",
    "frame_hop_s",
    "tx_spacing_wavelengths",
    "rx_spacing_wavelengths",
)
_COUNTS = {"samples_per_chirp": 1, "tx_y": 0, "tx_z": 0, "rx_y": 0, "rx_z": 0}
_CHOICES = {
    "channels": ("pairs", "all"),
    "polarization": ("v", "h"),
    "multiplexing": ("tdm", "fdm", "ddm"),
}
_POWERS = (
    ("transmit_power_dbm", -200, 200),
    ("noise_figure_db", 0, 100),
    ("noise_temperature_k", 0, 1e6),
)
_MAY_BE_UNKNOWN = ("transmit_power_dbm", "noise_figure_db")
# Far outside every radar; inside, no product or ratio of two of them leaves the range of float64.
_LEAST, _LARGEST, _MOST = 1e-15, 1e15, 65536


def checked_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a `Radar` that have a meaning by themselves, in their types.

    Parameters
    ----------
    values : mapping
        Every field by its name.

    Returns
    -------
    dict
        Those that were checked.

    Raises
    ------
    InputError
        Where a value has no physical meaning; the message names the field and what is allowed.
    """
    if not (isinstance(values["name"], str) and values["name"].isprintable()):
        raise InputError(f"radar: name = {shown(values['name'])}; it must be one line of text")
    radar = f"radar '{values['name']}'"
    found: dict[str, Any] = {}
    for field in _POSITIVE:
        value = values[field]
        if not (_is_number(value) and _LEAST < value < _LARGEST):
            raise InputError(
                f"{radar}: {field} = {shown(value)}; it must be a positive, finite number"
            )
        found[field] = float(value)
    for field, lowest in _COUNTS.items():
        value = values[field]
        if not (_is_count(value) and lowest <= value <= _MOST):
            raise InputError(
                f"{radar}: {field} = {shown(value)}; it must be a whole number from {lowest} to {_MOST}"
            )
        found[field] = int(value)
    for field, allowed in _CHOICES.items():
        if values[field] not in allowed:
            raise InputError(
                f"{radar}: {field} = {shown(values[field])}; allowed: {', '.join(allowed)}"
            )
    position = values["position_m"]
    if (
        not isinstance(position, list | tuple | np.ndarray)
        or len(position) != 3
        or not all(map(_is_number, position))
    ):
        raise InputError(
            f"{radar}: position_m = {shown(position)}; it must be three finite numbers [m]"
        )
    found["position_m"] = tuple(float(value) for value in position)
    for field, least, most in _POWERS:
        value = values[field]
        if value is None and field in _MAY_BE_UNKNOWN:
            continue
        if not (_is_number(value) and least <= value <= most):
            raise InputError(
                f"{radar}: {field} = {shown(value)}; it must lie between {least} and {most:g}"
            )
        found[field] = float(value)
    # What they may be hangs on other fields; `check_multiplexing` says.
    if _is_number(values["carrier_step_hz"]):
        found["carrier_step_hz"] = float(values["carrier_step_hz"])
    if _is_count(values["doppler_bands"]):
        found["doppler_bands"] = int(values["doppler_bands"])
    return found | {
        field: _antenna(radar, field, values[field]) for field in ("tx_antenna", "rx_antenna")
    }


def _antenna(radar: str, field: str, value: object) -> Antenna | None:
    try:
        made = Antenna.of(value) if isinstance(value, Mapping) else value
    except InputError as error:
        raise InputError(f"{radar}: {field}: {error}") from None
    if made is not None and not isinstance(made, Antenna):
        raise InputError(
            f"{radar}: {field} = {shown(value)}; it must be a table of an antenna's fields"
        )
    return made


def check_array(name: str, tx_lines: Sequence[int], rx_lines: Sequence[int], channels: str) -> None:
    """Refuse an array without Tx or Rx, and pairs of lines that have different numbers of Rx.

    Parameters
    ----------
    name : str
        Of the radar.
    tx_lines, rx_lines : (2,) int
        Antennas along y and along z.
    channels : {"pairs", "all"}

    Raises
    ------
    InputError
    """
    if sum(tx_lines) == 0 or sum(rx_lines) == 0:
        raise InputError(f"radar '{name}': the array has no Tx or no Rx; give at least one of each")
    used = {rx for tx, rx in zip(tx_lines, rx_lines, strict=True) if tx}
    if channels == "pairs" and (0 in used or len(used) > 1):
        raise InputError(
            f"radar '{name}': channels = 'pairs' needs as many Rx on the y-line as on the z-line, here "
            f"{rx_lines[0]} and {rx_lines[1]}; make them equal or set channels = 'all'"
        )


def check_multiplexing(
    name: str,
    multiplexing: str,
    *,
    carrier_step_hz: Any,
    start_frequency_hz: float,
    sample_rate_hz: float,
    doppler_bands: Any,
    n_tx: int,
    all_heard: bool,
) -> None:
    """Refuse carriers and bands that do not part the Tx, or belong to another kind of multiplexing.

    Parameters
    ----------
    name : str
        Of the radar.
    multiplexing : {"tdm", "fdm", "ddm"}
    carrier_step_hz, doppler_bands : number or None
        As given.
    start_frequency_hz : float
        Where the sweep begins, in the middle of all carriers [Hz].
    sample_rate_hz : float
        Width of an IF band [Hz].
    n_tx : int
    all_heard : bool
        Whether every Rx hears all Tx.

    Raises
    ------
    InputError
    """
    for field, value, owner in (
        ("carrier_step_hz", carrier_step_hz, "fdm"),
        ("doppler_bands", doppler_bands, "ddm"),
    ):
        if value is not None and multiplexing != owner:
            raise InputError(
                f"radar '{name}': {field} belongs to multiplexing = '{owner}'; leave it out"
            )
    if carrier_step_hz is not None and not (
        _is_number(carrier_step_hz) and sample_rate_hz <= carrier_step_hz
    ):
        raise InputError(
            f"radar '{name}': carrier_step_hz = {shown(carrier_step_hz)}; bands of the IF are {sample_rate_hz:g} Hz wide "
            "(samples_per_chirp / chirp_duration_s), so carriers must be at least that far apart"
        )
    if multiplexing == "fdm":
        step = sample_rate_hz if carrier_step_hz is None else carrier_step_hz
        below = (n_tx - 1) / 2 * step
        if below >= start_frequency_hz:
            raise InputError(
                f"radar '{name}': {n_tx} carriers {step:g} Hz apart begin {below:g} Hz below start_frequency_hz = "
                f"{start_frequency_hz:g}, at no positive frequency; raise that, or set them nearer (carrier_step_hz)"
            )
    if doppler_bands is not None and not (
        _is_count(doppler_bands) and n_tx < doppler_bands <= _MOST
    ):
        raise InputError(
            f"radar '{name}': doppler_bands = {shown(doppler_bands)}; it must be a whole number above {n_tx}, the number of Tx"
        )
    if multiplexing == "ddm" and not all_heard:
        raise InputError(
            f"radar '{name}': under multiplexing = 'ddm' every Rx hears all Tx; set channels = 'all', or give Tx on one line"
        )


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    return bool(-_LARGEST < value < _LARGEST)


def _is_count(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
