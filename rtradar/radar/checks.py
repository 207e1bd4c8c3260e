"""Rules for the fields of a radar: how they must fit each other."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar.schedule import FollowingCount
from rtradar.system.checks import brief

if TYPE_CHECKING:
    from rtradar.radar.radar import Radar

_MOST_SAMPLES = 16384  # of a chirp: four times as many as the chips of the boards take
_MOST_BEAM_TERMS = 8e6  # four times those of an imaging radar of 12 Tx and 16 Rx
_MOST_SAMPLES_PER_FRAME = 2**31  # 17 GB; the paper's have 3.3 and 16.4 million


def _rules(r: Radar) -> Iterator[tuple[Any, str]]:
    """Yield whether fields fit each other, and the complaint where they do not, one by one."""
    yield (
        r.n_tx and (r.rx_positions_m or r.rx_y + r.rx_z),
        "the array has no Tx or no Rx; give at least one of each",
    )
    yield (
        r.samples_per_chirp <= _MOST_SAMPLES,
        f"samples_per_chirp = {r.samples_per_chirp}; at most {_MOST_SAMPLES} are simulated, many "
        "more than boards have",
    )
    terms = _beam_terms(r)
    yield (
        terms <= _MOST_BEAM_TERMS,
        f"{r.n_tx} Tx and {r.n_rx} Rx need {terms:.2g} beams times elements, more "
        f"than {_MOST_BEAM_TERMS:.2g}; set them nearer, or take fewer",
    )
    yield (
        r.bandwidth_hz < r.start_frequency_hz,
        f"bandwidth_hz = {r.bandwidth_hz:g}; it must be below start_frequency_hz = "
        f"{r.start_frequency_hz:g}",
    )
    yield (
        r.channels == "all"
        or not r.is_cross
        or {rx for tx, rx in ((r.tx_y, r.rx_y), (r.tx_z, r.rx_z)) if tx} == {r.n_rx} != {0},
        f"channels = 'pairs' needs as many Rx on the y-line as on the z-line, here {r.rx_y} and "
        f"{r.rx_z}; make them equal or set channels = 'all'",
    )
    yield (
        r.tx_order is None or sorted(r.tx_order) == list(range(r.n_tx)),
        f"tx_order = {brief(r.tx_order)}; it must hold each of the {r.n_tx} Tx once, from 0 on",
    )
    yield (
        r.sampled_duration_s > 0
        and r.adc_start_s + r.sampled_duration_s <= r.chirp_duration_s * (1 + 1e-9),
        f"samples from adc_start_s = {r.adc_start_s:g} on for {r.sampled_duration_s:.4g} s do not "
        f"fit into chirp_duration_s = {r.chirp_duration_s:g}; begin sooner, take fewer "
        "(samples_per_chirp) or take them faster (adc_rate_hz)",
    )
    yield from _path_rules(r)
    yield from _multiplexing_rules(r)
    yield (
        r.cycles_per_frame >= 1,
        f"frame_duration_s = {r.frame_duration_s} holds no whole {r.multiplexing.upper()} cycle of "
        f"{r.cycle_duration_s * r.n_doppler_bands:.3g} s; lengthen the frame or shorten the chirp",
    )
    yield from _receiver_rules(r)
    chirps = r.cycles_per_frame * r.n_tx
    yield (
        isinstance(r.chirps_per_frame, FollowingCount) or r.chirps_per_frame == chirps,
        f"chirps_per_frame = {r.chirps_per_frame}; it must be a multiple of "
        f"{r.n_tx * r.n_doppler_bands}, the Tx{' times doppler_bands' * (r.n_doppler_bands > 1)}",
    )
    active_s = r.cycles_per_frame * r.cycle_duration_s
    yield (
        r.frame_period_s is None or active_s <= r.frame_period_s * (1 + 1e-12),
        f"frame_period_s = {r.frame_period_s}; the {chirps} chirps of one frame take "
        f"{active_s:.4g} s: lengthen the period, or take fewer (chirps_per_frame, or "
        "frame_duration_s)",
    )
    samples = chirps * r.n_rx * r.samples_per_chirp
    yield (
        samples <= _MOST_SAMPLES_PER_FRAME,
        f"frame_duration_s = {r.frame_duration_s} holds {samples:.2g} samples, more than "
        f"{_MOST_SAMPLES_PER_FRAME:.2g}; shorten the frame, or take fewer samples or longer chirps",
    )


def _beam_terms(r: Radar) -> float:
    """Beams of a grid four times as fine as the array resolves, times its elements."""
    if r.tx_positions_m is None or r.rx_positions_m is None:
        return 0.0
    places = np.array(r.tx_positions_m), np.array(r.rx_positions_m)
    size = sum(np.ptp(own[:, 1:], axis=0) for own in places)
    size = size * r.start_frequency_hz / SPEED_OF_LIGHT_MPS
    return float(np.prod(np.where(size > 0, 8 * size + 3, 1)) * len(places[0]) * len(places[1]))


def _path_rules(r: Radar) -> Iterator[tuple[Any, str]]:
    """Yield the rules of a radar that moves, as `_rules` does."""
    path = tuple(own for own in (r.path_m, r.path_angles_deg) if own is not None)
    yield (
        (r.path_times_s is not None) == bool(path),
        "path_times_s belongs to path_m or path_angles_deg, and they to it; give both, or neither",
    )
    yield (
        not path
        or (
            {len(own) for own in path} == {len(r.path_times_s or ())}
            and bool(np.all(np.diff(r.path_times_s or ()) > 0))
        ),
        f"path_times_s = {brief(r.path_times_s)}; it must have as many times as path_m and "
        "path_angles_deg have entries, ascending",
    )


def _multiplexing_rules(r: Radar) -> Iterator[tuple[Any, str]]:
    """Yield the rules that fit the Tx to how they are told apart, as `_rules` does."""
    yield (
        r.carrier_step_hz is None or r.multiplexing == "fdm",
        "carrier_step_hz belongs to multiplexing = 'fdm'; leave it out",
    )
    yield (
        r.doppler_bands is None or r.multiplexing == "ddm",
        "doppler_bands belongs to multiplexing = 'ddm'; leave it out",
    )
    yield (
        r.carrier_step_hz is None or r.sample_rate_hz <= r.carrier_step_hz,
        f"carrier_step_hz = {r.carrier_step_hz}; bands of the IF are {r.sample_rate_hz:g} "
        "Hz wide (the sample rate), so carriers must be at least that far apart",
    )
    yield (
        -r.tx_offset_hz[0] < r.start_frequency_hz,
        f"{r.n_tx} carriers {r.carrier_step_hz or r.sample_rate_hz:g} Hz apart begin "
        f"{-r.tx_offset_hz[0]:g} Hz below start_frequency_hz = {r.start_frequency_hz:g}, at no "
        "positive frequency; raise that, or set them nearer (carrier_step_hz)",
    )
    yield (
        r.doppler_bands is None or r.n_tx < r.doppler_bands,
        f"doppler_bands = {r.doppler_bands}; it must be a whole number above {r.n_tx}, the "
        "number of Tx",
    )
    yield (
        not r.receives_sums or r.channels == "all" or not (r.is_cross and r.tx_y and r.tx_z),
        f"under multiplexing = '{r.multiplexing}' every Rx receives all Tx; set channels = 'all', "
        "or give Tx on one line",
    )
    yield (
        r.multiplexing != "bpm" or r.n_tx.bit_count() == 1,
        f"multiplexing = 'bpm' needs 2, 4, 8 ... Tx, here {r.n_tx}; leave some out",
    )


def _receiver_rules(r: Radar) -> Iterator[tuple[Any, str]]:
    """Yield the rules that fit a receiver to its radar, as `_rules` does."""
    if r.receiver is None:
        return
    yield (
        not r.receiver.in_dbm or r.transmit_power_dbm is not None,
        f"receiver: {' and '.join(r.receiver.in_dbm)} in dBm needs transmit_power_dbm, to which "
        "echoes are in proportion; give it",
    )
    yield (
        r.multiplexing != "fdm" or not r.receiver.in_baseband,
        f"receiver: {' and '.join(r.receiver.in_baseband)} acts on all bands of FDM at once, for "
        "one ADC samples them together, and samples here are those of each band; leave it out, or "
        "take multiplexing = 'tdm' or 'ddm'",
    )
    yield (
        r.multiplexing != "bpm",
        "receiver: it is not simulated under multiplexing = 'bpm'; leave it out, or take 'tdm'",
    )
    for key in ("channel_gain_db", "channel_phase_deg"):
        value = getattr(r.receiver, key)
        yield (
            isinstance(value, float) or len(value) == r.n_channels,
            f"receiver: {key} must be one number, or one for each of {r.n_channels} channels",
        )


def check_rules(radar: Radar) -> None:
    """Refuse a radar whose fields do not fit each other, by the first rule that fails."""
    for holds, complaint in _rules(radar):
        if not holds:
            raise InputError(f"radar '{radar.name}': {complaint}")
