"""`rtradar.testing`: what the tests of other programs take from it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.scatter import MODELS
from rtradar.testing import SAME_LEVEL, tolerance

PAGE = Path(__file__).parents[1] / "docs" / "choosing-a-level.md"


def test_a_suite_of_somebody_else_runs_on_each_backend(pytester: pytest.Pytester) -> None:
    pytester.makeconftest('pytest_plugins = ["rtradar.testing"]')
    pytester.makepyfile(
        """
        import numpy as np
        import rtradar as rt

        def test_runs(rtradar_variant, rtradar_radar, rtradar_scene):
            motion = rt.synthetic_motion("kick", duration_s=0.2)
            given = {"variant": rtradar_variant, "duration_s": 0.06, "order": 0}
            result = rt.run(motion, rtradar_radar, rtradar_scene, **given)
            assert result.summary["variant"] == rtradar_variant
            assert len(result.points)
        """
    )
    result = pytester.runpytest_subprocess()
    outcomes = result.parseoutcomes()
    assert set(outcomes) == {"passed"}
    assert outcomes["passed"] >= 1


def test_the_backends_agree_as_it_says(rtradar_radar: rt.Radar, rtradar_scene: rt.Scene) -> None:
    from rtradar.trace.backend import available

    if len(available()) < 2:
        pytest.skip("one backend alone works on this machine")
    motion = rt.synthetic_motion("kick", duration_s=0.2)
    found = [
        rt.run(motion, rtradar_radar, rtradar_scene, variant=variant, duration_s=0.06).maps
        for variant in available()
    ]
    power = [maps["range_doppler"].values for maps in found]
    for other in power[1:]:
        assert np.abs(other - power[0]).max() <= SAME_LEVEL * power[0].max()


def test_tolerances_are_those_of_the_page() -> None:
    rows = re.findall(r"^\| `([\w-]+)` \| (.*) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    said = {name: cells.split(" | ") for name, cells in rows if cells.count("|") == 5}
    assert {name for name in said if name in MODELS.built_in} == set(MODELS.built_in)
    for name, (first, first_db, _, second, second_db, _) in said.items():
        if name == "reference":
            continue
        largest = max(float(cell.split(" to ")[-1].rstrip(" %")) for cell in (first, second))
        largest_db = max(float(cell.removesuffix(" dB")) for cell in (first_db, second_db))
        assert tolerance(name) == pytest.approx((largest / 100, largest_db))


def test_a_level_that_was_not_measured_is_named() -> None:
    with pytest.raises(rt.InputError, match="no error of level 'brightest' was measured; known: "):
        tolerance("brightest")
