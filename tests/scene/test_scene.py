"""Scenes by name and from files."""

from __future__ import annotations

import dataclasses
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scene import Furniture, Scene, Wall, material
from rtradar.system.registries import scene_files


def refusal(source: str | Path) -> str:
    with pytest.raises(InputError) as caught:
        Scene.load(source)
    message = str(caught.value)
    assert "\n" not in message
    return message


def write(folder: Path, text: str | bytes) -> Path:
    file = folder / "attic.toml"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return file


def test_free_space_is_the_default() -> None:
    scene = Scene.load("free-space")
    assert scene.name == "free-space" == Scene().name
    assert "nothing but the person" in scene.description


@pytest.mark.parametrize("file", scene_files().values(), ids=scene_files())
def test_every_scene_that_comes_along_loads_by_its_name(file: Path) -> None:
    assert Scene.load(file.stem) == Scene.load(file) == Scene.load(str(file))


def test_a_file(tmp_path: Path) -> None:
    file = write(tmp_path, 'name = "loft"\ndescription = "ivory"')
    assert Scene.load(file) == Scene(name="loft", description="ivory")
    assert Scene.load(write(tmp_path, "")).name == "attic"


@pytest.mark.parametrize(
    "name", ["ballroom", "", "free-space.tml", "Free-Space", "no/such/place", "nul\0l"]
)
def test_unknown_name(name: str) -> None:
    message = refusal(name)
    assert f"scene {name!r} is unknown" in message
    assert "free-space" in message


WALL = Wall(
    name="screen",
    corner_m=(-3.0, 0.0, 0.0),
    edge_u_m=(0.0, 0.0, 2.5),
    edge_v_m=(0.0, 4.0, 0.0),
    material=material("plasterboard"),
    thickness_m=0.0125,
)
CHAIR = Furniture(name="chair", mesh="chair", material=material("wood"), position_m=(1.0, 2.0, 0.0))


def test_a_scene_is_a_value() -> None:
    scene = Scene(name="x", walls=(WALL,), furniture=(CHAIR,))
    assert scene == Scene(name="x", walls=(WALL,), furniture=(CHAIR,))
    assert len({scene, Scene(name="x", walls=(WALL,), furniture=(CHAIR,)), Scene()}) == 2
    assert [made.name for made in scene.materials] == ["plasterboard", "wood"]


@pytest.mark.parametrize(
    "fields",
    [
        {"description": None},
        {"walls": (WALL, WALL)},
        {"walls": ("wall",)},
        {"furniture": (CHAIR, CHAIR)},
        {"furniture": (WALL,)},
        {"radar_position_m": (1, 2, float("nan"))},
        {"heading_deg": "90"},
    ],
)
def test_a_scene_without_meaning(fields: dict[str, Any]) -> None:
    with pytest.raises(InputError) as caught:
        Scene(**fields)
    assert "\n" not in str(caught.value)


def test_the_radar_stands_where_the_scene_says() -> None:
    radar = Radar.preset("paper-12ghz")
    assert Scene(walls=(WALL,), furniture=(CHAIR,)).place(radar) is radar
    placed = Scene(radar_position_m=(-2, 0, 1.5)).place(radar)
    assert placed.position_m == (-2.0, 0.0, 1.5)
    assert placed.bandwidth_hz == radar.bandwidth_hz
    # It is now said where it stands.
    assert Scene(radar_position_m=(-1, 0, 1)).place(placed).position_m == (-2.0, 0.0, 1.5)


def test_a_radar_of_which_it_is_said_stays_where_it_is(tmp_path: Path) -> None:
    scene = Scene(radar_position_m=(-2, 0, 1.5), radar_yaw_deg=5, radar_pitch_deg=-10)
    given = dataclasses.replace(Radar.preset("iwr6843"), position_m=(-4, 1, 1), pitch_deg=-30)
    placed = scene.place(dataclasses.replace(given, name="mine"))
    assert placed.position_m == (-4.0, 1.0, 1.0)
    assert (placed.yaw_deg, placed.pitch_deg) == (5.0, -30.0)
    file = tmp_path / "own.toml"
    file.write_text('base = "iwr6843"\nposition_m = [-3, 0, 2]\n')
    assert scene.place(Radar.load(file)).position_m == (-3.0, 0.0, 2.0)
    # Another field that is replaced says nothing of the place.
    other = dataclasses.replace(Radar.preset("iwr6843"), bandwidth_hz=1e9)
    assert scene.place(other).position_m == (-2.0, 0.0, 1.5)
    assert scene.place(pickle.loads(pickle.dumps(other))).position_m == (-2.0, 0.0, 1.5)


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        # The front of the screen looks along -x, so its slab is at -3 to -2.9875 m.
        (
            {"walls": (WALL,), "radar_position_m": (-2.995, 1.0, 1.0)},
            "antennas inside wall 'screen'",
        ),
        ({"furniture": (CHAIR,), "radar_position_m": (1.0, 2.0, 1.3)}, "'chair' is 0."),
        ({"furniture": (CHAIR,), "radar_position_m": (0.5, 2.0, 0.5)}, "0.3 m or more are needed"),
    ],
)
def test_places_that_the_radar_cannot_have(fields: dict[str, Any], reason: str) -> None:
    with pytest.raises(InputError) as caught:
        Scene(name="x", **fields).place(Radar.preset("paper-12ghz"))
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_materials_must_be_known_over_the_whole_sweep() -> None:
    brick = Scene(name="x", walls=(dataclasses.replace(WALL, material=material("brick")),))
    brick.place(Radar.preset("paper-12ghz"))
    with pytest.raises(InputError, match="scene 'x', screen: material 'brick' at 77 GHz"):
        brick.place(Radar.preset("paper-77ghz"))
    # 38 to 42 GHz: known where it begins, not where it ends.
    with pytest.raises(InputError, match="'brick' at 42 GHz"):
        brick.place(dataclasses.replace(Radar.preset("paper-12ghz"), start_frequency_hz=38e9))


def test_meshes_are_read_by_a_library_that_loads_when_the_first_one_is() -> None:
    code = (
        "import sys, rtradar, rtradar.scene; rtradar.Scene.load('free-space'); "
        "assert 'trimesh' not in sys.modules; "
        "rtradar.Scene.load('bedroom'); assert 'trimesh' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
