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

pytestmark = [pytest.mark.slow, pytest.mark.drawn]


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
    matplotlib.image.imsave(folder / "map.png", rng.uniform(size=(20, 30)))
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


def test_opens_without_an_error_or_a_request(browser: Any, report: str) -> None:
    browser.open(report)
    assert not browser.faults()
    asked = browser.requests()
    assert asked[0] == report
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
        "[...document.images].every((image) => image.complete && image.naturalWidth === 30)"
    )


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_3d_views_are_drawn(browser: Any, report: str, scheme: str) -> None:
    browser.open(f"{report}#t=0.3", scheme)
    shade = browser.picture("scene-figure")[-1, 0].mean()
    assert (shade > 0.9) == (scheme == "light")
    for view in ("scene-figure", "scene-rdt", "scene-spatial"):
        assert browser.evaluate(f"document.getElementById('{view}').dataset.drawn") == "true"
        # A colour bar alone, without anything in 3D, has up to 5000: so only the left of the
        # picture counts.
        picture = browser.picture(view)
        assert coloured(picture[:, : int(0.75 * picture.shape[1])]) > 500, view


def test_the_figure_stands_elsewhere_at_another_moment(browser: Any, report: str) -> None:
    def middle(moment: float) -> float:
        """Mean column of the body, which the walk carries toward the radar, to the left."""
        browser.open(f"{report}#t={moment}")
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

    assert middle(0.0) > middle(1.0) + 50


def test_plays_pauses_and_follows_the_slider(browser: Any, report: str) -> None:
    def frame() -> int:
        return int(
            browser.evaluate("Number(document.getElementById('scene-figure').dataset.frame)")
        )

    browser.open(report)
    browser.place("scene-figure")
    first = frame()
    browser.wait(f"Number(document.getElementById('scene-figure').dataset.frame) !== {first}")
    browser.evaluate("document.getElementById('play').click()")
    assert browser.evaluate("document.getElementById('play').textContent") == "Play"
    time.sleep(0.3)
    held = frame()
    time.sleep(0.3)
    assert frame() == held
    wanted = 3 if held != 3 else 5
    browser.set("moment", wanted)
    browser.wait(f"document.getElementById('scene-figure').dataset.frame === '{wanted}'")
    assert browser.evaluate("document.getElementById('clock').textContent").startswith(
        f"{wanted / 20:.2f} / 1.00 s"
    )


@pytest.mark.parametrize(("view", "moment"), [("scene-rdt", "#t=0"), ("scene-figure", "")])
def test_turns_under_the_mouse(browser: Any, report: str, view: str, moment: str) -> None:
    # Without a moment the figure is playing, and must turn all the same, and stay turned.
    browser.open(report + moment)
    eye = (
        f"Object.values(document.getElementById('{view}')._fullLayout.scene._scene.getCamera().eye)"
    )
    before = np.array(browser.evaluate(eye))
    browser.drag(view, 200)
    time.sleep(1.0)
    after = np.array(browser.evaluate(eye))
    cosine = float(before[:2] @ after[:2] / np.linalg.norm(before[:2]) / np.linalg.norm(after[:2]))
    assert np.degrees(np.arccos(cosine)) > 15


def test_the_wheel_brings_nearer_while_playing(browser: Any, report: str) -> None:
    browser.open(report)
    scene = "document.getElementById('scene-figure')._fullLayout.scene._scene"
    eye = f"Math.hypot(...Object.values({scene}.getCamera().eye))"
    before = browser.evaluate(eye)
    x, y, width, height = browser.place("scene-figure")
    for _ in range(3):
        browser.call(
            "Input.dispatchMouseEvent",
            type="mouseWheel",
            x=x + width / 2,
            y=y + height / 2,
            deltaX=0,
            deltaY=-120,
        )
        time.sleep(0.1)
    time.sleep(1.0)
    assert browser.evaluate(eye) < 0.95 * before
