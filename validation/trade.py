"""The trade of speed for accuracy: every rung against `reference` on four activities, and what each costs.

Error is that of the received spectrum H(f, t) at the four corner channels of the y-line (first and last Tx and Rx), at the
first, middle and last frequency of the sweep, in 34 TDM cycles evenly over one frame of 100 ms (every fourth at 12 GHz): rms
|H - Href| over rms |Href|, and the power of the frame in decibels. Cost is the time of echoes and IF samples of that whole
frame, all channels, over that of `analytic` in the same run, after one frame of warm-up.

    python validation/trade.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rows import Row, main, reported

import rtradar as rt
from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.motion import place
from rtradar.scatter import Rung, build_rung

# activity, start of the frame [s]: where limbs are fast and hide each other
FRAMES = {"walk": 0.75, "kick": 0.45, "punch": 0.35, "jumping_jack": 0.4}
RUNGS: dict[str, list[dict[str, Any]]] = {
    "analytic": [{}],  # first: all costs are relative to it
    "analytic-paper": [{}],
    "specular": [{}],
    "fresnel": [{}],
    "physical-optics": [{}],
}
SAMPLED_CYCLES = 34


def spectrum(rung: Rung, radar: rt.Radar, chirps: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Received spectrum (frequency, chirp, rx) at the first and last receiver."""
    echoes = rung.echoes(chirps)
    frequencies = radar.start_frequency_hz + radar.bandwidth_hz * np.array([0.0, 0.5, 1.0])
    nodes = echoes.frequency
    # Polynomial through the nodes, as the contract of `Echoes` says.
    weights = np.ones((len(frequencies), len(nodes)))
    for n, node in enumerate(nodes):
        for other in np.delete(nodes, n):
            weights[:, n] *= (frequencies - other) / (node - other)
    ends = [0, echoes.length.shape[1] - 1]
    amplitude = np.einsum("fn,ncre->fcre", weights, np.conj(echoes.amplitude[:, :, ends]))
    phase = -2j * np.pi * frequencies[:, None, None, None] * echoes.length[:, ends] / SPEED_OF_LIGHT_MPS
    return np.asarray((amplitude * np.exp(phase)).sum(axis=-1))


def blocks(radar: rt.Radar, first: int) -> Iterator[NDArray[np.int64]]:
    step = 33 * radar.n_tx
    for begin in range(first, first + radar.chirps_per_frame, step):
        yield np.arange(begin, min(begin + step, first + radar.chirps_per_frame))


def seconds(rung: Rung, radar: rt.Radar, first: int) -> float:
    began = time.perf_counter()
    for chirps in blocks(radar, first):
        rt.signal.synthesize(rung.echoes(chirps), radar, radar.chirp_times(len(chirps), int(chirps[0])), dtype=np.complex64)
    return time.perf_counter() - began


def measure(quick: bool) -> list[Row]:
    rows = []
    for name in ("paper-12ghz",) if quick else ("paper-12ghz", "paper-77ghz"):
        radar = rt.Radar.preset(name)
        for activity, start_s in list(FRAMES.items())[: 1 if quick else None]:
            body = Body.from_motion(place(rt.synthetic_motion(activity, seed=0, duration_s=1.2)))
            first = round(start_s / radar.cycle_duration_s) * radar.n_tx
            cycles = np.arange(0, radar.cycles_per_frame, max(1, radar.cycles_per_frame // SAMPLED_CYCLES))
            chirps = (first + cycles[:, None] * radar.n_tx + np.array([0, radar.tx_y - 1])).ravel()
            reference = spectrum(build_rung("reference", radar, body), radar, chirps)
            power = float((np.abs(reference) ** 2).mean())
            cost: dict[str, float] = {}
            for fidelity, settings in RUNGS.items():
                for dials in settings:
                    label = f"{fidelity} {' '.join(f'{key}={value}' for key, value in dials.items())}".strip()
                    claim = f"{name}, {activity}, {label}"
                    found = spectrum(build_rung(fidelity, radar, body, **dials), radar, chirps)
                    error = float(np.sqrt((np.abs(found - reference) ** 2).mean() / power))
                    decibels = 10 * np.log10(float((np.abs(found) ** 2).mean()) / power)
                    rows.append(reported(claim, "complex error, rms", "", error, key="body"))
                    rows.append(reported(claim, "frame power", "dB", decibels, key="body"))
                    seconds(build_rung(fidelity, radar, body, **dials), radar, first)
                    # A rung keeps what it traced: a new one pays for all of the frame.
                    cost[label] = seconds(build_rung(fidelity, radar, body, **dials), radar, first)
                    rows.append(reported(claim, "cost over analytic", "", cost[label] / cost["analytic"], key="body"))
    return rows


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
