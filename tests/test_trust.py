"""Files from strangers: nothing in them runs, leads elsewhere, or takes more than it may."""

from __future__ import annotations

import ast
import io
import json
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import rtradar
from rtradar.campaign.spec_file import read_spec
from rtradar.clouds import Collection, Sample
from rtradar.clouds.sample_files import write_index, write_sample
from rtradar.errors import InputError, InputErrors
from rtradar.motion import load_motion
from rtradar.radar import Radar
from rtradar.scene import Scene

SOURCES = sorted(Path(rtradar.__file__).parent.rglob("*.py"))
SAMPLE = Sample(np.arange(6.0).reshape(2, 3), "walk", {"subject": "she"})

# -- pickles ---------------------------------------------------------------------------------------


def calls_of(tree: ast.AST) -> list[tuple[str, dict[str, Any]]]:
    """Every call by its dotted name, with those keywords that are constants."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            constant = [one for one in node.keywords if isinstance(one.value, ast.Constant)]
            words = {one.arg: one.value.value for one in constant if one.arg}
            found.append((ast.unparse(node.func), words))
    return found


UNSAFE = ("pickle", "cPickle", "dill", "joblib", "shelve", "marshal", "cloudpickle")


def unsafe(source: str) -> list[str]:
    """What in a source could load a pickle, or run what a file says."""
    tree = ast.parse(source)
    nodes = list(ast.walk(tree))
    modules = [alias.name for one in nodes if isinstance(one, ast.Import) for alias in one.names]
    modules += [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    found = [name for name in modules if name.split(".")[0] in UNSAFE]
    for name, words in calls_of(tree):
        last = name.rpartition(".")[2]
        loads = last in ("load", "read_array") and name.split(".")[0] in ("np", "numpy", "torch")
        safe = words.get("allow_pickle") is False or words.get("weights_only") is True
        if (
            (name.endswith("read_array") or name in ("np.load", "numpy.load"))
            and "allow_pickle" not in words
            and last == "load"
        ):
            safe = True  # False is the default of numpy.load
        if (loads and not safe) or words.get("allow_pickle") is True or name in ("eval", "exec"):
            found.append(name)
    return found


@pytest.mark.slow
def test_no_source_can_load_a_pickle() -> None:
    assert len(SOURCES) > 100
    every = {path.as_posix(): unsafe(path.read_text(encoding="utf-8")) for path in SOURCES}
    found = {path: wrong for path, wrong in every.items() if wrong}
    # Numba's machine code is kept as Numba keeps it: who can write there can run code anyway.
    (compiled,) = found
    assert compiled.endswith("rtradar/kernels/jit.py")
    assert found[compiled] == ["pickle"]


@pytest.mark.parametrize(
    "source",
    [
        "import pickle",
        "from joblib import load",
        "torch.load(x)",
        "torch.load(x, weights_only=False)",
        "np.load(x, allow_pickle=True)",
        "eval(x)",
    ],
)
def test_the_search_finds_what_it_is_for(source: str) -> None:
    assert unsafe(source)


class Harm:
    """Makes a file where it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


def collection_of(folder: Path, entries: dict[str, bytes], **options: Any) -> None:
    write_index(folder, ["a"])
    with zipfile.ZipFile(folder / "a.npz", "w", **options) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
        archive.comment = b"0" * 64


def npy(values: Any, **header: Any) -> bytes:
    """A NumPy file, with another header than it should have where one is given."""
    buffer = io.BytesIO()
    if header:
        np.lib.format.write_array_header_1_0(buffer, header)
        buffer.write(np.asarray(values).tobytes())
    else:
        np.lib.format.write_array(buffer, np.asarray(values), allow_pickle=True)
    return buffer.getvalue()


ABOUT = np.frombuffer(
    json.dumps({"format": 1, "label": "walk", "provenance": {}}).encode(), dtype=np.uint8
)


def test_a_pickle_in_a_cloud_is_not_run(tmp_path: Path) -> None:
    harm = tmp_path / "harm"
    harmful = npy(np.array([[Harm(harm)] * 3], dtype=object))
    collection_of(tmp_path, {"about.npy": npy(ABOUT), "points.npy": harmful})
    clouds = Collection(tmp_path)
    with pytest.raises(InputError, match="is damaged"):
        clouds.points(0)
    assert not harm.exists()


# -- sizes -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(10**12, 3), (2**62, 3), (1, 3, 10**9)])
def test_a_cloud_that_promises_more_than_it_holds_is_damaged(
    tmp_path: Path, shape: tuple[int, ...]
) -> None:
    promised = npy([0.0] * 3, descr="<f8", fortran_order=False, shape=shape)
    collection_of(tmp_path, {"about.npy": npy(ABOUT), "points.npy": promised})
    with pytest.raises(InputError, match="is damaged"):
        Collection(tmp_path).points(0)


def test_a_compressed_bomb_is_not_unpacked(tmp_path: Path) -> None:
    bomb = npy(np.zeros((10**6, 3)))
    collection_of(
        tmp_path, {"about.npy": npy(ABOUT), "points.npy": bomb}, compression=zipfile.ZIP_DEFLATED
    )
    assert (tmp_path / "a.npz").stat().st_size < len(bomb) / 100
    with pytest.raises(InputError, match="is damaged"):
        Collection(tmp_path)


def sparse(path: Path, size: int) -> Path:
    """A file of that size, which takes no room on the disk."""
    with path.open("wb") as file:
        file.truncate(size)
    return path


def test_files_that_are_too_large_are_refused_with_the_limit(tmp_path: Path) -> None:
    write_index(tmp_path, ["a"])
    sparse(tmp_path / "a.npz", 10**10)
    with pytest.raises(InputError, match="10000 MB; 200 MB are allowed"):
        Collection(tmp_path)
    with pytest.raises(InputError, match=r"10000 MB; a BVH motion file may have 2000 MB"):
        load_motion(sparse(tmp_path / "x.bvh", 10**10))
    for read in (Radar.load, Scene.load, read_spec):
        with pytest.raises(InputError, match="larger than 1 MB"):
            read(sparse(tmp_path / "x.toml", 10**10))


BVH_HEAD = "HIERARCHY\nROOT hip\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n"
BVH_TAIL = "}\nMOTION\nFrames: %d\nFrame Time: 0.01\n%s"


def test_too_many_joints_and_poses_are_refused_with_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "x.bvh"
    path.write_text(BVH_HEAD + "".join(f"JOINT j{number}\n{{\n" for number in range(5000)))
    with pytest.raises(InputError, match="more than 1000 joints"):
        load_motion(path)
    joints = "".join(f"JOINT j{number}\n{{\nOFFSET 0 1 0\n}}\n" for number in range(999))
    path.write_text(BVH_HEAD + joints + BVH_TAIL % (100_001, "0 0 0\n" * 100_001))
    with pytest.raises(
        InputError, match="100001 frames of 1000 joints; frames times joints may be 100000000"
    ):
        load_motion(path)


@pytest.mark.parametrize("name", ["collection.json", "x.toml"])
def test_deep_nesting_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(("name = " if name == "x.toml" else "") + "[" * 100_000)
    reader = Collection if name == "collection.json" else Radar.load
    with pytest.raises(InputError):
        reader(tmp_path if name == "collection.json" else tmp_path / name)


# -- paths out of the folder -----------------------------------------------------------------------

SPEC = """
[windows]
duration_s = 0.1
[[recordings]]
file = "{file}"
label = "walk"
subject = "she"
licence = "CC0"
"""


@pytest.mark.parametrize("identity", ["../b", "/etc/passwd", "a/b", "", ".", "a\\b", "a.b"])
def test_a_collection_names_no_files_elsewhere(tmp_path: Path, identity: str) -> None:
    folder = tmp_path / "clouds"
    folder.mkdir()
    write_sample(tmp_path, "b", SAMPLE, np.zeros((0, 3)))
    (folder / "collection.json").write_text(json.dumps({"format": 1, "samples": [identity]}))
    with pytest.raises(InputError, match="which is no sample"):
        Collection(folder)


@pytest.mark.parametrize(
    "way", ["../out.bvh", "link/out.bvh", "{root}/out.bvh", "inside/../../out.bvh", "loop/x.bvh"]
)
def test_a_data_set_file_reads_nothing_elsewhere(tmp_path: Path, way: str) -> None:
    folder = tmp_path / "set"
    (folder / "inside").mkdir(parents=True)
    (tmp_path / "out.bvh").write_text("")
    (tmp_path / "out.toml").write_text("")
    (folder / "link").symlink_to(tmp_path)
    (folder / "loop").symlink_to(folder / "loop")
    way = way.format(root=tmp_path)
    for text in (
        SPEC.format(file=way),
        SPEC.format(file="x.bvh") + f'[each]\nradar = ["{way.replace("bvh", "toml")}"]',
        SPEC.format(file="x.bvh") + f'[each]\nscene = ["{way.replace("bvh", "toml")}"]',
        f'folder = "{os.path.dirname(way)}"\n' + SPEC.format(file="out.bvh"),
    ):
        (folder / "x.bvh").write_text("")
        (folder / "set.toml").write_text(text)
        with pytest.raises(InputError, match="leaves the folder"):
            read_spec(folder / "set.toml")


def test_an_environment_variable_allows_its_folder_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "far" / "deep").mkdir(parents=True)
    (tmp_path / "set").mkdir()
    (tmp_path / "far" / "deep" / "walk.bvh").write_text("")
    monkeypatch.setenv("RTRADAR_FAR", str(tmp_path / "far"))
    path = tmp_path / "set" / "set.toml"
    path.write_text('folder = "${RTRADAR_FAR}/deep"\n' + SPEC.format(file="walk.bvh"))
    assert read_spec(path).recordings[0].path == tmp_path / "far" / "deep" / "walk.bvh"
    for folder in ("${RTRADAR_FAR}/..", "${RTRADAR_FAR}/../far2", "${RTRADAR_FAR}/deep/../../set"):
        path.write_text(f'folder = "{folder}"\n' + SPEC.format(file="walk.bvh"))
        with pytest.raises(InputError, match="leaves the folder"):
            read_spec(path)


# -- whatever the bytes ----------------------------------------------------------------------------

BVH = (
    BVH_HEAD
    + "JOINT knee\n{\nOFFSET 0 -50 0\nCHANNELS 1 Xrotation\n}\n"
    + BVH_TAIL % (2, "0 0 0 1\n0 1 0 2\n")
)
AMC = ":DEGREES\n1\nroot 1 2 3 0 0 0\nfirst 0 0 0\n2\nroot 1 2 3 0 90 0\nfirst 0 0 450\n"
ASF = (
    ":units\nlength 0.45\nangle deg\n:root\norder TX TY TZ RX RY RZ\naxis XYZ\n"
    "position 0 0 0\norientation 0 0 0\n"
    ":bonedata\nbegin\nname first\ndirection 0 1 0\nlength 10\naxis 0 0 0 XYZ\ndof rx ry rz\nend\n"
    ":hierarchy\nbegin\nroot first\nend\n"
)
TOML = 'name = "x"\nsamples_per_chirp = 128\nposition_m = [-4.0, 1.0, 1.0]\n'
HOSTILE = st.sampled_from(
    [
        "",
        "nan",
        "1e308",
        "-1e308",
        "5e-324",
        "1e-300",
        "\xb2",
        "9" * 5000,
        "-1",
        "0",
        "{",
        "}",
        "[",
        ":",
        "\0",
        "\n",
        "root",
        "inf",
        "order",
    ]
)


@st.composite
def bent(draw: st.DrawFn, text: str) -> str:
    """A text with words replaced, lines left out, or said twice."""
    lines = text.split("\n")
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, len(lines) - 1))
        words = lines[place].split(" ")
        kind = draw(st.sampled_from(["word", "drop", "twice", "cut"]))
        if kind == "word":
            words[draw(st.integers(0, len(words) - 1))] = draw(HOSTILE)
            lines[place] = " ".join(words)
        elif kind == "drop":
            lines[place] = ""
        elif kind == "twice":
            lines.insert(place, lines[place])
        else:
            lines = lines[: place + 1]
    return "\n".join(lines)


def one_line_or_well(read: Any, *paths: Path) -> None:
    said: tuple[str, ...] = ("it was read",)
    try:
        read(*paths)
    except InputErrors as error:
        said = error.lines
    except InputError as error:
        said = (str(error),)
    assert all(len(line.splitlines()) == 1 for line in said)


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    bvh=bent(BVH),
    amc=bent(AMC),
    asf=bent(ASF),
    toml=bent(TOML),
    index=bent('{\n"format": 1,\n"samples": ["a"]\n}'),
)
def test_bent_files_give_one_line_or_are_read(
    tmp_path: Path, bvh: str, amc: str, asf: str, toml: str, index: str
) -> None:
    files = {"x.bvh": bvh, "x.amc": amc, "x.asf": asf, "x.toml": toml, "collection.json": index}
    for name, text in files.items():
        (tmp_path / name).write_bytes(text.encode("latin-1"))
    (tmp_path / "good.asf").write_text(ASF)
    (tmp_path / "good.amc").write_text(AMC)
    one_line_or_well(load_motion, tmp_path / "x.bvh")
    one_line_or_well(load_motion, tmp_path / "x.amc", tmp_path / "good.asf")
    one_line_or_well(load_motion, tmp_path / "good.amc", tmp_path / "x.asf")
    one_line_or_well(Radar.load, tmp_path / "x.toml")
    one_line_or_well(Scene.load, tmp_path / "x.toml")
    one_line_or_well(read_spec, tmp_path / "x.toml")
    one_line_or_well(Collection, tmp_path)


def test_files_to_bend_are_good(tmp_path: Path) -> None:
    (tmp_path / "x.asf").write_text(ASF)
    for name, text in (("x.amc", AMC), ("x.bvh", BVH)):
        (tmp_path / name).write_text(text)
        skeleton = tmp_path / "x.asf" if name == "x.amc" else None
        assert (
            load_motion(tmp_path / name, skeleton, unit_m=None if skeleton else 0.02).duration_s > 0
        )


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        # int() takes no superscript, which str.isdigit() takes; and not so many digits.
        ("\n2\n", "\n\xb2\n", "has 0 values|not in the skeleton"),
        ("\n2\n", "\n" + "2" * 5000 + "\n", "not in the skeleton"),
        ("450", "1e308", "1e[+]09 at most"),
    ],
)
def test_what_the_fuzzer_found_in_amc(tmp_path: Path, old: str, new: str, says: str) -> None:
    (tmp_path / "x.asf").write_text(ASF)
    (tmp_path / "x.amc").write_bytes(AMC.replace(old, new).encode("latin-1"))
    with pytest.raises(InputError, match=says):
        load_motion(tmp_path / "x.amc", tmp_path / "x.asf")


def test_what_the_fuzzer_found_in_asf_and_bvh(tmp_path: Path) -> None:
    (tmp_path / "x.amc").write_text(AMC)
    (tmp_path / "x.asf").write_text(
        ASF.replace("order TX TY TZ RX RY RZ\n", "").replace("dof rx ry rz\n", "")
    )
    with pytest.raises(InputError, match="the root has no order"):
        load_motion(tmp_path / "x.amc", tmp_path / "x.asf")
    (tmp_path / "x.bvh").write_text(BVH.replace("0.01", "1e-320"))
    with pytest.raises(
        InputError,
        match=r"Frame Time: is .*; it needs the positive seconds of a frame, 1e-06 to 10",
    ):
        load_motion(tmp_path / "x.bvh")


@pytest.mark.parametrize(
    "about",
    [
        b"[]",
        b"{}",
        b'{"format": 1, "label": 3, "provenance": {}}',
        b'{"format": 1, "label": "x"}',
        b"[" * 10**5,
    ],
)
def test_what_the_fuzzer_found_in_clouds(tmp_path: Path, about: bytes) -> None:
    collection_of(tmp_path, {"about.npy": npy(np.frombuffer(about, dtype=np.uint8))})
    with pytest.raises(InputError, match="is damaged"):
        Collection(tmp_path)


def test_a_header_that_is_no_python_is_damage(tmp_path: Path) -> None:
    head = b"\x93NUMPY\x01\x00\x0a\x00{'descr': "
    collection_of(tmp_path, {"about.npy": npy(ABOUT), "points.npy": head})
    with pytest.raises(InputError, match="is damaged"):
        Collection(tmp_path).points(0)
