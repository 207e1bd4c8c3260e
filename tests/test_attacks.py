"""What a hostile tester tried, and what is right: one line for each, or nothing at all."""

from __future__ import annotations

import json
import os
import shutil
import struct
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import trimesh

import rtradar as rt
from rtradar.cli import main
from rtradar.clouds.sample_files import Sample, is_whole, sample_path, write_sample
from rtradar.errors import InputError
from rtradar.exchange import open_samples
from rtradar.front_end import Antenna
from rtradar.motion.skeleton import NODES
from rtradar.radar import Radar
from rtradar.recognition import _of_scene
from rtradar.scene.mesh_files import read_mesh
from rtradar.system.files import csv_text


@pytest.mark.parametrize(
    "places",
    [
        [(0.0, 100.0 * y, 100.0 * z) for y in (0, 1) for z in (0, 1)],  # 4 Rx 100 m apart
        [(0.0, 1e-3 * y, 0.0) for y in range(1024)],
    ],
)
def test_arrays_that_need_too_many_beams_are_refused(places: list[Any]) -> None:
    with pytest.raises(InputError, match="beams times elements"):
        Radar(start_frequency_hz=77e9, tx_positions_m=[(0, 0, 0)] * 4, rx_positions_m=places)


def test_an_antenna_has_its_gain_where_its_table_is_0() -> None:
    table = {"azimuth_deg": (-60.0, 0.0, 60.0), "azimuth_db": (-9.0, -3.0, -9.0)}
    with pytest.raises(InputError, match="the largest of azimuth_db is -3 dB; it must be 0"):
        Antenna(pattern="table", gain_dbi=6.0, **table)  # type: ignore[arg-type]


def test_a_copy_of_another_sample_is_not_whole(tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 2)):
        own = Sample(np.zeros((3, 3)), "walk", {"seed": seed, "place": (0.5, 1)})
        write_sample(tmp_path, name, own, np.zeros((2, 3)))
    here = sample_path(tmp_path, "a")
    assert is_whole(here, {"seed": 1, "place": (0.5, 1)})
    shutil.copy(sample_path(tmp_path, "b"), here)
    assert is_whole(here)
    assert not is_whole(here, {"seed": 1, "place": (0.5, 1)})


def test_a_name_of_a_stranger_has_no_escape_sequence() -> None:
    summary = {"parameters": {"scene": "\x1b[31mroom\x07", "snr_db": 20}}
    (line,) = _of_scene(summary, {"snr_db": (0, 30)})
    assert line.isprintable()


def test_a_spreadsheet_runs_no_name() -> None:
    rows = [["=1+1", "@x", "+cmd", "-2+3", "plain", "-1.5", 4]]
    assert csv_text(["name"], rows).splitlines()[1] == "'=1+1,'@x,'+cmd,'-2+3,plain,-1.5,4"


def test_parts_of_samples_that_differ_in_shape_are_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file["if_real"] = np.zeros((6, 2, 4, 8), np.float32)
        file["if_imag"] = np.zeros((6, 2, 4, 1), np.float32)
    with pytest.raises(InputError, match=r"if_real is \(6, 2, 4, 8\), and if_imag"):
        open_samples(tmp_path / "a.nc", Radar(tx_y=2, tx_z=0, rx_y=4, rx_z=0))


HEADER = ",".join(f"{node}_{axis}" for node in NODES for axis in "xyz")


@pytest.mark.parametrize(
    ("column", "values", "says"),
    [
        ("up", ("z", "y"), "line 3: up is 'y', and was 'z'"),
        ("rate_hz", ("30", "60"), "line 3: rate_hz is 60, and was 30"),
    ],
)
def test_what_holds_for_a_table_does_not_change_in_it(
    tmp_path: Path, column: str, values: tuple[str, str], says: str
) -> None:
    file, zeros = tmp_path / "a.csv", ",".join(["1"] * 66)
    file.write_text("\n".join([f"{HEADER},{column}", *(f"{zeros},{one}" for one in values)]))
    with pytest.raises(InputError, match=says):
        rt.load_motion(file)


def test_a_recording_of_too_many_places_is_refused_before_it_takes_memory(tmp_path: Path) -> None:
    joints = np.array([f"j{k}" for k in range(100)])
    places = np.broadcast_to(np.float32(1), (50_001, 100, 3))
    np.savez(tmp_path / "a.npz", positions=places, joints=joints, rate_hz=30.0)
    with pytest.raises(InputError, match=r"50001 frames of 100 joints; .* 5000000"):
        rt.load_motion(tmp_path / "a.npz")


def test_a_mesh_that_moves_has_not_too_many_triangles() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=7, radius=0.2)
    moving = rt.Object("ball", sphere, "metal")
    with pytest.raises(InputError, match="has 327680 triangles; 200000 are allowed of what moves"):
        moving.shape  # noqa: B018


@pytest.mark.parametrize("option", ["--real", "--lanes=2", "--rx-mask=0"])
def test_the_layout_of_a_board_is_not_taken_for_an_array(
    tmp_path: Path, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save(tmp_path / "a.npy", np.zeros((96, 8, 4), np.complex64))
    words = ["process", str(tmp_path / "a.npy"), "--radar", "paper-12ghz", option]
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert f"{option.partition('=')[0]} is of the .bin of a DCA1000" in said
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "out").exists()


WALK = rt.synthetic_motion("walk", seed=0, duration_s=0.3)


@pytest.mark.parametrize(
    "call",
    [
        lambda: rt.load_motion([]),
        lambda: rt.load_motion("a\0.bvh"),
        lambda: rt.Radar.preset([]),
        lambda: rt.Radar.load(3),
        lambda: rt.Radar.load(None),
        lambda: rt.Scene.load([]),
        lambda: rt.synthetic_motion([]),
        lambda: rt.run(WALK, rt.Radar(), fidelity="analytic", out="\0"),
        lambda: rt.run(WALK, rt.Radar(), fidelity="analytic", out=3),
        lambda: rt.compare(WALK, rt.Radar(), out=3),
        lambda: rt.run(WALK, rt.Radar(), detector_options=3),
        lambda: rt.run(WALK, rt.Radar(), model_options=3),
        lambda: rt.motion.place(WALK, start_s="a"),
        lambda: rt.rcs.ellipsoid(1, 1, 1, None, 0),
    ],
)
def test_another_type_is_refused_in_one_line(call: Any) -> None:
    with pytest.raises(ValueError, match=r"^[^\n]*$"):
        call()


# -- messages that say what was wrong --------------------------------------------------------------


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_is_told_as_one(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "adc.bin")
    with pytest.raises(InputError, match="pipe"):
        open_samples(tmp_path / "adc.bin", rt.Radar.preset("iwr1443"))


@pytest.mark.parametrize(
    ("power", "says"), [(np.inf, "finite samples"), (np.nan, "finite samples"), (-1.0, "decibels")]
)
def test_what_is_wrong_with_a_power_is_said(power: float, says: str) -> None:
    with pytest.raises(InputError, match=says):
        rt.process.os_cfar(np.full((64, 64), power))


def test_a_mesh_whose_triangles_are_in_another_file_is_told(tmp_path: Path) -> None:
    buffers = [{"byteLength": 36, "uri": "other.bin"}]
    header = json.dumps({"asset": {"version": "2.0"}, "buffers": buffers}).encode()
    header += b" " * (-len(header) % 4)
    size = 20 + len(header)
    head = struct.pack("<4sIIII", b"glTF", 2, size, len(header), 0x4E4F534A)
    (tmp_path / "a.glb").write_bytes(head + header)
    with pytest.raises(InputError, match=r"another file, 'other\.bin'"):
        read_mesh(tmp_path / "a.glb")


def test_a_profile_named_after_its_board_names_it_once(tmp_path: Path) -> None:
    text = (
        "% Platform:xWR68xx\nsensorStop\nflushCfg\nchannelCfg 15 5 0\nadcCfg 2 1\n"
        "adcbufCfg -1 0 1 1 1\nprofileCfg 0 60 50 7 60 0 0 90 1 256 7000 0 0 158\n"
        "chirpCfg 0 0 0 0 0 0 0 1\nchirpCfg 1 1 0 0 0 0 0 4\nframeCfg 0 1 32 0 50 1 0\n"
    )
    for stem, name in (("iwr6843", "iwr6843"), ("hall", "iwr6843 hall")):
        (tmp_path / f"{stem}.cfg").write_text(text)
        assert rt.Radar.load(tmp_path / f"{stem}.cfg").name == name
