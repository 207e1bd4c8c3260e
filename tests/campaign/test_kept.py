"""Maps and joints that a data set keeps: those of a run, of one size, the same to the byte."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import torch
import xarray as xr
from torch.utils.data import DataLoader

import rtradar as rt
from rtradar.campaign import build_dataset, export_dataset
from rtradar.campaign.kept import capture_of
from rtradar.campaign.samples import make_sample, plan_samples
from rtradar.campaign.spec_file import read_spec
from rtradar.clouds import Collection
from rtradar.clouds.sample_files import check_size, write_index, write_sample
from rtradar.errors import InputError
from rtradar.motion.skeleton import NODES

LINE = "chirp_duration_s = 250e-6\nsamples_per_chirp = 128\nframe_duration_s = 0.05\n"
RADAR = "tx_y = 2\ntx_z = 0\nrx_y = 4\nrx_z = 0\n" + LINE
TALL = "tx_z = 2\ntx_y = 0\nrx_z = 4\nrx_y = 0\n" + LINE
KEEP = 'keep = ["spectrograms", "joints", "range_azimuth", "range_doppler"]\n'
SPEC = """
[windows]
start_s = 0.1
duration_s = 0.2
[each]
radar = ["small.toml"]
fidelity = ["analytic"]
[drawn]
offset_x_m = [0.5, 0.5]
[[synthetic]]
label = "walk"
count = 2
[[synthetic]]
label = "kick"
count = 1
"""


def write(folder: Path, text: str) -> Path:
    (folder / "small.toml").write_text(RADAR)
    (folder / "set.toml").write_text(text)
    return folder / "set.toml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("kept")


@pytest.fixture
def built(here: None, folder: Path) -> rt.Collection:
    """What the first test that asks for it builds."""
    if not (folder / "out").exists():
        build_dataset(write(folder, KEEP + SPEC), folder / "out")
    return rt.Collection(folder / "out")


def test_maps_are_those_of_a_run(built: rt.Collection, folder: Path, tmp_path: Path) -> None:
    maps, told = built.maps(0), built[0].provenance
    motion = rt.synthetic_motion(
        built[0].label,
        seed=told["subject_seed"],
        duration_s=told["take_s"],
        **{key: told[key] for key in ("height_m", "build", "tempo", "amplitude", "side", "take")},
    )
    plans = plan_samples(read_spec(folder / "set.toml"))
    (plan,) = (plan for plan in plans if plan.identity == built.ids[0])
    settings = vars(plan.run_settings())
    rt.run(motion, plan.radar, plan.scene, out=tmp_path / "run", **settings)
    with h5py.File(tmp_path / "run" / "maps.h5") as file:
        for name in ("spectrogram", "range_doppler", "range_azimuth"):
            np.testing.assert_array_equal(maps[name], file[name])
            for axis in maps[name].dims:
                np.testing.assert_array_equal(maps[axis], file[axis])
            assert maps[name].attrs["units"] == file[name].attrs["units"] == "m2"
    assert maps["joints"].dims == ("time", "joint", "axis")
    assert maps["joint"].values.tolist() == list(NODES)
    # The interval stands with its mean root at the place of the person.
    root = maps["joints"].sel(joint="root").mean("time")
    assert float(root.sel(axis="x")) == pytest.approx(0.5, abs=0.1)
    assert 0.7 < float(root.sel(axis="z")) < 1.2


@pytest.mark.parametrize(
    "options",
    [{}, {"fidelity": "specular", "heading_deg": 20.0, "clutter_removal": "mean", "seed": 3}],
)
def test_clouds_are_those_of_a_run(folder: Path, options: dict[str, Any]) -> None:
    write(folder, KEEP + SPEC)
    radar = rt.Radar.load(folder / "small.toml")
    motion = rt.synthetic_motion("walk", duration_s=0.5)
    taken: Any = {"variant": "cpu", "fidelity": "analytic", "start_s": 0.1, "duration_s": 0.2}
    taken |= options
    result = rt.run(motion, radar, **taken)
    clouds = capture_of([motion], radar, rt.Scene(), (), **taken).clouds
    np.testing.assert_array_equal(clouds.rdt.points, result.points)
    np.testing.assert_array_equal(clouds.spatial.points, result.spatial.points)
    assert len(clouds.rdt.points)
    assert len(clouds.spatial.points)


def test_everything_kept_can_be_batched(built: rt.Collection) -> None:
    assert set(built.kinds) == {"clouds", "spatial", *eval(KEEP.partition("=")[2])}
    for kind in built.kinds:
        ((values, labels),) = DataLoader(built.torch(kind), batch_size=8)
        assert (values.dtype, len(values), len(labels)) == (torch.float32, 3, 3)
        if kind not in ("clouds", "spatial"):
            own = built.maps(2)[{"spectrograms": "spectrogram"}.get(kind, kind)]
            np.testing.assert_array_equal(values[2].numpy(), own.astype(np.float32))


def test_a_second_build_gives_the_same_bytes_and_mends_what_is_damaged(
    built: rt.Collection, folder: Path
) -> None:
    paths = built.paths
    before = [path.read_bytes() for path in paths]
    paths[1].write_bytes(before[1][:-100_000])
    assert build_dataset(folder / "set.toml", folder / "out")["made"] == 1
    assert [path.read_bytes() for path in paths] == before


def test_what_is_kept_changes_ids_and_its_order_does_not(tmp_path: Path) -> None:
    turned = KEEP.replace('"joints", ', "").replace("]", ', "joints"]')
    ids = [
        [plan.identity for plan in plan_samples(read_spec(write(tmp_path, keep + SPEC)))]
        for keep in ("", "keep = []\n", KEEP, turned)
    ]
    assert ids[0] == ids[1] != ids[2] == ids[3]


def test_nothing_more_is_kept_unless_asked_for(tmp_path: Path) -> None:
    made = make_sample(plan_samples(read_spec(write(tmp_path, SPEC)))[0].packed())
    assert made.maps == {}
    assert "keep" not in made.sample.provenance


def made_with(folder: Path, *texts: str) -> list[Any]:
    """Make one sample of each specification, of the same take."""
    found = []
    for text in texts:
        plans = plan_samples(read_spec(write(folder, text + SPEC)))
        plans.sort(key=lambda plan: str(plan.parameters["recording"]))
        found.append(make_sample(plans[0].packed()))
    return found


def test_without_angles_the_other_clouds_are_the_same(here: None, tmp_path: Path) -> None:
    with_angles, without = made_with(tmp_path, "angles = true\n", "angles = false\n")
    np.testing.assert_array_equal(with_angles.sample.points, without.sample.points)
    assert len(with_angles.spatial) > 0
    assert without.spatial.shape == (0, 3)
    assert "angles" not in with_angles.sample.provenance
    assert without.sample.provenance["angles"] is False
    assert build_dataset(tmp_path / "set.toml", tmp_path / "out")["made"] == 3
    clouds = Collection(tmp_path / "out")
    assert all(clouds.spatial(index).shape == (0, 3) for index in range(3))


def test_without_clouds_what_is_kept_is_the_same(here: None, tmp_path: Path) -> None:
    kept = 'keep = ["spectrograms", "joints"]\n'
    whole, alone = made_with(tmp_path, kept, "clouds = false\n" + kept)
    assert alone.sample.points.shape == alone.spatial.shape == (0, 3)
    assert alone.sample.provenance["clouds"] is False
    assert whole.maps.keys() == alone.maps.keys()
    for name, values in whole.maps.items():
        np.testing.assert_array_equal(values, alone.maps[name])
    assert build_dataset(tmp_path / "set.toml", tmp_path / "out")["made"] == 3
    assert len(Collection(tmp_path / "out")) == 3
    with pytest.raises(InputError, match="nothing would be left"):
        read_spec(write(tmp_path, "clouds = false\n" + SPEC))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("angles = 1\n" + SPEC, "angles = 1; it must be true or false"),
        ("angles = false\n" + KEEP + SPEC, "angles = false, and keep has range_azimuth; leave one"),
        ('keep = ["pictures"]\n' + SPEC, "keep = ['pictures']; it must be a list of: spectrogra"),
        ('keep = "joints"\n' + SPEC, "keep = 'joints'; it must be a list of"),
        (
            KEEP + SPEC.replace('"small.toml"', '"small.toml", "paper-12ghz"'),
            "maps of radars small, paper-12ghz have several sizes",
        ),
        (KEEP + SPEC.replace("small", "tall"), "radar 'tall' measures no azimuth; leave range_azi"),
        (
            KEEP + '[[recordings]]\nfile = "a.bvh"\nlabel = "a"\nsubject = "b"\nlicence = "c"\n',
            "intervals differ in length",
        ),
    ],
)
def test_what_could_not_be_batched_is_refused(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "a.bvh").touch()
    (tmp_path / "tall.toml").write_text(TALL)
    with pytest.raises(InputError) as caught:
        read_spec(write(tmp_path, text))
    assert says in str(caught.value)


def test_a_collection_without_maps_says_so(here: None, tmp_path: Path) -> None:
    build_dataset(write(tmp_path, SPEC.replace("count = 2", "count = 1")), tmp_path / "out")
    with pytest.raises(InputError, match=r'holds spectrograms, .* keep = \["spectrograms"\]'):
        rt.Collection(tmp_path / "out").torch("spectrograms")
    with pytest.raises(InputError, match="have 200 MB; 190 MB are allowed"):
        check_size({"joints": np.zeros(25_000_000)})


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two samples, one of three people far apart, the other of one alone."""
    folder = tmp_path_factory.mktemp("crowd")
    others = '[others]\ncount = 2\nlabels = ["stand"]\nx_m = [-1.5, 0]\ny_m = [-2, 2]\n'
    plans = [
        plan_samples(read_spec(write(folder, SPEC.replace("count = 2", "count = 1") + more)))[0]
        for more in (others, "")
    ]
    for number, plan in enumerate(plans):
        sample, spatial, _, maps = make_sample(plan.packed())
        write_sample(folder, f"s{number}", sample, spatial, maps)
    return folder


def only(folder: Path, *names: str) -> Collection:
    write_index(folder, names)
    return Collection(folder)


def test_a_sample_of_several_people_says_who_returned_its_points(crowd: Path) -> None:
    found = only(crowd, "s0", "s1")
    assert len(found.provenance[0]["source_names"]) == 3
    assert found.spatial_source(1) is None
    source, places = found.spatial_source(0), found.spatial(0)
    assert source is not None
    assert source.shape == places.shape[:1]
    assert set(source) <= {-1, 0, 1, 2}
    # Those who stand are a metre and more apart from everyone: their points are near them.
    plan = found.provenance[0]
    for number, other in enumerate(plan["others"], start=1):
        own = places[source == number]
        assert len(own) > 20
        middle = np.median(own[:, :2], axis=0)
        gaps = [np.linalg.norm(middle - one["position_m"]) for one in plan["others"]]
        assert int(np.argmin(gaps)) == number - 1
        assert gaps[number - 1] < 0.5, other


def test_a_loader_gives_who_returned_each_point(crowd: Path) -> None:
    found = only(crowd, "s0")
    source = found.spatial_source(0)
    assert source is not None
    points, label, own = found.torch("spatial", points=7, source=True)[0]
    chosen = np.linspace(0, len(source) - 1, 7).round().astype(int)
    np.testing.assert_array_equal(points, found.spatial(0)[chosen].astype(np.float32))
    np.testing.assert_array_equal(own, source[chosen])
    assert (label, own.dtype) == (0, torch.int64)
    (_, _, batch), *_ = DataLoader(found.torch("spatial", points=7, source=True), batch_size=1)
    assert batch.shape == (1, 7)
    for names, kind in ((("s0", "s1"), "spatial"), (("s0",), "clouds")):
        with pytest.raises(InputError, match="source = True: only kind = 'spatial'"):
            only(crowd, *names).torch(kind, source=True)


def test_an_export_says_who_returned_each_point(crowd: Path, tmp_path: Path) -> None:
    found = only(crowd, "s0", "s1")
    export_dataset([crowd], tmp_path / "x.zarr")
    with xr.open_zarr(tmp_path / "x.zarr") as data:
        read = data["spatial_source"]
        assert read.dims == ("sample", "spatial_point")
        assert read.dtype == np.int16
        source = found.spatial_source(0)
        assert source is not None
        np.testing.assert_array_equal(read[0, : len(source)], source)
        assert (read[0, len(source) :] == -2).all()
        assert (read[1] == -2).all()
