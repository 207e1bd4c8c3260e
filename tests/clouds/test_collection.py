"""Collections are read as written, equal samples give equal bytes, and damage is noticed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtradar.clouds import Collection, Sample
from rtradar.clouds.sample_files import INDEX, is_whole, sample_path, write_index, write_sample
from rtradar.errors import InputError

SPATIAL = np.arange(12.0).reshape(4, 3)


def sample(number: int, **provenance: Any) -> Sample:
    points = np.random.default_rng(number).random((5, 3))
    told = {"subject": f"s{number}", "seed": number, **provenance}
    return Sample(points, "walk" if number % 2 else "kick", told)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A collection of b, a and c."""
    for number, name in enumerate("bac"):
        write_sample(tmp_path, name, sample(number, start_s=0.5 * number), SPATIAL[:number])
    write_index(tmp_path, "bac")
    return tmp_path


def test_samples_read_back_in_the_order_of_their_ids(folder: Path) -> None:
    found = Collection(folder)
    assert len(found) == 3
    assert found.ids == ("a", "b", "c")
    assert found.labels.tolist() == ["walk", "kick", "kick"]
    assert found.column("start_s").tolist() == [0.5, 0.0, 1.0]
    assert found.column("subject").tolist() == ["s1", "s0", "s2"]
    expected = sample(1, start_s=0.5)
    np.testing.assert_array_equal(found[0].points, expected.points)
    assert (found[0].label, found[0].provenance) == (expected.label, expected.provenance)
    np.testing.assert_array_equal(found.points(0), expected.points)
    assert [found.spatial(index).shape for index in range(3)] == [(1, 3), (0, 3), (2, 3)]
    assert found.spatial(0).dtype == np.float64


def test_a_column_of_lists_is_one_dimensional(tmp_path: Path) -> None:
    for number, name in enumerate("ab"):
        write_sample(tmp_path, name, sample(number, place=[0.0, 1.0]), SPATIAL)
    write_index(tmp_path, "ab")
    assert Collection(tmp_path).column("place").shape == (2,)


def test_folders_are_joined_one_after_the_other(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    other = tmp_path_factory.mktemp("other")
    write_sample(other, "A", sample(3, start_s=2.0, tempo=1.5), SPATIAL)
    write_index(other, ["A"])
    found = Collection(folder, other)
    assert found.ids == ("a", "b", "c", "A")
    assert found.column("subject").tolist() == ["s1", "s0", "s2", "s3"]
    assert found.column("tempo").tolist() == [None, None, None, 1.5]
    np.testing.assert_array_equal(found.points(3), sample(3).points)
    with pytest.raises(InputError, match="no sample has 'colour'; there are: seed, start_s, sub"):
        found.column("colour")


def test_a_sample_in_two_folders_is_refused(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    other = tmp_path_factory.mktemp("other")
    write_sample(other, "b", sample(0), SPATIAL)
    write_index(other, ["b"])
    with pytest.raises(InputError, match="1 samples are in more than one"):
        Collection(folder, other)
    with pytest.raises(InputError, match="at least one"):
        Collection()


def test_nothing_is_read_of_the_clouds_until_it_is_asked_for(folder: Path) -> None:
    found = Collection(folder)
    for path in folder.glob("*.npz"):
        path.unlink()
    assert found.labels.tolist() == ["walk", "kick", "kick"]
    with pytest.raises(InputError, match=r"a\.npz' is damaged"):
        found.points(0)


def test_the_same_sample_is_the_same_bytes(tmp_path: Path) -> None:
    for name, told in (("a", {"x": 1, "y": 2}), ("b", {"y": 2, "x": 1})):
        write_sample(tmp_path, name, sample(1, **told), SPATIAL)
    assert sample_path(tmp_path, "a").read_bytes() == sample_path(tmp_path, "b").read_bytes()


def test_a_sample_is_an_archive_that_numpy_reads(folder: Path) -> None:
    with np.load(folder / "a.npz", allow_pickle=False) as archive:
        assert sorted(archive) == ["about", "points", "spatial"]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
@given(place=st.floats(0, 1, exclude_max=True), flip=st.integers(1, 255))
def test_any_byte_that_changed_is_damage(folder: Path, place: float, flip: int) -> None:
    content = bytearray((folder / "a.npz").read_bytes())
    content[int(place * len(content))] ^= flip
    (folder / "changed.npz").write_bytes(content)
    assert is_whole(folder / "a.npz")
    assert not is_whole(folder / "none.npz")
    assert not is_whole(folder / "changed.npz")


@pytest.mark.parametrize("length", [0, 1, 64, 100, 600, -1])
def test_a_file_cut_short_is_damage(folder: Path, length: int) -> None:
    content = (folder / "a.npz").read_bytes()
    (folder / "a.npz").write_bytes(content[:length])
    assert not is_whole(folder / "a.npz")
    with pytest.raises(InputError, match=r"a\.npz' is damaged; mend the collection with: rtr"):
        Collection(folder)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda folder: (folder / "a.npz").unlink(), r"1 of 3 samples are missing"),
        (lambda folder: (folder / INDEX).unlink(), r"no collection \(collection.json: No such f"),
        (lambda folder: (folder / INDEX).write_text("{"), r"collection.json' is damaged"),
        (
            lambda folder: (folder / INDEX).write_text('{"format": 99, "samples": []}'),
            r"no index of format 1",
        ),
    ],
)
def test_what_is_no_collection_is_refused_in_one_line(folder: Path, spoil: Any, says: str) -> None:
    spoil(folder)
    with pytest.raises(InputError, match=says) as caught:
        Collection(folder)
    assert "\n" not in str(caught.value)


def test_a_disk_that_is_full_leaves_the_folder_as_it_was(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    for name in ("a", "new"):
        with pytest.raises(InputError, match="No space left on device"):
            write_sample(folder, name, sample(7), SPATIAL)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_a_changed_coordinate_is_found_when_it_is_read(folder: Path) -> None:
    path = folder / "a.npz"
    content = path.read_bytes()
    number = sample(1).points[2, 1].tobytes()
    assert content.count(number) == 1
    path.write_bytes(content.replace(number, bytes(8)))
    with pytest.raises(InputError, match=r"a\.npz' is damaged"):
        Collection(folder).points(0)
