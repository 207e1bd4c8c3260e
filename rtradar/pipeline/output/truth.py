"""What is true of each person, each part and each echo, and the table of echoes that tells it.

Echoes are looked at some eight times in a frame and in its middle, for one Tx and all Rx together,
while the signal is made. Each is there with its part, path, range, range rate and power; of frames
that are over only the middles are kept that are shown. Cells, pictures and the truth of a run are
read from this table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.motion.skeleton import NODES
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.processing import refuse_large
from rtradar.scatter.common.interpolation import at_nodes

if TYPE_CHECKING:
    import xarray as xr

_BYTES_AN_ECHO = 25
"""Of a length, a complex amplitude and whether it is seen."""

_FEW_CHIRPS = 64

CYCLES_COMPARED = 40
"""Largest number of TDM cycles in which two levels are compared echo by echo."""

_STEP_S = 0.01  # over which speeds are taken

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Parts(NamedTuple):
    """The parts of all people and then the objects: ``names`` and the number of the ``person``.

    The person of an object is -1.
    """

    names: tuple[str, ...]
    person: NDArray[np.int64]


def parts_of(capture: Capture) -> Parts:
    """Return the parts of everyone and everything that moves in a capture."""
    body, objects = capture.body, capture.scene.objects
    names = *body.part_names, *(one.name for one in objects)
    return Parts(names, np.append(body.owner, np.full(len(objects), -1)))


def truth_of_parts(table: EchoTable, start_cycle: int, time_s: float) -> dict[str, NDArray[Any]]:
    """Return what is true of each part (part,) at the middle of a frame, which is at ``time_s``."""
    look, n_parts = table.middle(start_cycle), len(parts_of(table.capture).names)
    direct = (look.bounces == 1) & (look.path == 0)
    values = (own[direct] for own in (look.power_m2, look.range_m, look.rate_mps))
    total, range_m, rate = added_up(look.part[direct], (n_parts,), *values)
    # The look is at the middle of a chirp, which differs a little from the middle of the frame.
    range_m += (time_s - look.time_s) * rate
    return {"range_m": range_m, "range_rate_mps": rate, "power_m2": total, "visible": total > 0}


def added_up(
    cell: NDArray[np.integer], shape: tuple[int, ...], power: Array, *values: Array
) -> list[Array]:
    """Return the power of all echoes (echo,) of each cell, and means of their values.

    Means are weighted by power, or plain where there is none, and NaN where there is no echo. The
    ``cell`` is a number in an array of this shape.
    """
    size = math.prod(shape)

    def summed(values: Array) -> Array:
        # Of nothing NumPy counts in whole numbers.
        return np.bincount(cell, values, size).reshape(shape).astype(np.float64)

    total = summed(power)
    # Cells in which everything is occluded have no power to weight by.
    weight = np.where(total.ravel()[cell] > 0, power, 1.0)
    with np.errstate(invalid="ignore"):
        return [total, *(summed(weight * own) / summed(weight) for own in values)]


def truth_of(body: Body, times: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return the arrays of the table ``people`` at times (time,) [s].

    The speed is that over 10 ms, and 0 of a person who rests in the last pose.
    """
    joints = np.empty((len(times), len(body.names), len(NODES), 3))
    speeds = np.empty(joints.shape[:2])
    for number, person in enumerate(body.people):
        end = person.duration_s
        joints[:, number] = person.motion.at(np.minimum(times, end))[0]
        # A central difference, one-sided at both ends of the recording.
        ends = np.clip([times - _STEP_S / 2, times + _STEP_S / 2], 0.0, end)
        before, after = (person.motion.at(instants)[0][:, 0] for instants in ends)
        apart_s, away = ends[1] - ends[0], np.linalg.norm(after - before, axis=1)
        speeds[:, number] = np.divide(away, apart_s, out=np.zeros_like(away), where=apart_s > 0)
    return {"person_position": joints[:, :, 0], "person_speed": speeds, "joints": joints}


def labelled_echoes(capture: Capture, chirps: NDArray[np.int64]) -> xr.Dataset:
    """Return the echoes of some chirps (chirp,), numbered from the start of the capture.

    The dataset has ``length_m``, ``amplitude`` at the centre of the sweep and ``visible`` (chirp,
    rx, echo), with the coordinates ``time`` and ``tx (chirp,)`` and ``part``, ``path``, ``person``
    and ``bounces (echo,)``. An `InputError` is raised if it is larger than the memory that results
    may take.
    """
    import xarray as xr  # slow to import

    radar, parts = capture.radar, parts_of(capture)
    # A few chirps tell how many echoes there are, before all of them take memory.
    few = capture.model.echoes(chirps[:_FEW_CHIRPS])
    count = float(len(chirps)) * radar.n_rx * len(few.part)
    refuse_large(
        f"{len(few.part)} echoes of {len(chirps)} chirps of radar '{radar.name}'",
        count * _BYTES_AN_ECHO,
        "take them for a shorter time (start_s, duration_s)",
    )
    echoes = few if len(chirps) <= _FEW_CHIRPS else capture.model.echoes(chirps)
    # Amplitudes are known at some frequencies of the sweep; one at its centre stands for them.
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

    # The same whole cycles for all levels, evenly over the recording.
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
    # Levels may have other echoes, but the parts are the same, so differences are taken part by
    # part.
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
    # A matrix (echo, part) of ones and zeros makes sums over the echoes of each part.
    own = np.array([names == name for name in parts.names], dtype=np.float64).T
    power = np.abs(amplitude) ** 2
    total = power @ own
    mean = np.divide(
        (power * length) @ own, total, out=np.full(total.shape, np.nan), where=total > 0
    )
    # The field of an echo has the phase exp(+jkL), that of its IF.
    field = (amplitude * np.exp(1j * wavenumber * length)) @ own
    axes = "chirp", "rx", "part"
    coordinates = {name: echoes.coords[name] for name in ("chirp", "time", "tx")}
    values = {"length_m": (axes, mean), "field_m": (axes, field)}
    of_parts = {"part": list(parts.names), "person": ("part", parts.person)}
    return xr.Dataset(values, coordinates | of_parts)


# -- the table of echoes, thinned in time ---------------------------------------------------------

_INSTANTS = 8
"""Times in a frame at which echoes are looked at, beside its middle."""

_LOOKS_AHEAD = 8
"""Times that are looked at with those that are needed, because a call has its price."""

_RATE_CYCLES = 2
"""Cycles before and after such a time, over which range rates are taken."""

MAX_SHOWN, SHOWN_HZ = 400, 40.0
"""Largest number of frames whose middle is kept, which lasts for 10 s, and their largest rate [Hz].
Longer captures keep fewer frames a second."""


class Look(NamedTuple):
    """Echoes (echo,) at one time [s].

    ``part``, ``path`` and ``bounces`` are those of `Echoes`. The range [m] and the range rate [m/s]
    are means over the receivers, weighted by power, the power [m^2] is a mean; an echo that is
    occluded has power 0, and range and rate all the same.
    """

    time_s: float
    part: Indices
    path: Indices
    bounces: Indices
    range_m: Array
    rate_mps: Array
    power_m2: Array


class EchoTable:
    """The echoes of one capture at the instants of its frames, which are asked for in order.

    Unless ``middles`` are asked for, echoes are not looked at in the middle of a frame.
    """

    def __init__(self, capture: Capture, *, middles: bool = True) -> None:
        self.capture, self._middles, radar = capture, middles, capture.radar
        self._cycles = radar.cycles_per_frame
        self._every = max(1, self._cycles // _INSTANTS)
        # One Tx stands for all of them: the one nearest to the middle of the array.
        self._middle_tx = int(
            np.linalg.norm(radar.tx - np.asarray(radar.position_m), axis=1).argmin()
        )
        # Looks of the frames at hand by their cycle, and those of shown frames, which stay.
        self._kept: dict[int, Look] = {}
        starts = capture.frame_starts[self.shown_frames].tolist()
        self._shown = dict[int, Look | None].fromkeys(starts)

    @property
    def shown_frames(self) -> Indices:
        """Numbers of the evenly chosen frames whose middle is kept."""
        radar, starts = self.capture.radar, self.capture.frame_starts
        hop_s = radar.frame_hop_s
        if len(starts) > 1:
            hop_s = radar.frame_period_s or float(np.diff(starts).mean()) * radar.cycle_duration_s
        # As many frames at most, and no more of them in a second of radar, as the view shows.
        every = max(math.ceil(len(starts) / MAX_SHOWN), math.ceil(1 / (SHOWN_HZ * hop_s) - 1e-6))
        return np.arange(0, len(starts), every)

    def frame(self, start_cycle: int) -> tuple[Indices, list[Look]]:
        """Return the cycles about a frame at which echoes are looked at, and the looks."""
        at = self._instants(start_cycle)
        return at, self._looks(start_cycle, at)

    def middle(self, start_cycle: int) -> Look:
        """Return the look at the middle of a frame."""
        if (known := self._shown.get(start_cycle)) is not None:
            return known
        (look,) = self._looks(start_cycle, np.array([start_cycle + self._cycles // 2]))
        if start_cycle in self._shown:
            self._shown[start_cycle] = look
        return look

    def shown(self) -> list[Look]:
        """Return the middles of `shown_frames`."""
        return [self.middle(start) for start in self._shown]

    def _instants(self, start_cycle: int) -> Indices:
        """Cycles about a frame at which echoes are looked at; past a gap there is nothing."""
        end, every = start_cycle + self._cycles, self._every
        # A frame with gaps around it has instants of its own, with one at each end. Without gaps
        # the instants are multiples of a step, so that overlapping frames share them.
        if self.capture.radar.in_frames:
            return np.append(np.arange(start_cycle, max(end - 1, start_cycle + 1), every), end - 1)
        return np.arange(start_cycle // every, (end - 1) // every + 2) * every

    def _looks(self, start_cycle: int, numbers: Indices) -> list[Look]:
        """Echoes at some cycles about a frame, found once for all frames."""
        missing = [number for number in numbers.tolist() if number not in self._kept]
        if missing:
            # Frames come in order: what lies before this one is not asked for again.
            first = int(self._instants(start_cycle)[0])
            self._kept = {n: look for n, look in self._kept.items() if n >= first}
            wanted = sorted({*missing, *self._ahead(start_cycle)} - self._kept.keys())
            self._kept |= zip(wanted, self._look(np.array(wanted)), strict=True)
        return [self._kept[number] for number in numbers.tolist()]

    def _ahead(self, start_cycle: int) -> set[int]:
        """Return the cycles at which this frame and the next ones are looked at."""
        starts, found = self.capture.frame_starts, set[int]()
        most = _LOOKS_AHEAD + _INSTANTS
        for start in starts[np.searchsorted(starts, start_cycle) :].tolist():
            found.update(self._instants(start).tolist())
            if self._middles:
                found.add(start + self._cycles // 2)
            if len(found) >= most:
                break
        return found

    def _look(self, numbers: Indices) -> list[Look]:
        capture, radar = self.capture, self.capture.radar
        # Each instant is looked at a few cycles before and after it, for the range rate between.
        cycles = numbers[:, None] + [-_RATE_CYCLES, _RATE_CYCLES]
        cycles = np.clip(cycles, 0, capture.n_chirps // radar.n_tx - 1)
        if radar.in_frames:
            first = numbers[:, None] - numbers[:, None] % self._cycles
            cycles = np.clip(cycles, first, first + self._cycles - 1)
        wanted = (cycles * radar.n_tx + self._middle_tx).astype(np.int64)
        # Neighbouring instants share chirps, whose echoes are computed once.
        chirps, where = np.unique(wanted, return_inverse=True)
        echoes = capture.model.echoes(chirps)
        # (number, before and after, rx, echo)
        where = where.reshape(cycles.shape)
        power = (np.abs(echoes.amplitude) ** 2).mean(axis=0)[where]
        length = echoes.length[where]
        # A receiver that has an echo at one time only knows no rate.
        both = np.sqrt(power[:, 0] * power[:, 1])
        weight = np.where(both.any(axis=1, keepdims=True), both, 1.0)
        weight /= weight.sum(axis=1, keepdims=True)
        # Range and rate are means over receivers, weighted by power. The range is half the path.
        before, after = ((weight * length[:, side]).sum(axis=1) for side in (0, 1))
        apart_s = np.diff(cycles, axis=1) * radar.cycle_duration_s
        rate = np.divide(after - before, 2 * apart_s, out=np.zeros_like(before), where=apart_s > 0)
        # At the ends of the capture the times are not in the middle of both cycles.
        late_s = (numbers - cycles.mean(axis=1)) * radar.cycle_duration_s
        range_m = (before + after) / 4 + rate * late_s[:, None]
        middles = radar.centres_of(chirps)[where].mean(axis=1)
        owned = echoes.part, echoes.path, echoes.bounces
        return [
            Look(float(time_s), *owned, *arrays)
            for time_s, *arrays in zip(
                middles + late_s, range_m, rate, both.mean(axis=1), strict=True
            )
        ]
