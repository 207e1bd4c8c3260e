"""Meshes from files: what they give, and what is refused."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtradar.errors import InputError
from rtradar.scene import mesh_files
from rtradar.scene.mesh_files import MESH_ENDINGS, Triangles, mesh_names, read_mesh
from rtradar.system.files import shipped_folder


def cube() -> trimesh.Trimesh:
    return trimesh.creation.box((1.0, 2.0, 3.0))


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        read_mesh(path)
    message = str(caught.value)
    assert "\n" not in message
    assert path.name in message
    return message


def volume(mesh: Triangles) -> float:
    a, b, c = (mesh.corners[:, k] for k in range(3))
    return float(np.sum(np.einsum("ij,ij->i", a, np.cross(b, c))) / 6)


@pytest.mark.parametrize("ending", MESH_ENDINGS)
def test_every_kind_of_file(tmp_path: Path, ending: str) -> None:
    file = tmp_path / f"cube{ending}"
    cube().export(file)
    mesh = read_mesh(file)
    assert mesh.closed
    # STL repeats every corner and glb splits edges: each place is there once.
    assert mesh.vertices.shape == (8, 3)
    assert mesh.faces.shape == (12, 3)
    assert volume(mesh) == pytest.approx(6.0)
    assert not mesh.vertices.flags.writeable


OBJ = b"""# caf\xe9 \x85 v 9 9 9
mtllib caf\xe9.mtl
o caf\xe9
usemtl caf\xe9
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
g caf\xe9
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""
PLY_OF_TEXT = b"""ply
format ascii 1.0
comment TextureFile caf\xe9.png
comment caf\xe9
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 0 3 2
3 1 2 3
"""


def solid() -> trimesh.Trimesh:
    return trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    )


def stl_of_text() -> bytes:
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corner) for corner in face)
        + "endloop\nendfacet\n"
        for face in solid().triangles
    )
    return b"solid caf\xe9\n" + facets.encode() + b"endsolid caf\xe9\n"


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"], ids=["", "with a byte order mark"])
@pytest.mark.parametrize(
    ("ending", "content"),
    [
        ("obj", OBJ),
        ("obj", OBJ.replace(b"\xe9", "é".encode())),
        ("stl", stl_of_text()),
        ("stl", stl_of_text().replace(b"\n", b"\r\n")),
        ("ply", PLY_OF_TEXT),
    ],
    ids=["obj", "obj in UTF-8", "stl", "stl of Windows", "ply"],
)
def test_names_and_comments_may_be_in_any_encoding(
    tmp_path: Path, ending: str, content: bytes, mark: bytes
) -> None:
    path = tmp_path / f"x.{ending}"
    path.write_bytes(mark + content)
    mesh = read_mesh(path)
    assert mesh.closed
    assert volume(mesh) == pytest.approx(1 / 6)


@pytest.mark.parametrize("ending", ["stl", "ply"])
def test_headers_of_binary_files_may_be_in_any_encoding(tmp_path: Path, ending: str) -> None:
    solid().export(tmp_path / f"plain.{ending}")
    content = (tmp_path / f"plain.{ending}").read_bytes()
    if ending == "stl":
        content = b"solid caf\xe9".ljust(80, b"\xe9") + content[80:]
    else:
        content = content.replace(b"1.0\n", b"1.0\ncomment caf\xe9\n", 1)
    (tmp_path / f"x.{ending}").write_bytes(content)
    plain, other = (read_mesh(tmp_path / f"{name}.{ending}") for name in ("plain", "x"))
    np.testing.assert_array_equal(plain.corners, other.corners)


def test_a_package_that_trimesh_lacks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lacking(*words: object, **named: object) -> None:
        raise ModuleNotFoundError("No module named 'extra'", name="extra")

    monkeypatch.setattr(trimesh, "load_scene", lacking)
    cube().export(tmp_path / "cube.ply")
    assert (
        "takes the Python package 'extra'; install that, or save the mesh as binary PLY"
        in refusal(tmp_path / "cube.ply")
    )


def test_endings_in_capitals(tmp_path: Path) -> None:
    file = tmp_path / "CUBE.STL"
    cube().export(file, file_type="stl")
    assert read_mesh(file).closed


def test_inside_out_is_turned_round(tmp_path: Path) -> None:
    mesh = cube()
    mesh.invert()
    mesh.export(tmp_path / "cube.ply")
    assert volume(read_mesh(tmp_path / "cube.ply")) == pytest.approx(6.0)


def test_an_open_mesh_is_known(tmp_path: Path) -> None:
    mesh = cube()
    trimesh.Trimesh(mesh.vertices, mesh.faces[:-1], process=False).export(tmp_path / "open.ply")
    read = read_mesh(tmp_path / "open.ply")
    assert not read.closed
    assert len(read.faces) == 11


def test_faces_that_disagree(tmp_path: Path) -> None:
    mesh = cube()
    faces = np.array(mesh.faces)
    faces[3] = faces[3][::-1]
    trimesh.Trimesh(mesh.vertices, faces, process=False).export(tmp_path / "twisted.ply")
    assert "do not agree which side is outside" in refusal(tmp_path / "twisted.ply")


def test_pieces_of_a_glb_stand_where_its_nodes_put_them(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirror[0, 3] = 10.0
    scene.add_geometry(cube(), geom_name="cube")
    scene.add_geometry(cube(), geom_name="other", transform=mirror)
    scene.export(tmp_path / "two.glb")
    mesh = read_mesh(tmp_path / "two.glb")
    assert mesh.closed
    assert volume(mesh) == pytest.approx(12.0)
    np.testing.assert_allclose(
        [mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], [[-0.5, -1, -1.5], [10.5, 1, 1.5]]
    )


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "cube.ply"
    cube().export(file)
    first = read_mesh(file)
    assert read_mesh(file) is first
    trimesh.creation.icosphere(subdivisions=1).export(file)
    assert len(read_mesh(file).faces) == 80


def test_missing_folder_and_ending(tmp_path: Path) -> None:
    assert "No such file" in refusal(tmp_path / "none.ply")
    (tmp_path / "folder.ply").mkdir()
    assert "not a file" in refusal(tmp_path / "folder.ply")
    assert "allowed: .ply, .obj, .stl, .glb" in refusal(tmp_path / "mesh.pkl")


@pytest.mark.parametrize("ending", MESH_ENDINGS)
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\0",
        b"hello\nworld\n",
        b"ply\n",
        b"glTF" + bytes(40),
        b"v 1 2\nf 1 2 3\n",
        b"\xff" * 200,
    ],
)
def test_what_is_no_mesh(tmp_path: Path, ending: str, content: bytes) -> None:
    file = tmp_path / f"bad{ending}"
    file.write_bytes(content)
    refusal(file)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", "not finite"),
        ("v 0 0 0\nv 1 0 0\nv inf 1 0\nf 1 2 3\n", "not finite"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no triangle with an area"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", ""),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", ""),
    ],
)
def test_broken_triangles(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "bad.obj").write_text(text)
    assert reason in refusal(tmp_path / "bad.obj")


def test_promises_of_a_header_are_not_believed(tmp_path: Path) -> None:
    for element in ("vertex", "face", "surprise"):
        head = (
            f"ply\nformat binary_little_endian 1.0\nelement {element} 99999999999999999999\n"
            "property float x\nend_header\n"
        )
        (tmp_path / "huge.ply").write_text(head)
        assert "promises more" in refusal(tmp_path / "huge.ply")
    comments = "comment nothing\n" * 9000
    (tmp_path / "long.ply").write_text(
        f"ply\nformat ascii 1.0\n{comments}element face 9999999999\nend_header\n"
    )
    assert "header has no end" in refusal(tmp_path / "long.ply")
    (tmp_path / "huge.stl").write_bytes(bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(100))
    refusal(tmp_path / "huge.stl")


def test_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cube().export(tmp_path / "cube.obj")
    monkeypatch.setattr(mesh_files, "MOST_FACES", 11)
    assert "has 12 triangles; 1 to 11 are allowed" in refusal(tmp_path / "cube.obj")
    monkeypatch.setattr(mesh_files, "MOST_BYTES", 10)
    assert "MB; no more are allowed" in refusal(tmp_path / "cube.obj")


def test_a_glb_that_repeats_its_mesh_is_counted_before_it_is_unfolded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = trimesh.Scene()
    for k in range(5):
        scene.add_geometry(
            cube(),
            geom_name="cube",
            transform=trimesh.transformations.translation_matrix((4 * k, 0, 0)),
        )
    scene.export(tmp_path / "many.glb")
    monkeypatch.setattr(mesh_files, "MOST_FACES", 50)
    assert "has 60 triangles" in refusal(tmp_path / "many.glb")


def glb(tree: dict[str, Any]) -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk


TREE: dict[str, Any] = {
    "asset": {"version": "2.0"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
}


def test_other_files_are_never_opened(tmp_path: Path) -> None:
    (tmp_path / "secret.bin").write_bytes(np.zeros(9, dtype="<f4").tobytes())
    outside = {
        "buffers": [{"uri": "secret.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    }
    (tmp_path / "thief.glb").write_bytes(glb({**TREE, **outside}))
    refusal(tmp_path / "thief.glb")
    (tmp_path / "lib.obj").write_text(
        "mtllib secret.bin\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n"
    )
    assert len(read_mesh(tmp_path / "lib.obj").faces) == 1


@pytest.mark.parametrize(
    "accessors",
    [[{"componentType": 5126, "count": 10**11, "type": "VEC3"}], [{"count": 10**7}] * 3],
)
def test_a_glb_cannot_ask_for_zeros_without_end(
    tmp_path: Path, accessors: list[dict[str, Any]]
) -> None:
    (tmp_path / "zeros.glb").write_bytes(glb({**TREE, "accessors": accessors}))
    assert "promises more data" in refusal(tmp_path / "zeros.glb")


@pytest.mark.parametrize("accessors", [3, [3], [{}], [{"count": "x"}], [{"count": [1]}], {"a": 1}])
def test_a_glb_with_a_broken_header(tmp_path: Path, accessors: Any) -> None:
    (tmp_path / "broken.glb").write_bytes(glb({**TREE, "accessors": accessors}))
    assert "header cannot be read" in refusal(tmp_path / "broken.glb")


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40, deadline=None
)
@given(data=st.data())
def test_damaged_files_give_a_mesh_or_one_line(tmp_path: Path, data: st.DataObject) -> None:
    ending = data.draw(st.sampled_from(MESH_ENDINGS))
    whole = bytearray(
        cube().export(file_type=ending[1:])
        if ending != ".obj"
        else cube().export(file_type="obj").encode()
    )
    for _ in range(data.draw(st.integers(1, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    file = tmp_path / f"damaged{ending}"
    file.write_bytes(whole[: data.draw(st.integers(0, len(whole)))])
    mesh_files._read.cache_clear()
    try:
        mesh = read_mesh(file)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017  both ways out are right
    else:
        assert np.isfinite(mesh.vertices).all()


def test_distance_to_a_mesh(tmp_path: Path) -> None:
    cube().export(tmp_path / "cube.ply")
    mesh = read_mesh(tmp_path / "cube.ply")
    for point, distance in (
        ((0, 0, 0), 0.0),
        ((1.5, 0, 0), 1.0),
        ((0.5, 1, 2.5), 1.0),
        ((3.5, 5, 1.5), 5.0),
        ((0.49, 0, 0), 0.0),
    ):
        assert mesh.distance_m(np.array(point, dtype=float)) == pytest.approx(distance, abs=1e-12)
    sheet = read_mesh(shipped_folder("meshes") / "trihedral.ply")
    assert sheet.distance_m(np.array([0.0, 0.0, 0.0])) == pytest.approx(0.0, abs=1e-12)
    assert sheet.distance_m(np.array([-2.0, 0.0, 0.0])) == pytest.approx(2.0)


def test_names() -> None:
    assert {"bed", "sofa", "trihedral", "dihedral"} <= set(mesh_names())
