"""Noise alone for 3 s through the whole chain: false alarms in the RDT volume at the default rate.

The person is 150 dB below the noise. At most 20 voxels are allowed for the default radar. Expected
are the rate asked for times the cells of all frames, and 1.35 times as many on maps with Hann
windows (``validation/closed_forms/cfar.py``). At 77 GHz, with five times the cells, even the exact
rate would give 20 voxels, so there the count is reported and not judged.

    python validation/closed_forms/noise_alone.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import tempfile
import warnings

import rtradar as rt
from rtradar.validate.rows import Row, judged, main, reported

MOST_VOXELS = 20.0


def measure(quick: bool) -> list[Row]:
    rows = []
    motion = rt.synthetic_motion("walk", seed=0, duration_s=3.0)
    for name in ("paper-12ghz",) if quick else ("paper-12ghz", "paper-77ghz"):
        radar = rt.Radar.preset(name)
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore", rt.ValidityWarning)
            given = {"fidelity": "analytic", "snr_db": -150.0}
            found = rt.run(motion, radar, out=folder, **given).summary
        cells = found["windows"] * radar.samples_per_chirp * radar.cycles_per_frame
        claim = f"{name}, {found['windows']} windows"
        rows.append(
            reported(
                claim,
                "false alarms at exactly the asked rate",
                "voxels",
                cells * found["parameters"]["pfa"],
                key="cfar",
            )
        )
        if name == "paper-12ghz":
            says = "noise alone through the whole chain for 3 s, 12 GHz: false voxels"
            rows.append(
                judged(
                    claim,
                    "false alarms",
                    "voxels",
                    found["detections"],
                    MOST_VOXELS,
                    key="cfar",
                    says=says,
                )
            )
        else:
            rows.append(reported(claim, "false alarms", "voxels", found["detections"], key="cfar"))
    return rows


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
