"""Echoes with their names, as an xarray dataset: what was traced, chirp by chirp."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.memory import refuse_large
from rtradar.pipeline.output.truth import parts_of
from rtradar.scatter.common.echo_sets import at_nodes

if TYPE_CHECKING:
    import xarray as xr

_BYTES_AN_ECHO = 25
"""Of a length, a complex amplitude and whether it is seen."""

_FEW_CHIRPS = 64

CYCLES_COMPARED = 40
"""Largest number of TDM cycles in which two levels are compared echo by echo."""


def labelled_echoes(capture: Capture, chirps: NDArray[np.int64]) -> xr.Dataset:
    """Return the echoes of some chirps (chirp,), numbered from the start of the capture.

    The dataset has ``length_m``, ``amplitude`` at the centre of the sweep and ``visible`` (chirp,
    rx, echo), with the coordinates ``time`` and ``tx (chirp,)`` and ``part``, ``path``, ``person``
    and ``bounces (echo,)``. An `InputError` is raised if it is larger than the memory that results
    may take.
    """
    import xarray as xr  # slow to import

    radar, parts = capture.radar, parts_of(capture)
    few = capture.model.echoes(chirps[:_FEW_CHIRPS])
    count = float(len(chirps)) * radar.n_rx * len(few.part)
    refuse_large(
        f"{len(few.part)} echoes of {len(chirps)} chirps of radar '{radar.name}'",
        count * _BYTES_AN_ECHO,
        "take them for a shorter time (start_s, duration_s)",
    )
    echoes = few if len(chirps) <= _FEW_CHIRPS else capture.model.echoes(chirps)
    centre_hz = radar.centre_frequency_hz
    (amplitude,) = at_nodes(echoes.amplitude, echoes.frequency, np.array([centre_hz]))
    axes = "chirp", "rx", "echo"
    text = "conjugate of the scattering length with the phase of the length taken out"
    return xr.Dataset(
        {
            "length_m": (axes, echoes.length, {"units": "m", "long_name": "path from Tx to Rx"}),
            "amplitude": (axes, amplitude.astype(np.complex128), {"units": "m", "long_name": text}),
            "visible": (axes, amplitude != 0, {"long_name": "whether the echo is seen"}),
        },
        {
            "chirp": chirps,
            "time": ("chirp", radar.centres_of(chirps), {"units": "s"}),
            "tx": ("chirp", echoes.tx),
            "part": ("echo", np.array(parts.names)[echoes.part]),
            "path": ("echo", np.array(capture.model.path_names)[echoes.path]),
            "person": ("echo", parts.person[echoes.part], {"long_name": "number; -1: an object"}),
            "bounces": ("echo", echoes.bounces),
        },
        {"frequency_hz": centre_hz, "fidelity": capture.settings.fidelity},
    )


def chirps_between(capture: Capture, start_s: float, duration_s: float | None) -> NDArray[np.int64]:
    """Return the chirps whose centre is in an interval; an `InputError` is raised if none is."""
    radar, chirps = capture.radar, np.arange(capture.n_chirps)
    times = radar.centres_of(chirps)
    end_s = np.inf if duration_s is None else start_s + duration_s
    inside = chirps[(times >= start_s) & (times < end_s)]
    if not len(inside):
        raise InputError(
            f"echoes: no chirp is between start_s = {start_s} and {end_s} s; the capture is from 0 "
            f"to {radar.duration_of(capture.n_chirps):.3f} s"
        )
    return inside


def compared_echoes(captures: Mapping[str, Capture], reference: str) -> xr.Dataset:
    """Compare the echoes of several levels, part by part, in some cycles of one recording.

    The dataset has, by ``fidelity``, ``chirp``, ``rx`` and ``part``, the mean ``length_m`` of the
    echoes of a part, weighted by power and NaN where it has none; ``field_m``, their complex sum at
    the centre of the sweep; and how both differ from the ``reference``: ``length_difference_m`` and
    ``field_difference_m``.
    """
    import xarray as xr  # slow to import

    first = captures[reference]
    n_cycles = first.n_chirps // first.radar.n_tx
    cycles = np.unique(np.linspace(0, n_cycles - 1, CYCLES_COMPARED).astype(np.int64))
    chirps = (cycles[:, None] * first.radar.n_tx + np.arange(first.radar.n_tx)).ravel()
    found = xr.concat(
        [_by_part(labelled_echoes(capture, chirps), capture) for capture in captures.values()],
        xr.Variable("fidelity", list(captures)),
        coords="minimal",
        compat="override",
        join="outer",
    )
    other = found.sel(fidelity=reference, drop=True)
    differences = {
        "length_difference_m": found["length_m"] - other["length_m"],
        "field_difference_m": found["field_m"] - other["field_m"],
    }
    return found.assign(differences).assign_attrs(reference=reference)


def _by_part(echoes: xr.Dataset, capture: Capture) -> xr.Dataset:
    """Sum the echoes of each part."""
    import xarray as xr  # slow to import

    parts, names = parts_of(capture), echoes["part"].values
    length, amplitude = echoes["length_m"].values, echoes["amplitude"].values
    wavenumber = 2 * np.pi * echoes.attrs["frequency_hz"] / SPEED_OF_LIGHT_MPS
    own = np.array([names == name for name in parts.names], dtype=np.float64).T
    power = np.abs(amplitude) ** 2
    total = power @ own
    mean = np.divide(
        (power * length) @ own, total, out=np.full(total.shape, np.nan), where=total > 0
    )
    field = (amplitude * np.exp(1j * wavenumber * length)) @ own
    axes = "chirp", "rx", "part"
    coordinates = {name: echoes.coords[name] for name in ("chirp", "time", "tx")}
    values = {"length_m": (axes, mean), "field_m": (axes, field)}
    of_parts = {"part": list(parts.names), "person": ("part", parts.person)}
    return xr.Dataset(values, coordinates | of_parts)
