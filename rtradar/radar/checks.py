"""Rules for the fields of a radar: how they must fit each other.

``checks.toml`` has what is said where they do not.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar.schedule import FollowingCount
from rtradar.system.checks import brief

if TYPE_CHECKING:
    from rtradar.radar.radar import Radar

_MOST_BEAM_TERMS = 8e6  # four times those of an imaging radar of 12 Tx and 16 Rx
_MOST_SAMPLES_PER_FRAME = 2**31  # 17 GB; the paper's have 3.3 and 16.4 million

_Rules = Iterator[tuple[Any, str, Mapping[str, Any]]]
"""Whether fields fit each other, the name of the complaint, and what it tells beside the radar."""


def check_rules(radar: Radar) -> None:
    """Refuse a radar whose fields do not fit each other, by the first rule that fails."""
    # Each rule may rely on those before it: without a Tx, for instance, a cycle has no duration.
    for rules in (_of_array, _of_path, _of_multiplexing, _of_receiver, _of_frames):
        for holds, name, told in rules(radar):
            if not holds:
                complaint = _complaints()[name].format(r=radar, **told)
                raise InputError(f"radar '{radar.name}': {complaint}")


@cache
def _complaints() -> Mapping[str, str]:
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def _of_array(r: Radar) -> _Rules:
    """Yield the rules of antennas and sweep; each may rely on those before it."""
    # Antennas on both ends, not too many for beams, and a sweep within one octave.
    yield r.n_tx and (r.rx_positions_m or r.rx_y + r.rx_z), "antennas", {}
    terms = _beam_terms(r)
    yield terms <= _MOST_BEAM_TERMS, "beams", {"terms": terms, "most": _MOST_BEAM_TERMS}
    yield r.bandwidth_hz < r.start_frequency_hz, "bandwidth", {}
    # In pairs each line of Tx needs Rx on its own line, as many on both, for one length of the rx
    # axis.
    received = {rx for tx, rx in ((r.tx_y, r.rx_y), (r.tx_z, r.rx_z)) if tx}
    yield r.channels == "all" or not r.is_cross or received == {r.n_rx} != {0}, "pairs", {}
    in_turn = r.tx_order is None or sorted(r.tx_order) == list(range(r.n_tx))
    yield in_turn, "order", {"given": brief(r.tx_order)}
    # Samples must be taken while the chirp lasts.
    end_s = r.adc_start_s + r.sampled_duration_s
    fits = r.sampled_duration_s > 0 and end_s <= r.chirp_duration_s * (1 + 1e-9)
    yield fits, "samples", {}


def _beam_terms(r: Radar) -> float:
    """Beams of a grid four times as fine as the array resolves, times its elements."""
    if r.tx_positions_m is None or r.rx_positions_m is None:
        return 0.0
    # Eight beams a wavelength of aperture along each axis, as the search for directions takes them.
    places = np.array(r.tx_positions_m), np.array(r.rx_positions_m)
    size = sum(np.ptp(own[:, 1:], axis=0) for own in places)
    size = size * r.start_frequency_hz / SPEED_OF_LIGHT_MPS
    return float(np.prod(np.where(size > 0, 8 * size + 3, 1)) * len(places[0]) * len(places[1]))


def _of_path(r: Radar) -> _Rules:
    """Yield the rules of a radar that moves."""
    # Times and places belong together, one time for each, in ascending order.
    path = tuple(own for own in (r.path_m, r.path_angles_deg) if own is not None)
    yield (r.path_times_s is not None) == bool(path), "path", {}
    times = r.path_times_s or ()
    as_many = {len(own) for own in path} <= {len(times)} and (np.diff(times) > 0).all()
    yield as_many, "path_times", {"given": brief(r.path_times_s)}


def _of_multiplexing(r: Radar) -> _Rules:
    """Yield the rules that fit the Tx to how they are told apart."""
    step_hz = r.carrier_step_hz
    yield step_hz is None or r.multiplexing == "fdm", "fdm", {}
    yield r.doppler_bands is None or r.multiplexing == "ddm", "ddm", {}
    # Bands of FDM may not overlap, and the lowest must be above 0 Hz.
    yield step_hz is None or r.sample_rate_hz <= step_hz, "carriers", {}
    below = -r.tx_offset_hz[0]
    told = {"step": step_hz or r.sample_rate_hz, "below": below}
    yield below < r.start_frequency_hz, "lowest", told
    # At least one band of DDM is empty, and shows where the Doppler axis begins.
    yield r.doppler_bands is None or r.n_tx < r.doppler_bands, "bands", {}
    two_lines = r.is_cross and r.tx_y and r.tx_z
    yield not r.receives_sums or r.channels == "all" or not two_lines, "sums", {}
    # Hadamard matrices of signs are made for powers of two.
    yield r.multiplexing != "bpm" or r.n_tx.bit_count() == 1, "bpm", {}
    told = {"name": r.multiplexing.upper(), "cycle_s": r.cycle_duration_s * r.n_doppler_bands}
    yield r.cycles_per_frame >= 1, "cycle", told


def _of_receiver(r: Radar) -> _Rules:
    """Yield the rules that fit a receiver to its radar."""
    if r.receiver is None:
        return
    # Levels in dBm need the transmitted power. What acts on the baseband acts on all bands of FDM
    # at once, of which the samples here are one, and BPM has no receiver.
    in_dbm, in_baseband = r.receiver.in_dbm, r.receiver.in_baseband
    yield not in_dbm or r.transmit_power_dbm is not None, "in_dbm", {"names": " and ".join(in_dbm)}
    told = {"names": " and ".join(in_baseband)}
    yield r.multiplexing != "fdm" or not in_baseband, "in_bands", told
    yield r.multiplexing != "bpm", "in_sums", {}
    for key in ("channel_gain_db", "channel_phase_deg"):
        value = getattr(r.receiver, key)
        yield isinstance(value, float) or len(value) == r.n_channels, "channels", {"key": key}


def _of_frames(r: Radar) -> _Rules:
    """Yield the rules of chirps that come in frames."""
    # A frame holds whole cycles, is over before the next begins, and has a size that memory takes.
    chirps, active_s = r.cycles_per_frame * r.n_tx, r.cycles_per_frame * r.cycle_duration_s
    also = " times doppler_bands" * (r.n_doppler_bands > 1)
    whole = isinstance(r.chirps_per_frame, FollowingCount) or r.chirps_per_frame == chirps
    yield whole, "chirps", {"step": r.n_tx * r.n_doppler_bands, "also": also}
    fits = r.frame_period_s is None or active_s <= r.frame_period_s * (1 + 1e-12)
    yield fits, "period", {"chirps": chirps, "active_s": active_s}
    yield r.frame_period_s is None or r.cycle_period_s is None, "one_period", {}
    fits = r.cycle_active_s <= r.cycle_duration_s * (1 + 1e-12)
    yield fits, "cycle_period", {"n": r.n_tx}
    samples = chirps * r.n_rx * r.samples_per_chirp
    told = {"samples": samples, "most": _MOST_SAMPLES_PER_FRAME}
    yield samples <= _MOST_SAMPLES_PER_FRAME, "frame", told
