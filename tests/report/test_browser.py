"""The report in a real browser, headless; skipped where there is none."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rtradar as rt

pytestmark = pytest.mark.slow

FIGURE = "document.getElementById('scene-figure')"


@pytest.fixture(scope="module")
def report(chromium: Any, small: rt.Radar, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Address of the report of a small run."""
    folder = tmp_path_factory.mktemp("report")
    walk = rt.synthetic_motion("walk", seed=0, duration_s=1.0)
    motion = dataclasses.replace(walk, name="synthetic:<script>walk</script>")
    radar = dataclasses.replace(small, tx_z=2, rx_z=4)  # measures both angles
    rt.run(motion, radar, out=folder, fidelity="analytic")
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
    titles = "(document.querySelectorAll('.modebar-btn'), (button) => button.dataset.title)"
    buttons = browser.evaluate(f"Array.from{titles}")
    assert len(buttons) == 3 * 5 + 2 * 4  # of the views in 3D, and of the maps
    assert not [title for title in buttons if "share" in title.lower() or "cloud" in title.lower()]
    heading = browser.evaluate("document.querySelector('h1').textContent")
    assert heading == "synthetic:<script>walk</script>"
    named = "Array.from(document.querySelectorAll('section[id]'), (one) => one.id)"
    sections = browser.evaluate(named)
    assert sections == ["figure", "spatial", "maps", "limits", "parameters", "cost"]
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
    maps = browser.evaluate("document.querySelectorAll('[id^=scene-map-]').length")
    assert maps == 5
    for number in range(maps):  # which are drawn when they come near
        browser.place(f"scene-map-{number}")
        browser.wait(f"document.getElementById('scene-map-{number}').dataset.drawn === 'true'")
        assert coloured(browser.picture(f"scene-map-{number}")) > 10_000, number

    def nearest() -> float:
        """Least x of the body as drawn [m], which the walk carries toward the radar."""
        return float(browser.evaluate(f"Math.min(...{FIGURE}.data[0].x)"))

    first = nearest()
    browser.set("moment", 15)
    browser.wait(f"{FIGURE}.dataset.frame === '15'")
    assert nearest() < first - 0.3
    browser.look("light", 420)
    browser.wait("document.documentElement.scrollWidth <= 420")
    assert not browser.faults()


def test_playing(browser: Any, report: str) -> None:
    """Without a moment it plays, pauses, is moved, and turns and goes away under the mouse."""

    def frame() -> int:
        return int(browser.evaluate(f"Number({FIGURE}.dataset.frame)"))

    def eye(view: str) -> NDArray[np.float64]:
        scene = f"document.getElementById('{view}')._fullLayout.scene._scene"
        return np.array(browser.evaluate(f"Object.values({scene}.getCamera().eye)"))

    def turn(view: str) -> None:
        """Turn a view with the mouse; it must stay turned."""
        before = eye(view)[:2]

        def angle_deg() -> float:
            after = eye(view)[:2]
            cosine = before @ after / np.linalg.norm(before) / np.linalg.norm(after)
            return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))

        # A slow machine merges the moves of a mouse or drops them, so one drag may turn too little.
        for _ in range(20):
            browser.drag(view, 100)
            time.sleep(0.5)
            if angle_deg() > 15:
                break
        time.sleep(1.0)
        assert angle_deg() > 15

    browser.open(report, width=480)  # a small view is drawn more quickly
    x, y, width, height = browser.place("scene-figure")  # it plays where it is seen
    first = frame()
    browser.wait(f"Number({FIGURE}.dataset.frame) !== {first}")
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
    written = "JSON.parse(document.getElementById('report-data').textContent)"
    times = browser.evaluate(f"{written}.figure.times")
    np.testing.assert_allclose(np.diff(times), 1 / 20, atol=1e-3)
    assert clock.startswith(f"{times[wanted]:.2f} / {times[-1]:.2f} s")
    # The mouse comes after the pause: without a GPU a page that plays hardly answers.
    turn("scene-figure")
    before = np.linalg.norm(eye("scene-figure"))
    # Away and not nearer, for what is near covers more pixels, which take a core seconds to draw.
    wheel = {"x": x + width / 2, "y": y + height / 2, "deltaX": 0, "deltaY": 120}
    for _ in range(20):
        # Chromium answers a wheel after the next picture, or never where a slow machine drops that
        # picture: so the camera is asked.
        browser.send("Input.dispatchMouseEvent", type="mouseWheel", **wheel)
        time.sleep(0.5)
        if np.linalg.norm(eye("scene-figure")) > 1.05 * before:
            break
    assert np.linalg.norm(eye("scene-figure")) > 1.05 * before
    seen = eye("scene-figure")
    browser.set("moment", wanted + 1)
    browser.wait(f"{FIGURE}.dataset.frame === '{wanted + 1}'")
    np.testing.assert_allclose(eye("scene-figure"), seen, rtol=1e-6)  # as the user left it
    turn("scene-rdt")
