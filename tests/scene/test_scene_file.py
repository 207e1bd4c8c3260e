"""Scene files: what they can say, and one line about everything else."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtradar.errors import InputError, ValidityWarning
from rtradar.radar import Radar
from rtradar.scene import Scene
from rtradar.system.registries import scene_files

HEAD = "[radar]\nposition_m = [-4, 1, 1]\n[person]\nposition_m = [0.5, 0]\nheading_deg = 30\n"
ROOM = """
[room]
size_m = [6, 4, 2.5]
corner_m = [-4.5, -2]
[room.walls]
material = "plasterboard"
thickness_m = 0.0125
[room.floor]
material = "concrete"
thickness_m = 0.2
roughness_m = 0.001
[room.ceiling]
material = "ceiling-board"
thickness_m = 0.02
"""
WALL = """
[[walls]]
name = "screen"
corner_m = [1, 0, 0]
edge_u_m = [0, 2, 0]
edge_v_m = [0, 0, 2]
material = "glass"
thickness_m = 0.006
"""
FURNITURE = """
[[furniture]]
name = "seat"
mesh = "chair"
material = "wood"
position_m = [1, 1, 0]
"""
MATERIAL = """
[materials.felt]
source = "a table of mine"
low_hz = 10e9
high_hz = 80e9
a = 1.3
c = 0.001
d = 1.0
"""


def load(folder: Path, text: str) -> Scene:
    (folder / "attic.toml").write_text(text)
    return Scene.load(folder / "attic.toml")


def refusal(folder: Path, text: str) -> str:
    with pytest.raises(InputError) as caught:
        load(folder, text)
    message = str(caught.value)
    assert "\n" not in message
    assert "attic.toml'" in message
    return message


def test_everything(tmp_path: Path) -> None:
    scene = load(tmp_path, HEAD + ROOM + WALL + FURNITURE.replace('"wood"', '"felt"') + MATERIAL)
    assert scene.name == "attic"
    assert scene.radar_position_m == (-4, 1, 1)
    assert scene.person_position_m == (0.5, 0)
    assert scene.heading_deg == 30
    assert [wall.name for wall in scene.walls] == [
        "near",
        "far",
        "right",
        "left",
        "floor",
        "ceiling",
        "screen",
    ]
    assert scene.walls[4].roughness_m == 0.001
    assert scene.walls[0].roughness_m == 0
    assert scene.furniture[0].material.source == "a table of mine"
    assert scene.furniture[0].material.eta(10e9).real == pytest.approx(1.3)


def test_one_side_of_a_room_may_differ(tmp_path: Path) -> None:
    scene = load(tmp_path, ROOM + '[room.far]\nmaterial = "glass"\nthickness_m = 0.01\n')
    assert {wall.name: wall.material.name for wall in scene.walls} == {
        **dict.fromkeys(("near", "right", "left"), "plasterboard"),
        "far": "glass",
        "floor": "concrete",
        "ceiling": "ceiling-board",
    }


def test_a_mesh_beside_the_file(tmp_path: Path) -> None:
    (tmp_path / "things").mkdir()
    trimesh.creation.box((300.0, 200.0, 100.0)).export(tmp_path / "things" / "box.glb")
    own = (
        FURNITURE.replace('"chair"', '"things/box.glb"')
        + "metres_per_unit = 0.001\nyaw_deg = 90\nscale = 2\n"
    )
    scene = load(tmp_path, own)
    size = np.ptp(scene.furniture[0].triangles().vertices, axis=0)
    np.testing.assert_allclose(size, (0.4, 0.6, 0.2))
    # The same from another place: paths belong to the scene file, not to where Python runs.
    shutil.move(tmp_path / "things", tmp_path / "gone")
    assert "No such file" in refusal(tmp_path, own)


@pytest.mark.parametrize(
    "mesh",
    [
        "../box.ply",
        "/tmp/box.ply",
        "a/../../box.ply",
        "nul\\u0000l.ply",
        "link/box.ply",
        "loop/box.ply",
    ],
)
def test_no_mesh_from_elsewhere(tmp_path: Path, mesh: str) -> None:
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "link").symlink_to(tmp_path)
    (tmp_path / "scene" / "loop").symlink_to(tmp_path / "scene" / "loop")
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "box.ply")
    message = refusal(
        tmp_path / "scene", FURNITURE.replace('"chair"', f'"{mesh}"') + "metres_per_unit = 1\n"
    )
    assert "leaves the folder" in message or "mesh = " in message or "loop" in message


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("room = 3", ["room = 3", "[room]"]),
        (ROOM.replace("size_m = [6, 4, 2.5]\n", ""), ["[room] size_m is missing"]),
        (ROOM.replace("[6, 4, 2.5]", "[6, 4]"), ["size_m = [6, 4]", "3 numbers"]),
        (ROOM.replace("[room.floor]", "[room.roof]"), ["[room] unknown key 'roof'", "floor"]),
        (
            ROOM.replace("[room.walls]", "[room.far]"),
            ["[room.near], or [room.walls] for all four is missing"],
        ),
        (
            ROOM.replace('"concrete"', '"concreet"'),
            ["[room.floor]", "'concreet'", "concrete", "[materials.NAME]"],
        ),
        (
            ROOM.replace("thickness_m = 0.2\n", "thicknes_m = 0.2\n"),
            ["[room.floor] unknown key 'thicknes_m'"],
        ),
        ("walls = 3", ["walls = 3", "[[walls]]"]),
        (
            WALL.replace("[0, 2, 0]", "[0, 2, 1]"),
            ["[[walls]] number 1", "'screen'", "right angles"],
        ),
        (WALL + WALL, ["two of the name 'screen'"]),
        (ROOM + WALL.replace("screen", "far"), ["two of the name 'far'"]),
        (WALL.replace('"glass"', "7"), ["[[walls]] number 1", "material = 7"]),
        (
            FURNITURE.replace('"chair"', '"throne"'),
            ["[[furniture]] number 1", "'throne'", "sofa", ".ply"],
        ),
        (FURNITURE.replace('"chair"', '"throne.fbx"'), ["throne.fbx", ".glb"]),
        (FURNITURE.replace('"chair"', '"throne.ply"'), ["metres_per_unit is missing"]),
        (FURNITURE.replace('"chair"', "[]"), ["[[furniture]] number 1", "mesh = []"]),
        (FURNITURE + "yaw = 2", ["unknown key 'yaw'", "yaw_deg"]),
        (FURNITURE.replace('name = "seat"\n', ""), ["[[furniture]] number 1 name is missing"]),
        (
            MATERIAL.replace('source = "a table of mine"\n', ""),
            ["[materials.felt] source is missing"],
        ),
        (MATERIAL.replace("felt", "glass"), ["'glass'", "ITU-R P.2040-3", "another"]),
        (MATERIAL.replace("a = 1.3", "a = 0.3"), ["'felt'", "1 or more"]),
        ("[materials]\nfelt = 3", ["materials.felt = 3", "[materials.felt]"]),
        ("[radar]\nposition_m = [0, 0]", ["[radar] position_m = [0, 0]", "3 numbers"]),
        ("[radar]\nyaw = 3\nposition_m = [0, 0, 0]", ["[radar] unknown key 'yaw'"]),
        ("[radar]", ["[radar] position_m is missing"]),
        ("[person]\nposition_m = [0]", ["[person] position_m = [0]"]),
        ("person = []", ["person = []", "[person]"]),
    ],
)
def test_mistakes(tmp_path: Path, text: str, parts: list[str]) -> None:
    message = refusal(tmp_path, text)
    for part in parts:
        assert part in message


def test_meshes_are_judged_when_the_scene_is_read(tmp_path: Path) -> None:
    (tmp_path / "bad.ply").write_text("ply\n")
    assert "bad.ply' is broken" in refusal(
        tmp_path, FURNITURE.replace('"chair"', '"bad.ply"') + "metres_per_unit = 1\n"
    )
    thin = FURNITURE.replace('"chair"', '"trihedral"')
    assert "'wood' of a thin sheet; allowed: metal" in refusal(tmp_path, thin)


def test_a_file_that_is_no_scene_by_its_size(tmp_path: Path) -> None:
    assert "1001 times; 1000 are allowed" in refusal(tmp_path, "[[walls]]\n" * 1001)


@pytest.mark.parametrize(
    "text",
    [
        "a" * 500 + " = 1",
        '"a\\nb" = 1',
        '["x\\ny"]',
        'room = "\\n"',
        "a = " + "[" * 900,
        "a = " + "9" * 5000,
        '[materials."a\\nb"]\na = 1',
    ],
)
def test_long_and_broken_lines_stay_one_line(tmp_path: Path, text: str) -> None:
    assert len(refusal(tmp_path, text)) < 1000


# -- anything at all -------------------------------------------------------------------------------

_WORDS = st.sampled_from(
    ["chair", "trihedral", "concrete", "metal", "felt", "../x.ply", "x.ply", "", "\n", "near"]
)
_VALUES = st.recursive(
    st.one_of(
        st.integers(-3, 3), st.integers(), st.floats(), st.booleans(), _WORDS, st.text(max_size=3)
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=6,
)
_WHOLE = tomllib.loads(HEAD + ROOM + WALL + FURNITURE + MATERIAL)


def _changed(data: st.DataObject, table: Any) -> Any:
    """A table in which some entry, at any depth, is anything; at times one is left out or new."""
    items = list(table.items() if isinstance(table, dict) else enumerate(table))
    key, value = data.draw(st.sampled_from(items))
    deeper = isinstance(value, dict | list) and value and data.draw(st.booleans())
    found = dict(items)
    found[key] = _changed(data, value) if deeper else data.draw(_VALUES)
    if data.draw(st.integers(0, 9)) == 0:
        del found[key]
    if isinstance(table, list):
        return list(found.values())
    return found | data.draw(st.dictionaries(st.sampled_from(["name", "other"]), _VALUES))


def _toml(value: Any) -> str:
    """TOML of a value, tables inline; what TOML cannot say is left to the reader to refuse."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return (
            "{" + ", ".join(f"{_toml(key)} = {_toml(inner)}" for key, inner in value.items()) + "}"
        )
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(letter):08x}" for letter in value) + '"'
    return str(value)


def _only_input_errors(folder: Path, content: bytes) -> None:
    file = folder / "fuzz.toml"
    file.write_bytes(content)
    try:
        Scene.load(file)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017  both ways out are right
        assert str(error).isprintable()  # noqa: PT017


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=80
)
@given(data=st.data())
def test_any_table_gives_a_scene_or_one_line(tmp_path: Path, data: st.DataObject) -> None:
    table = _WHOLE
    for _ in range(data.draw(st.integers(1, 3))):
        table = _changed(data, table) or _WHOLE
    text = "\n".join(f"{key} = {_toml(value)}" for key, value in table.items())
    _only_input_errors(tmp_path, text.encode("utf-8", "surrogatepass"))


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=50
)
@given(data=st.data())
def test_any_damage_gives_a_scene_or_one_line(tmp_path: Path, data: st.DataObject) -> None:
    whole = bytearray(scene_files()["bathroom"].read_bytes())
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(whole) - 1))
        whole[at : at + data.draw(st.integers(0, 6))] = data.draw(st.binary(max_size=4))
    _only_input_errors(tmp_path, bytes(whole))


def test_a_box_stands_on_its_position(tmp_path: Path) -> None:
    table = '[[furniture]]\nname = "cabinet"\nmaterial = "metal"\nposition_m = [1, 2, 0.1]\n'
    file = tmp_path / "a.toml"
    file.write_text(table + "box = [0.8, 0.4, 1.9]\n")
    (cabinet,) = Scene.load(file).furniture
    box = cabinet.triangles()
    assert box.closed
    np.testing.assert_allclose(box.vertices.min(axis=0), [0.6, 1.8, 0.1])
    np.testing.assert_allclose(box.vertices.max(axis=0), [1.4, 2.2, 2.0])
    for more, says in (
        ("", r"give a mesh, or box = \[x, y, z\]"),
        ("box = [1, 1, 1]\nmesh = 'bed'", "one of them"),
        ("box = 3", "box = 3; it must be"),
        ("box = [1, 1]", "box = .* 3 numbers"),
        ("box = [1, 1, 0]", "3 numbers, lengths"),
        ("box = [1, 1, 1]\nmetres_per_unit = 0.01", "both settled"),
    ):
        file.write_text(f"{table}{more}\n")
        with pytest.raises(InputError, match=says):
            Scene.load(file)


def test_a_radar_is_turned_as_the_scene_says(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text("[radar]\nposition_m = [0, 0, 2.6]\npitch_deg = -90\n")
    placed = Scene.load(file).place(Radar(roll_deg=3))
    assert (placed.position_m, placed.pitch_deg, placed.roll_deg) == ((0.0, 0.0, 2.6), -90.0, 3.0)


def test_a_radar_at_its_own_position_outside_of_the_room_is_warned_of(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text(
        "[room]\nsize_m = [2, 2, 2.5]\ncorner_m = [-1, -1]\n[room.walls]\n"
        'material = "concrete"\nthickness_m = 0.1\n[room.floor]\nmaterial = "concrete"\n'
        'thickness_m = 0.1\n[room.ceiling]\nmaterial = "concrete"\nthickness_m = 0.1\n'
    )
    with pytest.warns(ValidityWarning, match="its own position, is outside of the room"):
        Scene.load(file).place(Radar())
