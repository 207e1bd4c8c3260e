"""Data of the linked views: levels, groups of parts, velocities on the map, parts of points."""

from __future__ import annotations

import base64
import zlib
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import Body
from rtradar.clouds.spatial import SpatialCloud
from rtradar.motion import place
from rtradar.pipeline.output.snapshots import moving_meshes
from rtradar.report.run_view import GROUPS, Levels, RunView, group_of_parts, view_data, write_view
from rtradar.report.snapshots import Snapshots
from rtradar.report.three_d import drawn_sphere, semi_axis_poses

pytestmark = pytest.mark.drawn

OBJECTS = (
    rt.Object("fan", "fan", "metal", position_m=(0, 1.6, 3.2), motion=rt.Turning(rate_hz=2)),
)
RADAR = rt.Radar.preset("paper-12ghz")
LOW_DB = -60.0


def linked(
    points: list[tuple[float, float, float]], power_db: tuple[float, float] = (-40.0, -50.0)
) -> RunView:
    """Two snapshots: a head at 4 m, -1 m/s, and a left foot at 5 m, +8 m/s, which is ambiguous."""
    body = Body.from_motion(place(rt.synthetic_motion("walk", seed=0), duration_s=0.3))
    times = np.array([0.1, 0.2])
    snapshots = Snapshots(
        times=times,
        window=np.array([0, 1]),
        part_names=np.array(body.part_names),
        poses=semi_axis_poses(body, times).astype(np.float32),
        path_names=np.array(["body"]),
        echo_path=np.array([0, 0]),
        echo_part=np.array([body.part_names.index("head"), body.part_names.index("left foot")]),
        echo_bounces=np.array([1, 1]),
        range_m=np.array([[4.0, 5.0]] * 2),
        velocity_mps=np.array([[-1.0, 8.0]] * 2),
        power_m2=np.array([[10 ** (power / 10) for power in power_db]] * 2),
        corners=np.zeros((2, 2, 1, 3), dtype=np.float32),
        wall_names=np.array(["far"]),
        walls=np.array([[[2.2, -2, 0], [2.2, 2, 0], [2.2, 2, 2.4], [2.2, -2, 2.4]]]),
        furniture_names=np.array([], dtype=np.str_),
        furniture_vertices=np.zeros((0, 3), dtype=np.float32),
        furniture_faces=np.zeros((0, 3), dtype=np.int64),
        furniture_piece=np.zeros(0, dtype=np.int64),
        part_person=body.owner,
        person_names=np.array(["walk <1>"]),
        person_position=np.zeros((2, 1, 3)),
        person_speed=np.ones((2, 1)),
        **moving_meshes(body, OBJECTS, times, 100),
    )
    level = np.arange(2 * 4 * 5, dtype=np.uint8).reshape(2, 4, 5)
    scale: dict[str, float] = {"low_db": LOW_DB, "step_db": 0.2}
    label, axes = "RCS [dBsm]", {"across": (-7.0, 3.5), "up": (0.0, 3.0)}
    maps = Levels(level=level, label=label, **scale, **axes)
    label, axes = "Power [dB re maximum]", {"across": (0.1, 0.1), "up": (-7.0, 3.5)}
    return RunView(
        heading="walk",
        subtitle="",
        snapshots=snapshots,
        radar=RADAR,
        range_doppler=maps,
        spectrogram=Levels(level=level[:1], label=label, **scale, **axes),
        rdt_points=np.array(points).reshape(-1, 3),
        rdt_power_db=np.full(len(points), -60.0),
        rdt_source=np.full(len(points), 1),
        spatial=SpatialCloud(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0)),
    )


def names(found: list[int]) -> list[str]:
    return [list(GROUPS)[group] for group in found]


def test_every_part_has_its_group() -> None:
    parts = [
        "head",
        "neck",
        "upper torso",
        "left clavicle",
        "right hand",
        "left hip",
        "right foot",
        "left shank",
    ]
    groups = [
        "head, neck",
        "head, neck",
        "torso",
        "left arm",
        "right arm",
        "left leg",
        "right leg",
        "left leg",
    ]
    assert names(group_of_parts(parts)) == groups


def test_levels_unpack_to_decibels() -> None:
    level = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    packed = Levels(
        level=level, low_db=-80.0, step_db=0.5, label="", across=(0.0, 1.0), up=(2.0, 3.0)
    ).packed()
    unpacked = np.frombuffer(zlib.decompress(base64.b64decode(packed["levels"])), dtype=np.uint8)
    np.testing.assert_array_equal(unpacked.reshape(2, *packed["shape"]), level)
    assert (packed["low_db"], packed["high_db"]) == (-80.0, -80.0 + 250 * 0.5)


def test_a_velocity_beyond_the_unambiguous_shows_at_another() -> None:
    # Twice the unambiguous 7.138 m/s is the period.
    np.testing.assert_allclose(linked([]).shown_velocity()[0], [-1.0, 8.0 - 2 * 7.138], atol=1e-3)


def test_points_belong_to_the_nearest_echo_of_their_moment() -> None:
    bins = 3.747e-2, 0.1073
    points = [
        (0.1, 4.0 + 2 * bins[0], -1.0 - 2 * bins[1]),
        (0.2, 5.0, 8.0 - 2 * 7.138),
        (0.2, 5.0, 7.0),  # not where the echo shows
        (0.1, 4.0 + 3 * bins[0], -1.0 + 3 * bins[1]),  # 4.2 bins away
    ]
    near = ["head, neck", "left leg", "no part near", "no part near"]
    assert names(linked(points).rdt_group().tolist()) == near
    # An echo below the floor of the map shows nothing, and owns no point.
    assert names(linked(points[:1], (-95.0, -50.0)).rdt_group().tolist()) == ["no part near"]


def test_the_box_holds_what_is_seen_with_a_margin() -> None:
    (slow, fast), (near, far) = linked([(0.1, 4.5, 0.5)]).shown_box()
    assert (slow, fast) == pytest.approx((8.0 - 2 * 7.138 - 1.0, 1.5), abs=1e-3)
    assert (near, far) == pytest.approx((3.5, 5.5))


def test_echoes_read_their_cross_section() -> None:
    # 40 log10 of 4 m and of 5 m: 24.08 and 27.96 dB above -40 and -50 dB.
    found = linked([])
    np.testing.assert_allclose(found.power_db, [[-15.918, -22.041]] * 2, atol=1e-3)
    assert view_data(found)["power_label"] == "RCS, of an echo [dBsm]"


def test_a_body_that_nobody_sees_is_drawn_all_the_same() -> None:
    view = linked([], (-np.inf, -np.inf))
    assert not view.seen.any()
    assert np.isnan(view.power_db).all()
    assert view.power_range_db == (LOW_DB, LOW_DB + 1.0)
    data = view_data(view)
    assert (data["rdt"]["count"], data["rdt"]["group"]) == (0, [])
    # Walls lie in the box too: up to 2.2 m, in half metres.
    assert data["figure"]["ranges"][0][1] == 2.5


def test_people_and_objects_have_names_colours_and_truth(tmp_path: Path) -> None:
    view = linked([(0.1, 4.5, 0.5)])
    assert view.source_names == ["walk <1>", "fan", "room or noise"]
    assert len(set(view.source_colours)) == 3
    assert view.colour == "person"
    data = view_data(view)
    assert data["rdt"]["source"] == [1]
    assert data["people"]["of_part"] == [0] * 21
    assert data["meshes"]["source"] == [1]
    write_view(tmp_path / "view.html", view)
    page = (tmp_path / "view.html").read_text(encoding="utf-8")
    assert "walk &lt;1&gt;" in page
    assert '<option value="person" selected>' in page
    # The fan, at 3.2 m, is inside of the axes.
    assert data["figure"]["ranges"][2][1] >= 3.5


def test_a_false_alarm_does_not_set_the_box() -> None:
    points = [(0.1, 4.5, 0.5)] * 200 + [(0.1, 9.0, 7.0)]
    (_, fast), (_, far) = linked(points).shown_box()
    assert (fast, far) == pytest.approx((1.5, 5.5))


def test_the_sphere_that_pages_draw_is_closed_and_its_faces_look_outward() -> None:
    vertices, faces = drawn_sphere()
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1, rtol=1e-12)
    # Volumes of the tetrahedra from the centre to each face: all positive, and together those of a
    # sphere but for its curvature.
    volumes = np.linalg.det(vertices[faces]) / 6
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(4 / 3 * np.pi, rel=0.06)
