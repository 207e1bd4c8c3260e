"""`process_samples`: maps and clouds of anybody's IF samples, simulated or measured."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Unpack

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from rtradar.errors import InputError
from rtradar.exchange.recording import SampleFile
from rtradar.pipeline.capture import SpectraSink
from rtradar.pipeline.prepare import with_background
from rtradar.pipeline.processing import Processing, block_chirps, refuse_large_maps
from rtradar.pipeline.result import Result
from rtradar.pipeline.run import results_of
from rtradar.pipeline.timing import forget_peak_memory
from rtradar.radar import Radar
from rtradar.settings import ProcessingOptions, settings_of
from rtradar.signal.multiplexing import chirps_together
from rtradar.system.checks import brief

if TYPE_CHECKING:
    import xarray as xr

    Block: TypeAlias = NDArray[np.complexfloating[Any, Any]] | xr.DataArray


_NAME = "IF samples"
_DIMENSIONS = ("chirp", "rx", "sample"), ("cycle", "tx", "rx", "sample")


def process_samples(
    samples: Block | SampleFile | Iterable[Block],
    radar: Radar,
    out: str | Path | None = None,
    *,
    overwrite: bool = False,
    pictures: bool = False,
    unit: Literal["m", "count"] = "m",
    **options: Unpack[ProcessingOptions],
) -> Result:
    """Process IF samples, simulated or measured, as `run` does: maps, detections, angles, clouds.

    Parameters
    ----------
    samples : (chirp, rx, sample) complex, or iterable of such blocks
        IF samples from the first Tx of a cycle on, as an array of NumPy, or as a DataArray whose
        dimensions have these names, in any order, or as another array whose rows are read when they
        are needed, such as one of Zarr. Whole cycles, (cycle, tx, rx, sample), will do as well, and
        so will blocks of any length, one after another. Chirps after the last whole cycle are left
        out. Under Doppler division a chirp is a whole cycle.
    radar : Radar
        Radar that has received the samples, at its position.
    out : path, optional
        Folder for maps, clouds, pictures, report and summary; as for `run`.
    overwrite : bool
        Whether files of others in ``out`` are replaced; as for `run`.
    pictures : bool
        Whether PNG files are drawn as well; as for `run`.
    unit : {"m", "count"}
        Unit of the samples. Powers of the maps are in its square; pictures show cross-sections of
        samples in metres, and levels of those that are the numbers of an ADC.
    **options
        Settings of the processing, such as ``pfa`` or ``clutter_removal``: fields of
        `rtradar.RunSettings`.

    Returns
    -------
    Result
        It has no link budget, and no view of a body. Where clutter is removed, the maps also hold
        the middle frame as it was received, but not of an iterable, whose middle is known too late.

    Raises
    ------
    InputError
        If a value is invalid, samples are of another shape or type than the radar gives, are not
        finite or hold no whole frame, or maps are too large for memory; nothing is written then.

    Examples
    --------
    >>> import rtradar as rt
    >>> motion = rt.synthetic_motion("punch", duration_s=0.5)
    >>> radar = rt.Radar.preset("paper-12ghz")
    >>> samples = rt.simulate(motion, radar, fidelity="analytic", duration_s=0.15).samples
    >>> result = rt.process_samples(samples.values, radar, clutter_removal="mean", pfa=1e-4)
    >>> result.maps["spectrogram"].attrs["units"]
    'm2'
    """
    settings = settings_of("process_samples", ProcessingOptions, options)
    forget_peak_memory()
    if unit not in ("m", "count"):
        raise InputError(f"unit = {brief(unit)}; it must be m, or count for the numbers of an ADC")
    if settings.slow_time == "capture" and radar.in_frames and radar.cycles_per_frame > 1:
        raise InputError(
            f"slow_time = capture: a recording of radar '{radar.name}' has "
            f"{radar.cycles_per_frame} cycles in each frame; keep the first of each, and give "
            f"chirps_per_frame = {radar.n_tx}"
        )
    given = replace(Processing.of(radar, settings), unit=unit)
    source = Samples(samples, given, in_memory=out is None)
    # A background is read only where the samples are sound.
    source.processing = with_background(given)
    return results_of(source, None if out is None else Path(out), overwrite, pictures)


class Samples:
    """Checked samples, in blocks of `block_chirps`, each with the number of its first chirp.

    ``frame_starts`` are the first cycles of the frames, none where the length is not known, and
    ``n_chirps`` is how many chirps there were so far.
    """

    def __init__(
        self,
        samples: Block | SampleFile | Iterable[Block],
        processing: Processing,
        *,
        in_memory: bool,
    ) -> None:
        self.processing, self._in_memory = processing, in_memory
        self._radar = radar = processing.radar
        self.title = f"{_NAME}, {radar.name}"
        self._cycle_rows = radar.n_tx // chirps_together(radar)
        self.n_chirps, self.frame_starts = 0, radar.window_starts(0)
        # An array has a known length, and with it known frames; blocks are checked as they come.
        if hasattr(samples, "dtype"):
            rows = _rows(samples, radar)
            self.frame_starts = self._checked(len(rows) // self._cycle_rows * radar.n_tx)
            self._pieces: Iterator[NDArray[Any]] = iter([rows])
        elif isinstance(samples, Iterable):
            self._pieces = (_rows(np.asarray(block), radar) for block in samples)
        else:
            raise InputError(
                f"samples are of type {type(samples).__name__}; give an array (chirp, rx, sample) "
                "of complex numbers, or blocks of them"
            )

    def stream(self, sink: SpectraSink) -> None:
        """Make the range spectra of all samples, which the sink receives; samples are not kept."""
        together = chirps_together(self._radar)
        # The same pieces as those of a run, so that the maps are the same to the last bit.
        at_once = min(sink.max_chirps, block_chirps(self._radar))
        range_spectra = self.processing.range_spectra(at_once)
        for first, block in tqdm(self, desc=_NAME, unit="block", disable=None):
            for begin in range(0, len(block) * together, at_once):
                part = block[begin // together : (begin + at_once) // together]
                sink.push(range_spectra(part, first + begin), first + begin)

    def __iter__(self) -> Iterator[tuple[int, NDArray[np.complex64]]]:
        most = block_chirps(self._radar) // chirps_together(self._radar)
        held: list[NDArray[np.complex64]] = []
        count = 0
        # Pieces of any length are cut and joined to blocks of one length.
        for piece in self._pieces:
            begin = 0
            while begin < len(piece):
                # Copies, because the caller may fill the same array again.
                with np.errstate(over="ignore"):
                    part = np.array(piece[begin : begin + most - count], dtype=np.complex64)
                held.append(part)
                begin, count = begin + len(part), count + len(part)
                if count == most:
                    yield self._block(held)
                    held, count = [], 0
        # What is left makes a shorter block, if it holds a whole cycle.
        if count >= self._cycle_rows:
            yield self._block(held)
        self._checked(self.n_chirps)

    def _block(self, held: list[NDArray[np.complex64]]) -> tuple[int, NDArray[np.complex64]]:
        """Join rows to a block of whole cycles, with the number of its first chirp."""
        block = held[0] if len(held) == 1 else np.concatenate(held)
        block = block[: len(block) // self._cycle_rows * self._cycle_rows]
        first, n_chirps = self.n_chirps, len(block) * chirps_together(self._radar)
        if not np.isfinite(block).all():
            where = first + int(np.flatnonzero(~np.isfinite(block).all(axis=(1, 2)))[0])
            raise InputError(
                f"IF samples: chirp {where} holds NaN, infinity, or more than single precision "
                "does; every sample must be finite"
            )
        self.n_chirps += n_chirps
        if self._in_memory:
            refuse_large_maps(self._radar, self.n_chirps)
        return first, block

    def _checked(self, n_chirps: int) -> NDArray[np.int64]:
        """Return the first cycle of each frame of so many chirps."""
        radar = self._radar
        starts = radar.window_starts(n_chirps)
        if not len(starts):
            raise InputError(
                f"IF samples: {n_chirps} chirps in whole cycles hold no frame of radar "
                f"'{radar.name}', which has {radar.chirps_per_frame}; give a longer capture, or a "
                "radar with a shorter frame_duration_s"
            )
        if self._in_memory:
            refuse_large_maps(radar, n_chirps)
        return starts


def _rows(samples: Any, radar: Radar) -> Any:
    """Return samples as rows (chirp, rx, sample), one for each cycle under DDM."""
    sums = radar.receives_sums
    allowed = _DIMENSIONS[:1] if sums else _DIMENSIONS
    # Named dimensions may be in any order.
    if hasattr(samples, "dims"):
        order = next((names for names in allowed if set(names) == set(samples.dims)), None)
        if order is None:
            given, texts = samples.dims, (f"({', '.join(names)})" for names in allowed)
            raise InputError(
                f"IF samples: dimensions are ({', '.join(map(str, given))}); "
                f"allowed: {' or '.join(texts)}"
            )
        samples = samples.transpose(*order)
    # The samples themselves are not read yet: they may be rows of a file.
    kind, shape = np.dtype(samples.dtype), tuple(samples.shape)
    if kind.kind != "c":
        raise InputError(f"IF samples are of type {kind}; they must be complex numbers")
    end = radar.n_rx, radar.samples_per_chirp
    tx, own = getattr(samples, "tx_per_cycle", None), radar.n_tx // chirps_together(radar)
    if tx not in (None, own):
        raise InputError(
            f"IF samples have cycles of {tx} Tx; radar '{radar.name}' has {own}: give the radar "
            "that received them"
        )
    # Cycles by Tx are laid out as chirps, which come in the same order.
    if len(shape) == 4 and not sums and shape[1:] == (radar.n_tx, *end):
        return np.asarray(samples).reshape(-1, *end)
    if len(shape) != 3 or shape[1:] != end:
        whole = f" or (cycle, tx, rx, sample) = (any, {radar.n_tx}, {end[0]}, {end[1]})"
        raise InputError(
            f"IF samples have shape {shape}; radar '{radar.name}' needs "
            f"(chirp, rx, sample) = (any, {end[0]}, {end[1]}){'' if sums else whole}"
        )
    return samples
