"""What a receiver's effects cost: CPU time from motion to cloud with all of them over that without.

python validation/cost/receiver_cost.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import sys
import time
import warnings
from collections.abc import Iterator

import rtradar as rt
from rtradar.pipeline.prepare import prepare
from rtradar.pipeline.processing import CloudMaker
from rtradar.settings import RunSettings
from rtradar.validate.rows import Row, judged, main, reported

POWER_DBM = 12.0


def cost_rows(quick: bool) -> Iterator[Row]:
    """Effects so weak that detections stay, but all of them modelled."""
    ideal = dataclasses.replace(rt.Radar.preset("paper-12ghz"), transmit_power_dbm=POWER_DBM)
    receiver = rt.Receiver(
        phase_noise_hz=(1e5, 1e6),
        phase_noise_dbc_hz=(-90.0, -110.0),
        iq_gain_db=0.001,
        iq_phase_deg=0.01,
        adc_bits=16,
        adc_full_scale_dbm=-60.0,
        leakage_db=-200.0,
        dc_dbm=-200.0,
        channel_gain_db=0.01,
        channel_phase_deg=0.1,
        highpass_hz=(1e3, 2e3),
        interferer=rt.Interferer(
            start_frequency_hz=11e9,
            slope_hz_per_s=9e13,
            ramp_s=50e-6,
            period_s=61e-6,
            power_dbm=-200.0,
        ),
    )
    motion = rt.synthetic_motion("walk", seed=0, duration_s=1.0 if quick else 3.0)
    for fidelity in ("analytic",) if quick else ("analytic", "specular"):
        settings = RunSettings(fidelity=fidelity, keep_all=True)
        spent: dict[bool, float] = {}
        counts = []
        for _ in range(3):
            for all_on in (False, True):
                its = dataclasses.replace(ideal, receiver=receiver if all_on else None)
                begin = time.process_time()
                capture = prepare([motion], its, rt.Scene(), settings)
                maker = CloudMaker(capture.processing)
                capture.stream(maker, progress=False)
                counts.append(len(maker.finish().spatial.points))
                took = time.process_time() - begin
                spent[all_on] = min(took, spent.get(all_on, took))
        ratio = spent[True] / spent[False]
        row = f"walk of {motion.duration_s:g} s, {fidelity}", "CPU time, all effects over none", "1"
        says = "CPU time from motion to cloud with everything a receiver adds, over that without"
        # The limit is that of 3 s: in one second what a run costs once weighs more.
        yield (
            reported(*row, ratio, key="receiver-cost", says=says)
            if quick
            else judged(*row, ratio, 1.3, key="receiver-cost", says=says)
        )
        yield reported(
            f"walk of {motion.duration_s:g} s, {fidelity}", "points in the cloud", "1", counts[1],
            reference=counts[0], key="receiver-cost",
        )  # fmt: skip


def measure(quick: bool) -> list[Row]:
    warnings.simplefilter("ignore", rt.ValidityWarning)
    return list(cost_rows(quick))


if __name__ == "__main__":
    sys.exit(main("What a receiver's effects cost", measure))
