"""The rung `auto` against its tolerance, frame by frame of four whole activities, and its cost against the fixed rungs.

Frames of 100 ms follow each other over 3 s of each activity. Of each, the received spectrum H(f, t) is held against that of
`reference` at the four corner channels of the y-line, at the first, middle and last frequency of the sweep, in 4 TDM cycles
spread evenly over the frame: the power of the frame in decibels, and rms |H - Href| over rms |Href| of the whole activity.
Cost is the time of echoes and IF samples of every third frame over that of `analytic` in the same run.

    python validation/auto.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from ladder import FRAMES, spectrum
from rows import Row, judged, main, reported
from trade import seconds

import rtradar as rt
from rtradar.body import Body
from rtradar.motion import place
from rtradar.scatter import build_rung

DURATION_S = 3.0
LOOSE = {"tolerance_db": 0.5}
CYCLES = 4
FIXED = ("analytic", "specular", "fresnel")  # cheapest first
TOLERANCES: dict[str, tuple[dict[str, float], ...]] = {
    "paper-12ghz": ({"tolerance_db": 0.5}, {"tolerance_db": 0.1}, {"tolerance_complex": 0.2}, {"tolerance_complex": 0.05}),
    "paper-77ghz": ({"tolerance_db": 0.5},),  # its facets take minutes
}


def measure(quick: bool) -> list[Row]:
    rows = []
    for name in ("paper-12ghz",) if quick else ("paper-12ghz", "paper-77ghz"):
        radar = rt.Radar.preset(name)
        meets: dict[str, list[bool]] = {}
        cost: dict[str, list[float]] = {}
        for activity in ("kick",) if quick else FRAMES:
            duration_s = 1.0 if quick else DURATION_S
            body = Body.from_motion(place(rt.synthetic_motion(activity, seed=0, duration_s=duration_s)))
            n_frames = round(duration_s / radar.frame_duration_s)
            spread = (np.arange(CYCLES) + 0.5) / CYCLES * radar.cycles_per_frame
            cycles = np.arange(n_frames)[:, None] * (duration_s / n_frames / radar.cycle_duration_s) + spread
            chirps = (cycles.astype(np.int64)[..., None] * radar.n_tx + np.array([0, radar.tx_y - 1])).ravel()
            truth = spectrum(build_rung("reference", radar, body), radar, chirps)

            rungs: list[tuple[str, str, dict[str, Any]]] = [(fixed, fixed, {}) for fixed in FIXED]
            tolerances = TOLERANCES[name][::2] if quick else TOLERANCES[name]
            rungs += [(f"auto {key} {value:g}", "auto", {key: value}) for dials in tolerances for key, value in dials.items()]
            for label, fidelity, dials in rungs:
                found = spectrum(build_rung(fidelity, radar, body, **dials), radar, chirps)
                powers = [(np.abs(field) ** 2).reshape(3, n_frames, -1).mean(axis=(0, 2)) for field in (found, truth)]
                worst = float(np.abs(10 * np.log10(powers[0] / powers[1])).max())
                wrong = float(np.sqrt((np.abs(found - truth) ** 2).mean() / (np.abs(truth) ** 2).mean()))
                claim = f"{name}, {activity}, {label}"
                of_power, of_field = (
                    (claim, "frame power, worst of all frames", "dB", worst),
                    (claim, "complex error, rms", "", wrong),
                )
                says = "four activities by `auto` against `reference`, 3 s"
                for figure, dial, judges in (
                    (of_power, "tolerance_db", f"{says}: power of the worst frame"),
                    (of_field, "tolerance_complex", f"{says}: complex error"),
                ):
                    rows.append(judged(*figure, dials[dial], says=judges) if dial in dials else reported(*figure))
                meets.setdefault(label, []).append(worst <= LOOSE["tolerance_db"])
                if not quick and (fidelity in FIXED or dials == LOOSE):
                    cost.setdefault(label, []).append(_cost(fidelity, dials, radar, body, n_frames))
                    rows.append(reported(claim, "cost over analytic", "", cost[label][-1] / cost["analytic"][-1], key="auto"))
        if quick:
            continue  # one activity does not tell which fixed rung meets the tolerance on all
        cheapest = next(fixed for fixed in FIXED if all(meets[fixed]))
        ratio = sum(cost["auto tolerance_db 0.5"]) / sum(cost[cheapest])
        says = f"{name}, cost of `auto` at 0.5 dB over that of `{cheapest}`, the cheapest fixed rung that keeps it"
        rows.append(judged(f"{name}, auto 0.5 dB over {cheapest}", "cost", "", ratio, 1.0, key="auto", says=says))
    return rows


def _cost(fidelity: str, dials: dict[str, Any], radar: rt.Radar, body: Body, n_frames: int) -> float:
    """Seconds of every third frame [s], by a new rung, for rungs keep what they traced."""
    seconds(build_rung(fidelity, radar, body, **dials), radar, 0)
    rung = build_rung(fidelity, radar, body, **dials)
    return sum(seconds(rung, radar, frame * radar.chirps_per_frame) for frame in range(0, n_frames, 3))


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
