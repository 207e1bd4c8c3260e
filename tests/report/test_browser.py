"""The report in a real browser, headless; skipped where there is none."""

from __future__ import annotations

import time
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Body
from rtradar.clouds.spatial import SpatialCloud
from rtradar.motion import place
from rtradar.report.pages.run_page import write_report

pytestmark = pytest.mark.slow

FIGURE = "document.getElementById('scene-figure')"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("report")
    body = Body.from_motion(place(rt.synthetic_motion("walk", seed=0), duration_s=1.0))
    rng = np.random.default_rng(0)
    time_s = rng.uniform(0, 1, 800)
    centres = body.at(time_s).centres[np.arange(800), rng.integers(0, 21, 800)] + rng.normal(
        scale=0.1, size=(800, 3)
    )
    rdt = np.stack([time_s, 4 + rng.normal(size=800) / 4, 2 * rng.normal(size=800)], axis=1)
    matplotlib.image.imsave(folder / "map.png", rng.uniform(size=(20, 1500)))
    write_report(
        folder / "report.html",
        body=body,
        radar=rt.Radar.preset("paper-12ghz"),
        summary={
            "parameters": {"motion": "synthetic:<script>walk</script>"},
            "part_power_m2": dict.fromkeys(body.part_names[:10], 1e-4)
            | dict.fromkeys(body.part_names[10:], 1e-5),
        },
        pictures={"A map": folder / "map.png"},
        rdt_points=rdt,
        spatial=SpatialCloud(centres, rdt[:, 2], np.ones(800), time_s),
    )
    return (folder / "report.html").as_uri()


def coloured(picture: NDArray[np.float64]) -> int:
    """Pixels that are neither grey nor white: the page's ink, lines and backgrounds nearly are."""
    return int((np.ptp(picture, axis=2) > 0.25).sum())


def test_at_rest(browser: Any, report: str) -> None:
    """It opens without an error or a request, is drawn in both schemes, and moves."""
    browser.open(f"{report}#t=0")
    assert not browser.faults()
    asked = browser.requests()
    assert asked[0].startswith(report)
    assert not [url for url in asked[1:] if not url.startswith(("data:", "blob:"))]
    # Plotly offers to send the data to its own site unless it is told not to.
    buttons = browser.evaluate(
        "[...document.querySelectorAll('.modebar-btn')].map((button) => button.dataset.title)"
    )
    assert len(buttons) == 3 * 5
    assert not [title for title in buttons if "share" in title.lower() or "cloud" in title.lower()]
    assert (
        browser.evaluate("document.querySelector('h1').textContent")
        == "synthetic:<script>walk</script>"
    )
    assert browser.evaluate(
        "[...document.images].every((image) => image.complete && image.naturalWidth === 1500)"
    )
    for scheme in ("light", "dark"):
        browser.look(scheme)
        shade = browser.picture("scene-figure")[-1, 0].mean()
        assert (shade > 0.9) == (scheme == "light")
        for view in ("scene-figure", "scene-rdt", "scene-spatial"):
            assert browser.evaluate(f"document.getElementById('{view}').dataset.drawn") == "true"
            # A colour bar alone, without anything in 3D, has up to 5000: so only the left of the
            # picture counts.
            picture = browser.picture(view)
            assert coloured(picture[:, : int(0.75 * picture.shape[1])]) > 500, view
    browser.look("light")

    def middle() -> float:
        """Mean column of the body, which the walk carries toward the radar, to the left."""
        picture = browser.picture("scene-figure")
        # Yellow to green, as parts of much power are; antennas are red and blue, points pink.
        body = (
            (picture[..., 1] > 0.4)
            & (picture[..., 1] > picture[..., 2] + 0.15)
            & (picture[..., 1] > picture[..., 0] - 0.15)
        )
        columns = np.nonzero(body[:, : int(0.85 * picture.shape[1])])[1]
        assert len(columns) > 200
        return float(columns.mean())

    first = middle()
    browser.set("moment", 20)
    browser.wait(f"{FIGURE}.dataset.frame === '20'")
    assert first > middle() + 50
    browser.look("light", 420)
    browser.wait("document.documentElement.scrollWidth <= 420")
    assert not browser.faults()


def test_playing(browser: Any, report: str) -> None:
    """Without a moment it plays, turns and comes nearer under the mouse, pauses and is moved."""

    def frame() -> int:
        return int(browser.evaluate(f"Number({FIGURE}.dataset.frame)"))

    def eye(view: str) -> NDArray[np.float64]:
        scene = f"document.getElementById('{view}')._fullLayout.scene._scene"
        return np.array(browser.evaluate(f"Object.values({scene}.getCamera().eye)"))

    def turned(view: str) -> float:
        """Angle by which a view turns under the mouse, and stays turned [deg]."""
        before = eye(view)[:2]
        browser.drag(view, 200)
        time.sleep(1.0)
        after = eye(view)[:2]
        cosine = before @ after / np.linalg.norm(before) / np.linalg.norm(after)
        return float(np.degrees(np.arccos(cosine)))

    browser.open(report, width=640)  # a small view is drawn more quickly
    x, y, width, height = browser.place("scene-figure")
    first = frame()
    browser.wait(f"Number({FIGURE}.dataset.frame) !== {first}")
    assert turned("scene-figure") > 15
    before = np.linalg.norm(eye("scene-figure"))
    wheel = {"x": x + width / 2, "y": y + height / 2, "deltaX": 0, "deltaY": -120}
    for _ in range(3):
        browser.call("Input.dispatchMouseEvent", type="mouseWheel", **wheel)
        time.sleep(0.1)
    time.sleep(1.0)
    assert np.linalg.norm(eye("scene-figure")) < 0.95 * before
    browser.evaluate("document.getElementById('play').click()")
    assert browser.evaluate("document.getElementById('play').textContent") == "Play"
    time.sleep(0.3)
    held = frame()
    time.sleep(0.3)
    assert frame() == held
    wanted = 3 if held != 3 else 5
    browser.set("moment", wanted)
    browser.wait(f"{FIGURE}.dataset.frame === '{wanted}'")
    clock = browser.evaluate("document.getElementById('clock').textContent")
    assert clock.startswith(f"{wanted / 20:.2f} / 1.00 s")
    assert turned("scene-rdt") > 15
