"""Targets of `fuzz_readers.py`: every reader of files, and good files to begin with."""

from __future__ import annotations

import hashlib
import io
import json
import os
import tempfile
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import torch
import trimesh
from fuzz_kit import Target, npy, written

from rtradar.body import Body
from rtradar.campaign.spec_file import read_spec
from rtradar.classify.outcomes import load_outcome
from rtradar.classify.recipes import LEAN
from rtradar.classify.study import load_network, load_study
from rtradar.classify.training import load_checkpoint
from rtradar.clouds import Collection
from rtradar.clouds.sample_files import Sample, write_index, write_sample
from rtradar.errors import InputError
from rtradar.motion import Motion, load_motion
from rtradar.radar import Radar
from rtradar.scene import Scene

ASF = """:units
  mass 1.0
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name first
    direction 0 1 0
    length 10
    axis 0 0 90 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
  end
:hierarchy
  begin
    root first
  end
"""
AMC = (
    ":FULLY-SPECIFIED\n:DEGREES\n"
    "1\nroot 1 2 3 0 0 0\nfirst 0 0 0\n2\nroot 1 2 3 0 90 0\nfirst 0 0 450\n"
)
BVH = """HIERARCHY
ROOT hip
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT knee
  {
    OFFSET 0 -50 0
    CHANNELS 3 Yrotation Zrotation Xrotation
    End Site
    {
      OFFSET 0 -50 0
    }
  }
}
MOTION
Frames: 2
Frame Time: .0333333
0 100 0 0 0 0 0 0 0
10 100 20 0 90 0 0 90 0
"""
RADAR = """name = "small"
start_frequency_hz = 60e9
bandwidth_hz = 3_000_000_000.0
chirp_duration_s = 250e-6
samples_per_chirp = 128
frame_duration_s = 0.05
tx_y = 2
tx_z = 0
rx_y = 4
rx_z = 0
position_m = [-4.0, 1, 1.0]
channels = "all"
polarization = "h"
"""
ANTENNAS = """tx_z = 0
rx_z = 0
transmit_power_dbm = 12.0
noise_figure_db = 14
noise_temperature_k = 290.0
multiplexing = "fdm"
carrier_step_hz = 5e6
frame_hop_s = 0.01
[tx_antenna]
pattern = "table"
gain_dbi = 9.5
azimuth_deg = [-90, 0.0, 90]
azimuth_db = [-20, 0, -20]
elevation_deg = [-90.0, 0.0, 90]
elevation_db = [-30, 0.0, -30]
[rx_antenna]
pattern = "cosine"
exponent = 1.5
"""
DIVISION = """tx_y = 3
tx_z = 0
multiplexing = "ddm"
doppler_bands = 5
tx_antenna = {pattern = "dipole", gain_dbi = 2}
rx_antenna.pattern = "isotropic"
"""
SCENE = """name = "mine"
description = "a room"
radar.position_m = [-3.0, 0.0, 1.0]
person = {position_m = [0.0, 0.0], heading_deg = 10}
[materials.slate]
source = "a book"
low_hz = 1e9
high_hz = 1e11
a = 7.0
c = 0.01
[room]
size_m = [8.0, 4.0, 2.5]
corner_m = [-4.0, -2.0]
walls = {material = "brick", thickness_m = 0.2}
floor = {material = "concrete", thickness_m = 0.3, roughness_m = 0.001}
ceiling = {material = "slate", thickness_m = 0.1}
[[walls]]
name = "screen"
corner_m = [1, 1, 0]
edge_u_m = [1, 0, 0]
edge_v_m = [0, 0, 1]
material = "glass"
thickness_m = 0.01
[[furniture]]
name = "chair"
mesh = "chair"
material = "wood"
position_m = [1.0, 0.5, 0.0]
yaw_deg = 30.0
[[furniture]]
name = "box"
mesh = "box.ply"
metres_per_unit = 0.001
material = "metal"
position_m = [1.0, -0.5, 0.0]
"""
SPEC = """seed = 3
pfa = 1e-6
clutter_removal = "mean"
folder = "."
[windows]
start_s = 0.0
duration_s = 0.01
hop_s = 0.5
end_s = 2.0
[each]
radar = ["paper-12ghz", "radar.toml"]
scene = ["free-space", "scene.toml"]
fidelity = ["analytic"]
heading_deg = [0.0]
person_position_m = [[0.0, 0.0]]
[drawn]
snr_db = [15.0, 25.0]
tempo = [0.9, 1.1]
[[synthetic]]
label = "walk"
count = 3
subjects = 2
[[recordings]]
file = "walk.bvh"
label = "walk"
subject = "she"
licence = "CC0"
start_s = 0.01
"""
WORDS = {
    "asf": ":units :root :bonedata :hierarchy :documentation begin end name direction length axis "
    "dof order orientation position "
    "rx ry rz TX TY TZ XYZ zyx deg rad limits 1e-320 1e308 -1e308 nan \xb2 #",
    "amc": ":DEGREES :RADIANS :FULLY-SPECIFIED root first 1e308 1e-320 \xb2 # "
    "99999999999999999999 -",
    "bvh": "HIERARCHY ROOT JOINT End Site OFFSET CHANNELS MOTION Frames: Frame Time: "
    "Xposition Yposition Zposition Zrotation "
    "Xrotation Yrotation { } 1e308 1e-320 1e-300 1e20 1e-9 \xb2",
    "toml": "true false inf nan -inf = [ ] [[ ]] { } "
    '""" 1e308 0xffffffffffffffffffff 1979-05-27T07:32:00Z '
    + " ".join(
        line.split(" = ")[0].strip("[]{ ")
        for line in (RADAR + ANTENNAS + DIVISION + SCENE + SPEC).splitlines()
    )
    + " tdm cosine dipole isotropic pairs v",
    "json": 'null true false NaN Infinity 1e999 -1 {} [] "" 99999999999999999999 "../x" [[[[ : ,',
    "ply": "ply format ascii 1.0 binary_little_endian binary_big_endian element vertex face edge "
    "property list uchar int float "
    "double x y z vertex_indices end_header comment",
    "obj": "v vt vn f o g usemtl mtllib # // / -1 s",
    "stl": "solid facet normal outer loop vertex endloop endfacet endsolid",
    "glb": "glTF JSON BIN accessors bufferViews buffers meshes nodes scenes primitives attributes "
    "POSITION indices mode count "
    "componentType 5126 5125 type VEC3 SCALAR byteLength byteOffset matrix children uri sparse",
}
"""Words of each format: a fuzzer that knows them gets farther."""


def _pose(motion: Motion) -> None:
    motion.at([0.0, motion.duration_s / 2, motion.duration_s])
    with suppress(InputError):  # the reader does not know which joints a person needs
        Body.from_motion(motion).at([0.0, motion.duration_s])


def _asf(folder: Path, data: bytes) -> None:
    (folder / "x.amc").write_text(AMC)
    _pose(load_motion(folder / "x.amc", written(folder / "x.asf", data)))


def _amc(folder: Path, data: bytes) -> None:
    (folder / "x.asf").write_text(ASF)
    _pose(load_motion(written(folder / "x.amc", data), folder / "x.asf"))


def _person(folder: Path, data: bytes) -> None:
    """Skeleton and motion in one, separated at the first null byte, which reaches more code."""
    asf, _, amc = data.partition(b"\0")
    (folder / "x.asf").write_bytes(asf)
    _pose(load_motion(written(folder / "x.amc", amc), folder / "x.asf"))


def _bvh(folder: Path, data: bytes) -> None:
    _pose(load_motion(written(folder / "x.bvh", data)))


def _radar(folder: Path, data: bytes) -> None:
    radar = Radar.load(written(folder / "x.toml", data))
    assert np.isfinite(radar.tx_offset_hz).all()
    assert np.isfinite(
        [
            radar.receiver_rate_hz,
            radar.occupied_bandwidth_hz,
            radar.max_velocity_mps,
            radar.max_angle_deg,
        ]
    ).all()
    with suppress(InputError):  # not stated
        assert radar.watts_per_m2 + radar.noise_power_w > 0
    for antenna in filter(None, (radar.tx_antenna, radar.rx_antenna)):
        share = antenna.relative(np.concatenate([np.eye(3), -np.eye(3)]), radar.polarization)
        assert ((share >= 0) & (share <= 1 + 1e-12)).all()


def _scene(folder: Path, data: bytes) -> None:
    trimesh.creation.box((300, 300, 300)).export(folder / "box.ply")
    Scene.load(written(folder / "x.toml", data))


def _spec(folder: Path, data: bytes) -> None:
    for name, text in (("walk.bvh", BVH), ("radar.toml", RADAR), ("scene.toml", 'name = "x"')):
        (folder / name).write_text(text)
    read_spec(written(folder / "x.toml", data))


def _collection(folder: Path) -> None:
    clouds = Collection(folder)
    if len(clouds):
        for column in ("subject", "seed"):
            clouds.column(column)
        assert clouds.labels.shape == (len(clouds),)
        assert clouds[0].points.shape[1:] == clouds.spatial(0).shape[1:] == (3,)


def _index(folder: Path, data: bytes) -> None:
    write_sample(folder, "a", *_sample())
    written(folder / "collection.json", data)
    _collection(folder)


def _cloud(folder: Path, data: bytes) -> None:
    write_index(folder, ["a"])
    written(folder / "a.npz", data)
    _collection(folder)


def _array(folder: Path, data: bytes) -> None:
    """Arrays and labels with right checksums, separated by CUT, which no random change reaches."""
    parts = data.split(b"CUT")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in zip(("points.npy", "spatial.npy", "about.npy"), parts, strict=False):
            archive.writestr(
                name,
                content if name != "about.npy" else npy(np.frombuffer(content, dtype=np.uint8)),
            )
        archive.comment = b"0" * 64
    body = buffer.getvalue()[:-64]
    _cloud(folder, body + hashlib.sha256(body).hexdigest().encode())


def _checkpoint(folder: Path, data: bytes) -> None:
    load_checkpoint(written(folder / "x.pt", data))


def _pickled(folder: Path, data: bytes) -> None:
    """The pickle of a checkpoint behind right checksums."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("x/data.pkl", data)
        for name, content in (
            ("version", b"3\n"),
            ("byteorder", b"little"),
            ("data/0", bytes(4)),
            ("data/1", bytes(4)),
        ):
            archive.writestr(f"x/{name}", content)
    _checkpoint(folder, buffer.getvalue())


def _outcome(folder: Path, data: bytes) -> None:
    found = load_outcome(written(folder / "x.json", data))
    assert 0 <= found.accuracy <= 1
    assert found.seconds >= 0
    found.as_dict()


def _plan(folder: Path, data: bytes) -> None:
    (folder / "training-01").mkdir(exist_ok=True)
    (folder / "training-01" / "outcome.json").write_bytes(_outcomes()[0])
    written(folder / "plan.json", data)
    assert load_study(folder).title
    with suppress(InputError):  # it was not trained
        load_network(folder)


def _mesh(ending: str) -> Callable[[Path, bytes], None]:
    def read(folder: Path, data: bytes) -> None:
        from rtradar.scene.mesh_files import read_mesh

        read_mesh(written(folder / f"x{ending}", data))

    return read


def _sample() -> tuple[Sample, np.ndarray]:
    return Sample(np.arange(6.0).reshape(2, 3), "walk", {"subject": "she", "seed": 3}), np.zeros(
        (1, 3)
    )


def _samples() -> list[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        write_sample(Path(folder), "a", *_sample())
        return [Path(folder, "a.npz").read_bytes()]


def _arrays() -> list[bytes]:
    about = json.dumps(
        {"format": 1, "label": "walk", "provenance": {"subject": "she", "seed": 3}}
    ).encode()
    return [b"CUT".join((npy(np.arange(6.0).reshape(2, 3)), npy(np.zeros((0, 3))), about))]


def _checkpoints(only_pickle: bool = False) -> list[bytes]:
    weights = torch.nn.Linear(1, 1)
    optimiser = torch.optim.AdamW(weights.parameters())
    content = {
        "network": weights.state_dict(),
        "optimiser": optimiser.state_dict(),
        "epochs": 1,
        "history": [{"rate": 1.0}],
    }
    buffer = io.BytesIO()
    torch.save(content, buffer)
    if not only_pickle:
        return [buffer.getvalue()]
    with zipfile.ZipFile(buffer) as archive:
        return [archive.read(name) for name in archive.namelist() if name.endswith("data.pkl")]


def _outcomes() -> list[bytes]:
    rows = {
        "rate": 1.0,
        "train_loss": 1.0,
        "train_accuracy": 1.0,
        "test_loss": 1.0,
        "test_accuracy": 1.0,
        "seconds": 1.0,
    }
    lists = {
        "indices": [0, 1],
        "truth": [0, 1],
        "predicted": [0, 0],
        "tested_on": ["", ""],
        "recordings": ["a", "b"],
    }
    return [json.dumps({"name": "fold 1", "trained_on": "", **lists, "history": [rows]}).encode()]


def _plans() -> list[bytes]:
    plan = {
        "data": "",
        "clouds": 2,
        "fingerprint": "0",
        "classes": ["a", "b"],
        "recipe": LEAN.as_dict(),
    }
    return [
        json.dumps(
            {**plan, "split": "folds", "folds": None, "seed": 0, "trainings": ["fold 1"]}
        ).encode()
    ]


def _meshes(ending: str) -> list[bytes]:
    box = trimesh.creation.box()
    kinds = [{"encoding": "ascii"}, {"encoding": "binary"}] if ending == ".ply" else [{}]
    found = [box.export(file_type=ending[1:], **kind) for kind in kinds]
    found += [box.export(file_type="stl_ascii")] if ending == ".stl" else []
    return [text.encode() if isinstance(text, str) else text for text in found]


def recorded(ending: str, lines: int) -> list[bytes]:
    """Real recordings, cut to some lines, if the environment names a folder of them."""
    root = os.environ.get("RTRADAR_MOCAP")
    files = sorted(Path(root).rglob(f"*{ending}"))[:6] if root else []
    return [b"\n".join(file.read_bytes().split(b"\n")[:lines]) + b"\n" for file in files]


def _people() -> list[bytes]:
    """Whole people of a few frames, if there are recordings."""
    root = os.environ.get("RTRADAR_MOCAP")
    found = [(ASF + "\0" + AMC).encode()]
    for asf in sorted(Path(root).rglob("*.asf"))[:4] if root else []:
        takes = sorted(asf.parent.glob(f"{asf.stem.split('_')[0]}_*.amc"))[:1]
        found += [
            asf.read_bytes() + b"\0" + b"\n".join(amc.read_bytes().split(b"\n")[:64]) + b"\n"
            for amc in takes
        ]
    return found


def _short_bvh() -> list[bytes]:
    """BVH recordings that are cut to three frames, with the right count."""
    found = []
    for data in recorded(".bvh", 10**6):
        head, _, rest = data.partition(b"Frame Time:")
        found.append(
            head[: head.rindex(b"Frames:")]
            + b"Frames: 3\nFrame Time:"
            + b"\n".join(rest.split(b"\n")[:4])
            + b"\n"
        )
    return [BVH.encode(), *found]


TARGETS = {
    "asf": Target(_asf, lambda: [ASF.encode(), *recorded(".asf", 1000)], WORDS["asf"], 20_000),
    "amc": Target(_amc, lambda: [AMC.encode()], WORDS["amc"]),
    "asf+amc": Target(_person, _people, WORDS["asf"] + " " + WORDS["amc"], 40_000),
    "bvh": Target(_bvh, _short_bvh, WORDS["bvh"], 20_000),
    "radar": Target(
        _radar, lambda: [RADAR.encode(), ANTENNAS.encode(), DIVISION.encode()], WORDS["toml"]
    ),
    "scene": Target(_scene, lambda: [SCENE.encode()], WORDS["toml"]),
    "spec": Target(_spec, lambda: [SPEC.encode()], WORDS["toml"]),
    "collection.json": Target(_index, lambda: [b'{"format": 1, "samples": ["a"]}'], WORDS["json"]),
    "cloud": Target(_cloud, _samples),
    "cloud arrays": Target(
        _array, _arrays, WORDS["json"] + " CUT '<f8' '|O' '<U9' fortran_order descr shape"
    ),
    "checkpoint": Target(_checkpoint, _checkpoints, most_bytes=8192),
    "checkpoint pickle": Target(_pickled, lambda: _checkpoints(only_pickle=True), WORDS["json"]),
    "plan.json": Target(_plan, _plans, WORDS["json"]),
    "outcome.json": Target(_outcome, _outcomes, WORDS["json"]),
    "ply": Target(_mesh(".ply"), lambda: _meshes(".ply"), WORDS["ply"]),
    "obj": Target(_mesh(".obj"), lambda: _meshes(".obj"), WORDS["obj"]),
    "stl": Target(_mesh(".stl"), lambda: _meshes(".stl"), WORDS["stl"]),
    "glb": Target(_mesh(".glb"), lambda: _meshes(".glb"), WORDS["glb"]),
}
