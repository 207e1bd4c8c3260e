"""``view.npz``: what is written is read again, and nothing else is taken for it."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rtradar as rt
from rtradar.report.snapshots import Snapshots, load_snapshots, save_snapshots

pytestmark = pytest.mark.drawn


def example() -> Snapshots:
    rng = np.random.default_rng(0)
    return Snapshots(
        times=np.array([0.1, 0.2]),
        window=np.array([0, 4]),
        part_names=np.array(["head", "left foot", "neck"]),
        poses=rng.normal(size=(2, 3, 4, 3)).astype(np.float32),
        path_names=np.array(["body", "body > floor"]),
        echo_path=np.array([0, 0, 1, 1]),
        echo_part=np.array([0, 1, 2, 0]),
        echo_bounces=np.array([1, 1, 2, 2]),
        range_m=rng.uniform(2, 5, (2, 4)),
        velocity_mps=rng.normal(size=(2, 4)),
        power_m2=rng.uniform(size=(2, 4)),
        corners=np.full((2, 4, 2, 3), np.nan, dtype=np.float32),
        wall_names=np.array([], dtype=np.str_),
        walls=np.zeros((0, 4, 3)),
        furniture_names=np.array(["chair"]),
        furniture_vertices=np.eye(3, dtype=np.float32),
        furniture_faces=np.array([[0, 1, 2]]),
        furniture_piece=np.array([0, 0, 0]),
        part_person=np.array([0, 0, 1]),
        person_names=np.array(["walk", "kick"]),
        person_position=np.zeros((2, 2, 3)),
        person_speed=np.ones((2, 2)),
        object_names=np.array(["fan"]),
        mesh_source=np.array([2]),
        mesh_faces=np.array([[0, 1, 2]]),
        mesh_of_vertex=np.array([0, 0, 0]),
        mesh_part=np.array([-1, -1, -1]),
        mesh_rows=np.tile(np.eye(4, 3, dtype=np.float32), (2, 1, 1)),
        blend_vertex=np.array([0, 1, 2]),
        blend_row=np.array([0, 1, 2]),
        blend_weight=np.array([1, 2, 3], dtype=np.float32),
    )


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    save_snapshots(tmp_path / "view.npz", example())
    found = load_snapshots(tmp_path / "view.npz")
    for field in fields(Snapshots):
        ours, read = getattr(example(), field.name), getattr(found, field.name)
        assert ours.dtype.kind == read.dtype.kind
        np.testing.assert_array_equal(ours, read)


def test_a_vertex_of_a_mesh_is_the_sum_of_its_rows() -> None:
    np.testing.assert_array_equal(example().mesh_vertices(1), np.diag([1.0, 2.0, 3.0]))
    assert example().sources == ["walk", "kick", "fan"]
    assert example().drawn_parts.all()


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("times", np.array([0.2, 0.1]), "ascend"),
        ("times", np.array([0.1, np.nan]), "NaN"),
        ("times", np.zeros(0), "length 0"),
        ("window", np.array([0.0, 1.0]), "int64"),
        ("poses", np.zeros((2, 3, 3, 3), dtype=np.float32), "axis 4 must have length 4"),
        ("poses", np.zeros((2, 4, 4, 3), dtype=np.float32), "length 3"),
        ("echo_part", np.array([0, 1, 2, 3]), "echo_part points at a part"),
        ("echo_path", np.array([0, -1, 1, 1]), "echo_path points at a path"),
        ("furniture_faces", np.array([[0, 1, 3]]), "points at a vertex"),
        ("part_person", np.array([0, 1, 2]), "part_person points at a person"),
        ("mesh_faces", np.array([[0, 1, 3]]), "mesh_faces points at a mesh vertex"),
        ("blend_row", np.array([0, 1, 4]), "blend_row points at a row"),
        ("mesh_source", np.array([3]), "mesh points at"),
        ("mesh_part", np.array([0, 1, 3]), "mesh points at"),
        ("power_m2", np.full((2, 4), -1.0), "negative"),
        ("walls", np.zeros((1, 4, 3)), "length 0"),
        ("part_names", np.array(["two\nlines", "b", "c"]), "holds what is no line of text"),
        ("range_m", np.full((2, 4), 1e300), "range_m holds a value above"),
        ("poses", np.full((2, 3, 4, 3), 1e300), "poses holds a value above"),
        ("times", np.array([0.1, 0.2], dtype=np.float16), "times holds float16"),
    ],
)
def test_refuses_what_has_no_meaning(field: str, value: Any, said: str) -> None:
    with pytest.raises(rt.InputError, match=said) as caught:
        replace(example(), **{field: value})
    assert "\n" not in str(caught.value)


def damage(path: Path, how: str) -> None:
    if how == "missing":
        path.unlink()
    elif how == "cut":
        path.write_bytes(path.read_bytes()[:300])
    elif how == "text":
        path.write_text("not an archive")
    else:
        with np.load(path) as arrays:
            content = {name: arrays[name] for name in arrays.files}
        content |= {
            "version": {"format": np.array(99)},
            "field": {},
            "pickle": {"walls": np.array([{}], dtype=object)},
            "shape": {"range_m": np.zeros((1, 4))},
            "vast": {"more": np.zeros(26_000_000)},
        }[how]
        if how == "field":
            del content["corners"]
        np.savez_compressed(path, **content)


def test_files_of_the_first_format_have_one_person(tmp_path: Path) -> None:
    first = replace(example(), part_names=np.array(["head", "left foot", "lower torso"]))
    later = [field.name for field in fields(Snapshots)][-13:]
    assert later[0] == "part_person"
    old = {name: value for name, value in vars(first).items() if name not in later}
    np.savez_compressed(tmp_path / "view.npz", format=np.array(1), **old)
    found = load_snapshots(tmp_path / "view.npz")
    assert found.sources == ["person"]
    np.testing.assert_array_equal(found.poses, first.poses)
    np.testing.assert_array_equal(found.person_position[:, 0], first.poses[:, 2, 0])
    apart = np.linalg.norm(np.diff(first.poses[:, 2, 0].astype(float), axis=0)) / 0.1
    np.testing.assert_allclose(found.person_speed, apart, rtol=1e-6)


@pytest.mark.parametrize("field", ["window", "walls", "furniture_piece"])
def test_files_of_the_first_format_have_all_that_it_had(tmp_path: Path, field: str) -> None:
    first = replace(example(), part_names=np.array(["head", "left foot", "lower torso"]))
    kept = {name: value for name, value in vars(first).items() if name != field}
    np.savez_compressed(tmp_path / "view.npz", format=np.array(1), **kept)
    with pytest.raises(rt.InputError, match="damaged"):
        load_snapshots(tmp_path / "view.npz")


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("missing", "is not there"),
        ("cut", "damaged"),
        ("text", "damaged"),
        ("field", "damaged"),
        ("pickle", "damaged"),
        ("version", "another version"),
        ("shape", "range_m has shape"),
        ("vast", "claims more than 200 MB"),
    ],
)
def test_refuses_what_is_no_such_file(tmp_path: Path, how: str, said: str) -> None:
    path = tmp_path / "view.npz"
    save_snapshots(path, example())
    damage(path, how)
    with pytest.raises(rt.InputError, match=said) as caught:
        load_snapshots(path)
    assert "rtradar run" in str(caught.value)
    assert "\n" not in str(caught.value)
