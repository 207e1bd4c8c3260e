"""IF samples in every format: read back by us and by others, equal or as far off as is said."""

from __future__ import annotations

import dataclasses
import json
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
import zarr
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

from rtradar.cli import main
from rtradar.errors import InputError, ValidityWarning
from rtradar.exchange import IF_FORMATS, export, open_samples, read_if
from rtradar.pipeline import process_samples
from rtradar.radar import Radar

RADAR = Radar(
    name="small", tx_y=2, tx_z=1, rx_y=4, rx_z=4, samples_per_chirp=16,
    chirp_duration_s=1e-4, frame_duration_s=3e-3, frame_hop_s=1e-3,
)  # fmt: skip

CENTRES = (np.arange(30) + 0.5).reshape(10, 3) * 1e-4


def make_run(
    folder: Path, chirps: int, seed: int = 0, chunk: int = 12, size: float = 1e-3
) -> np.ndarray:
    """A folder with IF samples and a summary; the samples (chirp, rx, sample) are returned."""
    random = np.random.default_rng(seed)
    shape = (chirps, RADAR.n_rx, RADAR.samples_per_chirp)
    parts = (random.standard_normal((*shape, 2)) * size).astype(np.float32)
    samples = parts.view(np.complex64)[..., 0]
    folder.mkdir(parents=True, exist_ok=True)
    array = zarr.create_array(
        folder / "if.zarr", shape=shape, chunks=(chunk, *shape[1:]), dtype="complex64",
        config={"write_empty_chunks": True},
    )  # fmt: skip
    array[:] = samples
    summary = {"parameters": {"radar": dataclasses.asdict(RADAR)}}
    (folder / "summary.json").write_text(json.dumps(summary))
    return samples


@pytest.fixture
def run(tmp_path: Path) -> tuple[Path, np.ndarray]:
    """Folder and samples (chirp, tx, rx, sample) of a run of 31 chirps, 10 whole TDM cycles."""
    samples = make_run(tmp_path / "walk", 31)
    # Written out by the schedule: chirp m is from Tx m mod 3.
    cube = np.stack([np.stack([samples[3 * cycle + tx] for tx in range(3)]) for cycle in range(10)])
    return tmp_path / "walk", cube


def test_the_folder_itself_is_read_in_that_order(run: tuple[Path, np.ndarray]) -> None:
    folder, cube = run
    read = read_if(folder)
    np.testing.assert_array_equal(read.samples, cube)
    assert read.radar == RADAR


@pytest.mark.parametrize("suffix", IF_FORMATS)
def test_rows_are_read_where_they_are_asked_for(
    run: tuple[Path, np.ndarray], tmp_path: Path, suffix: str
) -> None:
    folder, cube = run
    said = export(folder, tmp_path / f"cube{suffix}")
    found = open_samples(tmp_path / f"cube{suffix}", RADAR)
    rows = cube.reshape(30, 4, 16)
    assert (found.shape, found.dtype, found.radar) == (rows.shape, rows.dtype, RADAR)
    exact = {"atol": 1e-6} if suffix == ".bin" else {"rtol": 0}  # int16 of samples about 1e-3
    for part in (slice(0, 30), slice(4, 11), slice(29, 40), slice(7, 7)):
        np.testing.assert_allclose(found[part], rows[part], **exact)
    if suffix in (".mat", ".nc"):
        read = read_if(tmp_path / f"cube{suffix}")
        assert (said["shape"], read.radar) == ([10, 3, 4, 16], RADAR)
        assert read.samples.tobytes() == cube.tobytes()
    if suffix == ".npy":
        with pytest.raises(InputError, match="does not tell of its radar"):
            read_if(tmp_path / "cube.npy")
        with (tmp_path / "cube.npy").open("ab") as file:
            file.write(b"more")
        with pytest.raises(InputError, match="longer than its header tells"):
            open_samples(tmp_path / "cube.npy", RADAR)
    if suffix == ".zarr":
        with pytest.raises(InputError, match=r"cube\.zarr' is there"):
            export(folder, tmp_path / "cube.zarr")


def test_int16_is_off_by_half_of_its_scale_at_most(
    run: tuple[Path, np.ndarray], tmp_path: Path
) -> None:
    folder, cube = run
    scale = export(folder, tmp_path / "cube.bin")["scale"]
    parts = cube.view(np.float32).reshape(*cube.shape, 2).astype(np.float64)
    # By the documented layout alone, without our reader.
    about = json.loads((tmp_path / "cube.json").read_text())
    assert about["axes"] == ["chirp", "tx", "rx", "sample", "iq"]
    whole = np.fromfile(tmp_path / "cube.bin", "<i2").reshape(about["shape"])
    assert np.abs(whole).max() == 32767
    off = np.abs(whole * about["scale"] - parts)
    assert off.max() <= about["quantisation"] * (1 + 1e-12)
    assert off.max() > 0.9 * scale / 2  # it is rounded, not kept
    read = read_if(tmp_path / "cube.bin")
    off = np.abs(read.samples.view(np.float32).reshape(parts.shape) - parts)
    assert off.max() <= scale / 2 + 2**-24 * np.abs(parts).max()
    assert read.radar == RADAR


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_xarray_opens_netcdf(run: tuple[Path, np.ndarray], tmp_path: Path, engine: str) -> None:
    if engine == "netcdf4":
        pytest.importorskip("netCDF4")
    folder, cube = run
    export(folder, tmp_path / "cube.nc")
    with xarray.open_dataset(tmp_path / "cube.nc", engine=engine) as data:
        assert data.if_real.dims == ("chirp", "tx", "rx", "sample")
        np.testing.assert_array_equal((data.if_real + 1j * data.if_imag).astype(np.complex64), cube)
        np.testing.assert_allclose(data.chirp_time, CENTRES, rtol=1e-12)
        assert "chirp_time" in data.if_real.coords
        assert data.if_real.attrs["units"] == "m"
        np.testing.assert_array_equal(data.tx_position, RADAR.tx)
        # The z-line listens to the Tx of the z-line.
        np.testing.assert_array_equal(data.rx_position[2], RADAR.rx[4:])
        assert data.attrs["start_frequency_hz"] == 12e9


def test_mat_is_laid_out_as_matlab_does(run: tuple[Path, np.ndarray], tmp_path: Path) -> None:
    folder, cube = run
    export(folder, tmp_path / "cube.mat")
    head = (tmp_path / "cube.mat").read_bytes()[:512]
    assert head.startswith(b"MATLAB 7.3 MAT-file")
    assert head[124:128] == b"\x00\x02IM"
    with h5py.File(tmp_path / "cube.mat") as file:
        data = file["if_samples"]
        assert data.attrs["MATLAB_class"] == b"single"
        assert data.dtype.names == ("real", "imag")
        np.testing.assert_array_equal(np.transpose(data["real"]), cube.real)
        assert file["radar/sample_rate_hz"][()].tolist() == [[160_000.0]]
        assert "".join(map(chr, file["radar/name"][:].ravel())) == "small"


@pytest.mark.skipif(
    not shutil.which("octave-cli"),
    reason="octave-cli is not installed: nobody else reads .mat of version 7.3 here",
)
def test_octave_opens_mat(run: tuple[Path, np.ndarray], tmp_path: Path) -> None:
    folder, cube = run
    export(folder, tmp_path / "cube.mat")
    script = (
        "s = load('cube.mat'); x = s.if_samples; printf('%d ', size(x)); "
        "printf('\\n%s\\n', char(s.radar.name)); f = s.radar.start_frequency_hz; "
        "printf('%.17g %.17g %.17g\\n', f, s.chirp_time(2, 3), s.tx_position(3, 1));"
        "y = permute(x, [4 3 2 1]); f = fopen('back.bin', 'w'); "
        "fwrite(f, [real(y(:))'; imag(y(:))'], 'single'); fclose(f);"
    )
    # Without a display it complains on leaving; what it printed counts.
    words = ["octave-cli", "--norc", "--eval", script]
    found = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    sizes, name, numbers, *_ = found.stdout.split("\n")
    assert (sizes, name) == ("10 3 4 16 ", "small"), found.stderr
    assert list(map(float, numbers.split())) == [12e9, CENTRES[1, 2], RADAR.tx[2, 0]]
    assert (tmp_path / "back.bin").read_bytes() == cube.tobytes()


FILES = [suffix for suffix in IF_FORMATS if suffix != ".zarr"]  # which is a folder


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_mat_files_of_others_are_read(tmp_path: Path, version: str) -> None:
    values = np.random.default_rng(0).standard_normal((6, 2, 8, 2)).view(np.complex128)[..., 0]
    for name, own in (("complex", values), ("real", values.real)):
        if version == "5":
            savemat(tmp_path / f"{name}.mat", {"if_samples": own})
        else:  # MATLAB compresses, and names the parts of complex numbers
            parts = np.dtype([("real", "<f8"), ("imag", "<f8")])
            data = own.view(parts) if name == "complex" else own
            with h5py.File(tmp_path / f"{name}.mat", "w") as file:
                file.create_dataset("if_samples", data=data.T, compression="gzip", chunks=True)
    found = open_samples(tmp_path / "complex.mat", RADAR)
    assert found.unit == "count"
    np.testing.assert_array_equal(found[2:5], values[2:5].astype(np.complex64))
    assert open_samples(tmp_path / "real.mat")[:].shape == (6, 2, 4)
    (tmp_path / "none.mat").write_bytes(b"MATLAB 5.0 MAT-file" + bytes(200))
    with pytest.raises(InputError, match="cannot read IF samples"):
        open_samples(tmp_path / "none.mat")


@pytest.mark.parametrize("suffix", FILES)
def test_the_same_samples_give_the_same_file(
    run: tuple[Path, np.ndarray], tmp_path: Path, suffix: str
) -> None:
    export(run[0], tmp_path / f"cube{suffix}")
    first = (tmp_path / f"cube{suffix}").read_bytes()
    export(run[0], tmp_path / f"cube{suffix}")
    assert (tmp_path / f"cube{suffix}").read_bytes() == first


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux can forget a peak")
@pytest.mark.slow
def test_a_long_recording_takes_no_more_memory_than_a_short_one(tmp_path: Path) -> None:
    make_run(tmp_path / "short", 3000, chunk=600)
    make_run(tmp_path / "long", 90_000, chunk=600)  # 46 MB
    # In a process of its own: what other tests have left in the heap decides where arrays find
    # room.
    code = (
        "import sys; from pathlib import Path\n"
        "from rtradar.exchange import IF_FORMATS, export, open_samples\n"
        "from rtradar.pipeline.timing import forget_peak_memory, peak_memory_mb\n"
        "folder = Path(sys.argv[1])\n"
        "def there_and_back(name, suffix):\n"
        "    file = folder / f'{name}{suffix}'\n"
        "    export(folder / name, file)\n"
        "    found = open_samples(file)\n"
        "    for first in range(0, len(found), 600): found[first : first + 600]\n"
        "for suffix in IF_FORMATS:\n"
        "    there_and_back('short', suffix)\n"
        "    forget_peak_memory(); before = peak_memory_mb()\n"
        "    there_and_back('long', suffix)\n"
        "    print(peak_memory_mb() - before)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=True
    )
    # 46 MB are written and read, in blocks of 0.3 MB; the times of all chirps take 0.7 MB.
    grown = [float(line) for line in done.stdout.split()]
    assert len(grown) == len(IF_FORMATS)
    assert max(grown) < 6


def test_what_cannot_be_exported_is_refused_and_leaves_nothing(
    run: tuple[Path, np.ndarray], tmp_path: Path
) -> None:
    folder, _ = run
    for source, out, says in (
        (folder, "cube.xyz", "suffix '.xyz'; allowed: .mat, .nc, .bin, .npy, .zarr for IF samples"),
        (folder, "cube.ply", "is a folder; name the cloud in it"),
        (tmp_path, "cube.mat", "holds no IF samples"),
        (folder / "summary.json", "cube.mat", "is no folder"),
        (folder, "nowhere/cube.mat", "cannot write"),
        (folder, "nowhere/cube.bin", "cannot write"),
    ):
        with pytest.raises(InputError, match=says):
            export(source, tmp_path / out)
    told = (folder / "summary.json").read_bytes()
    with pytest.raises(InputError, match="something else"):
        export(folder, folder / "summary.bin")
    assert (folder / "summary.json").read_bytes() == told
    (tmp_path / "cube.json").mkdir()
    with pytest.raises(InputError, match="a directory"):
        export(folder, tmp_path / "cube.bin")
    wrong = ('{"tx_y": -1}', '{"colour": 1}')
    for text in ("{", "{}", *(f'{{"parameters": {{"radar": {one}}}}}' for one in wrong)):
        (folder / "summary.json").write_text(text)
        with pytest.raises(InputError, match="tells of no radar"):
            export(folder, tmp_path / "cube.mat")
    (folder / "summary.json").write_text('{"parameters": {"radar": {}}}')
    with pytest.raises(InputError, match="the radar of its summary gives"):
        export(folder, tmp_path / "cube.mat")
    (folder / "if.zarr" / "zarr.json").write_text("{")
    with pytest.raises(InputError, match="cannot read IF samples"):
        export(folder, tmp_path / "cube.mat")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cube.json", "walk"]


def test_samples_that_a_later_run_into_the_folder_did_not_keep_are_refused(
    run: tuple[Path, np.ndarray], tmp_path: Path
) -> None:
    summary = json.loads((run[0] / "summary.json").read_text())
    summary["parameters"]["save_if"] = False
    (run[0] / "summary.json").write_text(json.dumps(summary))
    with pytest.raises(InputError, match="of an earlier run than the last one"):
        export(run[0], tmp_path / "x.mat")
    assert not (tmp_path / "x.mat").exists()


def test_samples_that_are_not_finite_are_refused_as_int16(
    run: tuple[Path, np.ndarray], tmp_path: Path
) -> None:
    zarr.open_array(run[0] / "if.zarr", mode="r+")[5, 1, 2] = np.nan
    with pytest.raises(InputError, match="not finite"):
        export(run[0], tmp_path / "cube.bin")
    assert not (tmp_path / "cube.bin").exists()
    export(run[0], tmp_path / "cube.nc")
    assert np.isnan(read_if(tmp_path / "cube.nc").samples).sum() == 1


def test_a_file_of_something_else_is_refused(run: tuple[Path, np.ndarray], tmp_path: Path) -> None:
    export(run[0], tmp_path / "cube.bin")
    (tmp_path / "cube.bin").write_bytes(b"\0" * 10)
    with pytest.raises(InputError, match="5 numbers where the JSON file tells"):
        read_if(tmp_path / "cube.bin")
    for name in ("none.mat", "none.nc", "none.bin"):
        with pytest.raises(InputError, match="cannot read IF samples"):
            read_if(tmp_path / name)
    with pytest.raises(InputError, match="are read from"):
        read_if(tmp_path / "cube.json")


@pytest.mark.parametrize("suffix", [".npy", ".mat", ".nc", ".zarr", ".bin"])
def test_samples_of_other_tx_are_refused(
    run: tuple[Path, np.ndarray], tmp_path: Path, suffix: str
) -> None:
    # Four Rx a Tx and as many samples, but of three Tx where the radar that is given has two.
    folder, cube = run
    path = tmp_path / f"cube{suffix}"
    if suffix == ".npy":
        np.save(path, cube)
    elif suffix == ".zarr":
        zarr.create_array(path, data=cube, chunks=cube.shape)
    else:
        export(folder, path)
    fewer = dataclasses.replace(RADAR, tx_y=1)
    with pytest.raises(InputError, match="cycles of 3 Tx; radar 'small' has 2: give the radar"):
        process_samples(open_samples(path, fewer), fewer)
    with pytest.warns(ValidityWarning, match="nothing was detected"):
        process_samples(open_samples(path, RADAR), RADAR)


@pytest.mark.parametrize("place", ["run", "array"])
def test_chunks_that_are_missing_are_no_zeros(
    run: tuple[Path, np.ndarray], tmp_path: Path, place: str
) -> None:
    folder, _ = run
    export(folder, tmp_path / "cube.zarr")
    store = folder / "if.zarr" if place == "run" else tmp_path / "cube.zarr"
    (store / "c" / "1" / "0" / "0").unlink()
    with pytest.raises(InputError, match="1 of its 3 chunks are missing, as where a copy broke"):
        open_samples(folder if place == "run" else store)


def test_silence_stays_silence_and_is_stored(tmp_path: Path) -> None:
    make_run(tmp_path / "quiet", 24, size=0.0)
    assert export(tmp_path / "quiet", tmp_path / "quiet.bin")["scale"] == 1.0
    export(tmp_path / "quiet", tmp_path / "quiet.zarr")
    for suffix in (".bin", ".zarr"):
        assert not open_samples(tmp_path / f"quiet{suffix}")[:].any()


def test_an_array_of_a_length_that_nobody_stored_is_refused(
    run: tuple[Path, np.ndarray], tmp_path: Path
) -> None:
    path = tmp_path / "cube.zarr"
    export(run[0], path)
    about = json.loads((path / "zarr.json").read_text())
    about["shape"][0] = 2**20
    (path / "zarr.json").write_text(json.dumps(about))
    with pytest.raises(InputError, match="chunks are missing"):
        open_samples(path)
    about["chunk_grid"]["configuration"]["chunk_shape"][0] = 0
    (path / "zarr.json").write_text(json.dumps(about))
    with pytest.raises(InputError, match="cannot read IF samples"):
        open_samples(path)


@given(data=st.data())
def test_junk_is_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    suffix = data.draw(st.sampled_from(FILES))
    base = tmp_path_factory.getbasetemp()
    if not (base / f"good{suffix}").exists():
        make_run(base / "good", 6, chunk=3)
        export(base / "good", base / f"good{suffix}")
        shutil.rmtree(base / "good")
    victim = base / (f"good{suffix}" if suffix != ".bin" else "good.json")
    changed = bytearray(victim.read_bytes())
    for at, value in data.draw(
        st.lists(st.tuples(st.integers(0, len(changed) - 1), st.integers(0, 255)), max_size=30)
    ):
        changed[at] = value
    junk = base / f"junk{suffix}"
    junk.write_bytes((base / f"good{suffix}").read_bytes())
    kept = changed[: data.draw(st.integers(0, len(changed)))]
    junk.with_suffix(victim.suffix).write_bytes(bytes(kept))
    refusal = ""
    try:
        assert open_samples(junk)[:].ndim == 3  # what was hit does not matter to us
    except InputError as error:
        refusal = str(error)
    assert "\n" not in refusal


def test_the_command(
    run: tuple[Path, np.ndarray], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "cube.bin"
    words = ["export", str(run[0]), "--out", str(out), "--json", str(tmp_path / "said.json")]
    assert main(words) == 0
    assert capsys.readouterr().out.startswith("chirp 10, tx 3, rx 4, sample 16; int16; see ")
    said = json.loads((tmp_path / "said.json").read_text())
    assert said["axes"] == ["chirp", "tx", "rx", "sample"]
    assert said["quantisation"] == said["scale"] / 2
    assert main(["export", str(tmp_path), "--out", str(out)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
