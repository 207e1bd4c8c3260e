"""One training: a network for the training clouds of a split, epoch by epoch, that can be stopped and taken up at any time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from rtradar.classify.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from rtradar.classify.pointnet import PointNet
from rtradar.classify.prepare import drawn, for_training, scaled
from rtradar.classify.recipes import Precision, Recipe
from rtradar.errors import BackendError, InputError
from rtradar.system.seeds import stream

SKEWNESS_WEIGHT = 1e-3
"""Of the feature transform's distance from a rotation, in the loss (Qi et al.)."""

SAVE_EVERY_S = 15.0
"""Between checkpoints: what a kill costs at most, beside one epoch."""

_WATCHED = 100
"""Most test clouds that the curves follow; the result is of all."""

Row = dict[str, float]


@dataclass(frozen=True)
class Examples:
    """Clouds and what they show.

    Parameters
    ----------
    points : (cloud, point, 3) float32 tensor
        As of `rtradar.classify.prepare.stack_clouds`.
    classes : (cloud,) int64 tensor
        Places in ``names``.
    names : tuple of str
        Of the classes.
    """

    points: Tensor
    classes: Tensor
    names: tuple[str, ...]

    def of(self, indices: NDArray[np.int64]) -> Examples:
        """Some of them.

        Parameters
        ----------
        indices : (cloud,) int64
            Which.

        Returns
        -------
        chosen : Examples
        """
        chosen = torch.from_numpy(indices)
        return Examples(self.points[chosen], self.classes[chosen], self.names)


def check_points(examples: Examples, recipe: Recipe) -> None:
    """Raise where clouds have fewer points than the recipe asks for."""
    if recipe.points > examples.points.shape[1]:
        raise InputError(
            f"--points {recipe.points}: the clouds hold {examples.points.shape[1]} points; give no more"
        )


def pick_device(name: str) -> torch.device:
    """``auto``: a CUDA device where there is one. ``cpu``, ``cuda``: that one; BackendError where it is not there."""
    there = torch.cuda.is_available()
    if name == "cuda" and not there:
        raise BackendError(
            "--device cuda: torch finds no CUDA device here; give --device cpu, or install a CUDA build of torch"
        )
    return torch.device("cuda" if there and name != "cpu" else "cpu")


def pick_precision(device: torch.device) -> Precision:
    """bfloat16 where the device multiplies in it, and is faster so; else float32."""
    if device.type == "cuda":
        return "bfloat16" if torch.cuda.is_bf16_supported() else "float32"
    # Older versions of torch do not tell.
    known: dict[str, object] = getattr(torch.cpu, "get_capabilities", dict)()
    return "bfloat16" if known.get("avx512_bf16") or known.get("amx_bf16") else "float32"


def train_network(
    train: Examples,
    test: Examples,
    recipe: Recipe,
    *,
    seed: int = 0,
    device: torch.device | None = None,
    checkpoint: Path | None = None,
    on_epoch: Callable[[int, Row], None] = lambda epoch, row: None,
) -> tuple[PointNet, list[Row]]:
    """Train to the end of the recipe, from the checkpoint where there is one.

    The same clouds, recipe and seed give the same network on a CPU with the same number of threads, stopped in between or not:
    each epoch begins random numbers of its own, so nothing but whole epochs counts. On CUDA sums may be taken in another order.

    Parameters
    ----------
    train, test : Examples
        The test clouds are only watched: they choose nothing.
    recipe : Recipe
    seed : int
        Of the weights, the order, the points drawn, the variations and the dropout.
    device : torch.device, optional
        Default: the CPU.
    checkpoint : path, optional
        Where the state is kept, every `SAVE_EVERY_S` seconds and at the end.
    on_epoch : callable
        Told the number of epochs done and the last row of the history.

    Returns
    -------
    network : PointNet
    history : list of dict
        An epoch each: ``rate``, ``train_loss`` and ``train_accuracy`` while it learns, with dropout and variations, ``test_loss``
        and ``test_accuracy`` of at most 100 of the test clouds, ``seconds``.

    Raises
    ------
    InputError
        Where clouds have fewer points than the recipe asks for, there are fewer than two to learn from, or the checkpoint cannot
        be used or written.
    """
    check_points(train, recipe)
    if len(train.points) < 2:
        raise InputError(f"{len(train.points)} training cloud: batch norm needs at least 2")
    device = device or torch.device("cpu")
    with _random_numbers(device):
        torch.manual_seed(_number(seed, 0))
        network = PointNet(len(train.names), recipe).to(device)
        optimiser = torch.optim.AdamW(
            network.parameters(), lr=recipe.rate, weight_decay=recipe.weight_decay, fused=True
        )
        history: list[Row] = []
        finished = False
        if checkpoint is not None and checkpoint.exists():
            history = _restore(checkpoint, network, optimiser, recipe)
            finished = len(history) == recipe.epochs_run
            if history:
                on_epoch(len(history), history[-1])
        watched = test.of(np.arange(0, len(test.points), -(-len(test.points) // _WATCHED)))
        saved = time.monotonic()
        for epoch in range(len(history), recipe.epochs_run):
            began = time.perf_counter()
            torch.manual_seed(_number(seed, 1 + epoch))
            row = _epoch(network, optimiser, train, recipe, epoch, device) | _watch(
                network, watched, recipe
            )
            history.append(row | {"seconds": time.perf_counter() - began})
            if checkpoint is not None and time.monotonic() - saved > SAVE_EVERY_S:
                state = Checkpoint(
                    network.state_dict(), optimiser.state_dict(), len(history), history
                )
                save_checkpoint(checkpoint, state)
                saved = time.monotonic()
            on_epoch(len(history), history[-1])
        if checkpoint is not None and not finished:
            # What is done needs no optimiser: two thirds of the file.
            save_checkpoint(checkpoint, Checkpoint(network.state_dict(), {}, len(history), history))
    return network.eval(), history


def predict(network: PointNet, examples: Examples, recipe: Recipe) -> NDArray[np.float32]:
    """Logarithm of the probability of every class, (cloud, class), from the first points of every cloud.

    Parameters
    ----------
    network : PointNet
    examples : Examples
        Their clouds.
    recipe : Recipe
        That of the network.

    Returns
    -------
    (cloud, class) float32
    """
    device = next(network.parameters()).device
    network.eval()
    with torch.no_grad():
        points = drawn(examples.points, recipe.points, redraw=False)
        # One scaled cloud does not depend on the others: batches are only for the memory.
        found = [
            network(scaled(some, recipe.scaling).to(device))[0].cpu()
            for some in torch.split(points, 32)
        ]
    return torch.cat(found).numpy()


def _epoch(
    network: PointNet,
    optimiser: torch.optim.Optimizer,
    train: Examples,
    recipe: Recipe,
    epoch: int,
    device: torch.device,
) -> Row:
    network.train()
    n_clouds = len(train.points)
    batches = torch.randperm(n_clouds).tensor_split(max(1, n_clouds // recipe.batch))
    loss_sum, right = 0.0, 0
    rate = recipe.rate_at(epoch, 0.0)
    for number, batch in enumerate(batches):
        for group in optimiser.param_groups:
            group["lr"] = recipe.rate_at(epoch, number / len(batches))
        points = drawn(train.points[batch], recipe.points, redraw=recipe.redraw)
        points = for_training(points, recipe.augmentation, recipe.scaling).to(device)
        wanted = train.classes[batch].to(device)
        log_probabilities, skewness = network(points)
        loss = functional.nll_loss(log_probabilities, wanted)
        optimiser.zero_grad()
        (loss + SKEWNESS_WEIGHT * skewness).backward()
        optimiser.step()
        loss_sum += loss.item() * len(batch)
        right += int((log_probabilities.argmax(dim=1) == wanted).sum())
    return {"rate": rate, "train_loss": loss_sum / n_clouds, "train_accuracy": right / n_clouds}


def _watch(network: PointNet, test: Examples, recipe: Recipe) -> Row:
    log_probabilities = torch.from_numpy(predict(network, test, recipe))
    right = (log_probabilities.argmax(dim=1) == test.classes).float().mean()
    return {
        "test_loss": functional.nll_loss(log_probabilities, test.classes).item(),
        "test_accuracy": right.item(),
    }


def _restore(
    path: Path, network: PointNet, optimiser: torch.optim.Optimizer, recipe: Recipe
) -> list[Row]:
    """Put the state of a checkpoint in place; its history is returned."""
    state = load_checkpoint(path)
    try:
        network.load_state_dict(state.network)
        if state.optimiser:
            optimiser.load_state_dict(state.optimiser)
    except (RuntimeError, ValueError, KeyError, TypeError, AttributeError):
        raise InputError(
            f"'{path}' is of another network than recipe '{recipe.name}' makes; give another folder"
        ) from None
    if state.epochs != len(state.history) or not (
        state.optimiser or state.epochs == recipe.epochs_run
    ):
        raise InputError(
            f"'{path}' holds {state.epochs} epochs of another recipe; give another folder"
        )
    return list(state.history)


def _number(seed: int, epoch: int) -> int:
    """One number for a seed and an epoch, unlike any other's."""
    return int(stream(seed, epoch).generate_state(1, np.uint64)[0] >> np.uint64(1))


@contextmanager
def _random_numbers(device: torch.device) -> Iterator[None]:
    """Torch's random numbers are the caller's again afterwards."""
    with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
        yield
