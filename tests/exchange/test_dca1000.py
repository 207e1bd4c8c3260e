"""The words of a DCA1000: by TI's tables, as xwr reads them, and to the bit there and back."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import zarr
from hypothesis import given
from hypothesis import strategies as st

import rtradar as rt
from rtradar.cli import main
from rtradar.errors import InputError
from rtradar.exchange import Dca1000Layout, export, open_samples
from rtradar.exchange.int16_files import of_radar, pack, unpack, words_of
from rtradar.pipeline.output.writer import open_maps

RADAR = rt.Radar(
    name="board", tx_y=2, tx_z=0, rx_y=4, rx_z=0, samples_per_chirp=4,
    chirp_duration_s=1e-4, frame_duration_s=3e-3, frame_hop_s=1e-3,
)  # fmt: skip


def radar_of(n_rx: int, samples: int = 4) -> rt.Radar:
    return dataclasses.replace(RADAR, rx_y=n_rx, samples_per_chirp=samples)


def named(n_rx: int, n_samples: int, real: bool = False) -> np.ndarray:
    """One chirp whose parts say what they are: 100 rx + 10 sample, and 1 more for Q."""
    rx, sample = np.ogrid[:n_rx, :n_samples]
    first = 100 * rx + 10 * sample
    return np.stack([first] if real else [first, first + 1], axis=-1)[None].astype(np.int16)


@pytest.mark.parametrize(
    ("layout", "n_rx", "words"),
    [
        # SWRA581, xWR16xx with DCA1000: Rx by Rx; I, I, then Q, Q of two samples.
        (Dca1000Layout(2), 2, [0, 10, 1, 11, 20, 30, 21, 31, 100, 110, 101, 111, 120, 130]),
        (Dca1000Layout(2, q_first=True), 2, [1, 11, 0, 10, 21, 31, 20, 30, 101, 111]),
        (Dca1000Layout(2, real=True), 2, [0, 10, 20, 30, 100, 110, 120, 130]),
        # The same, xWR14xx: I of all lanes, then Q of all lanes, sample by sample.
        (Dca1000Layout(4), 4, [0, 100, 200, 300, 1, 101, 201, 301, 10, 110]),
        (Dca1000Layout(4), 2, [0, 100, 0, 0, 1, 101, 0, 0, 10, 110, 0, 0, 11, 111]),
        (Dca1000Layout(4, rx_mask=0b1010), 2, [0, 0, 0, 100, 0, 1, 0, 101, 0, 10]),
        (Dca1000Layout(4, real=True), 4, [0, 100, 200, 300, 10, 110, 210, 310, 20]),
    ],
)
def test_the_order_is_that_of_the_application_report(
    layout: Dca1000Layout, n_rx: int, words: list[int]
) -> None:
    packed = pack(named(n_rx, 4, layout.real), layout)
    assert packed[0, : len(words)].tolist() == words


@given(data=st.data())
def test_words_are_read_as_they_are_written(data: st.DataObject) -> None:
    real, n_rx = data.draw(st.booleans()), data.draw(st.integers(1, 4))
    lanes = data.draw(st.sampled_from([2, 4]))
    masks = [mask for mask in range(1, 16) if mask.bit_count() == n_rx]
    layout = Dca1000Layout(
        lanes, real, not real and data.draw(st.booleans()), data.draw(st.sampled_from(masks))
    )
    radar = radar_of(n_rx, 2 * data.draw(st.integers(2, 5)))
    shape = (3, n_rx, radar.samples_per_chirp * (2 if real else 1), 1 if real else 2)
    seed = data.draw(st.integers(0, 99))
    parts = np.random.default_rng(seed).integers(-(2**15), 2**15, shape, np.int16, endpoint=False)
    words = pack(parts, of_radar(layout, radar))
    assert words.shape == (3, words_of(layout, radar))
    np.testing.assert_array_equal(unpack(words, layout, radar), parts)


@pytest.mark.parametrize("q_first", [False, True])
def test_xwr_reads_the_same_samples(q_first: bool) -> None:
    rsp = pytest.importorskip("xwr.rsp")
    parts = np.random.default_rng(0).integers(-(2**15), 2**15 - 1, (6, 4, 16, 2), np.int16)
    words = pack(parts, Dca1000Layout(2, q_first=q_first))
    # Its radars send (chirp, tx, rx, words); by default it takes the order of the mmWave SDK.
    theirs = rsp.iq_from_iiqq(words.reshape(3, 2, 4, 32), sample_swap=not q_first)
    ours = (parts[..., 0] + 1j * parts[..., 1]).reshape(3, 2, 4, 16)
    np.testing.assert_array_equal(theirs, ours)


def make_run(folder: Path, radar: rt.Radar, chirps: int = 63) -> np.ndarray:
    shape = (chirps, radar.n_rx, radar.samples_per_chirp, 2)
    parts = np.random.default_rng(1).integers(-20_000, 20_000, shape).astype(np.float32)
    parts.flat[0] = 32_767.0  # so that the scale is 1
    samples = parts.view(np.complex64)[..., 0]
    zarr.create_array(folder / "if.zarr", data=samples, chunks=(10, *samples.shape[1:]))
    summary = {"parameters": {"radar": dataclasses.asdict(radar)}}
    (folder / "summary.json").write_text(json.dumps(summary))
    return samples


@pytest.mark.parametrize("lanes", [2, 4])
@pytest.mark.parametrize("multiplexing", ["tdm", "ddm"])
def test_a_file_is_read_to_the_bit(tmp_path: Path, lanes: int, multiplexing: str) -> None:
    radar = dataclasses.replace(RADAR, multiplexing=multiplexing)
    samples = make_run(tmp_path / "run", radar)
    said = export(tmp_path / "run", tmp_path / "adc.bin", dca1000=Dca1000Layout(lanes))
    assert said["scale"] == 1.0
    whole = 62 if multiplexing == "tdm" else 63
    found = open_samples(tmp_path / "adc.bin")
    assert found.radar == radar
    np.testing.assert_array_equal(found[:], samples[:whole])
    # As a board leaves it: no text beside it.
    (tmp_path / "adc.json").unlink()
    found = open_samples(tmp_path / "adc.bin", radar, Dca1000Layout(lanes))
    np.testing.assert_array_equal(found[5:23], samples[5:23])


def test_real_samples_are_the_same_signal_but_for_half_of_range_0(tmp_path: Path) -> None:
    samples = make_run(tmp_path / "run", RADAR)
    said = export(tmp_path / "run", tmp_path / "adc.bin", dca1000=Dca1000Layout(real=True))
    found = open_samples(tmp_path / "adc.bin")[:]
    off = np.fft.fft(found - samples[:62], axis=-1)
    assert np.abs(off[..., 0].real).max() < 5 * said["scale"]
    assert np.abs(off[..., 1:]).max() < 5 * said["scale"]


@pytest.mark.parametrize(
    ("name", "lanes"),
    [("iwr1443", 4), ("awr2243", 4), ("AWR1243 mine", 4), ("iwr6843", 2), ("board", 2)],
)
def test_the_name_of_the_radar_tells_the_lanes(name: str, lanes: int) -> None:
    assert of_radar(Dca1000Layout(), dataclasses.replace(RADAR, name=name)).lanes == lanes


@pytest.mark.parametrize(
    ("layout", "radar", "says"),
    [
        ({"rx_mask": 7}, RADAR, "rx_mask = 7 switches 3 Rx on, radar 'board' has 4"),
        ({"lanes": 4}, radar_of(5), "has 5 Rx, and 4 lanes carry at most 4"),
        ({}, radar_of(4, 5), "send complex samples in pairs, and radar 'board' has 5"),
    ],
)
def test_what_no_chip_sends_is_refused(
    tmp_path: Path, layout: dict[str, int], radar: rt.Radar, says: str
) -> None:
    (tmp_path / "adc.bin").write_bytes(bytes(64))
    with pytest.raises(InputError, match=says):
        open_samples(tmp_path / "adc.bin", radar, Dca1000Layout(**layout))


@pytest.mark.parametrize("layout", [{"lanes": 3}, {"rx_mask": 16}, {"real": True, "q_first": True}])
def test_layouts_that_are_none_are_refused(layout: dict[str, int]) -> None:
    with pytest.raises(InputError, match="DCA1000: "):
        Dca1000Layout(**layout)


def test_a_file_of_another_length_or_without_a_radar_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "adc.bin"
    file.write_bytes(bytes(1001))
    says = (
        r"has 1001 bytes, which are 15\.6406 chirps of radar 'board' \(4 Rx, 4 complex samples, "
        r"2 lanes: 64 bytes\), no whole number of cycles of 2; give .* or cut it to its first 896 "
    )
    with pytest.raises(InputError, match=says):
        open_samples(file, RADAR)
    file.write_bytes(bytes(64 * 15))
    with pytest.raises(InputError, match=r"which are 15 chirps .* cut it to its first 896 bytes"):
        open_samples(file, RADAR)
    frames = dataclasses.replace(RADAR, chirps_per_frame=8, frame_period_s=0.1)
    with pytest.raises(InputError, match=r"no whole number of frames of 8; .* first 512 bytes"):
        open_samples(file, frames)
    with pytest.raises(InputError, match="no JSON file beside it tells of its radar"):
        open_samples(file)
    file.write_bytes(b"")
    with pytest.raises(InputError, match="has 0 bytes"):
        open_samples(file, RADAR)
    file.write_bytes(bytes(640))
    found = open_samples(file, RADAR)
    file.write_bytes(bytes(64))
    with pytest.raises(InputError, match="it became shorter while it was read"):
        found[:]


def test_process_gives_the_maps_of_the_run_to_the_step_of_int16(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    radar = dataclasses.replace(RADAR, samples_per_chirp=64, bandwidth_hz=1e9)
    motion = rt.synthetic_motion("walk", duration_s=0.1)
    rt.run(motion, radar, fidelity="analytic", out=tmp_path / "run", save_if=True)
    adc, out = str(tmp_path / "adc.bin"), str(tmp_path / "out")
    assert main(["export", str(tmp_path / "run"), "--out", adc, "--format", "dca1000"]) == 0
    assert "chirp 1000, rx 4, sample 64; int16" in capsys.readouterr().out
    scale = json.loads((tmp_path / "adc.json").read_text())["scale"]
    assert main(["process", adc, "--out", out, "--quiet"]) == 0
    assert (tmp_path / "out" / "report.html").is_file()
    found, wanted = (
        np.sqrt(open_maps(folder / "maps.h5")["range_doppler"].values)
        for folder in (tmp_path / "out", tmp_path / "run")
    )
    # Rounding is noise of the power scale^2 / 6 in each sample, that is, of
    # looks * scale^2 / 6 * bandwidth of the windows / samples in a cell; 6 times its root is
    # beyond all cells.
    noise = 8 * scale**2 / 6 * 1.5**2 / (64 * radar.cycles_per_frame)
    assert np.abs(found - wanted).max() < 6 * np.sqrt(noise)
    assert np.abs(found - wanted).max() > 0
    capsys.readouterr()
    assert main(["view", out, "--no-browser"]) == 2
    assert "which have no body to show; look at its report.html" in capsys.readouterr().err
    files = json.loads((tmp_path / "out" / "summary.json").read_text())["files"]
    wanted = {"maps.h5", "cloud_rdt.npz", "cloud_xyz.npz", "report.html"}
    assert wanted <= set(files)


def test_the_command_refuses_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "adc.bin").write_bytes(bytes(999))
    for more, says in (
        (["--radar", "paper-12ghz"], "which are 0.121948 chirps"),
        (["--radar", "paper-12ghz", "--rx-mask", "3"], "switches 2 Rx on"),
        ([], "none is given (--radar)"),
        (["--pfa", "3"], "pfa = 3"),
    ):
        out = tmp_path / "out"
        assert main(["process", str(tmp_path / "adc.bin"), *more, "--out", str(out)]) == 2
        said = capsys.readouterr().err
        assert says in said
        assert said.count("\n") == 1
        assert not out.exists()


def packed(data: bytes, lost: tuple[int, ...] = (), header: int = 10) -> bytes:
    """Words in packets, as the board sends them: number, (length,) bytes before, 1456 bytes."""
    found = []
    for number, begin in enumerate(range(0, len(data), 1456), start=1):
        if number in lost:
            continue
        own = data[begin : begin + 1456]
        middle = len(own).to_bytes(4, "little") if header == 14 else b""
        found.append(number.to_bytes(4, "little") + middle + begin.to_bytes(6, "little") + own)
    return b"".join(found)


@pytest.mark.parametrize("header", [10, 14])
def test_headers_of_packets_are_left_out(tmp_path: Path, header: int) -> None:
    words = np.random.default_rng(3).integers(-999, 999, 90 * words_of(Dca1000Layout(2), RADAR))
    data = words.astype("<i2").tobytes()
    (tmp_path / "plain.bin").write_bytes(data)
    plain = open_samples(tmp_path / "plain.bin", RADAR)
    (tmp_path / "packets.bin").write_bytes(packed(data, header=header))
    with pytest.warns(rt.ValidityWarning, match=r"\d packets with headers, which are left out$"):
        found = open_samples(tmp_path / "packets.bin", RADAR)
    assert found.shape == plain.shape
    np.testing.assert_array_equal(found.read(1, 60), plain.read(1, 60))
    (tmp_path / "lost.bin").write_bytes(packed(data, lost=(2,), header=header))
    with pytest.warns(rt.ValidityWarning, match="1 were lost, and zeros stand for them"):
        found = open_samples(tmp_path / "lost.bin", RADAR)
    there, ours = (one.read(0, one.shape[0]).ravel() for one in (plain, found))
    gone = slice(1456 // 4, 2 * 1456 // 4)
    assert not ours[gone].any()
    assert np.count_nonzero(ours != there) <= 1456 // 4


def test_a_capture_that_stops_in_a_frame_ends_with_the_frame_before(tmp_path: Path) -> None:
    words = np.random.default_rng(3).integers(-999, 999, 91 * words_of(Dca1000Layout(2), RADAR))
    (tmp_path / "a.bin").write_bytes(packed(words.astype("<i2").tobytes()))
    with pytest.warns(rt.ValidityWarning, match="the last 64 bytes are no whole frame"):
        assert open_samples(tmp_path / "a.bin", RADAR).shape[0] == 90
