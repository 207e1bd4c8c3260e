"""Faces of furniture: which there are, and what is seen over them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from rtradar.radar import Radar
from rtradar.scatter.echo_models import build_model
from rtradar.scatter.multipath.image_paths import faces_of, reflecting_faces
from rtradar.scene import Furniture, Scene, Wall, material, reflection
from rtradar.trace.backend import Backend

RADAR = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0)
PLACE = np.array(RADAR.position_m)


def block(folder: Path, size: tuple[float, float, float], made: str = "metal", **at: Any) -> Any:
    path = folder / "block.ply"
    trimesh.creation.box(size).export(path)
    return Furniture("block", path, material(made), metres_per_unit=1.0, **at)


def test_a_turned_block_has_six_faces_where_its_sides_are(tmp_path: Path) -> None:
    size, yaw, place = np.array([0.4, 1.0, 2.0]), 30.0, np.array([1.0, 2.0, 1.0])
    piece = block(tmp_path, tuple(size), yaw_deg=yaw, position_m=tuple(place))
    faces = {face.name: face for face in faces_of(piece)}
    turn = piece.axes
    for axis, (plus, minus) in enumerate((("front", "back"), ("left", "right"), ("top", "bottom"))):
        for sign, side in ((1, plus), (-1, minus)):
            face = faces.pop(f"block {side}")
            outward = sign * turn[:, axis]
            np.testing.assert_allclose(face.normal, outward, atol=1e-12)
            middle = place + outward * size[axis] / 2
            np.testing.assert_allclose(face.corners.mean(axis=0), middle, atol=1e-6)
            assert face.area_m2 == pytest.approx(np.prod(size) / size[axis], rel=1e-6)
            assert face.fraction == pytest.approx(1.0, abs=1e-6)
    assert not faces


def test_the_doors_of_the_wardrobe_are_one_face_and_a_lamp_has_none() -> None:
    wardrobe = Furniture("wardrobe", "wardrobe", material("wood"), position_m=(0, 0, 0), yaw_deg=30)
    front = next(face for face in faces_of(wardrobe) if face.name == "wardrobe front")
    # Three doors of 0.49 by 1.96 m with gaps between them, and where handles are.
    assert np.array(front.patches)[:, 2:].max(axis=1) == pytest.approx([1.96] * 3, abs=0.01)
    assert np.array(front.patches)[:, 2:].min(axis=1) == pytest.approx([0.49] * 3, abs=0.01)
    assert front.area_m2 == pytest.approx(1.49 * 1.96, rel=0.01)
    assert 0.97 < front.filled_m2 / front.area_m2 < 0.99
    lamp = Furniture("lamp", "lamp", material("metal"), position_m=(0, 0, 0))
    assert not [face for face in faces_of(lamp) if face.filled_m2 > 0.05]


def test_only_faces_over_which_the_body_is_seen_are_listed(tmp_path: Path, make: Any) -> None:
    # The front of the block looks at radar and body; nothing is seen over its other faces.
    body = make.one(centre=(0.0, 0.1, 1.1))
    for made, high, place, reason in (
        ("metal", 1.5, (-2.6, 2.2, 1.0), ""),
        # Out of the way.
        ("metal", 1.5, (-2.6, 2.2, 4.0), "nobody is seen"),
        ("vacuum", 1.5, (-2.6, 2.2, 1.0), "nobody is seen"),
        ("ceiling-board", 1.5, (-2.0, 30.0, 1.0), "dB below the direct echoes"),
        # 6 cm are less than a zone.
        ("metal", 0.06, (-2.6, 2.2, 1.0), "nobody is seen"),
    ):
        piece = block(tmp_path, (1.0, 0.3, high), made, position_m=place)
        faces, summaries = reflecting_faces(Scene(furniture=(piece,)), RADAR, PLACE, body, None)
        assert [face.wall.name for face in faces] == ([] if reason else ["block right"])
        reasons = {face.name: face.reason for face in summaries}
        assert len(reasons) == 6
        assert reason in reasons["block right"]
        assert reasons["block left"] == "looks away from the radar"


@pytest.mark.parametrize("made", ["perfect-conductor", "wood"])
def test_a_large_face_reflects_as_a_wall_of_the_same_material(
    made: str, tmp_path: Path, backend: Backend, make: Any
) -> None:
    # A block as large as a wall, in whose front the wall is; wood without end against a conductor.
    piece = block(tmp_path, (12.0, 0.4, 12.0), made, position_m=(-2.0, 2.2, 0.0))
    wall = Wall(
        name="wall",
        corner_m=(-8.0, 2.0, -6.0),
        edge_u_m=(12.0, 0.0, 0.0),
        edge_v_m=(0.0, 0.0, 12.0),
        material=material("perfect-conductor"),
        thickness_m=0.1,
    )
    body = make.one((0.1, 0.1, 0.1), (0.0, 0.3, 1.0))
    found = {}
    for name, scene in {
        "block right": Scene(furniture=(piece,)),
        "wall": Scene(walls=(wall,)),
    }.items():
        model = build_model("specular", RADAR, body, scene=scene, variant=backend.kind)
        assert [path.name for path in model.paths] == ["body", f"body > {name}", f"{name} > body"]
        echoes = model.echoes(np.arange(1))
        index = model.path_names.index(f"body > {name}")
        middle = echoes.amplitude.shape[0] // 2
        found[name] = echoes.length[0, 0, index], echoes.amplitude[middle, 0, 0, index]
    (length, amplitude), (expected, mirrored) = found.values()
    # The file holds the block in float32.
    assert length == pytest.approx(expected, abs=1e-7)
    # Body and radar are as high as each other: v is TE. The body turns the field with both alike.
    image = np.array([-4.0, 3.0, 1.0])
    way = np.array([0.0, 0.3, 1.0]) - image
    eta = piece.material.eta(RADAR.centre_frequency_hz)
    te = complex(reflection(eta, abs(way[1]) / np.linalg.norm(way), "te"))
    # The specular point on the body, 0.1 m from its middle, changes the angle by this.
    assert amplitude == pytest.approx(-np.conj(te) * mirrored, rel=0.02)
