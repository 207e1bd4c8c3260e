"""Configuration files of TI's mmWave SDK (``.cfg``), the commands of a chip, read as a radar.

A file says how the chip transmits and samples; where its antennas are is known from its board. The
commands are those of the user guide of the mmWave SDK, releases 1 to 3, of the MCU+ SDK, and of the
MMWAVE-L-SDK for the low-power chips, whose files speak of bursts of chirps.
"""

from __future__ import annotations

import dataclasses
import math
import re
import tomllib
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, NoReturn

import numpy as np

from rtradar.errors import InputError, ValidityWarning, prefixed
from rtradar.front_end import Chip
from rtradar.radar.radar import Radar
from rtradar.system.checks import brief, printable
from rtradar.system.files import read_bytes

_MOST_BYTES, _MOST_CHIRPS = 1_000_000, 512

_ODD = "the number of real samples is odd; half as many complex ones are made"

_CEILING_DEG = 45.0
"""Tilt from which on a sensor looks down from a ceiling."""

_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
_BOARDS, _PROCESSING, _REFUSED = (_TABLE[key] for key in ("boards", "processing", "refused"))
_GEOMETRIES = {tuple(places): board for board, places in _TABLE["geometries"].items()}
_COUNTS: dict[str, Sequence[int]] = {**_TABLE["counts"], "antGeometryCfg": range(2, 100)}
"""Commands that are read, with the numbers of values that they may have."""

_Q9_DB, _Q8_DB = 20 * math.log10(2) / 512, 20 * math.log10(2) / 256
"""Decibels of one step of thresholds, which count logarithms to base 2 in units of 1/512 or, summed
over the virtual antennas, 1/256."""

_MODES = ("ca", "cago", "caso")

_PLATFORM = re.compile(r"%\s*platform\s*:\s*(\S+)", re.IGNORECASE)


class _Line(NamedTuple):
    """A command, where it is and what it says."""

    number: int
    values: tuple[float, ...]

    def refuse(self, why: str) -> NoReturn:
        raise InputError(f"line {self.number}: {why}") from None

    def whole(self, index: int, least: int, most: int, what: str) -> int:
        value = self.values[index]
        if value != int(value) or not least <= value <= most:
            self.refuse(f"{what} is {value:g}; it must be a whole number from {least} to {most}")
        return int(value)


_Commands = dict[str, list[_Line]]


@dataclass(frozen=True)
class TiProfile:
    """What a configuration file says: the radar, and how its samples leave the chip.

    ``real``, ``q_first`` and ``rx_mask`` are those of `rtradar.exchange.Dca1000Layout`.
    """

    radar: Radar
    real: bool
    q_first: bool
    rx_mask: int


def read_ti_cfg(path: str | Path, board: str | None = None) -> TiProfile:
    """Read a configuration file; see `Radar.from_ti_cfg`."""
    path = Path(path)
    with prefixed(f"profile '{path}': "):
        commands, platform = _commands(path)
        low_power = "chirpComnCfg" in commands
        needed = _TABLE["needed"]["low_power" if low_power else "sdk"]
        for command in needed:
            if command not in commands:
                raise InputError(f"it has no {command}; it must say it")
        read = _read_low_power if low_power else _read
        return read(path, commands, platform, board, *(commands[one][-1] for one in needed))


def _warn(path: Path, text: str) -> None:
    warnings.warn(f"profile '{path}': {text}", ValidityWarning, stacklevel=6)


def _read(
    path: Path, commands: _Commands, platform: str | None, board: str | None, *lines: _Line
) -> TiProfile:
    """Read the commands of the mmWave SDK; ``lines`` are those that are needed."""
    mode = commands.get("dfeDataOutputMode", [])
    if mode and mode[-1].values[0] != 1:
        mode[-1].refuse("dfeDataOutputMode must be 1, frames of one kind; others are not simulated")
    *_, frame, channels, adc = lines
    sequence = _sequence(path, commands, frame, channels)
    order, profile = sequence.order, sequence.profile
    base = Radar.preset(board or _board(path, commands, platform, profile.values[1]))
    rx_mask = channels.whole(0, 1, 2**base.n_rx - 1, "the mask of Rx")
    if max(order) >= base.n_tx:
        channels.refuse(f"Tx {max(order) + 1} is on, and board {base.name} has {base.n_tx}")
    if adc.whole(0, 0, 2, "the bits of a sample") != 2:
        adc.refuse("samples must have 16 bits (2); others are not read")
    if adc.values[1] not in (0, 1):
        adc.refuse("the samples must be complex 1x (1) or real (0); others are not simulated")
    buffer = commands["adcbufCfg"][-1] if "adcbufCfg" in commands else None
    q_first = buffer is not None and buffer.values[-3] == 1
    if buffer is not None and not set(buffer.values[-4:-1]) <= {0, 1}:
        buffer.refuse("the order of samples, Q first and the interleaving must be 0 or 1 each")
    real, in_turn = adc.values[1] == 0, sequence.multiplexing == "tdm"
    tx = order if sequence.multiplexing == "ddm" else sorted(order)
    places = _places_of(base)
    fields = {
        "tx_positions_m": tuple(places[0][one] for one in tx),
        "tx_order": tuple(tx.index(one) for one in order) if in_turn else None,
        "multiplexing": sequence.multiplexing,
        "chirps_per_frame": frame.whole(2, 1, 65536, "the number of loops")
        * sequence.cycles
        * len(order),
        "frame_period_s": 1e-3 * frame.values[5 if len(frame.values) == 8 else 4],
        "transmit_power_dbm": _power(base, profile, tx),
        **_waveform(profile, real),
    }
    radar = _radar(path, commands, base, places[1], rx_mask, fields)
    return TiProfile(radar, real, not real and q_first, rx_mask)


def _read_low_power(
    path: Path, commands: _Commands, platform: str | None, board: str | None, *lines: _Line
) -> TiProfile:
    """Read the commands of the low-power chips (xWRL), whose samples are real."""
    common, timing, frame, channels = lines
    name = (platform or "").lower()
    if len(frame.values) != 6:
        frame.refuse(f"frameCfg of a low-power chip has {len(frame.values)} values, not 6")
    base = Radar.preset(board or _BOARDS.get(name, "iwrl6432"))
    large = "684" in name
    tx_places, rx_places = _places_of(base)
    if "antGeometryCfg" in commands:
        counts = (4, 4) if large else (base.n_tx, base.n_rx)
        tx_places, rx_places = _virtual_places(commands["antGeometryCfg"][-1], *counts)
    elif large:
        raise InputError("it has no antGeometryCfg, which says where antennas are")
    rx_mask = channels.whole(0, 1, 2 ** len(rx_places) - 1, "the mask of Rx")
    tx_mask = channels.whole(1, 1, 2 ** len(tx_places) - 1, "the mask of Tx")
    tx = [place for k, place in enumerate(tx_places) if tx_mask >> k & 1]
    pattern = common.whole(4, 0, 4, "the pattern of the Tx")
    if pattern not in (0, 1, 4) or (pattern == 4 and len(tx) != 2):
        common.refuse("the Tx must take turns (1), or two be told apart by their signs (4)")
    if pattern == 0 and len(tx) > 1:
        common.refuse("several Tx transmit in one chirp; let them take turns (1)")
    chirps = frame.whole(0, 1, 512, "the number of chirps in a burst")
    if chirps % len(tx):
        frame.refuse(f"{chirps} chirps in a burst are no multiple of {len(tx)} Tx")
    bursts, burst_us = frame.whole(3, 1, 4096, "the number of bursts"), frame.values[2]
    samples = common.whole(3, 2, 2048, "the number of samples")
    if samples % 2:
        common.refuse(_ODD)
    rate_hz = (200e6 if large else 100e6) / common.whole(0, 8, 100, "the divisor of the rate")
    ramp_us, idle_us, slope = common.values[5], timing.values[0], timing.values[3]
    if not (slope > 0 and ramp_us > 0 and chirps * (ramp_us + idle_us) <= burst_us * (1 + 1e-9)):
        frame.refuse(
            f"{chirps} chirps of {ramp_us + idle_us:g} us in a burst of {burst_us:g} us, with a "
            f"slope of {slope:g} MHz/us; the sweep must rise and the chirps fit"
        )
    if bursts > 1 and chirps * (ramp_us + idle_us) < burst_us * (1 - 1e-9):
        _warn(
            path,
            f"the {chirps} chirps of a burst are taken evenly over its "
            f"{burst_us:g} us; the chip transmits one every {ramp_us + idle_us:g} us, and pauses",
        )
    fields = {
        "tx_positions_m": tuple(tx),
        "tx_order": None,
        "multiplexing": "bpm" if pattern == 4 else "tdm",
        "start_frequency_hz": 1e9 * timing.values[4],
        "bandwidth_hz": 1e6 * slope * ramp_us,
        "chirp_duration_s": 1e-6 * ramp_us,
        "idle_s": 1e-6 * (burst_us / chirps - ramp_us),
        "adc_start_s": timing.values[1] / rate_hz,
        "samples_per_chirp": samples // 2,
        "adc_rate_hz": rate_hz / 2,
        "chirps_per_frame": chirps * bursts,
        "frame_period_s": 1e-3 * frame.values[4],
    }
    base = dataclasses.replace(base, name="iwrl6844") if large else base
    radar = _radar(path, commands, base, rx_places, rx_mask, fields)
    return TiProfile(radar, True, False, rx_mask)


_Places = tuple[tuple[float, float, float], ...]


def _places_of(board: Radar) -> tuple[_Places, _Places]:
    """Places of the Tx and of the Rx of a board."""
    if board.tx_positions_m is None or board.rx_positions_m is None:
        raise InputError(f"{board.name} has lines of antennas, not places; name a board (--board)")
    return board.tx_positions_m, board.rx_positions_m


def _radar(
    path: Path,
    commands: _Commands,
    board: Radar,
    rx_places: _Places,
    rx_mask: int,
    fields: dict[str, Any],
) -> Radar:
    """Make the radar of a board, and of the fields that follow from the file.

    Where the file says height and tilt of the sensor they count; beneath a ceiling it is above
    x = 0. It is named by its board and its file, once where the file is named after the board.
    """
    virtual = len(fields["tx_positions_m"]) * rx_mask.bit_count()
    fields["chip"] = _chip(path, commands, virtual) if "cfarCfg" in commands else None
    name = printable(path.stem)
    fields["name"] = name if board.name in name.lower() else f"{board.name} {name}"
    fields["rx_positions_m"] = tuple(own for k, own in enumerate(rx_places) if rx_mask >> k & 1)
    if "sensorPosition" in commands:
        height_m, azimuth_deg, tilt_deg = commands["sensorPosition"][-1].values
        place = (0.0, 0.0) if abs(tilt_deg) > _CEILING_DEG else board.position_m[:2]
        fields |= {"position_m": (*place, height_m), "yaw_deg": -azimuth_deg}
        fields["pitch_deg"] = -tilt_deg
    return dataclasses.replace(board, **fields)


def _chip(path: Path, commands: _Commands, virtual: int) -> Chip:
    """Say how the chip detects, by its lines ``cfarCfg`` and ``peakGrouping``.

    Those of ``cfarCfg`` have 7 values on the xWR14xx, 8 on other chips up to SDK 2, whose first one
    is the subframe, and 9 from SDK 3 on, which gives the threshold in decibels and says at the end
    whether peaks are grouped along that axis.
    """
    found: dict[str, Any] = {}
    grouped = {"range": True, "doppler": True}
    axes: list[str] = []
    for line in commands["cfarCfg"]:
        count = len(line.values)
        first = 0 if count == 7 else 1
        axis = ("range", "doppler")[line.whole(first, 0, 1, "the direction of CFAR")]
        mode = line.whole(first + 1, 0, 2, "the mode of CFAR")
        cells = line.whole(first + 2, 1, 64, "the number of noise cells")
        guard = line.whole(first + 3, 0, 64, "the number of guard cells")
        both = 2 if mode == 0 else 1
        if 2 ** line.whole(first + 4, 0, 8, "the divisor of the noise") != both * cells:
            _warn(path, f"line {line.number}: the noise is the mean of its cells here")
        step_db = {7: _Q9_DB, 8: _Q8_DB / virtual, 9: 1.0}[count]
        key = "threshold_db" if axis == "range" else "doppler_threshold_db"
        found[key] = step_db * line.values[first + 6]
        found |= {f"{axis}_mode": _MODES[mode], f"{axis}_noise": cells, f"{axis}_guard": guard}
        if count == 9:
            grouped[axis] = bool(line.values[8])
        axes.append(axis)
    if "peakGrouping" in commands:
        _, along_range, along_doppler, *_ = commands["peakGrouping"][-1].values[-5:]
        grouped = {"range": bool(along_range), "doppler": bool(along_doppler)}
    names = [axis for axis, on in grouped.items() if on]
    grouping: Any = "both" if len(names) == 2 else (*names, "none")[0]
    cfar_axes: Any = "both" if len(set(axes)) == 2 else axes[0]
    return Chip(cfar_axes=cfar_axes, grouping=grouping, **found)


def _virtual_places(line: _Line, n_tx: int, n_rx: int) -> tuple[_Places, _Places]:
    """Places of Tx and Rx by rows and columns of the virtual antennas, Tx by Tx, and spacings [mm].

    The first row is the highest, and columns go to the left as the radar looks.
    """
    count = n_tx * n_rx
    if len(line.values) != 2 * count + 2:
        line.refuse(
            f"antGeometryCfg has {len(line.values)} values, not {2 * count + 2}: rows and columns "
            f"of {count} virtual antennas, and two spacings"
        )
    *steps, y_mm, z_mm = line.values
    virtual = np.zeros((n_tx, n_rx, 3))
    virtual[..., 2:0:-1] = np.reshape(steps, (n_tx, n_rx, 2)) * [-1e-3 * z_mm, 1e-3 * y_mm]
    tx, rx = virtual[:, 0] - virtual[0, 0], virtual[0]
    off = np.abs(tx[:, None] + rx - virtual).sum(axis=2).ravel() > 1e-9
    if off.any():
        line.refuse(f"virtual antenna {off.argmax() + 1} is not where its Tx and its Rx put it")
    return tuple(map(tuple, tx.tolist())), tuple(map(tuple, rx.tolist()))


def _commands(path: Path) -> tuple[_Commands, str | None]:
    """Return the lines of each command that is read, and the platform that a comment names."""
    try:
        text = read_bytes(path, _MOST_BYTES).decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(f"{error.strerror}; give a .cfg file") from None
    except ValueError:
        raise InputError("it is larger than 1 MB, and no .cfg file") from None
    found: _Commands = {}
    unknown: dict[str, int] = {}
    processing: dict[str, int] = {}
    platform = None
    for number, whole in enumerate(text.splitlines(), 1):
        named = _PLATFORM.match(whole.strip())
        platform = named[1] if named else platform
        command, *words = whole.partition("%")[0].split() or [""]
        if command == "flushCfg":
            found.clear()
        if command in _REFUSED:
            _Line(number, ()).refuse(_REFUSED[command])
        if command in _COUNTS:
            found.setdefault(command, []).append(_line(number, command, words))
        elif command in _PROCESSING:
            if command not in _TABLE["switches"] or not words or words[-1] not in ("0", "0.0"):
                processing.setdefault(command, number)
        elif command and not re.fullmatch(_TABLE["without_effect"], command):
            unknown.setdefault(command, number)
    if "chirpComnCfg" in found and "cfarCfg" in found:
        # The low-power chips look for peaks over range and azimuth, in another chain.
        processing["cfarCfg"] = found.pop("cfarCfg")[0].number
    listed = [f"{brief(name)[1:-1]} (line {n})" for name, n in unknown.items()]
    listed += [f"{name} (line {n}; {_PROCESSING[name]})" for name, n in processing.items()]
    if listed:
        text = ", ".join(listed)
        text = text if len(text) <= 700 else text[:697] + "..."
        _warn(path, f"what these lines say is not read: {text}")
    return found, platform


def _line(number: int, command: str, words: Sequence[str]) -> _Line:
    """Read the values of a command."""
    counts = _COUNTS[command]
    if len(words) not in counts:
        allowed = " or ".join(map(str, counts))
        _Line(number, ()).refuse(f"{command} has {len(words)} values, not {allowed}")
    values = []
    for word in words:
        try:
            value = float(int(word, 0)) if word.lower().startswith("0x") else float(word)
        except (ValueError, OverflowError):
            value = math.nan
        if not abs(value) < 1e15:
            _Line(number, ()).refuse(f"{command} has {brief(word)}, which is no number")
        values.append(value)
    return _Line(number, tuple(values))


class _Sequence(NamedTuple):
    """Tx of one cycle in the order of sending, cycles of a loop, the profile, and how Tx differ."""

    order: list[int]
    cycles: int
    profile: _Line
    multiplexing: Literal["tdm", "ddm", "bpm"]


def _sequence(path: Path, commands: _Commands, frame: _Line, channels: _Line) -> _Sequence:
    chirps: dict[int, _Line] = {}
    for line in commands["chirpCfg"]:
        first = line.whole(0, 0, _MOST_CHIRPS - 1, "the first chirp")
        for index in range(first, line.whole(1, first, _MOST_CHIRPS - 1, "the last chirp") + 1):
            chirps[index] = line
    first = frame.whole(0, 0, _MOST_CHIRPS - 1, "the first chirp")
    last = frame.whole(1, first, _MOST_CHIRPS - 1, "the last chirp")
    tx_on = channels.whole(1, 1, 15, "the mask of Tx")
    masks, profiles = [], set()
    for index in range(first, last + 1):
        if index not in chirps:
            frame.refuse(f"no chirpCfg says what chirp {index} is")
        line = chirps[index]
        mask = line.whole(7, 1, 15, "the mask of Tx")
        if mask & ~tx_on:
            off = (mask & ~tx_on).bit_length()
            line.refuse(f"Tx {off} transmits, but channelCfg switches it off")
        if any(line.values[3:7]):
            line.refuse("the chirp differs from its profile, which is not simulated; give zeros")
        profiles.add(line.values[2])
        masks.append(mask)
    matching = [line for line in commands["profileCfg"] if line.values[0] in profiles]
    if len(profiles) > 1 or not matching:
        frame.refuse("its chirps must have one profileCfg in common")
    profile = matching[-1]
    signs = commands.get("bpmCfg", [])
    if signs and signs[-1].values[0 if len(signs[-1].values) == 3 else 1]:
        order, multiplexing = _with_signs(path, masks, first, signs[-1])
    elif all(mask.bit_count() == 1 for mask in masks):
        order, multiplexing = [mask.bit_length() - 1 for mask in masks], "tdm"
    elif "ddmPhaseShiftAntOrder" in commands and len(set(masks)) == 1:
        given = commands["ddmPhaseShiftAntOrder"][-1]
        order = [given.whole(k, 0, 3, "a Tx") for k in range(len(given.values))]
        order = [one for one in order if masks[0] >> one & 1]
        if len(set(order)) != masks[0].bit_count():
            given.refuse("it must name each Tx that transmits once")
        return _Sequence(order, len(masks), profile, "ddm")
    else:
        chirps[first + next(k for k, mask in enumerate(masks) if mask.bit_count() > 1)].refuse(
            "several Tx transmit in one chirp, and neither bpmCfg nor ddmPhaseShiftAntOrder tells "
            "them apart; give each its own"
        )
    cycle = len(set(order))
    if order != order[:cycle] * (len(order) // cycle) or len(set(order[:cycle])) != cycle:
        frame.refuse("a Tx transmits twice before the others; each must have its turn in a cycle")
    return _Sequence(order[:cycle], len(order) // cycle, profile, multiplexing)


def _with_signs(
    path: Path, masks: Sequence[int], first: int, line: _Line
) -> tuple[list[int], Literal["tdm", "bpm"]]:
    """Tx of each chirp where two of the chirps are sent by two Tx, with signs + + and + -."""
    chirps = [int(value) - first for value in line.values[-2:]]
    inside = all(0 <= chirp < len(masks) for chirp in chirps)
    pair = masks[chirps[0]] if inside else 0
    if len(set(chirps)) != 2 or pair.bit_count() != 2 or masks[chirps[1]] != pair:
        line.refuse(
            "binary phase modulation (bpmCfg) must name two chirps of the frame, with the same two "
            "Tx"
        )
    order = [mask.bit_length() - 1 for mask in masks]
    order[chirps[0]], order[chirps[1]] = members = [one for one in range(4) if pair >> one & 1]
    others = [mask for chirp, mask in enumerate(masks) if chirp not in chirps]
    if any(mask.bit_count() > 1 for mask in others):
        line.refuse("several Tx transmit in a chirp that bpmCfg does not name")
    if not others and chirps == [0, 1]:
        return order, "bpm"
    _warn(
        path,
        f"line {line.number}: Tx {members[0] + 1} and {members[1] + 1} "
        "transmit together with signs of their own (BPM); here each has a chirp of its own, and 3 "
        "dB less signal over noise",
    )
    return order, "tdm"


def _board(path: Path, commands: _Commands, platform: str | None, start_ghz: float) -> str:
    """Choose the board by its virtual antennas or the platform that the file names, or the band."""
    if "antGeometry0" in commands:
        board = _GEOMETRIES.get(tuple(map(int, commands["antGeometry0"][-1].values)))
        if board is not None:
            return board
    if platform is not None:
        board = _BOARDS.get(platform.lower())
        if board is None:
            raise InputError(
                f"it is for platform {brief(platform)[1:-1]}, whose antennas are not "
                f"known; name a board (board, --board), or one of: % Platform:{', '.join(_BOARDS)}"
            )
        low, high = (57, 64) if "6843" in board or "6432" in board else (76, 81)
        if not low <= start_ghz <= high:
            raise InputError(
                f"it is for platform {brief(platform)[1:-1]} of {low} to {high} GHz, "
                f"and starts at {start_ghz:g} GHz; mend one of both, or name a board (--board)"
            )
        return board
    board = "iwr6843" if start_ghz < 70 else "iwr1843"
    _warn(
        path,
        f"it names no board: the antennas are those of {board}; another is named by "
        "--board, or in the file by a line such as % Platform:xWR14xx",
    )
    return board


def _power(board: Radar, profile: _Line, tx: Sequence[int]) -> float | None:
    """Transmit power less the back-off, which has a byte for each Tx [dBm]."""
    code = profile.whole(5, 0, 2**32 - 1, "the power back-off")
    backoff_db = {code >> 8 * one & 0xFF for one in tx}
    if len(backoff_db) > 1:
        profile.refuse("the Tx have different powers, which is not simulated; give one back-off")
    power = board.transmit_power_dbm
    return None if power is None else power - backoff_db.pop()


def _waveform(profile: _Line, real: bool) -> dict[str, Any]:
    """Return the fields of a radar that follow from a profile, in SI units."""
    _, start_ghz, idle_us, adc_us, ramp_us, _, phase, slope, _, _, rate_ksps, *_ = profile.values
    samples = profile.whole(9, 1, 65536, "the number of samples")
    if phase:
        profile.refuse("phases of the Tx are not simulated; give 0")
    if slope <= 0 or ramp_us <= 0:
        profile.refuse("the sweep must rise: slope and ramp end must be above 0")
    if real and samples % 2:
        profile.refuse(_ODD)
    return {
        "start_frequency_hz": 1e9 * start_ghz,
        "bandwidth_hz": 1e6 * slope * ramp_us,
        "chirp_duration_s": 1e-6 * ramp_us,
        "idle_s": 1e-6 * idle_us,
        "adc_start_s": 1e-6 * adc_us,
        "samples_per_chirp": samples // 2 if real else samples,
        "adc_rate_hz": 1e3 * rate_ksps / (2 if real else 1),
    }
