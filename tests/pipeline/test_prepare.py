"""Who and what is in a scene, what a run in a room leaves, and where it says ghosts are."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

import rtradar as rt
from rtradar.body import Body
from rtradar.errors import InputError
from rtradar.motion import place
from rtradar.pipeline.prepare import people_in
from rtradar.scatter import build_model
from rtradar.scatter.multipath.path_summary import ghosts

pytestmark = pytest.mark.drawn

WALK = rt.synthetic_motion("walk", duration_s=0.3)
FAN = rt.Object("fan", "fan", "metal", position_m=(1, 1, 1), motion=rt.Turning(rate_hz=5))


def test_people_and_objects_that_are_given_come_before_those_of_the_scene() -> None:
    own, person = rt.Person(WALK, (2.0, 0.0)), rt.Person(WALK, (0.0, 1.0))
    scene = rt.Scene(people=(own,), objects=(FAN,), person_position_m=(1.0, 0.5))
    other = rt.Object("other fan", "fan", "metal", position_m=(2, 1, 1))
    found, everyone = people_in(scene, [person, other, WALK])
    assert [one.name for one in found.objects] == ["other fan", "fan"]
    assert [one.position_m for one in everyone] == [(0.0, 1.0), (1.0, 0.5), (2.0, 0.0)]


def test_an_object_alone_is_nobody() -> None:
    assert people_in(rt.Scene(), [FAN])[1] == ()


RADAR = rt.Radar(
    name="small",
    tx_y=2,
    tx_z=0,
    rx_y=4,
    rx_z=0,
    chirp_duration_s=250e-6,
    samples_per_chirp=256,
    frame_duration_s=0.05,
)
ROOM = """
[radar]
position_m = [-4, 1, 1]

[[walls]]
name = "side"
corner_m = [-6, 2.5, -1]
edge_u_m = [12, 0, 0]
edge_v_m = [0, 0, 4]
material = "perfect-conductor"
thickness_m = 0.1

[[furniture]]
name = "shelf"
mesh = "shelf"
material = "chipboard"
position_m = [2.5, 0, 0]
yaw_deg = 180
"""


@pytest.fixture
def room(tmp_path: Path) -> rt.Scene:
    (tmp_path / "room.toml").write_text(ROOM)
    return rt.Scene.load(tmp_path / "room.toml")


@pytest.mark.slow
def test_a_run_in_a_room_says_what_it_kept_and_shows_the_map_before_and_after(
    tmp_path: Path, room: rt.Scene
) -> None:
    motion = rt.synthetic_motion("punch", seed=0, duration_s=0.2)
    rt.run(
        motion,
        RADAR,
        room,
        out=tmp_path / "out",
        fidelity="analytic",
        clutter_removal="mean",
        pfa=1e-4,
        pictures=True,
    )
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["parameters"]["scene"] == "room"
    paths = {row["path"]: row for row in summary["room"]["paths"]}
    walls = {"body", "side > body", "body > side"}
    assert set(paths) == walls | {"shelf front > body", "body > shelf front"}
    # The wall is to the radar's left, and both legs see it: nothing of these paths is far below the
    # direct one.
    assert paths["side > body"]["over_noise_db"] > paths["body"]["over_noise_db"] - 10
    kept = {item["name"]: item for item in summary["room"]["clutter"]["kept"]}
    assert kept["side"]["kind"] == "mirror"
    # A conducting mirror d = 1.5 m to the left sends the field 1 / (2 d), that of sqrt(4 pi) / (2
    # d) for |F| / (R1 R2); 10 % in power for antennas some 5 cm from the array's middle.
    assert kept["side"]["power_m2"] == pytest.approx(4 * np.pi / (2 * 1.5) ** 2, rel=0.1)
    pictures = {"plan.png", "clutter_removal.png", "range_azimuth_walls.png"}
    for picture in pictures:
        assert (tmp_path / "out" / picture).stat().st_size > 1000
    with h5py.File(tmp_path / "out" / "maps.h5") as maps:
        window = int(
            np.abs(maps["time"][:] - maps["range_doppler_received"].attrs["time_s"]).argmin()
        )
        before, after = maps["range_doppler_received"][:], maps["range_doppler"][window]
        still = before.shape[1] // 2
        wall = int(np.argmin(np.abs(RADAR.range_m - 1.5)))
        assert before[wall, still] > 1e4 * after[wall, still]
        # What moves stays: beyond the bins beside zero both maps are the same.
        np.testing.assert_allclose(
            before[:, : still - 2], after[:, : still - 2], rtol=1e-2, atol=1e-6 * before.max()
        )
    # Without a room they would be of another run than all else.
    rt.run(motion, RADAR, out=tmp_path / "out", fidelity="analytic", pfa=1e-4)
    assert {path.name for path in (tmp_path / "out").glob("*.png")}.isdisjoint(pictures)


def test_a_ghost_is_as_far_as_the_person_mirrored(room: rt.Scene) -> None:
    radar = room.place(RADAR)
    body = Body.from_motion(place(rt.synthetic_motion("punch", seed=0, duration_s=0.2)))
    model = build_model("analytic", radar, body, scene=room)
    found = {ghost.path: ghost for ghost in ghosts(model, radar, 0.1)}
    assert set(found) == {"side > body", "body > side", "shelf front > body", "body > shelf front"}
    # The shelf is 2.5 m behind.
    behind = [found.pop("shelf front > body"), found.pop("body > shelf front")]
    assert min(ghost.range_m for ghost in behind) > max(ghost.range_m for ghost in found.values())
    # Mean of the straight way to the body and that to its image in y = 2.5, less the surface's few
    # centimetres.
    place_of_radar, person = np.array([-4, 1, 1.0]), body.at([0.1]).centres[0].mean(axis=0)
    image = person * [1, -1, 1] + [0, 5, 0]
    expected = (
        np.linalg.norm(person - place_of_radar) + np.linalg.norm(image - place_of_radar)
    ) / 2
    for ghost in found.values():
        assert ghost.range_m == pytest.approx(expected, abs=0.15)
    # What comes back over the wall comes from the image, what goes out over it from the person.
    seen = found["body > side"].azimuth_rad, found["side > body"].azimuth_rad
    for angle, target in zip(seen, (image, person), strict=True):
        way = target - place_of_radar
        assert angle == pytest.approx(np.arcsin(way[1] / np.linalg.norm(way)), abs=np.radians(4))


def test_what_has_no_meaning_in_a_room_is_refused_before_anything_is_written(
    tmp_path: Path, room: rt.Scene
) -> None:
    motion = rt.synthetic_motion("punch", seed=0, duration_s=0.2)
    for given, word in (
        ({"fidelity": "analytic", "spreading": False}, "free space only"),
        ({"fidelity": "analytic", "model_options": {"tolerance_db": 1.0}}, "tolerance_db"),
        ({"fidelity": "analytic", "clutter_removal": "magic"}, "magic"),
    ):
        with pytest.raises(InputError, match=word) as caught:
            rt.run(motion, RADAR, room, out=tmp_path / "out", **given)  # type: ignore[arg-type]
        assert "\n" not in str(caught.value)
        assert not (tmp_path / "out").exists()
