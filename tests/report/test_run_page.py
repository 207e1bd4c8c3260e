"""The report as a file: whole, escaped, closed to the network, with the numbers of the run."""

from __future__ import annotations

import base64
import dataclasses
import gzip
import hashlib
import json
import re
import zlib
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Body
from rtradar.clouds.spatial import SpatialCloud
from rtradar.motion import place
from rtradar.report.canvas import FieldUnit
from rtradar.report.html import InlinePage, grade, quantity
from rtradar.report.maps import Overlay, ShownMap
from rtradar.report.run_page import write_report
from rtradar.report.three_d import (
    MOST_POINTS,
    posed_figure,
    rdt_data,
    semi_axis_poses,
    spatial_data,
)

pytestmark = pytest.mark.drawn

RADAR = rt.Radar.preset("paper-12ghz")
REPORT = Path(rt.__file__).parent / "report"
EVIL = "walk</script><script>alert('1')</script><img src=x>&\"amc"


class Elements(HTMLParser):
    """All elements with their attributes, the texts of scripts, and all text outside of them."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.text = ""
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._inside = tag
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            self.scripts[-1] += data
        elif self._inside != "style":
            self.text += data


@pytest.fixture(scope="module")
def body() -> Body:
    return Body.from_motion(place(rt.synthetic_motion("walk", seed=0), duration_s=0.5))


def summary() -> dict[str, Any]:
    parameters = {"motion": EVIL, "snr_db": 20.0, "pfa": 1e-6}
    return {
        "parameters": parameters | {"radar": dataclasses.asdict(RADAR)},
        "versions": {"numpy": "<2.4>"},
        "fidelity": "specular",
        "stages": {"scatter": 3.0, "cfar": 1.0},
        "wall_s": 4.5,
        "capture_s": 0.5,
        "real_time_factor": 9.0,
        "peak_memory_mb": 446.6,
        "detections": 7416,
        "limits": [{"name": "beyond_range", "share": 0.125, "message": f"echo power from {EVIL}"}],
    }


def write(path: Path, **changes: Any) -> Elements:
    given: dict[str, Any] = {"summary": summary(), "shown": []}
    given |= {"points": np.array([[0.1, 4.0, -1.0]])} | changes
    cloud = SpatialCloud(np.zeros((0, 3)), *np.zeros((3, 0)))
    plots: Any = SimpleNamespace(radar=RADAR, spatial_cloud=cloud, **given)
    write_report(path, plots)
    return Elements(path.read_text(encoding="utf-8"))


def floats(text: str) -> NDArray[np.float32]:
    return np.frombuffer(base64.b64decode(text), dtype="<f4")


def shown(title: str = "A map", note: str = "") -> ShownMap:
    level = np.linspace(-90.0, -30.0, 12 * 20).reshape(12, 20)
    ghost = Overlay("ghost", EVIL, np.array([[1.0, 4.0]]))
    axes = {"across": np.arange(20) / 10, "up": np.arange(12.0)}
    labels, unit = ("Time [s]", "Range [m]"), FieldUnit("dBsm", 1.0)
    how = {"unit": unit, "qualifier": "mean", "view": (None, (2.5, 8.5)), "over": (ghost,)}
    return ShownMap(title=title, labels=labels, level_db=level, note=note, **axes, **how)


def test_no_text_from_outside_becomes_markup(tmp_path: Path) -> None:
    page = write(tmp_path / "r.html", shown=[shown(EVIL, note=EVIL)])
    tags = [tag for tag, _ in page.elements]
    # The data, plotly.js and the viewer.
    assert (tags.count("script"), tags.count("img")) == (3, 0)
    # Title, heading, limit, title and caption of the map, and table of parameters show it as it is.
    assert page.text.count(EVIL) == 6
    assert "<2.4>" in page.text


def test_refers_to_nothing_outside_and_allows_its_own_scripts_alone(tmp_path: Path) -> None:
    page = write(tmp_path / "r.html", shown=[shown()])
    policy = ""
    for tag, attributes in page.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        if tag == "a":  # the list of contents
            assert (attributes["href"] or "").startswith("#")
            continue
        for name in ("src", "href", "srcset", "action", "data"):
            assert (attributes.get(name) or "data:").startswith("data:")
        if attributes.get("http-equiv") == "Content-Security-Policy":
            policy = attributes["content"] or ""
    rules = {rule.split()[0]: rule.split()[1:] for rule in policy.split(";")}
    assert rules["default-src"] == ["'none'"]
    assert not {"connect-src", "script-src-elem", "frame-src"} & rules.keys()
    expected = [
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
        for text in (gzip.decompress(base64.b64decode(page.scripts[1])).decode(), page.scripts[2])
    ]
    assert rules["script-src"] == expected


def test_plotly_js_comes_with_its_licence() -> None:
    script = gzip.decompress((REPORT / "plotly.min.js.gz").read_bytes())[:200].decode()
    assert re.search(
        r"plotly\.js v\d.*Copyright 2012-\d+, Plotly.*the MIT license", script, re.DOTALL
    )
    assert (REPORT / "plotly.LICENSE").read_text(encoding="utf-8").startswith("MIT License")


def test_shows_the_numbers_that_it_was_given(tmp_path: Path) -> None:
    page = write(tmp_path / "r.html")
    text = re.sub(r"\s+", " ", page.text)
    for shown in (
        *("12.5% of the echo power from", "Peak memory446.6 MB", "7416", "62.5 µs", "12 GHz"),
        *("Signal-to-noise ratio of one IF sample20 dB", "75%", "3.000 s", "4.0 to 4.0 m"),
    ):
        assert shown in text, shown
    # By hand for 14 GHz: c / 2B = 3.747 cm, x 256 = 9.593 m; lambda = 21.414 mm; lambda / 4 / 0.75
    # ms = 7.138 m/s; lambda / 2 / (133 x 0.75 ms) = 0.1073 m/s.
    html = (tmp_path / "r.html").read_text(encoding="utf-8")
    limits = "9.593 m|3.747 cm|±7.138 m/s|0.1073 m/s|±59.0°|1.81°|21.414 mm|750 µs|133|12 × 8 = 96"
    for value in limits.split("|"):
        assert f"<td>{value}</td>" in html, value


def test_says_so_where_there_is_nothing(tmp_path: Path) -> None:
    page = write(tmp_path / "r.html", summary={}, points=np.zeros((0, 3)))
    assert "Nothing was detected" in page.text
    assert "Nothing came near the end" in page.text
    assert "scene-rdt" not in [attributes.get("id") for _, attributes in page.elements]
    # Neither a body, which measured samples lack, nor pictures, a room, or costs.
    sections = [attributes["id"] for tag, attributes in page.elements if tag == "section"]
    assert sections == ["rdt", "spatial", "limits", "parameters"]


def test_the_same_gives_the_same_file(tmp_path: Path) -> None:
    write(tmp_path / "a.html")
    write(tmp_path / "b.html")
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def figure(body: Body) -> Any:
    """Body and radar at 11 times in half a second, as a page holds them."""
    times = np.arange(11) / 20
    poses = semi_axis_poses(body, times)
    return json.loads(json.dumps(posed_figure(body.part_names, times, poses, RADAR)))


def test_poses_give_back_the_ellipsoids(body: Body) -> None:
    data = figure(body)
    np.testing.assert_allclose(data["times"], np.arange(11) / 20, atol=1e-4)
    poses = floats(data["poses"]).reshape(11, 21, 4, 3)
    sphere = floats(data["vertices"]).reshape(-1, 3)
    now = body.ellipsoids(0.25)
    for part in (0, 7, 20):
        vertices = poses[5, part, 0] + sphere @ poses[5, part, 1:]
        local = (vertices - now.centres[part]) @ now.frames[part] / now.semi_axes[part]
        # On the unit sphere of the mesh, whose corners lie up to 2 % outside; float32 of some
        # metres is 1e-6 of some centimetres.
        np.testing.assert_allclose(local, sphere, atol=2e-5)
    assert np.linalg.norm(sphere, axis=1).max() < 1.02
    ends = poses[5, :, 0] + poses[5, :, 3]
    np.testing.assert_allclose(ends, body.motion.at([0.25])[0][0, 1:], atol=1e-6)


def test_the_box_holds_body_and_radar(body: Body) -> None:
    data = figure(body)
    low, high = np.array(data["ranges"]).T
    sphere = floats(data["vertices"]).reshape(-1, 3)
    for pose in floats(data["poses"]).reshape(-1, 4, 3):
        vertices = pose[0] + sphere @ pose[1:]
        assert (vertices.max(axis=0) < high).all()
        assert (vertices.min(axis=0) > low - [0, 0, 0.1]).all()
    for antennas in (RADAR.tx, RADAR.rx):
        assert ((antennas > low) & (antennas < high)).all()


def test_large_clouds_are_thinned_and_counted() -> None:
    count = 2 * MOST_POINTS + 1
    points = np.stack([np.arange(count), np.zeros(count), np.ones(count)], axis=1)
    data = rdt_data(points)
    assert (data["count"], data["shown"]) == (count, len(range(0, count, 3)))
    np.testing.assert_array_equal(floats(data["points"]).reshape(-1, 3), points[::3])
    cloud = spatial_data(SpatialCloud(points, points[:, 0], points[:, 1], points[:, 0] / 10), RADAR)
    np.testing.assert_allclose(floats(cloud["time"]), points[::3, 0] / 10, rtol=1e-7)  # float32


def test_outliers_do_not_set_the_axes_of_the_spatial_cloud() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform([0, -1, 0], [2, 1, 2], (1000, 3))
    points[:2] = [[0, 30, -40], [20, 1, 1]]
    ones = np.ones(1000)
    (x, y, z) = spatial_data(SpatialCloud(points, ones, ones, ones), RADAR)["ranges"]
    assert x[0] < RADAR.position_m[0]
    assert 2 < x[1] < 4
    assert -2.5 < y[0] < -1 < 1 < y[1] < 2.5
    assert -1.5 < z[0] < 0 < 2 < z[1] < 3.5
    points[:, 2] = np.nan
    line = spatial_data(SpatialCloud(points, ones, ones, ones), RADAR)
    assert (line["ranges"][0], line["ranges"][2]) == (x, None)


@pytest.mark.parametrize(
    ("points", "said"),
    [(np.zeros((4, 2)), "(4, 2)"), (np.zeros(3), "(3,)"), (np.full((2, 3), np.nan), "NaN")],
)
def test_refuses_what_is_no_cloud(points: NDArray[np.float64], said: str) -> None:
    with pytest.raises(rt.InputError, match=re.escape(said)) as caught:
        rdt_data(points)
    assert "\n" not in str(caught.value)


def test_a_page_has_of_a_map_what_is_in_view(tmp_path: Path) -> None:
    page = write(tmp_path / "r.html", shown=[shown()])
    (one,) = json.loads(page.scripts[0])["maps"]
    assert (one["shape"], one["x"], one["y"]) == ([6, 20], [0.0, 0.1], [3.0, 1.0])
    assert one["view"] == [pytest.approx([-0.05, 1.95]), [2.5, 8.5]]
    level = np.frombuffer(zlib.decompress(base64.b64decode(one["levels"])), np.uint8)
    found = one["low_db"] + one["step_db"] * level.reshape(6, 20)
    assert np.abs(np.maximum(shown().level_db[3:9], one["low_db"]) - found).max() <= 0.15
    assert floats(one["over"][0]["xy"]).tolist() == [1.0, 4.0]
    assert "Colours: ceiling -45 dBsm, the strongest cell; floor" in page.text


def test_a_page_has_the_strongest_of_neighbouring_cells_of_a_large_map() -> None:
    level = np.random.default_rng(0).uniform(-50.0, 0.0, (1300, 40))
    axes = {"up": np.arange(1300.0), "across": np.arange(40.0)}
    large = dataclasses.replace(shown(), level_db=level, **axes)
    one = dataclasses.replace(large, view=(None, (-0.5, 1299.5))).packed()
    assert (one["shape"], one["y"]) == ([434, 40], [1.0, 3.0])
    found = np.frombuffer(zlib.decompress(base64.b64decode(one["levels"])), np.uint8)
    expected = level[:1299].reshape(433, 3, 40).max(axis=1)
    decibels = one["low_db"] + one["step_db"] * found.reshape(434, 40)[:433]
    assert np.abs(np.maximum(expected, one["low_db"]) - decibels).max() <= 0.15


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("start_frequency_hz", 12e9, ("Frequency at the start of the sweep", "12 GHz")),
        ("chirp_duration_s", 62.5e-6, ("Duration of a chirp", "62.5 µs")),
        ("start_s", 0.0, ("Start in the recording", "0 s")),
        ("snr_db", "inf", ("Signal-to-noise ratio of one IF sample", "inf dB")),
        ("heading_deg", -90.0, ("Heading of the person", "-90°")),
        ("position_m", [-4.0, 1.0, 1.0], ("Position of the array (x, y, z)", "(-4, 1, 1) m")),
        ("pfa", 1e-6, ("False alarms, probability in one cell", "1e-06")),
        ("chirps", 15996000, ("Chirps", "15\u202f996\u202f000")),
        ("spreading", True, ("Spreading loss over the path", "yes")),
        ("duration_s", None, ("Duration", "-")),
        # A key that nobody has named yet.
        ("if_gain_db", 3.0, ("IF gain", "3 dB")),
    ],
)
def test_quantities_read_as_people_write_them(
    name: str, value: object, shown: tuple[str, str]
) -> None:
    assert quantity(name, value) == shown


@pytest.mark.parametrize(
    ("share", "kind"),
    [(0.008, "note"), (0.05, "note"), (0.051, "warning"), (0.0, "warning"), (None, "note")],
)
def test_a_limit_is_a_warning_where_it_matters(share: float | None, kind: str) -> None:
    # A fraction of 5 % is 0.2 dB. None of 0 is nobody visible, and one that is not known is told.
    assert grade({"name": "beyond_range", "share": share, "message": "m"}) == kind


def test_sections_come_in_order_and_are_linked(tmp_path: Path) -> None:
    ghost = {"path": "body > left", "range_m": 5.25, "velocity_mps": -1.5, "azimuth_deg": 20.0}
    room = {
        "paths": [
            {"path": "body", "order": 0, "kept": ["head"], "dropped": [], "why": ""},
            {"path": "body > left", "order": 1, "kept": [], "dropped": ["head"], "why": "weak"},
        ],
        "clutter": {"signal_to_clutter_db": -26.9, "after_removal_db": 12.3}
        | {"kept": [{"name": "left", "kind": "mirror", "power_m2": 1.0}], "dropped": []},
        "ghosts": {"time_s": 1.25, "paths": [ghost | {"power_m2": 5.25**-4}]},
    }
    page = write(tmp_path / "r.html", summary=summary() | {"room": room}, shown=[shown()])
    names = ["rdt", "spatial", "maps", "room", "limits", "parameters", "cost"]
    assert [a["id"] for tag, a in page.elements if tag == "section"] == names
    assert [a["href"] for tag, a in page.elements if tag == "a"] == [f"#{name}" for name in names]
    # R^4 times the power is 1 m^2.
    minus = "\N{MINUS SIGN}"
    ghost_row = f"Power [dBsm]Range [m]Velocity [m/s]Azimuth [°]body > left0.05.25{minus}1.50+20.0"
    texts = (f"{minus}26.9 dB", "\u2265 12.3 dB", ghost_row, "1 of 1 partsweak")
    for text in texts:
        assert text in page.text, text
    # Keys are in words.
    assert not re.search(r"[a-z]_(db|m2|s|hz|mb)\b", page.text)


def test_an_inline_page_is_saved_whole_or_refused(tmp_path: Path) -> None:
    page = InlinePage("<p>é</p>")
    page.save(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == page.html
    with pytest.raises(rt.InputError, match="cannot write"):
        page.save(tmp_path)
    with pytest.raises(rt.InputError, match="missing"):
        page.save(tmp_path / "missing" / "page.html")


def test_people_have_a_row_each(tmp_path: Path) -> None:
    one = {"name": "walk <1>", "position_m": [0.5, -1.0], "heading_deg": 30.0}
    one |= {"material": "skin", "snr_db": 17.26}
    page = write(tmp_path / "r.html", summary={"people": [one, one | {"snr_db": None}]})
    row = "walk <1>(0.5, -1) m, 30°skin"
    assert f"Place, headingMaterialSNR{row}17.3 dB{row}-" in re.sub(r"\s*\n", "", page.text)


@pytest.mark.parametrize(
    ("echo", "noise", "shown"),
    [(1e-3, 1e-6, "30.0 dB"), (1e-3, 0.0, "no noise"), (0.0, 1e-6, "nobody is visible")],
)
def test_the_headline_has_the_ratio_that_a_run_had(
    tmp_path: Path, echo: float, noise: float, shown: str
) -> None:
    summary = {"echo_power_m2": echo, "noise_power_m2": noise, "parameters": {"snr_db": "physical"}}
    page = write(tmp_path / "r.html", summary=summary)
    assert f"{shown}signal to noise, of one IF sample" in page.text
    assert "physical dB" not in page.text
