"""A page in a real browser, headless, driven over the pipe that Chromium itself offers."""

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
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

import rtradar as rt
from rtradar.clouds import SpatialCloud
from rtradar.report.plots import Plots
from rtradar.system.figure_style import new_figure

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
TIMEOUT_S = 300.0
"""What ends a test that hangs; a loaded machine without a GPU draws a picture in seconds."""
SIZE = (1000, 760)
FRAME = "requestAnimationFrame"


class Browser:
    """One page in a headless Chromium, with all that it logged and asked for."""

    def __init__(self, profile: Path) -> None:
        # Chromium reads commands from its file 3 and writes answers to its file 4, each ended by a
        # zero byte.
        read_commands, self._commands = os.pipe()
        self._answers, write_answers = os.pipe()
        move = "import os, sys; os.dup2(int(sys.argv[1]), 3); os.dup2(int(sys.argv[2]), 4); "
        move += "os.execv(sys.argv[3], sys.argv[3:])"
        flags = [
            "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run",
            "--disable-extensions", "--disable-background-networking",
            "--disable-component-update", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader", "--remote-debugging-pipe", f"--user-data-dir={profile}",
        ]  # fmt: skip
        files = read_commands, write_answers
        command = [sys.executable, "-c", move, *map(str, files), str(CHROMIUM), *flags]
        silent = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        options: Any = {"pass_fds": files, "start_new_session": True, **silent}
        self._process = subprocess.Popen(command, **options)
        os.close(read_commands)
        os.close(write_answers)
        self._deadline = time.monotonic() + TIMEOUT_S
        self._buffer, self._last, self._session = b"", 0, ""
        self.events: list[dict[str, Any]] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def close(self) -> None:
        os.close(self._commands)
        os.close(self._answers)
        with contextlib.suppress(ProcessLookupError):  # it may have ended with its pipe
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def send(self, method: str, **params: object) -> int:
        """Ask for something without waiting until it is done."""
        self._last += 1
        message = {"id": self._last, "method": method, "params": params}
        message |= {"sessionId": self._session} if self._session else {}
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        return self._last

    def call(self, method: str, **params: object) -> dict[str, Any]:
        wanted = self.send(method, **params)
        while True:
            answer = self._next()
            if answer.get("id") == wanted:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return dict(answer["result"])
            if "method" in answer:  # what was sent without waiting is answered here
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
        answer = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait(self, script: str) -> None:
        """Until a script gives true."""
        while not self.evaluate(script):
            time.sleep(0.05)

    def open(self, address: str, scheme: str = "light", width: int = SIZE[0]) -> None:
        self._deadline = time.monotonic() + TIMEOUT_S
        self.look(scheme, width)
        # For the same file with another #t is no new page.
        self.call("Page.navigate", url="about:blank")
        self.events.clear()
        self.call("Page.navigate", url=address)
        self.wait("document.documentElement?.dataset.ready === 'true'")

    def look(self, scheme: str, width: int = SIZE[0]) -> None:
        """Choose the colour scheme and the width of the window; an open page follows."""
        size = {"width": width, "height": SIZE[1], "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        chosen = {"name": "prefers-color-scheme", "value": scheme}
        self.call("Emulation.setEmulatedMedia", features=[chosen])

    def place(self, element: str) -> tuple[float, float, float, float]:
        """Scroll to an element; its left, top, width and height in the window."""
        script = f"(() => {{ const e = document.getElementById('{element}');"
        script += " e.scrollIntoView({ block: 'center' });"
        x, y, width, height = self.evaluate(
            f"{script} const b = e.getBoundingClientRect();"
            " return [b.x, b.y, b.width, b.height]; })()"
        )
        return x, y, width, height

    def picture(self, element: str) -> NDArray[np.float64]:
        """Pixels of an element (row, column, rgb), 0 to 1."""
        self.place(element)
        # Two frames of the browser, so that what was scrolled to is painted.
        self.evaluate(f"new Promise((done) => {FRAME}(() => {FRAME}(done)))")
        x, y, width, height = self.place(element)
        data = self.call("Page.captureScreenshot", format="png")["data"]
        image = matplotlib.image.imread(io.BytesIO(base64.b64decode(data)))
        rows, columns = slice(int(y), int(y + height)), slice(int(x), int(x + width))
        return np.asarray(image[rows, columns, :3], dtype=np.float64)

    def drag(self, element: str, by: int) -> None:
        """With the mouse, from the middle of an element to the right."""
        x, y, width, height = self.place(element)
        x, y = x + width / 2, y + height / 2

        def mouse(kind: str, at: float, buttons: int) -> None:
            press: dict[str, object] = {"button": "left" if buttons else "none"}
            if kind != "mouseMoved":
                press = {"button": "left", "clickCount": 1}
            # Chromium answers after the next picture, which may take seconds.
            self.send("Input.dispatchMouseEvent", type=kind, x=at, y=y, buttons=buttons, **press)

        mouse("mouseMoved", x, 0)
        mouse("mousePressed", x, 1)
        for step in range(1, 4):
            mouse("mouseMoved", x + by * step / 3, 1)
            time.sleep(0.03)
        mouse("mouseReleased", x + by, 0)

    def set(self, element: str, value: object, event: str = "input") -> None:
        """Choose a value of a slider or a menu, as a hand would."""
        script = f"const e = document.getElementById('{element}'); e.value = '{value}';"
        script += f" e.dispatchEvent(new Event('{event}'));"
        self.evaluate(f"(() => {{ {script} }})()")

    def faults(self) -> list[dict[str, Any]]:
        """Errors that the page threw or logged."""
        wrong: dict[str, Callable[[Any], bool]] = {
            "Runtime.exceptionThrown": lambda params: True,
            "Runtime.consoleAPICalled": lambda params: params["type"] in ("error", "assert"),
            "Log.entryAdded": lambda params: params["entry"]["level"] == "error",
        }
        events = (one for one in self.events if one["method"] in wrong)
        return [one for one in events if wrong[one["method"]](one["params"])]

    def requests(self) -> list[str]:
        """Addresses that the page asked for."""
        return [
            event["params"]["request"]["url"]
            for event in self.events
            if event["method"] == "Network.requestWillBeSent"
        ]


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on PATH: install the package chromium (Debian, Ubuntu, Fedora)")
    opened = Browser(tmp_path_factory.mktemp("chromium"))
    yield opened
    opened.close()


@pytest.fixture
def browser(chromium: Browser) -> Iterator[Browser]:
    """A browser whose page is empty after each test, because one that plays takes a whole core."""
    yield chromium
    with contextlib.suppress(AssertionError, OSError):  # after a failure it may not answer
        chromium.call("Page.navigate", url="about:blank")


Drawer = Callable[..., Plots]


@pytest.fixture
def plots_of() -> Drawer:
    """Make the pictures of small maps, given or random, on figures that are no window."""

    def made(radar: rt.Radar, *, title: str = "run", **given: Any) -> Plots:
        rng = np.random.default_rng(0)
        n_range, n_velocity = radar.samples_per_chirp, given.pop("n_velocity", 8)
        parameters = given.pop("parameters", {})
        points = given.pop("points", rng.uniform([0, 0.3, -1], [1, 0.6, 1], (10, 3)))
        cloud = SpatialCloud(points, points[:, 2], points[:, 0] + 1, points[:, 0])
        spatial = given.pop("spatial", cloud)
        power = given.pop("power", rng.exponential(size=(n_range, n_velocity)))
        angles, of_spectrogram = np.linspace(-1, 1, 8), ("spectrogram_time", "spectrogram_velocity")
        values: dict[str, tuple[tuple[str, ...], Any]] = {
            "range_doppler": (("time", "range", "velocity"), power[None]),
            "detections": (("time", "range", "velocity"), given.pop("mask", power > 2)[None]),
            "range_time": (("slow_time", "range"), np.ones((8, n_range))),
            "spectrogram": (of_spectrogram, np.ones((16, n_velocity))),
            "range_azimuth": (("time", "range", "azimuth"), np.ones((1, n_range, 8))),
        }
        axes = {
            "time": [0.5],
            "range": radar.range_m,
            "velocity": radar.velocity_mps(n_velocity),
            "slow_time": np.arange(8.0),
            "spectrogram_time": np.arange(16.0),
            "spectrogram_velocity": radar.velocity_mps(n_velocity),
            "azimuth": angles,
        }
        for name, value in given.items():
            if name in axes:
                axes[name] = value
            else:
                values[name] = (values[name][0], value)
        maps, summary = xr.Dataset(values, axes, {"title": title}), {"parameters": parameters}
        return Plots(maps, points, spatial, radar, summary, new_figure=new_figure)

    return made
