"""Long recordings are read, made and placed by blocks of frames, and the result is the same."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rtradar.errors import InputError
from rtradar.motion import ACTIVITIES, Motion, load_motion, place, synthetic_motion
from rtradar.motion.formats import text_file as textfile
from rtradar.motion.skeleton import NODES


@pytest.mark.parametrize("frames", [1, 4, 5, 11])
def test_amc_in_pieces(
    asf_files: tuple[Path, Path],
    in_pieces: Callable[[], None],
    same: Callable[[Motion, Motion], None],
    frames: int,
) -> None:
    path, skeleton = asf_files
    head = path.read_bytes().decode("latin-1").split("\n1", maxsplit=1)[0]
    poses = "".join(
        f"\n{frame}\nroot {frame} 2 3 0 {40 * frame} 0\nfirst 0 0 {30 * frame}\nsecond {90 * frame}"
        for frame in range(1, frames + 1)
    )
    path.write_text(head + poses, "latin-1")
    whole = load_motion(path, skeleton)
    assert len(whole.root_positions) == frames
    in_pieces()
    same(load_motion(path, skeleton), whole)
    path.write_text(head + poses.replace(f"first 0 0 {30 * frames}", "first 0 0"), "latin-1")
    with pytest.raises(InputError, match="2 values"):
        load_motion(path, skeleton)


@pytest.mark.parametrize(
    "activity",
    # All are stitched and kept by the same code: one is enough within seconds.
    [one if one == "walk" else pytest.param(one, marks=pytest.mark.slow) for one in ACTIVITIES],
)
def test_actors_in_pieces(
    activity: str, in_pieces: Callable[[], None], same: Callable[[Motion, Motion], None]
) -> None:
    duration_s = 4.0 if activity == "jump" else 0.9  # several jumps, each of which ends in the next
    whole = synthetic_motion(activity, seed=3, duration_s=duration_s)
    placed = place(whole, start_s=0.5, heading_deg=20.0)
    times = np.linspace(0.0, placed.duration_s, 40)
    poses = placed.at(times)
    in_pieces()
    again = synthetic_motion(activity, seed=3, duration_s=duration_s)
    same(again, whole)
    assert not again.rotations.flags.writeable  # it does wait in a file
    placed_again = place(again, start_s=0.5, heading_deg=20.0)
    same(placed_again, placed)
    for ours, theirs in zip(placed_again.at(times), poses, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    same(again.scaled(0.5), whole.scaled(0.5))


def test_signs_go_on_over_blocks(in_pieces: Callable[[], None]) -> None:
    rng = np.random.default_rng(1)
    smooth = np.stack(
        [np.cos(np.arange(20) / 9), np.sin(np.arange(20) / 9)] + [np.zeros(20)] * 2, axis=1
    )
    signs = rng.choice([-1.0, 1.0], (20, 2, 1))
    given = {
        "name": "signs",
        "joints": ("a", "b"),
        "parents": (-1, 0),
        "offsets": np.ones((2, 3)),
        "root_positions": np.zeros((20, 3)),
        "rotations": smooth[:, None] * signs,
        "rate_hz": 10.0,
    }
    in_pieces()
    np.testing.assert_array_equal(Motion(**given).rotations, smooth[:, None] * signs[0])  # type: ignore[arg-type]


def test_a_line_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "long.bvh"
    path.write_text("HIERARCHY " + "x" * 2_000_000)
    with pytest.raises(InputError, match=r"long.bvh: a line of more than 1000000 characters"):
        load_motion(path)
    monkeypatch.setattr(textfile, "_MOST_BYTES", 1_000_000)
    with pytest.raises(
        InputError, match=r"long.bvh: 2 MB; a BVH motion file may have 1 MB: cut it"
    ):
        load_motion(path)


def test_other_units_of_angles_after_the_first_frame_are_refused(
    asf_files: tuple[Path, Path],
) -> None:
    path, skeleton = asf_files
    whole = load_motion(path, skeleton)
    text = path.read_text("latin-1")
    path.write_text(text + "\n:DEGREES\n", "latin-1")
    np.testing.assert_array_equal(load_motion(path, skeleton).rotations, whole.rotations)
    path.write_text(text + "\n:RADIANS\n", "latin-1")
    with pytest.raises(InputError, match=r"two.amc, line \d+: :RADIANS after the first frame"):
        load_motion(path, skeleton)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the unit of ru_maxrss differs")
def test_memory_does_not_grow_with_the_recording() -> None:
    # Ten minutes: rotations alone are 51 MB, as made, turned and placed.
    code = """
import resource
from rtradar.motion import place, synthetic_motion
place(synthetic_motion("kick")).at([0.0, 2.0])
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
motion = place(synthetic_motion("kick", duration_s=600.0))
motion.at([0.0, 300.0, 600.0])
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)
"""
    grown_mib = float(
        subprocess.run(
            [sys.executable, "-c", code], check=True, capture_output=True, text=True
        ).stdout
    )
    assert grown_mib < 25


@pytest.mark.parametrize("name", ["two.amc", "two.asf", "bad.bvh"])
def test_a_file_is_closed_when_an_error_is_told(asf_files: tuple[Path, Path], name: str) -> None:
    path, skeleton = asf_files
    bad = path.with_name(name)
    bad.write_text(
        (bad.read_text("latin-1") if bad.exists() else "HIERARCHY\nROOT a\n{\n") + "\noops x\n" * 9,
        "latin-1",
    )
    if name == "two.asf":
        bad.write_text(bad.read_text("latin-1").replace("length 0.45", "length oops"), "latin-1")
    try:
        load_motion(path if "two" in name else bad, skeleton if "two" in name else None)
    except InputError:
        if sys.platform == "linux":  # the traceback is still there, and all that its frames hold
            assert str(bad) not in [
                os.path.realpath(f"/proc/self/fd/{one}") for one in os.listdir("/proc/self/fd")
            ]
    else:
        pytest.fail("no error")


@pytest.mark.parametrize("activity", ["kick", "punch", "jumping_jack", "stand"])
def test_a_short_take_is_the_beginning_of_a_long_one(activity: str) -> None:
    short, long = (synthetic_motion(activity, seed=5, duration_s=seconds) for seconds in (0.6, 3.0))
    arms = [
        NODES.index(f"{side}_{node}") for side in "lr" for node in ("elbow", "wrist")
    ]  # legs reach as far as all need it
    np.testing.assert_allclose(
        short.rotations[:, arms], long.rotations[: len(short.rotations), arms], atol=1e-12
    )
