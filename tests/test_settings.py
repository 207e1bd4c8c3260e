"""The settings of a run: validated once, one list of names, and written as they are."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any, get_type_hints

import pytest

from rtradar.errors import InputError
from rtradar.settings import Breathing, RunOptions, RunSettings


def test_the_options_of_run_are_the_fields_of_its_settings() -> None:
    assert get_type_hints(RunOptions) == get_type_hints(RunSettings)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"snr_db": "loud"}, "snr_db = 'loud'; it must be a number of decibels"),
        ({"snr_db": -math.inf}, "snr_db = -inf"),
        ({"snr_db": "physical", "spreading": False}, "needs the loss with distance"),
        ({"noise_power_m2": math.inf}, "noise_power_m2 = inf"),
        ({"breathing": (3, 0.25)}, "breathing = .*fields of Breathing"),
        ({"pfa": 0.0}, "pfa = 0"),
        ({"pfa": "1e-3"}, "pfa = '1e-3'; a false-alarm rate is a number"),
        ({"snr_db": [3]}, r"snr_db = \[3\]"),
        ({"noise_power_m2": "a"}, "noise_power_m2 = 'a'"),
        ({"path_tolerance_db": "-35"}, "path_tolerance_db = '-35'; it must lie"),
        ({"seed": 0.5}, "seed = 0.5"),
        ({"keep_all": "false"}, "keep_all = 'false'; it must be true or false"),
        ({"variant": math.nan}, "variant = nan; allowed:"),
        ({"start_s": None}, "start_s = None; it must be"),
    ],
)
def test_values_without_a_meaning_are_refused_in_one_line(
    options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        RunSettings(**options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("values", [(-1, 0.3), (51, 0.3), (1, 6), (math.nan, 0.3), ("a", 1)])
def test_a_breath_that_no_one_takes_is_refused(values: tuple[Any, float]) -> None:
    with pytest.raises(InputError, match=r"breathing: (amplitude_mm|rate_hz) = .* from 0 to"):
        Breathing(*values)


def test_settings_cannot_be_changed_and_keep_a_copy_of_the_model_options() -> None:
    options = {"shadow_rays": 256}
    settings = RunSettings(model_options=options)
    options["shadow_rays"] = 1
    assert settings.model_options == {"shadow_rays": 256}
    assert RunSettings(background="any\nname \udcff").background == "any\nname \udcff"
    with pytest.raises(dataclasses.FrozenInstanceError):
        settings.pfa = 0.5


def test_the_summary_lists_every_setting_but_those_that_it_has_one_level_up() -> None:
    listed = RunSettings(snr_db=math.inf, model_options=None).parameters()
    names = {field.name for field in dataclasses.fields(RunSettings)}
    assert listed.keys() == names - {"seed", "noise_power_m2"}
    assert json.loads(json.dumps(listed, allow_nan=False))["snr_db"] == "inf"
