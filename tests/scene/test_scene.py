"""Scenes by name and from files."""

from __future__ import annotations

from pathlib import Path

import pytest

from rtradar.errors import InputError
from rtradar.scene import Scene
from rtradar.scene.scene import scenes_folder


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


@pytest.mark.parametrize("file", sorted(scenes_folder().glob("*.toml")), ids=lambda file: file.stem)
def test_every_scene_that_comes_along_loads_by_its_name(file: Path) -> None:
    assert Scene.load(file.stem) == Scene.load(file) == Scene.load(str(file))


def test_a_file(tmp_path: Path) -> None:
    file = write(tmp_path, 'name = "loft"\ndescription = "ivory"')
    assert Scene.load(file) == Scene(name="loft", description="ivory")
    assert Scene.load(write(tmp_path, "")).name == "attic"


@pytest.mark.parametrize("name", ["ballroom", "", "free-space.tml", "Free-Space", "no/such/place"])
def test_unknown_name(name: str) -> None:
    message = refusal(name)
    assert f"scene '{name}' is unknown" in message
    assert "free-space" in message


def test_missing_file(tmp_path: Path) -> None:
    message = refusal(tmp_path / "none.toml")
    assert "none.toml" in message
    assert "No such file" in message


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "folder.toml").mkdir()
    assert "folder.toml" in refusal(tmp_path / "folder.toml")


@pytest.mark.parametrize("text", ["name = ", "name", "\0", b"\xff\xfe", "[walls"])
def test_not_toml(tmp_path: Path, text: str | bytes) -> None:
    assert "attic.toml' is not TOML: " in refusal(write(tmp_path, text))


@pytest.mark.parametrize(("text", "key"), [('colour = "red"', "colour"), ("[walls]\nnorth = 3", "walls")])
def test_unknown_key(tmp_path: Path, text: str, key: str) -> None:
    message = refusal(write(tmp_path, text))
    assert f"unknown key '{key}'" in message
    assert "name, description" in message


@pytest.mark.parametrize("value", ["3", "true", '["x"]', "1.5"])
@pytest.mark.parametrize("key", ["name", "description"])
def test_values_are_strings(tmp_path: Path, key: str, value: str) -> None:
    message = refusal(write(tmp_path, f"{key} = {value}"))
    assert f"{key} = " in message
    assert "string" in message
