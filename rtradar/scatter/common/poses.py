"""Positions of body and antennas at each chirp and keyframe, and what all echo models share."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.radar import Radar


class BuiltInModel:
    """What the models of rtradar say of themselves; lists of models are derived from it.

    Models of other packages need none of this: what they do not say is False, or not known. All
    built-in models take the parameters below, and those that trace ``variant``.

    Parameters
    ----------
    radar : Radar
        Radar in the scene.
    body : Body
        Body in motion.
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend.
    spreading : bool
        Whether amplitudes hold 1 / (R1 R2).
    """

    traces: ClassVar[bool] = True
    """Whether the model traces rays, so that parts of the body occlude each other."""

    fast_over_walls: bool = False
    """Whether one model serves all paths of a room: by one formula, ``conductor_echo``, or if it is
    built in with one echo a part, over specular points; else each path has one before images of the
    antennas."""

    accepts_meshes: ClassVar[bool] = False
    """Whether the model takes meshes as well as ellipsoids, as people and as targets of
    `scattering_length`."""

    relative_cost: ClassVar[float | None] = None
    """Rough time per part and chirp over that of `analytic`; None if it depends on the pose."""

    scattering: ClassVar[Callable[..., NDArray[np.complex128]] | None] = None
    """Scattering length of one target (target, tx, rx, frequency, polarization, options of the
    model), which `scattering_length` calls; None where there is none."""


def check_option(level: str, option: str, value: object, fine: bool, allowed: str) -> None:
    """Raise an `InputError` where an option of a level is not ``fine``, with what is allowed."""
    if not fine:
        raise InputError(f"{level}: {option} = {value!r}; it must be {allowed}")


def owners_of(body: Body) -> NDArray[np.int64]:
    """Return the person that each part (part,) belongs to; one, where a body knows no people."""
    found: NDArray[np.int64] | None = getattr(body, "owner", None)
    return np.zeros(len(body.part_names), dtype=np.int64) if found is None else found


def has_mesh(body: Body) -> bool:
    """Whether any of the people has a mesh; other bodies than `Body` need not know of either."""
    people = getattr(body, "people", ())
    return any(getattr(person, "mesh", None) is not None for person in people)


class EchoModel(Protocol):
    """An echo model of a body seen by a radar, for any chirps of the capture.

    ``variant`` is the backend that traces, in the words of the command line; None for no tracing.
    """

    @property
    def variant(self) -> str | None:
        """Backend that traces."""
        ...

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Compute the echoes at some chirps.

        Parameters
        ----------
        chirps : (chirp,) int64
            Chirps, numbered from the start of the capture, ascending.

        Returns
        -------
        Echoes
        """
        ...


def account_of(model: EchoModel) -> dict[str, Any] | None:
    """Report what a model has modelled how so far.

    Parameters
    ----------
    model : EchoModel
        Model, which may have a method ``account()`` without arguments.

    Returns
    -------
    dict or None
        What the method returns, ready for JSON; None where there is none.
    """
    account: Callable[[], dict[str, Any] | None] | None = getattr(model, "account", None)
    return None if account is None else account()


class ChirpPoses(NamedTuple):
    """Body and antennas chirp by chirp, float64, world [m].

    ``tx_index (chirp,)``, ``tx (chirp, 3)``, ``rx (chirp, rx, 3)``, ``centres (chirp, part, 3)``,
    ``frames (chirp, part, 3, 3)``, ``semi_axes (part, 3)``; ``axes (chirp, 3, 3)`` are those of the
    radar, each as `Radar.axes` is, or one (3, 3) for all chirps.
    """

    tx_index: NDArray[np.int64]
    tx: NDArray[np.float64]
    rx: NDArray[np.float64]
    centres: NDArray[np.float64]
    frames: NDArray[np.float64]
    semi_axes: NDArray[np.float64]
    axes: NDArray[np.float64] = np.eye(3)


def chirp_poses(radar: Radar, body: Body, chirps: NDArray[np.int64]) -> ChirpPoses:
    """Compute the poses of a radar and a body at the centres of some chirps.

    Past the end of the recording both rest in their last pose.

    Parameters
    ----------
    radar : Radar
        Radar that transmits the chirps.
    body : Body
        Moving body.
    chirps : (chirp,) int64
        Numbers of chirps, counted from the start of the capture.

    Returns
    -------
    ChirpPoses
    """
    times, tx = np.minimum(radar.centres_of(chirps), body.duration_s), radar.tx_of_chirp(chirps)
    ends = antennas_in_use(radar, times, tx)
    return ChirpPoses(tx, *ends, *body.at(times), radar.poses_at(times)[0])


def antennas_in_use(
    radar: Radar, times: NDArray[np.float64], tx: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the places of one Tx at each time, and of the Rx that are kept with it.

    Parameters
    ----------
    radar : Radar
        Radar, which may move.
    times : (time,) float64
        Times since the start of the capture [s].
    tx : (time,) int64
        Which Tx is meant at each time.

    Returns
    -------
    tx : (time, 3) float64
        Places of the Tx, world [m].
    rx : (time, rx, 3) float64
        Places of the Rx, world [m].
    """
    number, (every_tx, every_rx) = np.arange(len(tx)), radar.antennas_at(times)
    return every_tx[number, tx], every_rx[number[:, None], radar.rx_of_tx[tx]]


def keyframe_time(radar: Radar, body: Body, chirp: int) -> float:
    """Time of a keyframe, in the middle of a chirp of `Radar.gapless`; at most the body's last [s].

    Parameters
    ----------
    radar : Radar
        Radar that transmits the chirps.
    body : Body
        Moving body.
    chirp : int
        Number of the chirp, counted without gaps.

    Returns
    -------
    float
    """
    return min(float(radar.gapless.centres_of(np.array([chirp]))[0]), body.duration_s)


def one_echo_a_part(
    tx: NDArray[np.int64],
    length: NDArray[np.float64],
    amplitude: NDArray[np.inexact],
    frequency_hz: float | NDArray[np.float64],
) -> Echoes:
    """Make echoes of single reflections, one a part.

    Parameters
    ----------
    tx : (chirp,) int64
        Transmitter of each chirp.
    length : (chirp, rx, part) float64
        Length of the path from Tx to Rx [m].
    amplitude : ([node,] chirp, rx, part) float64 or complex128
        Scattering length, defined as in `Echoes` [m]; without nodes it is that of the whole sweep.
    frequency_hz : float or (node,) float64
        Frequency of the amplitudes [Hz].

    Returns
    -------
    Echoes
        Echoes of one bounce.
    """
    parts = length.shape[2]
    values = amplitude.astype(np.complex128, copy=False)
    return Echoes(
        length=length,
        amplitude=values if values.ndim == 4 else values[None],
        frequency=np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64)),
        tx=tx,
        part=np.arange(parts),
        bounces=np.ones(parts, dtype=np.int64),
    )


# -- keyframes -------------------------------------------------------------------------------------


_Key = TypeVar("_Key", bound=Hashable)
_Value = TypeVar("_Value")


def keyframe_step(radar: Radar, apart_s: float = 10e-3) -> int:
    """Return the number of chirps between keyframes, all of those that are transmitted at once.

    Visibility and power are evaluated at keyframes, 10 ms apart: a limb at 5 m/s moves 5 cm in
    that time.
    """
    together = radar.n_tx if radar.at_once else 1
    return together * max(1, round(apart_s / (together * radar.chirp_interval_s)))


def keyframe_before(
    radar: Radar, chirps: NDArray[np.int64], step: int
) -> tuple[NDArray[np.int64], NDArray[np.int64] | NDArray[np.float64]]:
    """Number of the keyframe before each chirp, and how many chirps after it the chirp is.

    Keyframes follow each other evenly, also in the gaps between frames: keyframe k is in the middle
    of chirp k times ``step`` of `Radar.gapless`.
    """
    numbers, rest = np.divmod(radar.slots_of(chirps), step)
    return numbers.astype(np.int64), rest


def chirps_by_steps(radar: Radar, n_chirps: int, step: int) -> NDArray[np.int64]:
    """Every chirp that begins a step, and at least one behind every gap."""
    return np.arange(0, n_chirps, min(step, radar.burst_chirps or step))


class KeyframeCache(Generic[_Key, _Value]):
    """Values of keyframes: the first ``stay`` that come stay, later ones pass through.

    A recording is processed twice from its start, once for its power and once for its signal. If
    the last values were kept, a recording a little longer than this cache would find nothing left
    of them when it starts again. Of later values, the ``passing`` ones that were asked for last are
    held.
    """

    def __init__(self, stay: int, passing: int) -> None:
        self.stay, self._passing = stay, passing
        self._staying: dict[_Key, _Value] = {}
        self._later: dict[_Key, _Value] = {}

    def __contains__(self, key: object) -> bool:
        return key in self._staying or key in self._later

    def __getitem__(self, key: _Key) -> _Value:
        if key in self._later:
            self._later[key] = self._later.pop(key)  # dictionaries keep order: it is now last
        return self._later[key] if key in self._later else self._staying[key]

    def get(self, key: _Key, find: Callable[[], _Value]) -> _Value:
        """Return the value of a key, which ``find`` computes if it is not known."""
        if key not in self:
            self.keep(key, find())
        return self[key]

    def keep(self, key: _Key, value: _Value) -> None:
        """Keep the value of a key that is not known."""
        (self._staying if len(self._staying) < self.stay else self._later)[key] = value
        if len(self._later) > self._passing:
            del self._later[next(iter(self._later))]

    def mapped(self, new: Callable[[_Value], _Value]) -> KeyframeCache[_Key, _Value]:
        """Return a cache of its own with new values in place of all."""
        other = KeyframeCache[_Key, _Value](self.stay, self._passing)
        for here, there in ((self._staying, other._staying), (self._later, other._later)):
            there.update((key, new(value)) for key, value in here.items())
        return other
