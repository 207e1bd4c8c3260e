"""`rtradar view` in a real browser, headless: the slider, the colours and the saved picture."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

import rtradar as rt
from rtradar.pipeline.output.view import load_run_view, view
from rtradar.report.run_view import RunView
from rtradar.scene import Furniture, material

pytestmark = pytest.mark.slow

FIGURE = "document.getElementById('scene-figure')"
VIEWS = ("figure", "map", "rdt", "spectrogram")


@pytest.fixture(scope="module")
def seen(
    chromium: Any,
    beside_a_wall: tuple[rt.Radar, rt.Scene],
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[str, RunView]:
    """Address of the page, and what it was made of."""
    folder, (radar, room) = tmp_path_factory.mktemp("seen"), beside_a_wall
    place = {"position_m": (1.0, -1.0, 0.0)}
    chair = Furniture(name="chair", mesh="chair", material=material("wood"), **place)
    room = dataclasses.replace(room, name="one wall & <b>", furniture=(chair,))
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.6)
    rt.run(motion, radar, room, out=folder, fidelity="analytic", clutter_removal="mean")
    view(folder, page=folder / "view.html")
    return (folder / "view.html").as_uri(), load_run_view(folder)


def go(browser: Any, step: int) -> None:
    browser.set("moment", step)
    browser.wait(f"{FIGURE}.dataset.frame === '{step}'")


def values(browser: Any, view: str, trace: int, name: str) -> Any:
    """An attribute of a trace as Plotly holds it; NaN in place of gaps."""
    values = f"document.getElementById('scene-{view}').data[{trace}].{name}"
    script = f"Array.from({values}, (v) => v === null ? 'NaN' : v)"
    found = browser.evaluate(script)
    return found if name == "text" else np.array(found, dtype=float)


def places(browser: Any, trace: int, *shape: int) -> Any:
    """Points of a trace of the body (..., 3)."""
    found = [values(browser, "figure", trace, axis) for axis in "xyz"]
    return np.stack(found, axis=1).reshape(*shape, 3)


def test_opens_without_an_error_or_a_request_and_moves(
    browser: Any, seen: tuple[str, RunView], beside_a_wall: tuple[rt.Radar, rt.Scene]
) -> None:
    (address, linked), (radar, _) = seen, beside_a_wall
    snapshots = linked.snapshots
    browser.open(f"{address}#t=0.1")
    assert not browser.faults()
    asked = browser.requests()
    assert asked[0].startswith(address)
    assert not [url for url in asked[1:] if not url.startswith(("data:", "blob:"))]
    assert "one wall & <b>" in browser.evaluate("document.querySelector('.sub').textContent")
    for name in VIEWS:
        assert browser.evaluate(f"document.getElementById('scene-{name}').dataset.drawn") == "true"
        picture = browser.picture(f"scene-{name}")
        assert (picture.min(axis=2) < 0.8).sum() > 1000, name
    # The slider moves every view.
    pictures = []
    for step in (2, len(snapshots.times) - 2):
        go(browser, step)
        # The body where the run had it: vertices of a sphere sum up to its centre, in float32 of
        # some metres.
        centres = places(browser, 0, 21, -1).mean(axis=1)
        np.testing.assert_allclose(centres, snapshots.poses[step, :, 0], atol=1e-5)
        time = snapshots.times[step]
        clock = browser.evaluate("document.getElementById('clock').textContent")
        assert clock.startswith(f"{time:.2f} / ")
        # Direct paths: antenna, specular point, gap, for each echo above the floor.
        own = np.flatnonzero(linked.seen[step] & snapshots.direct)
        lines = places(browser, 5, len(own), 3)
        np.testing.assert_allclose(lines[:, 0], [radar.position_m] * len(own), atol=1e-6)
        np.testing.assert_allclose(lines[:, 1], snapshots.corners[step, own, 0], atol=1e-6)
        # Over the wall: antenna, wall and body or body and wall, antenna, gap.
        ghosts = np.flatnonzero(linked.seen[step] & ~snapshots.direct)
        lines = places(browser, 6, len(ghosts), 5)
        np.testing.assert_allclose(lines[:, 1:3], snapshots.corners[step, ghosts], atol=1e-6)
        # The map of this window, and its echoes where they show.
        rows = "document.getElementById('scene-map').data[0].z.map((row) => Array.from(row))"
        levels, velocity = linked.range_doppler, linked.shown_velocity()[step, own]
        decibels = levels.low_db + levels.step_db * levels.level[step]
        np.testing.assert_allclose(browser.evaluate(rows), decibels, atol=1e-4)
        for axis, expected in (("x", velocity), ("y", snapshots.range_m[step, own])):
            np.testing.assert_allclose(values(browser, "map", 1, axis), expected, atol=1e-5)
        # The cursor on the spectrogram, and the points of this window in the cloud.
        cursor = "document.getElementById('scene-spectrogram').layout.shapes[0].x0"
        assert browser.evaluate(cursor) == pytest.approx(time, abs=1e-4)
        near = np.abs(linked.rdt_points[:, 0] - time) <= radar.frame_duration_s / 2
        # Float32 at the ends of the window.
        assert len(values(browser, "rdt", 1, "x")) == pytest.approx(near.sum(), abs=2)
        assert near.sum() > 10
        pictures.append([browser.picture(f"scene-{name}") for name in VIEWS])
    for first, second in zip(*pictures, strict=True):
        assert (np.abs(first - second).max(axis=2) > 0.2).sum() > 50
    assert not browser.faults()


def save(browser: Any, tmp_path: Path) -> None:
    """Save what is seen, and look for all four views in it."""
    browser.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    browser.evaluate("document.getElementById('save').click()")
    saved: list[Path] = []
    while not saved:
        # Within the browser's own deadline.
        browser.evaluate("new Promise((done) => setTimeout(done, 200))")
        saved = list(tmp_path.glob("*.png"))
    picture = matplotlib.image.imread(saved[0])
    width = browser.evaluate("document.querySelector('.linked').getBoundingClientRect().width")
    assert picture.shape[1] == pytest.approx(2 * width, abs=2)
    halves = np.array_split(picture, 2)
    for quarter in (one for half in halves for one in np.array_split(half, 2, axis=1)):
        assert (quarter[..., :3].min(axis=2) < 0.8).sum() > 3000


def test_colours_are_of_part_power_or_velocity_and_are_saved(
    browser: Any, seen: tuple[str, RunView], tmp_path: Path
) -> None:
    address, linked = seen
    snapshots, step = linked.snapshots, 3
    browser.open(f"{address}#t=0.1")
    go(browser, step)
    own = np.flatnonzero(linked.seen[step] & snapshots.direct)
    expected = {"power": linked.power_db[step, own], "velocity": snapshots.velocity_mps[step, own]}
    for mode, wanted in expected.items():
        browser.set("colour", mode, "change")
        browser.wait(f"document.documentElement.dataset.colour === '{mode}'")
        np.testing.assert_allclose(values(browser, "map", 1, "marker.color"), wanted, atol=1e-4)
        painted = values(browser, "figure", 0, "intensity").reshape(21, -1)[:, 0]
        np.testing.assert_allclose(painted[snapshots.echo_part[own]], wanted, atol=1e-4)
        assert browser.evaluate("document.getElementById('groups').hidden")
        assert browser.evaluate(f"{FIGURE}.data[0].showscale")
    browser.set("colour", "part", "change")
    browser.wait("document.documentElement.dataset.colour === 'part'")
    assert len(set(values(browser, "figure", 0, "intensity"))) == 6
    assert not browser.evaluate("document.getElementById('groups').hidden")
    save(browser, tmp_path)
    for paths, counts in {"none": (0, 0), "direct": (3 * len(own), 0)}.items():
        browser.set("paths", paths, "change")
        browser.wait(
            f"{FIGURE}.data[5].x.length === {counts[0]}"
            f" && {FIGURE}.data[6].x.length === {counts[1]}"
        )
    assert not browser.faults()


@pytest.mark.parametrize("page", ["view.html", "report.html"])
def test_nothing_overflows_a_narrow_window(
    browser: Any, seen: tuple[str, RunView], page: str
) -> None:
    browser.open(seen[0].replace("view.html", page) + "#t=0.1", width=420)
    tables = "[...document.querySelectorAll('.wide')].filter((e) => e.scrollWidth > e.clientWidth)"
    for scheme in ("light", "dark"):
        browser.look(scheme, 420)
        assert browser.evaluate("document.documentElement.scrollWidth") <= 420
        assert browser.evaluate(f"{tables}.length") == 0
        back = browser.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (sum(map(int, back[4:-1].split(","))) > 3 * 128) == (scheme == "light")
        assert not browser.faults()
