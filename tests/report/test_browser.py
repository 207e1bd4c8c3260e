"""The report in a real browser, headless: driven over the pipe that Chromium itself offers, so nothing else is needed."""

from __future__ import annotations

import base64
import contextlib
import io
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Body
from rtradar.clouds.spatial import SpatialCloud
from rtradar.motion import place
from rtradar.report.html import write_report

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
TIMEOUT_S = 120.0
SIZE = (1000, 760)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on PATH: install the package chromium (Debian, Ubuntu, Fedora)"),
]


class Browser:
    """One page in a headless Chromium, with all that it logged and asked for."""

    def __init__(self, profile: Path) -> None:
        # Chromium reads commands from its file 3 and writes answers to its file 4, each ended by a zero byte.
        read_commands, self._commands = os.pipe()
        self._answers, write_answers = os.pipe()
        move = "import os, sys; os.dup2(int(sys.argv[1]), 3); os.dup2(int(sys.argv[2]), 4); os.execv(sys.argv[3], sys.argv[3:])"
        flags = [
            "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run", "--disable-extensions",
            "--disable-background-networking", "--disable-component-update", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader", "--remote-debugging-pipe", f"--user-data-dir={profile}",
        ]  # fmt: skip
        self._process = subprocess.Popen(
            [sys.executable, "-c", move, str(read_commands), str(write_answers), str(CHROMIUM), *flags],
            pass_fds=(read_commands, write_answers),
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(read_commands)
        os.close(write_answers)
        self._deadline = time.monotonic() + TIMEOUT_S
        self._buffer, self._last, self._session = b"", 0, ""
        self.events: list[dict[str, Any]] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=SIZE[0], height=SIZE[1], deviceScaleFactor=1, mobile=False)

    def close(self) -> None:
        os.close(self._commands)
        os.close(self._answers)
        with contextlib.suppress(ProcessLookupError):  # it may have ended with its pipe
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def call(self, method: str, **params: object) -> dict[str, Any]:
        self._last += 1
        message = {"id": self._last, "method": method, "params": params} | ({"sessionId": self._session} if self._session else {})
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._last:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return dict(answer["result"])
            self.events.append(answer)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            left = self._deadline - time.monotonic()
            ready, _, _ = select.select([self._answers], [], [], max(left, 0))
            assert ready, f"Chromium gave no answer within {TIMEOUT_S} s"
            chunk = os.read(self._answers, 1 << 20)
            assert chunk, "Chromium ended"
            self._buffer += chunk
        message, self._buffer = self._buffer.split(b"\0", 1)
        return dict(json.loads(message))

    def evaluate(self, script: str) -> Any:
        answer = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait(self, script: str) -> None:
        """Until a script gives true."""
        while not self.evaluate(script):
            time.sleep(0.05)

    def open(self, address: str, scheme: str = "light") -> None:
        self._deadline = time.monotonic() + TIMEOUT_S
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.call("Page.navigate", url="about:blank")  # for the same file with another #t is no new page
        self.events.clear()
        self.call("Page.navigate", url=address)
        self.wait("document.documentElement?.dataset.ready === 'true'")

    def place(self, element: str) -> tuple[float, float, float, float]:
        """Scroll to an element; its left, top, width and height in the window."""
        script = f"(() => {{ const e = document.getElementById('{element}'); e.scrollIntoView({{ block: 'center' }});"
        x, y, width, height = self.evaluate(
            f"{script} const b = e.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; }})()"
        )
        return x, y, width, height

    def picture(self, element: str) -> NDArray[np.float64]:
        """Pixels of an element (row, column, rgb), 0 to 1."""
        self.place(element)
        # Two frames of the browser, so that what was scrolled to is painted.
        self.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        x, y, width, height = self.place(element)
        data = self.call("Page.captureScreenshot", format="png")["data"]
        image = matplotlib.image.imread(io.BytesIO(base64.b64decode(data)))
        return np.asarray(image[int(y) : int(y + height), int(x) : int(x + width), :3], dtype=np.float64)

    def drag(self, element: str, by: int) -> None:
        """With the mouse, from the middle of an element to the right."""
        x, y, width, height = self.place(element)
        x, y = x + width / 2, y + height / 2

        def mouse(kind: str, at: float, buttons: int) -> None:
            press = {"button": "left", "clickCount": 1} if kind != "mouseMoved" else {"button": "left" if buttons else "none"}
            self.call("Input.dispatchMouseEvent", type=kind, x=at, y=y, buttons=buttons, **press)

        mouse("mouseMoved", x, 0)
        mouse("mousePressed", x, 1)
        for step in range(1, 11):
            mouse("mouseMoved", x + by * step / 10, 1)
            time.sleep(0.03)
        mouse("mouseReleased", x + by, 0)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    opened = Browser(tmp_path_factory.mktemp("chromium"))
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("report")
    body = Body.from_motion(place(rt.synthetic_motion("walk", seed=0), duration_s=1.0))
    rng = np.random.default_rng(0)
    time_s = rng.uniform(0, 1, 800)
    centres = body.at(time_s).centres[np.arange(800), rng.integers(0, 21, 800)] + rng.normal(scale=0.1, size=(800, 3))
    rdt = np.stack([time_s, 4 + rng.normal(size=800) / 4, 2 * rng.normal(size=800)], axis=1)
    matplotlib.image.imsave(folder / "map.png", rng.uniform(size=(20, 30)))
    write_report(
        folder / "report.html",
        body=body,
        radar=rt.Radar.preset("paper-12ghz"),
        summary={
            "parameters": {"motion": "synthetic:<script>walk</script>"},
            "part_power_m2": dict.fromkeys(body.part_names[:10], 1e-4) | dict.fromkeys(body.part_names[10:], 1e-5),
        },
        pictures={"A map": folder / "map.png"},
        rdt_points=rdt,
        spatial=SpatialCloud(centres, rdt[:, 2], np.ones(800), time_s),
    )
    return (folder / "report.html").as_uri()


def coloured(picture: NDArray[np.float64]) -> int:
    """Pixels that are neither grey nor white: the page's ink, lines and backgrounds nearly are."""
    return int((np.ptp(picture, axis=2) > 0.25).sum())


def test_opens_without_an_error_or_a_request(browser: Browser, report: str) -> None:
    browser.open(report)
    errors = [
        event
        for event in browser.events
        if event["method"] == "Runtime.exceptionThrown"
        or (event["method"] == "Runtime.consoleAPICalled" and event["params"]["type"] in ("error", "assert"))
        or (event["method"] == "Log.entryAdded" and event["params"]["entry"]["level"] == "error")
    ]
    assert not errors
    asked = [event["params"]["request"]["url"] for event in browser.events if event["method"] == "Network.requestWillBeSent"]
    assert asked[0] == report
    assert not [url for url in asked[1:] if not url.startswith(("data:", "blob:"))]
    # Plotly offers to send the data to its own site unless it is told not to.
    buttons = browser.evaluate("[...document.querySelectorAll('.modebar-btn')].map((button) => button.dataset.title)")
    assert len(buttons) == 3 * 5
    assert not [title for title in buttons if "share" in title.lower() or "cloud" in title.lower()]
    assert browser.evaluate("document.querySelector('h1').textContent") == "synthetic:<script>walk</script>"
    assert browser.evaluate("[...document.images].every((image) => image.complete && image.naturalWidth === 30)")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_3d_views_are_drawn(browser: Browser, report: str, scheme: str) -> None:
    browser.open(f"{report}#t=0.3", scheme)
    shade = browser.picture("scene-figure")[-1, 0].mean()
    assert (shade > 0.9) == (scheme == "light")
    for view in ("scene-figure", "scene-rdt", "scene-spatial"):
        assert browser.evaluate(f"document.getElementById('{view}').dataset.drawn") == "true"
        # A colour bar alone, without anything in 3D, has up to 5000: so only the left of the picture counts.
        picture = browser.picture(view)
        assert coloured(picture[:, : int(0.75 * picture.shape[1])]) > 500, view


def test_the_figure_stands_elsewhere_at_another_moment(browser: Browser, report: str) -> None:
    def middle(moment: float) -> float:
        """Mean column of the body, which the walk carries toward the radar, to the left."""
        browser.open(f"{report}#t={moment}")
        picture = browser.picture("scene-figure")
        # Yellow to green, as parts of much power are; antennas are red and blue, points pink.
        body = (picture[..., 1] > 0.4) & (picture[..., 1] > picture[..., 2] + 0.15) & (picture[..., 1] > picture[..., 0] - 0.15)
        columns = np.nonzero(body[:, : int(0.85 * picture.shape[1])])[1]
        assert len(columns) > 200
        return float(columns.mean())

    assert middle(0.0) > middle(1.0) + 50


def test_plays_pauses_and_follows_the_slider(browser: Browser, report: str) -> None:
    def frame() -> int:
        return int(browser.evaluate("Number(document.getElementById('scene-figure').dataset.frame)"))

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
    browser.evaluate(
        f"(() => {{ const s = document.getElementById('moment'); s.value = '{wanted}'; s.dispatchEvent(new Event('input')); }})()"
    )
    browser.wait(f"document.getElementById('scene-figure').dataset.frame === '{wanted}'")
    assert browser.evaluate("document.getElementById('clock').textContent").startswith(f"{wanted / 20:.2f} / 1.00 s")


@pytest.mark.parametrize(("view", "moment"), [("scene-rdt", "#t=0"), ("scene-figure", "")])
def test_turns_under_the_mouse(browser: Browser, report: str, view: str, moment: str) -> None:
    # Without a moment the figure is playing, and must turn all the same, and stay turned.
    browser.open(report + moment)
    eye = f"Object.values(document.getElementById('{view}')._fullLayout.scene._scene.getCamera().eye)"
    before = np.array(browser.evaluate(eye))
    browser.drag(view, 200)
    time.sleep(1.0)
    after = np.array(browser.evaluate(eye))
    cosine = float(before[:2] @ after[:2] / np.linalg.norm(before[:2]) / np.linalg.norm(after[:2]))
    assert np.degrees(np.arccos(cosine)) > 15


def test_the_wheel_brings_nearer_while_playing(browser: Browser, report: str) -> None:
    browser.open(report)
    eye = "Math.hypot(...Object.values(document.getElementById('scene-figure')._fullLayout.scene._scene.getCamera().eye))"
    before = browser.evaluate(eye)
    x, y, width, height = browser.place("scene-figure")
    for _ in range(3):
        browser.call("Input.dispatchMouseEvent", type="mouseWheel", x=x + width / 2, y=y + height / 2, deltaX=0, deltaY=-120)
        time.sleep(0.1)
    time.sleep(1.0)
    assert browser.evaluate(eye) < 0.95 * before
