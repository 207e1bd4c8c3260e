"""IF samples kept by a run, in the order that other tools expect: chirp, Tx, Rx, sample."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import stat
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.signal.multiplexing import chirps_together
from rtradar.system.checks import printable
from rtradar.system.files import read_json
from rtradar.system.output_folder import check_whole

IF_AXES = ("chirp", "tx", "rx", "sample")
"""Axes of a cube: chirps of each Tx (one in each TDM cycle), Tx, Rx and fast time."""

ROW_AXES = ("chirp", "rx", "sample")
"""Axes of samples as they are received: the chirps of all Tx in turn."""

IF_UNIT = "m"
"""Unit of the samples, whose square is a cross-section with spreading loss."""

_MOST_BYTES, _MOST_CHUNK_BYTES = 2**42, 2**34
"""Limits of an array (hours at the paper's rate) and of a chunk; a file may claim any size."""

DAMAGE = (
    OSError, ValueError, KeyError, IndexError, TypeError, EOFError, OverflowError, RuntimeError,
    zlib.error, struct.error,
)  # fmt: skip
"""Errors of readers of files that are damaged or of another kind."""

_MOST_TEXT_BYTES = 1_000_000
_WAVEFORM = (
    "start_frequency_hz", "bandwidth_hz", "centre_frequency_hz", "slope_hz_per_s",
    "sample_rate_hz", "chirp_duration_s", "cycle_duration_s",
)  # fmt: skip


@dataclass(frozen=True)
class IfCube:
    """IF samples with their radar.

    Parameters
    ----------
    samples : (chirp, tx, rx, sample) complex64
        Samples; the Rx of each Tx are those of `rtradar.Radar.rx_of_tx`.
    radar : Radar
        Radar that received them.
    """

    samples: NDArray[np.complex64]
    radar: Radar


@dataclass(frozen=True)
class SampleFile:
    """IF samples of a file, which are read when rows of them are asked for: ``samples[2:5]``.

    Parameters
    ----------
    path : path
        File or folder.
    radar : Radar, optional
        Radar that received them, None if the file does not tell.
    shape : tuple of int
        Length of the axes (chirp, rx, sample).
    read : callable
        Reads the chirps from a first one until before a last one, (chirp, rx, sample) complex64.
    unit : {"m", "count"}
        Unit of the samples; ``count``, the numbers of an ADC, where the file does not tell.
    tx_per_cycle : int, optional
        Number of the Tx in a cycle, where the file has an axis of them.

    Raises
    ------
    InputError
        When rows are read from a file that is damaged.
    """

    path: Path
    radar: Radar | None
    shape: tuple[int, int, int]
    read: Callable[[int, int], NDArray[np.complex64]]
    unit: Literal["m", "count"] = "m"
    tx_per_cycle: int | None = None
    dtype = np.dtype(np.complex64)
    ndim = 3

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: slice) -> NDArray[np.complex64]:
        first, last, _ = rows.indices(len(self))
        last = max(first, last)
        try:
            return np.asarray(self.read(first, last), dtype=np.complex64)
        except MemoryError:
            size = f"{(last - first) * math.prod(self.shape[1:]) * 8 / 1e9:.3g} GB"
            raise InputError(
                f"'{self.path}': {size} of IF samples at once, more than there is memory; "
                "take a shorter run"
            ) from None
        except Exception as error:  # readers fail in many ways on damaged files
            raise unreadable(self.path, "IF samples", error) from None


def unreadable(path: Path, what: str, error: Exception) -> InputError:
    """Return one line for an error of a reader, itself if it is such a line already."""
    if isinstance(error, InputError):
        return error
    why = getattr(error, "strerror", None) or in_short(error)
    cure = "give a file of the format that its suffix says"
    if path.is_dir() and (path.name == "if.zarr" or path.suffix.lower() != ".zarr"):
        cure = "run it again"
    return InputError(f"cannot read {what} from '{path}': {why}; {cure}")


class Quantity(NamedTuple):
    """Array that goes with the samples, under the same name in every format."""

    axes: tuple[str, ...]
    values: NDArray[np.float64]
    unit: str
    meaning: str


@dataclass(frozen=True)
class IfRecording(SampleFile):
    """IF samples that a run kept, whole cycles of a radar at its position in the scene.

    So many rows as ``together`` are stored in one piece.
    """

    radar: Radar
    together: int = 1

    @property
    def name(self) -> str:
        """Name of the run, for progress bars."""
        return printable(self.path.resolve().name)

    @property
    def cube_shape(self) -> tuple[int, int, int, int]:
        """Length of the chirp, tx, rx and sample axes.

        Under Doppler division the tx axis is 1, because all Tx are received as one sum.
        """
        tx = rows_in_cycle(self.radar)
        return (self.shape[0] // tx, tx, *self.shape[1:])

    @property
    def step(self) -> int:
        """Number of chirps of each Tx in a block that is stored together."""
        chirps, tx, *_ = self.cube_shape
        return min(max(1, self.together // tx), chirps)

    @property
    def radar_text(self) -> str:
        """The radar as JSON, from which `radar_of` makes it again."""
        return json.dumps(dataclasses.asdict(self.radar))

    def waveform(self) -> dict[str, float]:
        """Return the parameters of the waveform, with units in their names."""
        return {name: getattr(self.radar, name) for name in _WAVEFORM}

    def quantities(self) -> dict[str, Quantity]:
        """Return times and positions along the axes of the samples."""
        # What a tool needs to process samples: when each was taken, and where antennas are.
        radar, (chirps, tx, *_) = self.radar, self.cube_shape
        times = radar.chirp_times(chirps * tx).reshape(chirps, tx)
        since = "centre of each chirp since the start of the capture"
        fast = np.arange(radar.samples_per_chirp) / radar.sample_rate_hz
        begun = "time of each sample since the first of its chirp"
        rx, listens = radar.rx[radar.rx_of_tx], "place of each Rx that listens to a Tx"
        return {
            "chirp_time": Quantity(("chirp", "tx"), times, "s", since),
            "sample_time": Quantity(("sample",), fast, "s", begun),
            "tx_position": Quantity(("tx", "xyz"), radar.tx, "m", "place of each Tx, world axes"),
            "rx_position": Quantity(("tx", "rx", "xyz"), rx, "m", listens),
        }

    def blocks(self, doing: str) -> Iterator[tuple[int, NDArray[np.complex64]]]:
        """Yield first chirp and samples (chirp, tx, rx, sample) of each block, with a bar."""
        chirps, tx, rx, samples = self.cube_shape
        for first in tqdm(
            range(0, chirps, self.step), desc=f"{self.name}, {doing}", unit="block", disable=None
        ):
            last = min(first + self.step, chirps)
            yield first, self[first * tx : last * tx].reshape(last - first, tx, rx, samples)


def rows_in_cycle(radar: Radar) -> int:
    """Return how many rows (rx, sample) a cycle has, those of chirps that are received together."""
    return radar.n_tx // chirps_together(radar)


def open_recording(folder: Path) -> IfRecording:
    """Open the samples of a run's folder; InputError if there are none that fit its summary."""
    check_whole(folder)
    if not os.path.isdir(folder / "if.zarr"):
        raise InputError(
            f"'{folder}' holds no IF samples (if.zarr); give the folder of rtradar run --save-if"
        )
    try:
        summary = read_json(folder / "summary.json")
        radar = Radar(**summary["parameters"]["radar"])
    except (OSError, ValueError, KeyError, TypeError) as error:  # an InputError is a ValueError
        raise InputError(
            f"'{folder / 'summary.json'}' tells of no radar ({in_short(error)}); run it again"
        ) from None
    if not summary["parameters"].get("save_if", True):
        raise InputError(
            f"'{folder}' holds IF samples (if.zarr) of an earlier run than the last one, "
            "which kept none; run it again with --save-if, into another folder to keep both"
        )
    try:
        stored = check_store(folder / "if.zarr")
    except DAMAGE as error:
        raise unreadable(folder / "if.zarr", "IF samples", error) from None
    # An array that does not fit its radar is none that this run has written.
    shape, kind = stored.shape, np.dtype(stored.dtype)
    expected = (radar.n_rx, radar.samples_per_chirp)
    least = rows_in_cycle(radar)
    fits = len(shape) == 3 and shape[1:] == expected and shape[0] >= least
    if not fits or kind != np.complex64:
        raise InputError(
            f"'{folder / 'if.zarr'}' holds {kind} {shape}; "
            f"the radar of its summary gives complex64 (chirp, {radar.n_rx}, "
            f"{radar.samples_per_chirp}), at least {least} chirps; run it again"
        )
    whole = shape[0] // least * least

    def read(first: int, last: int) -> NDArray[np.complex64]:
        return np.asarray(stored[first:last])

    return IfRecording(folder, radar, (whole, *expected), read, together=stored.chunks[0])


def new_store(path: Path, shape: tuple[int, ...], rows: int, attributes: Mapping[str, Any]) -> Any:
    """Make a Zarr array (chirp, rx, sample) of samples, in chunks of so many rows."""
    import zarr  # slow to import

    return zarr.create_array(
        path,
        shape=shape,
        chunks=(rows, *shape[1:]),
        dtype="complex64",
        dimension_names=ROW_AXES,
        attributes={"units": IF_UNIT, **attributes},
        config={"write_empty_chunks": True},  # a chunk that is not there was lost
    )


def check_store(store: Path) -> Any:
    """Open a Zarr array that may be anybody's; OSError or ValueError if it is none or too large."""
    import zarr  # slow to import

    # Before Zarr reads anything, because it would believe what a stranger's file claims.
    largest = _largest_file(store)
    try:
        array = zarr.open_array(store, mode="r")
        if min((*array.chunks, *array.shape), default=0) < 1:
            raise ValueError(f"shape {array.shape} in chunks {array.chunks}")
        chunk_bytes = math.prod(array.chunks) * np.dtype(array.dtype).itemsize
    except Exception as error:  # zarr fails in many ways on a damaged folder
        raise ValueError(in_short(error)) from None
    if (
        array.nbytes > _MOST_BYTES
        or chunk_bytes > _MOST_CHUNK_BYTES
        or largest > 2 * chunk_bytes + _MOST_TEXT_BYTES
    ):
        raise ValueError(
            f"it claims {array.nbytes:.2g} bytes in chunks {array.chunks}, as no run writes"
        )
    # Zarr gives zeros for what is not there.
    if missing := array.nchunks - array.nchunks_initialized:
        raise ValueError(
            f"{missing} of its {array.nchunks} chunks are missing, as where a copy broke off"
        )
    return array


def _largest_file(store: Path) -> int:
    """Return the size of the largest file of an array [bytes]; zarr reads a file all at once."""
    largest = 0
    for folder, folders, names in os.walk(store):
        for name in (*folders, *names):
            status = os.lstat(os.path.join(folder, name))
            if name in folders and stat.S_ISDIR(status.st_mode):
                continue
            if not stat.S_ISREG(status.st_mode):
                raise ValueError(f"'{name}' in it is a link, a pipe or a device")
            largest = max(largest, status.st_size)
            if name == "zarr.json" and status.st_size > _MOST_TEXT_BYTES:
                raise ValueError(f"{name} has more than {_MOST_TEXT_BYTES / 1e6:g} MB")
    return largest


def radar_of(text: str) -> Radar:
    """Make a radar of `IfRecording.radar_text`; ValueError or TypeError if the text is another."""
    return Radar(**json.loads(text))


def in_short(error: BaseException) -> str:
    """Return the text of an error in one short line."""
    return " ".join(str(error).split())[:100] or type(error).__name__
