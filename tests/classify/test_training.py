from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from rtradar.classify import prepare, training
from rtradar.classify.prepare import stack_clouds
from rtradar.classify.recipes import LEAN, PAPER, Recipe
from rtradar.classify.study import classes_of
from rtradar.classify.training import (
    Checkpoint,
    Examples,
    Row,
    load_checkpoint,
    pick_device,
    pick_precision,
    save_checkpoint,
    train_network,
)
from rtradar.errors import BackendError, InputError

TINY = LEAN.changed(points=32, batch=4, epochs=4)


@pytest.fixture
def examples(made_up: Callable[..., Any]) -> Examples:
    clouds = made_up(per_class=4)
    names, classes = classes_of(clouds)
    return Examples(stack_clouds(clouds), torch.from_numpy(classes), names)


@pytest.fixture(autouse=True)
def _save_every_epoch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "SAVE_EVERY_S", -1.0)


def weights(network: torch.nn.Module) -> torch.Tensor:
    return torch.cat([value.flatten().double() for value in network.state_dict().values()])


@pytest.mark.parametrize(
    "recipe",
    [
        LEAN.changed(points=48, batch=4, epochs=14, augmentation="none", dropout=0.0),
        PAPER.changed(points=48, batch=8, epochs=12, rate=1e-3, dropout=0.0),
    ],
    ids=["lean", "paper"],
)
def test_eight_clouds_are_learnt_by_heart(examples: Examples, recipe: Recipe) -> None:
    few = examples[np.array([0, 1, 2, 4, 5, 6, 8, 9])]
    _, history = train_network(few, few, recipe)
    assert history[-1]["train_accuracy"] == 1
    assert history[-1]["train_loss"] < 0.5 * history[0]["train_loss"]


@pytest.mark.parametrize(
    "recipe",
    [TINY, PAPER.changed(points=32, epochs=4, augmentation="rotation", precision="bfloat16")],
    ids=["lean", "paper"],
)
def test_a_training_that_was_stopped_ends_as_one_that_was_not(
    examples: Examples, recipe: Recipe, tmp_path: Path
) -> None:
    examples = examples[np.arange(0, 12, 2)]
    whole, history = train_network(examples, examples, recipe, seed=3)

    def stop(epoch: int, row: Row) -> None:
        torch.rand(5)  # somebody else draws in between
        if epoch == 2:
            raise KeyboardInterrupt

    path = tmp_path / "checkpoint.pt"
    with pytest.raises(KeyboardInterrupt):
        train_network(examples, examples, recipe, seed=3, checkpoint=path, on_epoch=stop)
    assert load_checkpoint(path).epochs == 2
    seen: list[int] = []
    go_on = partial(train_network, examples, examples, recipe, seed=3, checkpoint=path)
    again, taken_up = go_on(on_epoch=lambda epoch, row: seen.append(epoch))
    assert seen == [2, 3, 4]
    assert torch.equal(weights(again), weights(whole))
    assert [row["train_loss"] for row in taken_up] == [row["train_loss"] for row in history]
    # A third time there is nothing to do.
    done, _ = go_on()
    assert torch.equal(weights(done), weights(whole))
    assert load_checkpoint(path).optimiser == {}


def test_the_seed_decides_and_nobody_elses_random_numbers_are_touched(examples: Examples) -> None:
    torch.manual_seed(11)
    first, _ = train_network(examples, examples, TINY, seed=1)
    after = torch.rand(3)
    torch.manual_seed(11)
    assert torch.equal(after, torch.rand(3))
    second, _ = train_network(examples, examples, TINY, seed=1)
    other, _ = train_network(examples, examples, TINY, seed=2)
    assert torch.equal(weights(first), weights(second))
    assert not torch.equal(weights(first), weights(other))


def test_no_cloud_is_dropped_and_none_stands_alone(
    examples: Examples, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes: list[int] = []
    real = prepare.for_training

    def spy(points: torch.Tensor, *how: Any) -> torch.Tensor:
        sizes.append(len(points))
        return real(points, *how)

    monkeypatch.setattr(prepare, "for_training", spy)
    seven = examples[np.arange(7)]
    train_network(seven, examples, PAPER.changed(points=8, epochs=1))
    assert sizes == [4, 3]


class Harm:
    """Would write a file where it is unpickled."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return open, (str(self._path), "w")


@pytest.mark.parametrize("how", ["pickle", "torch", "cut", "text", "other"])
def test_a_file_that_is_no_checkpoint_is_refused_in_one_line(tmp_path: Path, how: str) -> None:
    path, harmed = tmp_path / "checkpoint.pt", tmp_path / "harmed"
    if how == "pickle":
        path.write_bytes(pickle.dumps({"network": Harm(harmed)}))
    elif how == "torch":
        torch.save({"network": Harm(harmed)}, path)
    elif how == "cut":
        save_checkpoint(path, Checkpoint({"weight": torch.zeros(100)}, {}, 0, []))
        path.write_bytes(path.read_bytes()[:300])
    elif how == "text":
        path.write_text("nothing")
    else:
        torch.save({"weight": torch.zeros(3)}, path)
    with pytest.raises(InputError) as said:
        load_checkpoint(path)
    assert "\n" not in str(said.value)
    assert str(path) in str(said.value)
    assert "remove it" in str(said.value)
    assert not harmed.exists()


def test_a_full_disk_is_said_in_one_line(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
    try:
        with pytest.raises(InputError, match=r"cannot write '.*checkpoint\.pt': File too large"):
            save_checkpoint(
                tmp_path / "checkpoint.pt", Checkpoint({"weights": torch.zeros(50_000)}, {}, 1, [])
            )
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not list(tmp_path.iterdir())


def test_a_checkpoint_of_another_network_is_refused(examples: Examples, tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.pt"
    train_network(examples, examples, TINY.changed(epochs=1), checkpoint=path)
    with pytest.raises(InputError, match="another network"):
        train_network(examples, examples, PAPER.changed(points=8, epochs=1), checkpoint=path)
    with pytest.raises(InputError, match="1 epochs of another recipe"):
        train_network(examples, examples, TINY, checkpoint=path)


def test_a_processor_without_bfloat16_is_not_asked_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    cpu = torch.device("cpu")
    named = {"avx512_bf16": True}, {"avx512_bf16": False}, {}
    for known, wanted in zip(named, ("bfloat16", "float32", "float32"), strict=True):
        monkeypatch.setattr(torch.cpu, "get_capabilities", lambda known=known: known, raising=False)
        assert pick_precision(cpu) == wanted


def test_a_device_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert pick_device("auto") == pick_device("cpu") == torch.device("cpu")
    with pytest.raises(BackendError, match="finds no CUDA device"):
        pick_device("cuda")
