"""Files whose names are no UTF-8, from the recording to the page."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import rtradar as rt
from rtradar.system.checks import printable

NAME = b"caf\xe9"
BVH = """HIERARCHY
ROOT hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  End Site
  {
    OFFSET 0 1 0
  }
}
MOTION
Frames: 2
Frame Time: 0.1
0 1 0 0 0 0
0 1 0 0 0 10
"""


def put(folder: bytes, ending: bytes, text: str) -> str:
    path = os.path.join(folder, NAME + ending)
    try:
        Path(os.fsdecode(path)).write_text(text)
    except OSError:
        pytest.skip("this file system has names of UTF-8 alone")
    return os.fsdecode(path)


@pytest.mark.skipif(sys.platform == "win32", reason="names there are Unicode")
def test_what_takes_its_name_from_a_file_has_one_that_pages_can_hold(tmp_path: Path) -> None:
    folder = os.fsencode(tmp_path)
    assert rt.load_motion(put(folder, b".bvh", BVH), unit_m=1.0).name == "caf?"
    assert rt.Radar.load(put(folder, b".toml", "tx_z = 0\nrx_z = 0\n")).name == "caf?"
    assert rt.Scene.load(put(folder, b".toml", "")).name == "caf?"
    assert printable("a\nb\u2028\x85é²") == "a?b??é²"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="names there are Unicode")
def test_a_run_into_such_a_folder_and_its_page(tmp_path: Path) -> None:
    folder = os.fsencode(tmp_path)
    text = "tx_y = 2\nrx_y = 2\ntx_z = 0\nrx_z = 0\nchirp_duration_s = 250e-6\n"
    radar = put(folder, b".toml", f"{text}frame_duration_s = 0.05\n")
    out, page = (os.path.join(folder, NAME + ending) for ending in (b"", b".html"))
    run = [b"run", b"synthetic:walk", b"--duration", b"0.2", b"--fidelity", b"analytic"]
    run += [b"--radar", os.fsencode(radar), b"--out", out]
    for words in (run, [b"view", out, b"--out", page]):
        command = [os.fsencode(sys.executable), b"-m", b"rtradar", *words]
        done = subprocess.run(command, capture_output=True, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert rb"caf\udce9" in done.stdout
    summary = json.loads(Path(os.fsdecode(out), "summary.json").read_text())
    assert summary["parameters"]["radar"]["name"] == "caf?"
    assert "caf?" in Path(os.fsdecode(page)).read_text(encoding="utf-8")
