"""Configuration files of TI's mmWave SDK (``.cfg``), the commands of a chip, read as a radar.

A file says how the chip transmits and samples; where its antennas are is known from its board. The
commands are those of the user guide of the mmWave SDK, releases 1 to 3, and of the MCU+ SDK.
"""

from __future__ import annotations

import dataclasses
import math
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from rtradar.errors import InputError, ValidityWarning
from rtradar.radar.radar import Radar
from rtradar.system.checks import brief, printable
from rtradar.system.files import read_bytes

_MOST_BYTES, _MOST_CHIRPS = 1_000_000, 512

_BOARDS = {
    "xwr14xx": "iwr1443",
    "xwr18xx": "iwr1843",
    "xwr22xx": "awr2243",
    "xwr64xx": "iwr6843",
    "xwr68xx": "iwr6843",
    "xwr64xx_aop": "iwr6843aop",
    "xwr68xx_aop": "iwr6843aop",
    "xwr294x": "awr2944",
    "awr294x": "awr2944",
}
"""Boards of the platforms that the first lines of a file name."""

_PLATFORM = re.compile(r"%\s*platform\s*:\s*(\S+)", re.IGNORECASE)

_COUNTS = {
    "profileCfg": (14,),
    "chirpCfg": (8,),
    "frameCfg": (6, 7, 8),
    "channelCfg": (3, 5),
    "adcCfg": (2,),
    "adcbufCfg": (4, 5),
    "dfeDataOutputMode": (1,),
    "bpmCfg": (3, 4),
}
"""Commands that are read, with the numbers of values that they may have."""

_NEEDED = ("profileCfg", "chirpCfg", "frameCfg", "channelCfg", "adcCfg")

# These start, stop, calibrate or process, and leave the chirps and samples as they are.
_WITHOUT_EFFECT = re.compile(
    "sensorSt(art|op)|flushCfg|lowPower|guiMonitor|cfarCfg|peakGrouping|multiObjBeamForming|"
    "clutterRemoval|calibDcRangeSig|extendedMaxVelocity|(comp|measure)RangeBiasAndRxChanPhase|"
    "CQ(RxSat|SigImg)Monitor|analogMonitor|(aoa|cfar)FovCfg|nearFieldCfg|lvdsStreamCfg|calibData"
)
_REFUSED = {
    "advFrameCfg": "frames of several kinds (advFrameCfg) are not simulated; use frameCfg",
    "subFrameCfg": "frames of several kinds (subFrameCfg) are not simulated; use frameCfg",
    "contModeCfg": "continuous transmission is not simulated; use frameCfg",
}


class _Line(NamedTuple):
    """A command, where it is and what it says."""

    path: Path
    number: int
    values: tuple[float, ...]

    def refuse(self, why: str) -> NoReturn:
        raise InputError(f"profile '{self.path}', line {self.number}: {why}") from None

    def whole(self, index: int, least: int, most: int, what: str) -> int:
        value = self.values[index]
        if value != int(value) or not least <= value <= most:
            self.refuse(f"{what} is {value:g}; it must be a whole number from {least} to {most}")
        return int(value)


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
    commands, platform = _commands(path)
    for command in _NEEDED:
        if command not in commands:
            raise InputError(f"profile '{path}' has no {command}; it must say it")
    mode = commands.get("dfeDataOutputMode", [])
    if mode and mode[-1].values[0] != 1:
        mode[-1].refuse("dfeDataOutputMode must be 1, frames of one kind; others are not simulated")
    for line in commands.get("bpmCfg", []):
        if line.values[1]:
            line.refuse("binary phase modulation (bpmCfg) is not read; switch it off")
    frame, channels, adc = (commands[one][-1] for one in ("frameCfg", "channelCfg", "adcCfg"))
    order, repeats, profile = _sequence(commands, frame, channels)
    base = Radar.preset(board or _board(path, platform, profile.values[1]))
    most_tx, most_rx = base.n_tx, base.n_rx
    rx_mask = channels.whole(0, 1, 2**most_rx - 1, "the mask of Rx")
    if max(order) >= most_tx:
        channels.refuse(f"Tx {max(order) + 1} is on, and board {base.name} has {most_tx}")
    if adc.values[1] not in (0, 1):
        adc.refuse("the samples must be complex 1x (1) or real (0); others are not simulated")
    buffer = commands["adcbufCfg"][-1].values[-4:] if "adcbufCfg" in commands else (0, 0, 0, 1)
    real = adc.values[1] == 0
    loops = frame.whole(2, 1, 65536, "the number of loops")
    period_ms = frame.values[5 if len(frame.values) == 8 else 4]
    tx = sorted(order)
    positions = base.tx_positions_m, base.rx_positions_m
    assert positions[0] is not None  # every board lists its antennas
    assert positions[1] is not None
    try:
        radar = dataclasses.replace(
            base,
            name=f"{base.name} {printable(path.stem)}",
            tx_positions_m=tuple(positions[0][one] for one in tx),
            rx_positions_m=tuple(positions[1][k] for k in range(most_rx) if rx_mask >> k & 1),
            tx_order=tuple(tx.index(one) for one in order),
            chirps_per_frame=loops * repeats * len(order),
            frame_period_s=1e-3 * period_ms,
            transmit_power_dbm=_power(base, profile, tx),
            **_waveform(profile, real),
        )
    except InputError as error:
        raise InputError(f"profile '{path}': {error}") from None
    return TiProfile(radar, real, not real and buffer[1] == 1, rx_mask)


def _commands(path: Path) -> tuple[dict[str, list[_Line]], str | None]:
    """Return the lines of each command that is read, and the platform that a comment names."""
    try:
        text = read_bytes(path, _MOST_BYTES).decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(f"profile '{path}': {error.strerror}; give a .cfg file") from None
    except ValueError:
        raise InputError(f"profile '{path}' is larger than 1 MB: it is no .cfg file") from None
    found: dict[str, list[_Line]] = {}
    unknown: dict[str, int] = {}
    platform = None
    for number, whole in enumerate(text.splitlines(), 1):
        named = _PLATFORM.match(whole.strip())
        platform = named[1] if named else platform
        command, *words = whole.partition("%")[0].split() or [""]
        if command == "flushCfg":
            found.clear()
        if command in _REFUSED:
            _Line(path, number, ()).refuse(_REFUSED[command])
        if command in _COUNTS:
            found.setdefault(command, []).append(_line(path, number, command, words))
        elif command and not _WITHOUT_EFFECT.fullmatch(command):
            unknown.setdefault(command, number)
    if unknown:
        listed = ", ".join(f"{brief(name)[1:-1]} (line {n})" for name, n in unknown.items())
        listed = listed if len(listed) <= 400 else f"{listed[:397]}..."
        warnings.warn(
            f"profile '{path}': what these lines say is not read: {listed}",
            ValidityWarning,
            stacklevel=4,
        )
    return found, platform


def _line(path: Path, number: int, command: str, words: Sequence[str]) -> _Line:
    """Read the values of a command."""
    counts = _COUNTS[command]
    if len(words) not in counts:
        allowed = " or ".join(map(str, counts))
        _Line(path, number, ()).refuse(f"{command} has {len(words)} values, not {allowed}")
    values = []
    for word in words:
        try:
            value = float(int(word, 0)) if word.lower().startswith("0x") else float(word)
        except (ValueError, OverflowError):
            value = math.nan
        if not abs(value) < 1e15:
            _Line(path, number, ()).refuse(f"{command} has {brief(word)}, which is no number")
        values.append(value)
    return _Line(path, number, tuple(values))


def _sequence(
    commands: dict[str, list[_Line]], frame: _Line, channels: _Line
) -> tuple[list[int], int, _Line]:
    """Return the Tx of one cycle in the order of sending, the cycles of a loop, and the profile."""
    chirps: dict[int, _Line] = {}
    for line in commands["chirpCfg"]:
        first = line.whole(0, 0, _MOST_CHIRPS - 1, "the first chirp")
        for index in range(first, line.whole(1, first, _MOST_CHIRPS - 1, "the last chirp") + 1):
            chirps[index] = line
    first = frame.whole(0, 0, _MOST_CHIRPS - 1, "the first chirp")
    last = frame.whole(1, first, _MOST_CHIRPS - 1, "the last chirp")
    tx_on = channels.whole(1, 1, 15, "the mask of Tx")
    order, profiles = [], set()
    for index in range(first, last + 1):
        if index not in chirps:
            frame.refuse(f"no chirpCfg says what chirp {index} is")
        line = chirps[index]
        mask = line.whole(7, 1, 15, "the mask of Tx")
        if mask.bit_count() != 1:
            line.refuse("several Tx transmit in one chirp, which is not read; give each its own")
        if not mask & tx_on:
            line.refuse(f"Tx {mask.bit_length()} transmits, but channelCfg switches it off")
        if any(line.values[3:7]):
            line.refuse("the chirp differs from its profile, which is not simulated; give zeros")
        profiles.add(line.values[2])
        order.append(mask.bit_length() - 1)
    cycle = len(set(order))
    if order != order[:cycle] * (len(order) // cycle) or len(set(order[:cycle])) != cycle:
        frame.refuse("a Tx transmits twice before the others; each must have its turn in a cycle")
    matching = [line for line in commands["profileCfg"] if line.values[0] in profiles]
    if len(profiles) > 1 or not matching:
        frame.refuse("its chirps must have one profileCfg in common")
    return order[:cycle], len(order) // cycle, matching[-1]


def _board(path: Path, platform: str | None, start_ghz: float) -> str:
    """Choose the board by the platform that the file names, else by the band."""
    if platform is not None:
        board = _BOARDS.get(platform.lower())
        if board is None:
            raise InputError(
                f"profile '{path}' is for platform {brief(platform)[1:-1]}, whose antennas are not "
                f"known; name a board (board=), or one of: % Platform:{', '.join(_BOARDS)}"
            )
        return board
    board = "iwr6843" if start_ghz < 70 else "iwr1843"
    warnings.warn(
        f"profile '{path}' names no board: the antennas are those of {board}; another is named by "
        "board=, or in the file by a line such as % Platform:xWR14xx",
        ValidityWarning,
        stacklevel=4,
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
        profile.refuse("the number of real samples is odd; half as many complex ones are made")
    return {
        "start_frequency_hz": 1e9 * start_ghz,
        "bandwidth_hz": 1e6 * slope * ramp_us,
        "chirp_duration_s": 1e-6 * ramp_us,
        "idle_s": 1e-6 * idle_us,
        "adc_start_s": 1e-6 * adc_us,
        "samples_per_chirp": samples // 2 if real else samples,
        "adc_rate_hz": 1e3 * rate_ksps / (2 if real else 1),
    }
