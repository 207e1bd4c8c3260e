"""Fields of a receiver: what is allowed, and one line where they are not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rtradar as rt

RAMPS = {"start_frequency_hz": 12e9, "slope_hz_per_s": 1e12, "ramp_s": 1e-4, "period_s": 2e-4}


def test_a_file_gives_what_its_tables_say(tmp_path: Path) -> None:
    file = tmp_path / "radar.toml"
    file.write_text(
        "transmit_power_dbm = 12\n[receiver]\nhighpass_hz = [175e3, 350e3]\nadc_bits = 12\n"
        "adc_full_scale_dbm = -30\n[receiver.interferer]\nstart_frequency_hz = 12e9\n"
        "slope_hz_per_s = -1e13\nramp_s = 1e-4\nperiod_s = 1e-4\npower_dbm = -60\n"
    )
    receiver = rt.Radar.load(file).receiver
    assert receiver is not None
    assert receiver.highpass_hz == (175e3, 350e3)
    assert receiver.adc_bits == 12
    assert receiver.interferer == rt.Interferer(
        start_frequency_hz=12e9, slope_hz_per_s=-1e13, ramp_s=1e-4, period_s=1e-4, power_dbm=-60.0
    )
    assert rt.Radar().receiver is None


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"adc_bits": 8}, "needs adc_full_scale_dbm"),
        ({"leakage_db": 3}, "from -200 to 0"),
        ({"adc_bits": 8.5, "adc_full_scale_dbm": 0}, "whole number"),
        ({"highpass_hz": 1e5}, "list of numbers"),
        ({"seed": -1}, "seed = -1"),
        ({"interferer": 3}, "table"),
        ({"phase_noise_hz": [1e6]}, "as many"),
        ({"phase_noise_hz": [2e6, 1e6], "phase_noise_dbc_hz": [-90, -90]}, "ascend"),
        ({"interferer": RAMPS}, "power_dbm is missing"),
        ({"interferer": {**RAMPS, "power_dbm": 0, "period_s": 1e-5}}, "shorter than its ramp"),
        ({"image": 1}, "unknown key 'image'"),
    ],
)
def test_what_has_no_meaning_is_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(rt.InputError, match=message) as caught:
        rt.Radar(receiver=fields, transmit_power_dbm=10)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("fields", "radar", "message"),
    [
        ({"dc_dbm": -60}, {}, "needs transmit_power_dbm"),
        ({"iq_phase_deg": 1}, {"multiplexing": "fdm"}, "acts on all bands of FDM"),
        ({"channel_gain_db": [1.0, 2.0]}, {}, "one for each of 96 channels"),
    ],
)
def test_a_receiver_must_fit_its_radar(
    fields: dict[str, Any], radar: dict[str, Any], message: str
) -> None:
    with pytest.raises(rt.InputError, match=message):
        rt.Radar(receiver=rt.Receiver(**fields), **radar)
