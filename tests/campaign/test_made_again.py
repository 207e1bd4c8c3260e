"""A data set says what it was made from, and is made again from its own folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import rtradar as rt
from rtradar.campaign import build_dataset
from rtradar.campaign.samples import plan_samples
from rtradar.campaign.spec_file import read_spec
from rtradar.errors import InputError
from rtradar.motion.formats import save_motion
from rtradar.system.checks import read_toml

SPEC = """
folder = "recordings"
[windows]
duration_s = 0.2
[each]
radar = ["small.toml"]
scene = ["rooms/own.toml"]
fidelity = ["analytic"]
[[synthetic]]
label = "kick"
count = 1
[[recordings]]
file = "{label}.motion"
"""
ROOM = 'name = "own"\n[person]\nposition_m = [0.2, 0.1]\n'


@pytest.fixture(scope="module")
def spec(small_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A specification with a radar, a scene and a recording of its own."""
    folder = tmp_path_factory.mktemp("spec")
    for name in ("recordings", "rooms"):
        (folder / name).mkdir()
    shutil.copy(small_file, folder / "small.toml")
    (folder / "rooms/own.toml").write_text(ROOM)
    save_motion(folder / "recordings/walk.motion", rt.synthetic_motion("walk", duration_s=0.4))
    (folder / "own.toml").write_text(SPEC)
    return folder / "own.toml"


@pytest.fixture
def made(spec: Path, tmp_path: Path, here: None) -> Path:
    """The folder of the data set of `spec`, elsewhere."""
    out = tmp_path / "data/set"
    build_dataset(spec, out)
    return out


def clouds(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.npz")}


def test_the_same_bytes_from_its_own_folder(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = read_toml(made / "collection.toml", "", "")["files"]
    names = {Path(entry["path"]).name for entry in listed}
    assert names == {"small.toml", "own.toml", "walk.motion"}
    monkeypatch.chdir(tmp_path)
    build_dataset(Path("data/set/collection.toml"), Path("again"))
    assert clouds(tmp_path / "again") == clouds(made)
    assert len(clouds(made)) == 2
    # What it was made from is the same, wherever it lies.
    third = tmp_path / "deep/er/third"
    build_dataset(tmp_path / "again/collection.toml", third)
    assert clouds(third) == clouds(made)


@pytest.mark.parametrize("name", ["recordings/walk.motion", "rooms/own.toml", "small.toml"])
def test_a_file_that_has_changed_is_refused(spec: Path, made: Path, name: str) -> None:
    file = spec.parent / name
    before = file.read_bytes()
    file.write_bytes(before + b"\n")
    try:
        with pytest.raises(InputError, match="has changed since; give the one that it was"):
            read_spec(made / "collection.toml")
        read_spec(made / "collection.toml", changed=True)
    finally:
        file.write_bytes(before)


def test_files_that_it_does_not_list_are_not_opened(spec: Path, made: Path) -> None:
    own = made / "collection.toml"
    own.write_text(own.read_text().replace("rooms/own.toml", "rooms/other.toml", 1))
    (spec.parent / "rooms/other.toml").write_text(ROOM)
    with pytest.raises(InputError, match=r"other\.toml' is not among its files"):
        read_spec(own)
    own.write_text(own.read_text() + "\n[[files]]\nsha256 = 1\n")
    for changed in (False, True):
        with pytest.raises(InputError, match="data set file"):
            read_spec(own, changed=changed)


def test_a_file_of_somebody_else_is_left_alone(spec: Path, tmp_path: Path, here: None) -> None:
    (tmp_path / "collection.toml").write_bytes(b"mine = \xff\n")
    with pytest.raises(InputError, match="is there, and not of rtradar"):
        build_dataset(spec, tmp_path)
    assert (tmp_path / "collection.toml").read_bytes() == b"mine = \xff\n"
    assert plan_samples(read_spec(spec))


def test_shards_together_are_the_whole(spec: Path, made: Path, tmp_path: Path, here: None) -> None:
    folders = [tmp_path / str(number) for number in (1, 2)]
    for number, folder in enumerate(folders, start=1):
        assert build_dataset(spec, folder, shard=(number, 2))["made"] == 1
    assert clouds(folders[0]) | clouds(folders[1]) == clouds(made)
    assert len(rt.Collection(*folders)) == len(rt.Collection(made))
    # Its own folder makes the share again.
    build_dataset(folders[1] / "collection.toml", tmp_path / "again")
    assert clouds(tmp_path / "again") == clouds(folders[1])
    with pytest.raises(InputError, match="shard 3 of 3 is empty: there are 2 samples"):
        build_dataset(spec, tmp_path / "third", shard=(3, 3))
    with pytest.raises(InputError, match="it must be a number and a count"):
        build_dataset(spec, tmp_path / "third", shard=(0, 3))
    assert not (tmp_path / "third").exists()
