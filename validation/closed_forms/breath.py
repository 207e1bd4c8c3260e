"""Amplitude and rate of a breath, read back from the slow-time phase of the IF samples.

The truth is the sine that was put in, times the cosine between the chest's normal and the line of
sight. Samples of 60 s are focused on places of the body by the phases of the exact distances, which
takes its range bin and its angle cell together; the unwrapped phase of what comes back, times
lambda / 4 pi, is the way of the place along the line of sight. A sine of unknown rate, a constant
and a trend are fitted to that by least squares. Nothing of it comes from the library.

First the chest alone: the echoes of upper and middle torso of a person who holds still. Then a
whole person who stands and sways. A chest sways by 5 mm root mean square, at times as slow as a
breath, so a breath of 0.1 mm is hidden in the phase of the chest. But the body sways as one
pendulum: the way of the head, which does not breathe, is fitted beside the sine with a factor of
its own. How far off a reading without the head is, is reported. Real bodies also bend at the hip,
which the pendulum does not, so their sway is removed less well than here.

    python validation/closed_forms/breath.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

import rtradar as rt
from rtradar.motion import place
from rtradar.scatter import build_model
from rtradar.validate.rows import Row, judged, main, reported

Array = NDArray[np.float64]
SPEED_MPS = 299_792_458.0
DURATION_S = 60.0
SNR_DB = 20.0  # of one IF sample of the whole person
CHEST, HEAD = "upper torso", "head"
BREATHING_PARTS = ("middle torso", CHEST)
CYCLES_HZ = {12e9: 16.0, 77e9: 64.0}  # a chest moves by less than lambda / 4 from cycle to cycle


def array(frequency_hz: float, elements: int) -> rt.Radar:
    """A vertical line of Tx and a horizontal line of Rx, 1.1 m before the chest."""
    cycle_s = 1 / CYCLES_HZ[frequency_hz]
    return rt.Radar(
        name="breath",
        start_frequency_hz=frequency_hz,
        chirp_duration_s=cycle_s / elements,
        samples_per_chirp=64,
        tx_y=0,
        tx_z=elements,
        rx_y=elements,
        rx_z=0,
        tx_spacing_wavelengths=0.5,
        channels="all",
        frame_duration_s=8 * cycle_s,
        frame_hop_s=8 * cycle_s,
        position_m=(-1.1, 0.0, 1.28),
    )


class Place(NamedTuple):
    """A place on the front of the body [m], and the cosine of its normal to the line of sight."""

    at: Array
    cosine: float


def front(radar: rt.Radar, body: rt.Body, part: str) -> Place:
    """The foremost place of a part at the start; the person faces -x and leans a little."""
    pose, k = body.at([0.0]), body.part_names.index(part)
    along = pose.frames[0, k][:, 2]
    ahead = np.cross([0.0, -1.0, 0.0], along)
    ahead /= np.linalg.norm(ahead)
    at = pose.centres[0, k] + body.semi_axes[k, 0] * ahead
    sight = np.array(radar.position_m) - at
    return Place(at, float(sight @ ahead / np.linalg.norm(sight)))


def ways(blocks: Iterable[NDArray[np.complexfloating]], radar: rt.Radar, at: list[Array]) -> Array:
    """Ways (place, cycle) of places along the line of sight, toward the radar [m]."""
    count = radar.samples_per_chirp
    frequency = radar.start_frequency_hz + radar.bandwidth_hz * np.arange(count) / count
    over_tx, over_rx, over_range = (
        np.hanning(n + 2)[1:-1] for n in (len(radar.tx), len(radar.rx), count)
    )
    weights = []
    for point in at:
        out, back = (np.linalg.norm(point - ends, axis=1) for ends in (radar.tx, radar.rx))
        delay = (out[:, None] + back)[..., None] / SPEED_MPS
        window = (over_tx[:, None] * over_rx) ** 0.7
        weights.append(window[..., None] * over_range * np.exp(-2j * np.pi * frequency * delay))
    focus = np.reshape(weights, (len(at), -1)).T.astype(np.complex64)
    focused = np.concatenate([block.reshape(-1, len(focus)) @ focus for block in blocks])
    centre_hz = radar.start_frequency_hz + radar.bandwidth_hz / 2
    return -np.unwrap(np.angle(focused.T), axis=1) * SPEED_MPS / (4 * np.pi * centre_hz)


def breath(way: Array, beside: list[Array], cycle_hz: float) -> tuple[float, float]:
    """Rate [Hz] and amplitude [m] of the sine that, with ``beside`` and a trend, fits best."""
    t = (np.arange(len(way)) + 0.5) / cycle_hz
    slow = np.stack([np.ones_like(t), t, *beside], axis=1)

    def fitted(rate_hz: float) -> tuple[float, float]:
        turned = 2 * np.pi * rate_hz * t
        columns = np.column_stack([slow, np.cos(turned), np.sin(turned)])
        found = np.linalg.lstsq(columns, way, rcond=None)[0]
        return float(np.sum((way - columns @ found) ** 2)), float(np.hypot(*found[-2:]))

    rates = np.arange(0.1, 0.8, 0.25 / DURATION_S)
    first = rates[np.argmin([fitted(rate)[0] for rate in rates])]
    near = (first - 0.5 / DURATION_S, first + 0.5 / DURATION_S)
    rate_hz = minimize_scalar(
        lambda rate: fitted(rate)[0], bounds=near, method="bounded", options={"xatol": 1e-7}
    ).x
    return float(rate_hz), fitted(rate_hz)[1]


def chest_alone(
    radar: rt.Radar, level: str, breathing: rt.Breathing
) -> Iterator[NDArray[np.complexfloating]]:
    """IF samples of the breathing parts of a person who holds still, in blocks of cycles."""
    body = rt.Body.from_motion(still(), breathing)
    model = build_model(level, radar, body)
    cycles = int(DURATION_S * CYCLES_HZ[radar.start_frequency_hz])
    chest = [body.part_names.index(name) for name in BREATHING_PARTS]
    for block in np.array_split(np.arange(cycles * radar.n_tx), cycles // 64):
        echoes = model.echoes(block)
        kept = np.isin(echoes.part, chest)
        echoes = dataclasses.replace(echoes, amplitude=echoes.amplitude * kept)
        yield rt.signal.synthesize(echoes, radar, radar.centres_of(block))


def still() -> rt.Motion:
    """A person who stands without swaying."""
    motion = place(rt.synthetic_motion("stand", seed=0, duration_s=0.1))
    return dataclasses.replace(
        motion,
        root_positions=np.tile(motion.root_positions[:1], (3, 1)),
        rotations=np.tile(motion.rotations[:1], (3, 1, 1)),
        rate_hz=2 / DURATION_S,
        length_s=DURATION_S,
    )


def alone_rows(frequency_hz: float, level: str, breathing: rt.Breathing) -> list[Row]:
    radar = array(frequency_hz, 8)
    chest = front(radar, rt.Body.from_motion(still()), CHEST)
    (way,) = ways(chest_alone(radar, level, breathing), radar, [chest.at])
    rate_hz, amplitude_m = breath(way, [], CYCLES_HZ[frequency_hz])
    claim = f"{frequency_hz / 1e9:g} GHz, chest alone, {level}, {named(breathing)}"
    return [*rows_of(claim, breathing, rate_hz, amplitude_m / chest.cosine, 1.0)]


def whole_rows(frequency_hz: float, breathing: rt.Breathing, seed: int) -> list[Row]:
    radar = array(frequency_hz, 24)
    motion = rt.synthetic_motion("stand", seed=seed, duration_s=DURATION_S)
    body = rt.Body.from_motion(place(motion))
    chest, head = (front(radar, body, part) for part in (CHEST, HEAD))
    capture = rt.simulate(motion, radar, snr_db=SNR_DB, breathing=breathing)
    blocks = (block.values for block in capture.blocks())
    way, swayed = ways(blocks, radar, [chest.at, head.at])
    cycle_hz = CYCLES_HZ[frequency_hz]
    claim = f"{frequency_hz / 1e9:g} GHz, standing person {seed}, {named(breathing)}"
    rate_hz, amplitude_m = breath(way, [swayed], cycle_hz)
    rows = [*rows_of(claim, breathing, rate_hz, amplitude_m / chest.cosine, 20.0)]
    rate_hz, amplitude_m = breath(way, [], cycle_hz)
    without = f"{claim}, sway not removed"
    return [*rows, *rows_of(without, breathing, rate_hz, amplitude_m / chest.cosine, None)]


def named(breathing: rt.Breathing) -> str:
    return f"{breathing.amplitude_mm:g} mm at {breathing.rate_hz:g} Hz"


def rows_of(
    claim: str, true: rt.Breathing, rate_hz: float, amplitude_m: float, limit: float | None
) -> Iterator[Row]:
    """Errors of rate and amplitude in percent; without a limit both are reported."""
    who = "chest alone" if "alone" in claim else "whole person who sways"
    errors = {
        "rate of the breath": 100 * (rate_hz / true.rate_hz - 1),
        "amplitude of the breath": 100 * (1e3 * amplitude_m / true.amplitude_mm - 1),
    }
    for quantity, error in errors.items():
        if limit is None:
            yield reported(claim, quantity, "% off", error)
        else:
            most = 1.0 if "rate" in quantity else limit
            says = f"{quantity}, of a {who}, by the phase of the IF samples at 12 and 77 GHz"
            yield judged(claim, quantity, "% off", error, most, reference=0.0, says=says)


def measure(quick: bool) -> list[Row]:
    if quick:
        middle = rt.Breathing(1.0, 0.3)
        return [*alone_rows(12e9, "specular", middle), *whole_rows(12e9, middle, 0)]
    breaths = [rt.Breathing(mm, hz) for mm in (0.1, 1.0, 5.0) for hz in (0.2, 0.5)]
    rows: list[Row] = []
    for frequency_hz in CYCLES_HZ:
        for breathing in breaths:
            for level in ("analytic", "specular"):
                rows += alone_rows(frequency_hz, level, breathing)
            rows += whole_rows(frequency_hz, breathing, seed=int(breathing.rate_hz > 0.3))
    return rows


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
