"""Training of one network, epoch by epoch; it can be interrupted and continued at any time.

The state is kept in a checkpoint, which is read without running any code that it may contain.
"""

from __future__ import annotations

import io
import time
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from rtradar.classify.pointnet import build_network
from rtradar.classify.prepare import for_network
from rtradar.classify.recipes import Precision, Recipe
from rtradar.errors import BackendError, InputError
from rtradar.system.files import atomic_file, read_bytes
from rtradar.system.seeds import stream

SKEWNESS_WEIGHT = 1e-3
"""Weight in the loss of the feature transform's distance from a rotation (Qi et al.)."""

SAVE_EVERY_S = 15.0
"""Time between checkpoints [s], the most that a kill costs beside one epoch."""

_MAX_MONITORED = 100  # test clouds of the learning curves; the outcome uses all
_MAX_BYTES = 1_000_000_000  # PointNet with its optimiser takes 42 MB

Row = dict[str, float]


@dataclass(frozen=True)
class Examples:
    """Clouds, or spectrograms, with their classes.

    Parameters
    ----------
    points : (cloud, point, 3) or (cloud, time, velocity) float32 tensor
        Clouds from `rtradar.classify.stack_clouds`, or spectrograms from
        `rtradar.classify.stack_spectrograms`.
    classes : (cloud,) int64 tensor
        Class numbers, indices into ``names``.
    names : tuple of str
        Names of the classes.
    """

    points: Tensor
    classes: Tensor
    names: tuple[str, ...]

    def __getitem__(self, indices: NDArray[np.int64]) -> Examples:
        chosen = torch.from_numpy(indices)
        return Examples(self.points[chosen], self.classes[chosen], self.names)


def check_points(examples: Examples, recipe: Recipe) -> None:
    """Raise InputError if the clouds have fewer points than the recipe needs."""
    if recipe.takes_points and recipe.points > examples.points.shape[1]:
        raise InputError(
            f"--points {recipe.points}: the clouds hold {examples.points.shape[1]} points; "
            "give no more"
        )


def pick_device(name: str) -> torch.device:
    """Return the device ``cpu`` or ``cuda`` (BackendError without one); ``auto`` prefers CUDA."""
    there = torch.cuda.is_available()
    if name == "cuda" and not there:
        raise BackendError(
            "--device cuda: torch finds no CUDA device here; "
            "give --device cpu, or install a CUDA build of torch"
        )
    return torch.device("cuda" if there and name != "cpu" else "cpu")


def pick_precision(device: torch.device) -> Precision:
    """Return bfloat16 if the device multiplies in it, which is faster, otherwise float32."""
    if device.type == "cuda":
        return "bfloat16" if torch.cuda.is_bf16_supported() else "float32"
    # Older versions of torch lack this function.
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
) -> tuple[nn.Module, list[Row]]:
    """Train a network to the end of the recipe, continuing from the checkpoint if there is one.

    On a CPU the same clouds, recipe, seed and number of threads give the same network, interrupted
    or not, because each epoch seeds its own random numbers. On CUDA the order of sums may vary.

    Parameters
    ----------
    train, test : Examples
        Training and test clouds. The test clouds are only monitored and do not affect the training.
    recipe : Recipe
        Hyperparameters.
    seed : int
        Seed of the weights, the order of clouds, the points, the augmentation and the dropout.
    device : torch.device, optional
        Device of the network, the CPU by default.
    checkpoint : path, optional
        File of the state, which is saved every `SAVE_EVERY_S` seconds and at the end.
    on_epoch : callable
        Function called after each epoch with the number of epochs and the last history entry.

    Returns
    -------
    network : torch.nn.Module
        Trained network in evaluation mode.
    history : list of dict
        One entry for each epoch: ``rate``; ``train_loss`` and ``train_accuracy`` during training,
        with dropout and augmentation; ``test_loss`` and ``test_accuracy`` of at most 100 of the
        test clouds; ``seconds``.

    Raises
    ------
    InputError
        If the clouds have fewer points than the recipe needs, there are fewer than two training
        clouds, or the checkpoint cannot be used or written.
    """
    check_points(train, recipe)
    if len(train.points) < 2:
        raise InputError(f"{len(train.points)} training cloud: batch norm needs at least 2")
    device = device or torch.device("cpu")
    monitored = test[np.arange(0, len(test.points), -(-len(test.points) // _MAX_MONITORED))]
    # Torch's random state is restored afterwards.
    with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
        torch.manual_seed(_number(seed, 0))
        network = build_network(len(train.names), recipe).to(device)
        optimiser = torch.optim.AdamW(
            network.parameters(), lr=recipe.rate, weight_decay=recipe.weight_decay, fused=True
        )
        history: list[Row] = []
        if checkpoint is not None and checkpoint.exists():
            history = _restore(checkpoint, network, optimiser, recipe)
            if history:
                on_epoch(len(history), history[-1])
        finished = bool(history) and len(history) == recipe.epochs_run
        saved = time.monotonic()
        for epoch in range(len(history), recipe.epochs_run):
            began = time.perf_counter()
            torch.manual_seed(_number(seed, 1 + epoch))
            row = _train_epoch(network, optimiser, train, recipe, epoch)
            row |= _evaluate(network, monitored, recipe)
            history.append(row | {"seconds": time.perf_counter() - began})
            if checkpoint is not None and time.monotonic() - saved > SAVE_EVERY_S:
                state = network.state_dict(), optimiser.state_dict(), len(history), history
                save_checkpoint(checkpoint, Checkpoint(*state))
                saved = time.monotonic()
            on_epoch(len(history), history[-1])
    if checkpoint is not None and not finished:
        # A finished training needs no optimiser state, two thirds of the file.
        save_checkpoint(checkpoint, Checkpoint(network.state_dict(), {}, len(history), history))
    return network.eval(), history


def predict(network: nn.Module, examples: Examples, recipe: Recipe) -> NDArray[np.float32]:
    """Predict the log-probability of every class from the first points of every cloud.

    Parameters
    ----------
    network : torch.nn.Module
        Trained network.
    examples : Examples
        Clouds to classify.
    recipe : Recipe
        Recipe of the network.

    Returns
    -------
    (cloud, class) float32
    """
    device = next(network.parameters()).device
    network.eval()
    with torch.no_grad():
        # Clouds are independent of each other; batches only limit the memory.
        found = [
            network(for_network(some, recipe, training=False).to(device))[0].cpu()
            for some in torch.split(examples.points, 32)
        ]
    return torch.cat(found).numpy()


def _train_epoch(
    network: nn.Module,
    optimiser: torch.optim.Optimizer,
    train: Examples,
    recipe: Recipe,
    epoch: int,
) -> Row:
    device = next(network.parameters()).device
    network.train()
    n_clouds = len(train.points)
    batches = torch.randperm(n_clouds).tensor_split(max(1, n_clouds // recipe.batch))
    loss_sum, right = 0.0, 0
    rate, weights = recipe.rate_at(epoch, 0.0), None
    if recipe.balanced:
        counts = torch.bincount(train.classes, minlength=len(train.names)).clamp(min=1)
        weights = (counts.sum() / len(counts) / counts).to(device)
    for number, batch in enumerate(batches):
        for group in optimiser.param_groups:
            group["lr"] = recipe.rate_at(epoch, number / len(batches))
        points = for_network(train.points[batch], recipe, training=True).to(device)
        wanted = train.classes[batch].to(device)
        log_probabilities, skewness = network(points)
        loss = functional.cross_entropy(
            log_probabilities, wanted, weights, label_smoothing=recipe.label_smoothing
        )
        optimiser.zero_grad()
        (loss + SKEWNESS_WEIGHT * skewness).backward()
        optimiser.step()
        loss_sum += loss.item() * len(batch)
        right += int((log_probabilities.argmax(dim=1) == wanted).sum())
    return {"rate": rate, "train_loss": loss_sum / n_clouds, "train_accuracy": right / n_clouds}


def _evaluate(network: nn.Module, test: Examples, recipe: Recipe) -> Row:
    log_probabilities = torch.from_numpy(predict(network, test, recipe))
    right = (log_probabilities.argmax(dim=1) == test.classes).float().mean()
    return {
        "test_loss": functional.nll_loss(log_probabilities, test.classes).item(),
        "test_accuracy": right.item(),
    }


def _restore(
    path: Path, network: nn.Module, optimiser: torch.optim.Optimizer, recipe: Recipe
) -> list[Row]:
    """Load the state of a checkpoint and return its history."""
    state = load_checkpoint(path)
    try:
        network.load_state_dict(state.network)
        if state.optimiser:
            optimiser.load_state_dict(state.optimiser)
    except (RuntimeError, ValueError, KeyError, TypeError, AttributeError):
        raise InputError(
            f"'{path}' is of another network than recipe '{recipe.name}' makes; give another folder"
        ) from None
    complete = state.optimiser or state.epochs == recipe.epochs_run
    if state.epochs != len(state.history) or not complete:
        raise InputError(
            f"'{path}' holds {state.epochs} epochs of another recipe; give another folder"
        )
    return list(state.history)


def _number(seed: int, epoch: int) -> int:
    """Derive a seed for torch from the seed and the epoch."""
    return int(stream(seed, epoch).generate_state(1, np.uint64)[0] >> np.uint64(1))


class Checkpoint(NamedTuple):
    """State from which a training continues as if it had never been interrupted.

    Learning rate and random numbers follow from the number of finished ``epochs``. The state of the
    optimiser is empty when the training is finished. ``history`` has the quantities of `HISTORY`.
    """

    network: dict[str, Any]
    optimiser: dict[str, Any]
    epochs: int
    history: list[dict[str, float]]


def save_checkpoint(path: Path, state: Checkpoint) -> None:
    """Write a checkpoint, which replaces an existing one; InputError if it cannot be written."""
    content = io.BytesIO()  # torch would not report what is wrong with a disk
    torch.save(state._asdict(), content)
    with atomic_file(path) as file:
        file.write(content.getbuffer())


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint of tensors and plain values; InputError if it is damaged or holds more."""
    hint = "remove it to train anew, or give another folder"
    try:
        content = io.BytesIO(read_bytes(path, _MAX_BYTES))
        with zipfile.ZipFile(content) as archive:
            # The content of a compressed archive could exceed any limit.
            if any(one.compress_type != zipfile.ZIP_STORED for one in archive.infolist()):
                raise ValueError("it is compressed")
        content.seek(0)
        state = torch.load(content, map_location="cpu", weights_only=True)
    except OSError as error:
        raise InputError(f"cannot read '{path}': {error.strerror}; {hint}") from None
    except Exception as error:  # torch lets any error of its archive reader and unpickler through
        why = (str(error).strip() or type(error).__name__).splitlines()[0][:80]
        raise InputError(
            f"'{path}' is no checkpoint that can be read safely, or is damaged ({why}); {hint}"
        ) from None
    keys, types = Checkpoint._fields, (dict, dict, int, list)
    fits = isinstance(state, dict) and set(state) == set(keys)
    if not fits or not all(map(isinstance, map(state.get, keys), types)):
        raise InputError(
            f"'{path}' is no checkpoint of rtradar: it must hold {', '.join(keys)}; {hint}"
        )
    return Checkpoint(**state)
