"""A `DataLoader` batches a collection as it is, and pandas gets what is known of the samples."""

from __future__ import annotations

import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

import rtradar as rt
from rtradar.clouds import Collection, Sample
from rtradar.clouds.sample_files import write_index, write_sample
from rtradar.clouds.torch_dataset import of_size
from rtradar.errors import InputError

SIZES = (0, 5, 20, 12, 9)


def write_collection(folder: Path) -> Collection:
    random = np.random.default_rng(0)
    for number, size in enumerate(SIZES):
        told = {"subject": f"s{number}", "snr_db": 10.0 * number}
        told |= {"tempo": 1.5} if number else {}
        sample = Sample(random.random((size, 3)), "walk" if number % 2 else "kick", told)
        write_sample(folder, f"s{number}", sample, random.random((2 * size, 3)))
    write_index(folder, [f"s{number}" for number in range(len(SIZES))])
    return Collection(folder)


def test_a_loader_batches_clouds_as_they_are(tmp_path: Path) -> None:
    collection = write_collection(tmp_path)
    found = collection.torch(points=12)
    assert isinstance(found, torch.utils.data.Dataset)
    assert found.classes == collection.classes == ("kick", "walk")
    batches = list(DataLoader(found, batch_size=2))
    assert [tuple(clouds.shape) for clouds, _ in batches] == [(2, 12, 3), (2, 12, 3), (1, 12, 3)]
    assert batches[0][0].dtype == torch.float32
    assert torch.cat([labels for _, labels in batches]).tolist() == [0, 1, 0, 1, 0]
    own = collection.points(2).astype(np.float32)
    np.testing.assert_array_equal(found[2][0].numpy(), own[:12])
    repeated = found[1][0].numpy()
    np.testing.assert_array_equal(repeated[:5], collection.points(1).astype(np.float32))
    np.testing.assert_array_equal(repeated[5:10], repeated[:5])
    assert not found[0][0].any()
    assert found[-1][1] == found[4][1]
    with pytest.raises(IndexError):
        found[5]


def test_workers_give_the_same(tmp_path: Path) -> None:
    found = write_collection(tmp_path).torch("spatial", points=6)
    one, two = (list(DataLoader(found, batch_size=2, num_workers=n)) for n in (0, 2))
    for (clouds, labels), (same, as_before) in zip(one, two, strict=True):
        assert torch.equal(clouds, same)
        assert torch.equal(labels, as_before)
    sent: torch.utils.data.Dataset[tuple[torch.Tensor, int]] = pickle.loads(pickle.dumps(found))
    assert torch.equal(sent[3][0], found[3][0])  # spawned workers get a copy


def test_points_in_order_are_taken_evenly() -> None:
    points = np.repeat(np.arange(9.0)[:, None], 3, axis=1)
    assert of_size(points, 5, in_order=True)[:, 0].tolist() == [0, 2, 4, 6, 8]
    assert of_size(points[:2], 4, in_order=True)[:, 0].tolist() == [0, 0, 1, 1]


def test_pandas_gets_what_is_known(tmp_path: Path) -> None:
    table = rt.Collection(write_collection(tmp_path).folders[0]).to_pandas()
    assert table.index.tolist() == [f"s{number}" for number in range(5)]
    assert table["activity"].tolist() == ["kick", "walk", "kick", "walk", "kick"]
    assert table["label"].tolist() == [0, 1, 0, 1, 0]
    assert table["snr_db"].tolist() == [0.0, 10.0, 20.0, 30.0, 40.0]
    assert table["tempo"].isna().tolist() == [True, False, False, False, False]
    assert set(table["folder"]) == {str(tmp_path)}
    assert table.loc["s2", "digest"].encode() == (tmp_path / "s2.npz").read_bytes()[-64:]


def test_what_cannot_be_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    collection = write_collection(tmp_path)
    with pytest.raises(InputError, match="kind = 'pictures' is unknown; allowed: clouds, spatial"):
        collection.torch("pictures")
    with pytest.raises(InputError, match=r"kind = \[\] is unknown"):
        collection.torch([])  # type: ignore[arg-type]
    assert collection.torch(points=np.int64(3))[1][0].shape == (3, 3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="points = 0; it must be a whole number from 1 on"):
        collection.torch(points=0)
    monkeypatch.delitem(sys.modules, "rtradar.clouds.torch_dataset")
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(InputError, match=r"torch needs torch; install the extra 'learn'"):
        collection.torch()
