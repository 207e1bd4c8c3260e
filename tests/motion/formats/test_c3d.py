"""C3D files that an independent library writes: joints from markers, and what is refused."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError, ValidityWarning
from rtradar.motion import load_motion
from rtradar.motion.formats.markers import LONGEST_GAP_S, NEEDED, _Bounded, chosen, read_c3d
from rtradar.motion.skeleton import NODES, to_nodes

FRAMES, RATE = 90, 120.0

# The set of the HDM05 recordings, in the order of their files; some of it is not needed.
HDM05 = [
    "LFHD", "RFHD", "LBHD", "RBHD", "C7", "T10", "CLAV", "STRN", "RBAC", "LSHO", "LUPA", "LELB",
    "LFRM", "LWRA", "LWRB", "LFIN", "RSHO", "RUPA", "RELB", "RFRM", "RWRA", "RWRB", "RFIN", "LFWT",
    "RFWT", "LBWT", "RBWT", "LTHI", "LKNE", "LSHN", "LANK", "LHEE", "LTOE", "LMT5", "RTHI", "RKNE",
    "RSHN", "RANK", "RHEE", "RTOE", "RMT5",
]  # fmt: skip


def moved(points: np.ndarray) -> np.ndarray:
    """Points (n, 3) as the person walks a curve and turns, (frame, n, 3)."""
    time = np.arange(FRAMES) / RATE
    turn = Rotation.from_euler("z", 0.3 + 1.2 * time[:, None]).as_matrix()
    way = np.stack([1.1 * time, 0.2 * np.sin(3 * time), 0.02 * np.cos(9 * time)], axis=1)
    return points @ turn.transpose(0, 2, 1) + way[:, None]


def write(
    path: Path,
    positions_m: np.ndarray,
    names: list[str] = HDM05,
    unit: str = "mm",
    prefix: str = "",
    **more: Any,
) -> Path:
    """A C3D file of positions (frame, marker, 3) [m]; NaN is a marker that was not seen."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(prefix + name for name in names)
    file["parameters"]["POINT"]["UNITS"]["value"] = (unit,)
    for name, value in more.items():
        file.add_parameter("POINT", name, [value])
    points = np.ones((4, len(names), len(positions_m)))
    points[:3] = np.moveaxis(positions_m, 2, 0).swapaxes(1, 2) / {
        "mm": 1e-3,
        "cm": 1e-2,
        "m": 1.0,
    }.get(unit, 1.0)
    file["data"]["points"] = points
    file.write(str(path))
    return path


def anatomical(height: float) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return markers and joint centres of a person's left side: forward, left, up [m].

    The person stands with forearms forward, thumbs up and a level gaze. Heights and breadths are
    fractions of the standing height after Drillis and Contini (see
    `rtradar.motion.synthetic.figure`): chin 0.870, eyes 0.936, shoulders 0.818 high and 0.129 to
    the side, hips 0.530 and 0.048, knees 0.285, ankles 0.039. Markers lie on the skin, about 3 to 6
    cm from the centre of a limb; waist markers are worn on the crest of the hip bone, 0.60 high,
    and wrist bars stand off the back of the hand's wrist. The head is carried before the spine: the
    ear lies 50 degrees above the horizontal of the seventh cervical vertebra.
    """
    arm, elbow = 0.118, 0.818 - 0.186
    joints = {
        "head": (0.0, 0.0, (0.870 + 1) / 2),
        "root": (0.030, 0.0, 0.570),
        "hip": (0.030, 0.048, 0.530),
        "knee": (0.030, 0.048, 0.285),
        "ankle": (0.020, 0.048, 0.039),
        "toe": (0.100, 0.048, 0.030),
        "shoulder": (0.0, arm, 0.818 - 0.020),
        "elbow": (0.0, arm, elbow),
        "wrist": (0.146, arm, elbow),
        "hand": (0.190, arm, elbow),
    }
    markers = {
        "FHD": (0.070, 0.040, 0.950),
        "BHD": (-0.025, 0.035, 0.950),
        "C7": (-0.035, 0.0, 0.860),
        "CLAV": (0.035, 0.0, 0.818),
        "T10": (-0.060, 0.0, 0.700),
        "STRN": (0.060, 0.0, 0.690),
        "SHO": (0.0, 0.129, 0.818 + 0.010),
        "ELB": (-0.010, arm + 0.025, elbow),
        "WRA": (0.150, arm + 0.025, elbow + 0.022),
        "WRB": (0.150, arm + 0.025, elbow - 0.022),
        "FIN": (0.200, arm + 0.015, elbow),
        "FWT": (0.070, 0.070, 0.600),
        "BWT": (-0.070, 0.045, 0.600),
        "KNE": (0.025, 0.048 + 0.030, 0.285),
        "ANK": (0.015, 0.048 + 0.022, 0.039),
        "TOE": (0.100, 0.048, 0.030),
    }
    return tuple(
        {name: height * np.array(place) for name, place in places.items()}
        for places in (markers, joints)
    )  # type: ignore[return-value]


def worn(markers: dict[str, np.ndarray], names: list[str]) -> np.ndarray:
    """Places of markers, or of nodes, on both sides; what is not needed is anywhere."""
    anywhere = np.array([0.0, 0.0, 1.0])
    places = []
    for name in names:
        side, plain = (name[0], name[2:]) if name[1] == "_" else (name[0], name[1:])
        own = markers.get(plain, anywhere) * [1, 1 if side in "lL" else -1, 1]
        places.append(markers.get(name, own))
    return np.array(places)


@pytest.fixture
def walk() -> np.ndarray:
    return moved(worn(anatomical(1.77)[0], HDM05))


@pytest.mark.parametrize(("unit", "prefix"), [("cm", "male:"), ("m", "")])
def test_any_unit_and_any_prefix_are_the_same_person(
    tmp_path: Path, walk: np.ndarray, unit: str, prefix: str
) -> None:
    expected = load_motion(write(tmp_path / "walk.c3d", walk))
    motion = load_motion(write(tmp_path / "walk.c3d", walk, unit=unit, prefix=prefix))
    assert motion.joints == NODES
    assert motion.rate_hz == RATE
    # float32 in the file: 2 m are kept to 1e-7 m
    np.testing.assert_allclose(motion.positions, expected.positions, atol=2e-6)
    assert to_nodes(motion) is motion


@pytest.mark.parametrize("height", [1.2, 1.77, 2.05])
def test_joints_stand_where_anatomy_has_them(tmp_path: Path, height: float) -> None:
    """Joints agree to 3 % of the height, 5.3 cm of an adult: mean offsets fit no one better."""
    markers, joints = anatomical(height)
    needed = [name for name in HDM05 if name in NEEDED]
    motion = load_motion(write(tmp_path / "walk.c3d", moved(worn(markers, needed)), needed))
    known = [node for node in NODES if node in joints or node[2:] in joints]
    expected = moved(worn(joints, known))
    found = motion.positions[:, [NODES.index(node) for node in known]]
    apart = np.linalg.norm(found - expected, axis=2).max(axis=0) / height
    assert dict(zip(known, apart.round(3), strict=True)) == {
        node: pytest.approx(0, abs=0.03) for node in known
    }
    # The spine rises from bone to bone, from the root to the head.
    spine = motion.positions[
        :, [NODES.index(n) for n in ("root", "lowerback", "upperback", "thorax", "neck", "head")]
    ]
    rises = np.diff(spine[..., 2], axis=1) / height
    assert rises.min() > 0.03
    assert rises.max() < 0.15


@pytest.mark.parametrize("down", [0.0, 0.3, 1.0])
def test_straight_arms_of_both_sides_mirror_each_other(tmp_path: Path, down: float) -> None:
    """A straight arm does not say where it would bend; the guess must be alike on both sides."""
    markers, _ = anatomical(1.77)
    way = np.array([0.0, 1.0 - down, -down]) / np.hypot(1.0 - down, down)
    shoulder = markers["SHO"]
    for name, far in {"ELB": 0.33, "WRA": 0.59, "WRB": 0.59, "FIN": 0.68}.items():
        markers[name] = shoulder + far * way
    markers["WRA"], markers["WRB"] = markers["WRA"] + [0.03, 0, 0], markers["WRB"] - [0.03, 0, 0]
    needed = [name for name in HDM05 if name in NEEDED]
    points = np.repeat([worn(markers, needed)], FRAMES, axis=0)
    motion = load_motion(write(tmp_path / "straight.c3d", points, needed))
    left, right = (
        [j for j, node in enumerate(NODES) if node.startswith(side)] for side in ("l_", "r_")
    )
    assert [NODES[j][2:] for j in left] == [NODES[j][2:] for j in right]
    np.testing.assert_allclose(
        motion.positions[:, left], motion.positions[:, right] * [1, -1, 1], atol=2e-6
    )


def test_bones_turn_with_the_person_and_do_not_spin(tmp_path: Path, walk: np.ndarray) -> None:
    motion = load_motion(write(tmp_path / "walk.c3d", walk))
    # He turns by 1.2 rad/s as a whole: every bone's rotation from the first frame on is that turn.
    turns = Rotation.from_euler("z", 1.2 * np.arange(FRAMES)[:, None] / RATE)
    for j in range(1, len(NODES)):
        found = Rotation.from_quat(motion.rotations[:, j])
        assert (turns.inv() * found * found[0].inv()).magnitude().max() < 3e-5


def test_a_file_that_says_y_is_up_is_turned(tmp_path: Path, walk: np.ndarray) -> None:
    upright = load_motion(write(tmp_path / "z.c3d", walk))
    # World (x, y, z) = file (z, x, y).
    turned = load_motion(
        write(tmp_path / "y.c3d", walk[..., [1, 2, 0]], X_SCREEN="+X", Y_SCREEN="+Y")
    )
    np.testing.assert_allclose(turned.positions, upright.positions, atol=1e-14)
    with pytest.warns(ValidityWarning, match="up: y, not z as the format has it"):
        load_motion(write(tmp_path / "silent.c3d", walk[..., [1, 2, 0]]))
    told = load_motion(tmp_path / "silent.c3d", up="y")
    np.testing.assert_allclose(told.positions, upright.positions, atol=1e-14)


def test_positions_are_those_that_another_reader_finds(tmp_path: Path, walk: np.ndarray) -> None:
    walk[20:25, HDM05.index("LKNE")] = np.nan
    path = write(tmp_path / "walk.c3d", walk)
    ours = chosen(read_c3d(path), NEEDED)
    other = ezc3d.c3d(str(path))
    labels = other["parameters"]["POINT"]["LABELS"]["value"]
    theirs = (
        np.stack([other["data"]["points"][:3, labels.index(name)].T for name in NEEDED], axis=1)
        / 1000
    )
    np.testing.assert_allclose(ours.positions / 1000, theirs, rtol=1e-12)
    assert np.isnan(ours.positions).any(axis=2).sum() == 5


@pytest.mark.parametrize("lost", [np.nan, 0.0])
def test_short_gaps_are_bridged(tmp_path: Path, walk: np.ndarray, lost: float) -> None:
    whole = load_motion(write(tmp_path / "whole.c3d", walk))
    longest = round(LONGEST_GAP_S * RATE)
    for name, begin in (("LKNE", 30), ("RWRA", 50), ("LTHI", 0)):  # the last is not needed at all
        walk[begin : begin + longest, HDM05.index(name)] = lost
    bridged = load_motion(write(tmp_path / "gaps.c3d", walk))
    # 0.1 s of a turning walk: a cubic spline misses its sines by h^4/384 times 9^4 x 0.02 m, and
    # less than that: 40 um.
    assert 0 < np.abs(bridged.positions - whole.positions).max() < 40e-6


@pytest.mark.parametrize(
    ("frames", "says"),
    [
        ((40, 54), r"marker LKNE is not seen in frames 41 to 54, 0.117 s; gaps up to 0.1 s"),
        ((0, 3), "1 to 3, at an end"),
        ((88, 90), "89 to 90, at an end"),
    ],
)
def test_long_gaps_are_refused_by_name(
    tmp_path: Path, walk: np.ndarray, frames: tuple[int, int], says: str
) -> None:
    walk[slice(*frames), HDM05.index("LKNE")] = np.nan
    with pytest.raises(InputError, match=says):
        load_motion(write(tmp_path / "gaps.c3d", walk))


def test_what_is_no_person_is_refused(tmp_path: Path, walk: np.ndarray) -> None:
    found = load_motion(write(tmp_path / "b.c3d", walk, unit="furlong"))
    assert found.findings[0][:2] == ("unit_m", 1.0)
    with pytest.raises(InputError, match=r"unit of 0.001 m the person is 1.*e\+03 m tall.*--unit"):
        load_motion(write(tmp_path / "c.c3d", walk * 1000))
    with pytest.raises(InputError, match="marker LKNE is missing"):
        load_motion(
            write(tmp_path / "d.c3d", walk, [name if name != "LKNE" else "KNEE" for name in HDM05])
        )
    with pytest.raises(InputError, match="marker LKNE is there 2 times"):
        load_motion(
            write(
                tmp_path / "e.c3d",
                walk,
                [name if name != "LTHI" else "other:LKNE" for name in HDM05],
            )
        )
    with pytest.raises(InputError, match="C3D files take no skeleton"):
        load_motion(tmp_path / "d.c3d", skeleton="x.asf")
    with pytest.raises(InputError, match="cannot read"):
        load_motion(tmp_path / "none.c3d")
    (tmp_path / "folder.c3d").mkdir()
    with pytest.raises(InputError, match="a directory"):
        load_motion(tmp_path / "folder.c3d")
    coinciding = walk.copy()
    coinciding[7, HDM05.index("RANK")] = coinciding[7, HDM05.index("RTOE")] - [0.0, 0.0, 0.001]
    assert (
        load_motion(write(tmp_path / "f.c3d", coinciding)).joints == NODES
    )  # the offset of the ankle keeps them apart
    data = (tmp_path / "b.c3d").read_bytes()
    (tmp_path / "cut.c3d").write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=r"ends after \d+ frames where its header promises more"):
        load_motion(tmp_path / "cut.c3d", unit_m=1.0)


def test_names_of_two_lines_are_told_in_one(tmp_path: Path, walk: np.ndarray) -> None:
    names = [
        "two\x1clines" if name == "LKNE" else name
        for name in ["LKNE", *(name for name in HDM05 if name != "LKNE")]
    ]
    with pytest.raises(InputError, match="marker LKNE is missing") as caught:
        load_motion(write(tmp_path / "walk.c3d", walk, names))
    assert len(str(caught.value).splitlines()) == 1


def test_a_file_gives_no_more_than_it_has(tmp_path: Path) -> None:
    """Damaged rates make the reader ask for terabytes, which Python would reserve at once."""
    (tmp_path / "x.c3d").write_bytes(b"12345")
    with _Bounded(io.FileIO(tmp_path / "x.c3d")) as file:
        assert file.read(2) == b"12"
        assert file.read(10**15) == b"345"
        assert file.read(10**15) == b""
        file.seek(1)
        assert file.read() == b"2345"


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Bytes of a good file of few frames."""
    path = tmp_path_factory.mktemp("c3d") / "good.c3d"
    return write(path, moved(worn(anatomical(1.77)[0], HDM05))[:4]).read_bytes()


@pytest.mark.filterwarnings("ignore::rtradar.ValidityWarning")
@given(data=st.data())
def test_junk_is_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, good: bytes, data: st.DataObject
) -> None:
    kind = data.draw(st.sampled_from(["noise", "headed noise", "cut", "damaged"]))
    if kind.endswith("noise"):
        junk = (b"\x02\x50" if kind == "headed noise" else b"") + data.draw(
            st.binary(max_size=3000)
        )
    elif kind == "cut":
        junk = good[: data.draw(st.integers(0, len(good) - 1))]
    else:
        changed = bytearray(good)
        for at, value in data.draw(
            st.lists(
                st.tuples(st.integers(0, len(good) - 1), st.integers(0, 255)),
                min_size=1,
                max_size=40,
            )
        ):
            changed[at] = value
        junk = bytes(changed)
    path = tmp_path_factory.getbasetemp() / "junk.c3d"
    path.write_bytes(junk)
    refusal = None
    try:
        motion = load_motion(path)
    except InputError as error:
        refusal = str(error)
    if refusal is None:
        assert kind in ("damaged", "cut")  # what was hit said nothing of the markers
        assert np.isfinite(motion.positions).all()
    else:
        assert "\n" not in refusal
        assert "junk" in refusal


def test_names_of_plug_in_gait_are_those_of_cmu(tmp_path: Path, walk: np.ndarray) -> None:
    known = load_motion(write(tmp_path / "walk.c3d", walk))
    names = [name.replace("FWT", "ASI").replace("BWT", "PSI") for name in HDM05]
    found = load_motion(write(tmp_path / "walk.c3d", walk, names))
    np.testing.assert_array_equal(found.positions, known.positions)
    # One marker on the sacrum in place of two beside it.
    one, other = HDM05.index("LBWT"), HDM05.index("RBWT")
    middle = walk.copy()
    middle[:, one] = middle[:, [one, other]].mean(axis=1)
    names[one], names[other] = "SACR", "other"
    found = load_motion(write(tmp_path / "sacrum.c3d", middle, names))
    assert np.linalg.norm(found.positions - known.positions, axis=2).max() < 0.02


HELEN_HAYES = {
    "L.ASIS": (0.12, 0.12, 0.95), "V.Sacral": (-0.12, 0.0, 0.95), "L.Knee": (0.0, 0.14, 0.50),
    "L.Ankle": (0.0, 0.14, 0.08), "L.Toe": (0.16, 0.12, 0.04), "L.Shoulder": (0.0, 0.19, 1.44),
    "L.Elbow": (0.0, 0.22, 1.12), "L.Wrist": (0.05, 0.22, 0.86), "Top.Head": (0.02, 0.0, 1.75),
}  # fmt: skip


def test_full_body_helen_hayes_gives_joints_some_centimetres_off(tmp_path: Path) -> None:
    places = dict(HELEN_HAYES)
    for name, (x, y, z) in HELEN_HAYES.items():
        if name.startswith("L."):
            places["R." + name[2:]] = (x, -y, z)
    markers = moved(np.array(list(places.values())))
    motion = load_motion(write(tmp_path / "walk.c3d", markers, list(places)))
    shown = dict(zip(motion.joints, motion.positions[0] - motion.positions[0, 0], strict=True))
    turn = np.array([np.cos(0.3), np.sin(0.3), 0.0])
    for node, ahead, height in (
        ("l_hip", 0.09, -0.09), ("l_knee", 0.0, -0.45), ("l_ankle", 0.0, -0.87),
        ("r_elbow", 0.0, 0.17), ("head", 0.02, 0.80),
    ):  # fmt: skip
        assert shown[node][2] == pytest.approx(height, abs=0.04)
        assert shown[node] @ turn == pytest.approx(ahead, abs=0.06)
    assert shown["l_hip"] @ [-turn[1], turn[0], 0.0] > 0.05
