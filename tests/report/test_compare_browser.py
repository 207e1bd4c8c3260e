"""The page of a comparison in a real browser, headless: one slider moves body and all maps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rtradar as rt
from rtradar.pipeline.output.view import load_run_view
from rtradar.report.comparison import comparison_data

pytestmark = pytest.mark.slow

MODELS = ("analytic-paper", "analytic")


@pytest.fixture(scope="module")
def folder(
    chromium: Any,
    beside_a_wall: tuple[rt.Radar, rt.Scene],
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    out = tmp_path_factory.mktemp("compared")
    motion, (radar, _) = rt.synthetic_motion("walk", seed=0, duration_s=0.4), beside_a_wall
    rt.compare(motion, radar, out=out, fidelities=MODELS, overwrite=True)
    return out


def rows(browser: Any, panel: str) -> Any:
    script = f"document.getElementById('scene-{panel}').data[0].z.map((row) => Array.from(row))"
    return np.array(browser.evaluate(script))


@pytest.mark.parametrize("width", [1400, 420])
def test_one_slider_moves_body_maps_and_difference(browser: Any, folder: Path, width: int) -> None:
    address = (folder / "compare.html").as_uri()
    browser.open(f"{address}#t=0.1", width=width)
    asked = browser.requests()
    assert not [url for url in asked[1:] if not url.startswith(("data:", "blob:"))]
    assert browser.evaluate("document.documentElement.scrollWidth") <= width
    views = {name: load_run_view(folder / name) for name in MODELS}
    data = comparison_data(views)
    low, _ = data["limits_db"]
    steps = len(data["figure"]["times"])
    thinned = [view.thinned(60, 20.0).range_doppler for view in views.values()]
    for step in (0, steps - 1):
        browser.set("moment", step)
        browser.wait(f"document.getElementById('scene-figure').dataset.frame === '{step}'")
        decibels = (one.low_db + one.step_db * one.level[step] for one in thinned)
        ours, reference = (np.maximum(one, low) for one in decibels)
        np.testing.assert_allclose(rows(browser, "map-0"), ours, atol=1e-4)
        np.testing.assert_allclose(rows(browser, "map-1"), reference, atol=1e-4)
        np.testing.assert_allclose(rows(browser, "difference-0"), ours - reference, atol=1e-4)
    ranges = "['map-0', 'map-1', 'difference-0'].map((name) => JSON.stringify("
    ranges += "document.getElementById(`scene-${name}`).layout.yaxis.range))"
    assert len(set(browser.evaluate(ranges))) == 1
    assert not browser.faults()
