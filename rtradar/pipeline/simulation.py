"""`simulate`: IF samples of a recording, whole or block by block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np
from numpy.typing import NDArray

from rtradar.description import Moving, given_parts
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.output.truth import chirps_between, labelled_echoes
from rtradar.pipeline.prepare import prepare
from rtradar.pipeline.processing import block_chirps, refuse_large
from rtradar.radar import Radar
from rtradar.scatter.link_budget import LinkBudget
from rtradar.scene import Scene
from rtradar.settings import SimulationOptions, settings_of, takes_settings
from rtradar.signal.multiplexing import chirps_together

if TYPE_CHECKING:
    import xarray as xr


@takes_settings
def simulate(
    motion: Moving,
    radar: Radar | str | Path,
    scene: Scene | str | Path | None = None,
    **options: Unpack[SimulationOptions],
) -> Simulation:
    """Prepare the simulation of a recording, which gives IF samples when it is asked for them.

    Parameters
    ----------
    motion, radar, scene
        The same as for `run`.
    **options
        Settings of the simulation, such as ``fidelity``, ``snr_db`` or ``duration_s``: fields of
        `rtradar.RunSettings`.

    Returns
    -------
    Simulation
        Its samples are those that `run` processes with the same settings.

    Raises
    ------
    InputError, BackendError, ExtensionError
        As in `run`.

    Examples
    --------
    >>> import rtradar as rt
    >>> motion = rt.synthetic_motion("kick", duration_s=0.5)
    >>> radar = rt.Radar.preset("paper-12ghz")
    >>> capture = rt.simulate(motion, radar, fidelity="analytic", duration_s=0.15, snr_db=10)
    >>> capture.samples.dims, capture.samples.shape
    (('chirp', 'rx', 'sample'), (2400, 8, 256))
    >>> sum(len(block) for block in capture.blocks())
    2400
    """
    settings = settings_of("simulate", SimulationOptions, options)
    return Simulation(prepare(*given_parts(motion, radar, scene, settings), settings))


@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """Capture of a moving person by a radar, whose IF samples are computed when they are asked for.

    `simulate` makes it. IF samples are complex amplitudes [m], as `rtradar.signal.synthesize`
    defines them, with noise and with the echoes of the room.
    """

    _capture: Capture

    @property
    def radar(self) -> Radar:
        """Radar at its position in the scene."""
        return self._capture.radar

    @property
    def link_budget(self) -> LinkBudget:
        """Echo power of each part over time, and its occluded fraction."""
        return self._capture.link_budget

    @property
    def noise_power_m2(self) -> float:
        """Noise power of one complex sample [m^2]."""
        return self._capture.noise.power

    @property
    def duration_s(self) -> float:
        """Duration of the capture, whole cycles [s]."""
        return self.radar.duration_of(self._capture.n_chirps)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape (chirp, rx, sample) of the samples.

        Under Doppler division all transmitters transmit at once, and each cycle is one chirp.
        """
        chirps = self._capture.n_chirps // chirps_together(self.radar)
        return chirps, self.radar.n_rx, self.radar.samples_per_chirp

    @cached_property
    def samples(self) -> xr.DataArray:
        """IF samples (chirp, rx, sample) complex64, computed at the first access and kept.

        Coordinates are the time of each chirp, its transmitter, and the time within the chirp. An
        `InputError` is raised if they are larger than `rtradar.pipeline.MEMORY_LIMIT_BYTES`;
        `blocks` gives them in little memory.
        """
        n_bytes = float(np.prod(self.shape, dtype=np.float64)) * np.dtype(np.complex64).itemsize
        refuse_large(
            f"IF samples of {self.duration_s:.3g} s of radar '{self.radar.name}'",
            n_bytes,
            "take them block by block, blocks(), or keep them in a folder: "
            "rt.run(..., save_if=True, out=...)",
        )
        whole = np.empty(self.shape, np.complex64)
        for begin, values in self._blocks():
            whole[begin : begin + len(values)] = values
        return if_samples(whole, self.radar)

    def echoes(self, start_s: float = 0.0, duration_s: float | None = None) -> xr.Dataset:
        """Compute the echoes of each chirp by the level of the simulation: what was traced.

        Parameters
        ----------
        start_s : float
            Time from which on chirps are taken, since the start of the capture [s].
        duration_s : float, optional
            Time over which they are taken [s]; to the end of the capture if left out.

        Returns
        -------
        xarray.Dataset
            By ``chirp``, ``rx`` and ``echo``: ``length_m``, the length of the whole path from Tx to
            Rx at the centre of the chirp [m], float64; ``amplitude``, as `rtradar.Echoes` defines
            it, at the centre of the sweep [m], complex128; and ``visible``, whether it is not 0.
            Coordinates are the ``time`` [s] and the number ``tx`` of each chirp, and of each echo
            the names of its ``part`` and ``path``, the number of the ``person``, -1 of an object,
            and the number of its ``bounces``.

        Raises
        ------
        InputError
            If no chirp is in that time, or the echoes take more memory than results may.

        Examples
        --------
        >>> import rtradar as rt
        >>> motion = rt.synthetic_motion("kick", duration_s=0.5)
        >>> radar = rt.Radar.preset("paper-12ghz")
        >>> capture = rt.simulate(motion, radar, fidelity="analytic", duration_s=0.15)
        >>> echoes = capture.echoes(duration_s=0.01)
        >>> dict(echoes.sizes)
        {'chirp': 160, 'rx': 8, 'echo': 21}
        """
        return labelled_echoes(self._capture, chirps_between(self._capture, start_s, duration_s))

    def blocks(self) -> Iterator[xr.DataArray]:
        """Compute the samples in blocks of chirps, in constant memory.

        Yields
        ------
        (chirp, rx, sample) complex64
            Samples of whole cycles, with the same coordinates as `samples`. Together they are equal
            to these to the bit.
        """
        for begin, values in self._blocks():
            yield if_samples(values.copy(), self.radar, begin)

    def _blocks(self) -> Iterator[tuple[int, NDArray[np.complex64]]]:
        together = chirps_together(self.radar)
        for first, values in self._capture.received(block_chirps(self.radar)):
            yield first // together, values

    def __repr__(self) -> str:
        chirps, rx, samples = self.shape
        lines = (
            f"Simulation of {self._capture.title}",
            f"  samples: chirp {chirps}, rx {rx}, sample {samples}; complex64 [m]",
            f"  {self.duration_s:.3f} s, {chirps * rx * samples * 8 / 1e6:.0f} MB",
            f"  noise {self.noise_power_m2:.3g} m2 per sample",
        )
        return "\n".join(lines)


def if_samples(values: NDArray[np.complex64], radar: Radar, first: int = 0) -> xr.DataArray:
    """Give IF samples (chirp, rx, sample) their coordinates, from chirp ``first`` on."""
    import xarray as xr  # slow to import

    n, n_rx, n_samples = values.shape
    together, rows = chirps_together(radar), np.arange(first, first + n)
    # Under Doppler division the chirps of a cycle are transmitted together.
    times = radar.centres_of(rows * together)
    coordinates = {
        "chirp": ("chirp", rows, {"long_name": "number of the chirp in the capture"}),
        "time": (
            "chirp",
            times,
            {"units": "s", "long_name": "centre of the chirp since the start of the capture"},
        ),
        "rx": ("rx", np.arange(n_rx), {"long_name": "receiver of the line that is in use"}),
        "fast_time": (
            "sample",
            np.arange(n_samples) / radar.sample_rate_hz,
            {"units": "s", "long_name": "time since the start of the chirp"},
        ),
    }
    if not radar.receives_sums:
        text = {"long_name": "transmitter of the chirp"}
        coordinates["tx"] = ("chirp", rows % radar.n_tx, text)
    described = {"units": "m", "long_name": "IF samples", "multiplexing": radar.multiplexing}
    return xr.DataArray(values, coordinates, ("chirp", "rx", "sample"), "if_samples", described)
