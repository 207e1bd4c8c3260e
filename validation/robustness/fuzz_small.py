"""A run that is as small as possible, and words of its files, for `fuzz_readers.py`."""

from __future__ import annotations

import dataclasses

import numpy as np

from rtradar.radar import Radar

RADAR = Radar(
    tx_y=1,
    tx_z=0,
    rx_y=2,
    rx_z=0,
    samples_per_chirp=4,
    chirp_duration_s=1e-3,
    frame_duration_s=4e-3,
    frame_hop_s=2e-3,
)
POINTS = np.array([[0.002, 0.4, 0.1], [0.004, 0.8, -0.1]])
RDT = {"points": POINTS}
COLUMNS = {name: np.array([0.1, 0.2]) for name in ("velocity", "power", "time")}
SPATIAL = {"points": POINTS, "axes": np.array(["x", "y", "z"]), **COLUMNS}
SUMMARY = {
    "parameters": {"radar": dataclasses.asdict(RADAR), "scene": "free-space", "motion": "walk"},
    "fidelity": "analytic",
}
JSON = (
    "null true false NaN -Infinity 1e999 -1 -1e300 {} [] "
    '"" 99999999999999999999 1099511627775 [[[[ : , '
)
ARRAYS = JSON + "<f8 <f4 <i8 <u8 <c8 <c16 <U12 |S9 |b1 |O <M8[s] |V3 >f4 <f2 |u1 <f4,<f4"
RADAR_WORDS = (
    " ".join(field.name for field in dataclasses.fields(Radar))
    + " tdm fdm ddm pairs all pattern exponent gain_dbi"
)
