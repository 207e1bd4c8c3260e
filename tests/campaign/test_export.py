"""A data set as one Zarr group: what zarr and xarray read is what the collection holds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import zarr

from rtradar.campaign import build_dataset, export_dataset, write_template
from rtradar.campaign.intervals import INTERVAL_KEYS
from rtradar.campaign.samples import Made, SamplePlan
from rtradar.campaign.spec import DRAWN, EACH, RUN_KEYS
from rtradar.campaign.spec_file import read_spec
from rtradar.cli import main
from rtradar.clouds import Collection, Sample
from rtradar.clouds.sample_files import read_sample, write_index, write_sample
from rtradar.errors import InputError

SIZES = (3, 0, 5)


def write_collection(folder: Path, *, frames: tuple[int, ...] = (2, 2, 2)) -> Collection:
    folder.mkdir()
    random = np.random.default_rng(0)
    for number, (size, n) in enumerate(zip(SIZES, frames, strict=True)):
        told = {
            "subject": "unknown", "licence": "unknown" if number else "CC0",
            "recording": f"r{number}", "keep": ["spectrograms", "joints"],
            "snr_db": 10.0 * number, "seed": 2**31 + number, "radar": "small", "pfa": 1e-6,
            "person_position_m": [0.0, 1.0], "limits": ["a limit"],
            "joint_names": ["root", "head"],
        } | ({"tempo": 1.5} if number else {})  # fmt: skip
        maps = {
            "spectrogram": random.random((4, 6)), "spectrogram_time": np.arange(4.0),
            "spectrogram_velocity": np.arange(6.0), "time": 0.1 * np.arange(n),
            "joints": random.random((n, 2, 3)),
        }  # fmt: skip
        sample = Sample(random.random((size, 3)), "walk" if number % 2 else "kick", told)
        write_sample(folder, f"s{number}", sample, random.random((size + 1, 3)), maps)
    write_index(folder, ["s0", "s1", "s2"])
    return Collection(folder)


def test_zarr_and_xarray_read_what_the_collection_holds(tmp_path: Path) -> None:
    collection = write_collection(tmp_path / "data")
    words = ["dataset", "export", str(tmp_path / "data"), "--out", str(tmp_path / "x.zarr")]
    assert main(words) == 0
    group = zarr.open_group(tmp_path / "x.zarr", mode="r")
    with xr.open_zarr(tmp_path / "x.zarr") as data:
        assert data["sample"].values.tolist() == list(collection.ids)
        classes = data["label"].attrs["classes"]
        assert [classes[label] for label in data["label"].values] == collection.labels.tolist()
        for index in range(3):
            one = data.isel(sample=index)
            for name, count in (("points", "n_points"), ("spatial", "n_spatial")):
                own = read_sample(collection.paths[index], name)
                assert int(one[count]) == len(own)
                np.testing.assert_array_equal(one[name].values[: len(own)], own)
                assert np.isnan(one[name].values[len(own) :]).all()
                np.testing.assert_array_equal(group[name][index][: len(own)], own)
            maps = collection.maps(index)
            for name in maps.variables:
                np.testing.assert_array_equal(one[name].values, maps[name].values)
                assert one[name].dims == maps[name].dims
            assert one["spectrogram"].attrs["units"] == "m2"
            for name, value in collection.provenance[index].items():
                read = one[name].values[()]
                assert (json.loads(read) if isinstance(value, list) else read) == value
        coords = "sample coordinate axis joint time spectrogram_time spectrogram_velocity"
        assert set(data.coords) == set(coords.split())
        assert "folder" not in data
        assert data["seed"].dtype == np.int64
        assert data["snr_db"].attrs["units"] == "dB"
        np.testing.assert_array_equal(data["tempo"], [np.nan, 1.5, 1.5])
        assert data["points"].dims == ("sample", "point", "coordinate")
        assert data["coordinate"].values.tolist() == ["time", "range", "velocity"]
        assert data.attrs["counts"] == {"kick": 2, "walk": 1}
        assert data.attrs["licences"] == {"CC0": 1, "unknown": 2}
    card = (tmp_path / "x.zarr" / "README.md").read_text()
    for said in (
        "3 samples of 3 motions of 0 known people, in 2 classes", "| kick | 0 | 2 |",
        "unknown: 2 samples; nobody said what may be done with them", "in 3 samples: a limit",
        "in 1 samples: nothing was detected", "subject unknown: 3 samples", "SNR [dB]: 0 to 20",
        "| `spectrogram` | sample, spectrogram_time, spectrogram_velocity | 3 x 4 x 6 | m2 |",
    ):  # fmt: skip
        assert said in card
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data", "x.zarr"]


@pytest.mark.parametrize(
    "told",
    [
        {"keep": 7, "limits": 7, "label": "x", "licence": "a\nb\ud800"},
        {"keep": ["spectrograms", "sound", []], "seed": 10**400},
        {"keep": ["joints"], "joint_names": 7},
        {"../out": 1},
        {"points": 1},
    ],
)
def test_a_stranger_s_provenance_gives_a_group_or_one_line(
    tmp_path: Path, told: dict[str, Any]
) -> None:
    maps = {"joints": np.zeros((2, 2, 3)), "time": np.zeros(2)}
    write_sample(tmp_path, "a", Sample(np.zeros((2, 3)), "walk", told), np.zeros((0, 3)), maps)
    write_index(tmp_path, ["a"])
    collection = Collection(tmp_path)
    assert collection.to_pandas()["label"].tolist() == [0]
    said = ""
    try:
        export_dataset([tmp_path], tmp_path / "x.zarr")
    except InputError as error:
        said = str(error)
    assert "\n" not in said
    assert said or zarr.open_group(tmp_path / "x.zarr")["points"].shape == (1, 2, 3)
    assert not (tmp_path.parent / "out").exists()


def test_samples_of_several_lengths_are_filled_up(tmp_path: Path) -> None:
    collection = write_collection(tmp_path / "data", frames=(2, 3, 1))
    with pytest.raises(InputError, match=r"joints .* have 3 sizes, such as"):
        collection.torch("joints")
    export_dataset([tmp_path / "data"], tmp_path / "x.zarr")
    with xr.open_zarr(tmp_path / "x.zarr") as data:
        np.testing.assert_array_equal(data["time_of_sample"][0], [0.0, 0.1, np.nan])
        own = read_sample(collection.paths[2], "joints")
        np.testing.assert_array_equal(data["joints"][2, :1], own)
        assert np.isnan(data["joints"][2, 1:]).all()


def test_nothing_is_replaced_and_nothing_half_written_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_collection(tmp_path / "data")
    (tmp_path / "mine").write_text("mine")
    before = sorted(tmp_path.iterdir())
    there = "is there already"
    for out, says in (("mine", there), ("data", there), ("none/x.zarr", "there is no folder")):
        words = ["dataset", "export", str(tmp_path / "data"), "--out", str(tmp_path / out)]
        assert main(words) == 2
        said = capsys.readouterr().err
        assert says in said
        assert said.count("\n") == 1
    (tmp_path / "data" / "s2.npz").write_bytes((tmp_path / "data" / "s2.npz").read_bytes()[:-700])
    monkeypatch.setattr("rtradar.campaign.export.data_card", lambda *_: 1 / 0)
    with pytest.raises(InputError, match="damaged"):
        export_dataset([tmp_path / "data"], tmp_path / "x.zarr")
    write_index(tmp_path / "data", ["s0"])
    with pytest.raises(ZeroDivisionError):
        export_dataset([tmp_path / "data"], tmp_path / "x.zarr")
    assert sorted(tmp_path.iterdir()) == before
    assert (tmp_path / "mine").read_text() == "mine"


def test_the_file_to_begin_with_can_be_built_and_has_every_key(
    here: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fake(plan: SamplePlan) -> Made:
        return Made(Sample(np.zeros((3, 3)), plan.label, plan.parameters), np.zeros((0, 3)), 1.0)

    monkeypatch.setattr("rtradar.campaign.build.make_sample", fake)
    monkeypatch.chdir(tmp_path)
    assert main(["dataset", "init"]) == 0
    assert "rtradar dataset build dataset.toml --out DIR" in capsys.readouterr().out
    assert build_dataset(Path("dataset.toml"), Path("out"))["made"] == 8
    text = before = Path("dataset.toml").read_text()
    for key in (*RUN_KEYS, *DRAWN, *EACH, *INTERVAL_KEYS, "seed", "keep", "folder", "skeleton"):
        assert f"{key} = " in text, key
    # Everything that is commented out may be put in.
    for key in ("pfa", "keep ", "spreading"):
        text = text.replace(f"# {key}", key)
    Path("more.toml").write_text(text)
    assert len(read_spec(Path("more.toml")).keep) == 4
    assert main(["dataset", "init"]) == 2
    assert "'dataset.toml' is there already; give another name" in capsys.readouterr().err
    assert Path("dataset.toml").read_text() == before
    with pytest.raises(InputError, match="give a folder that exists"):
        write_template(Path("none/x.toml"))
