"""The antennas of a radar, how they are turned, and the angles that follow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.front_end import rotation
from rtradar.radar.waveform import MOST, Waveform, positive
from rtradar.system.fields import Angle, Limits

Places = tuple[tuple[float, float, float], ...]

MOST_CHIRPS = 2**31
_MOST_ANTENNAS, _MOST_PLACE_M = 1024, 100.0

_Count = Annotated[int, Limits(0, MOST)]
_Spacing = Annotated[float, positive()]
_WITHIN = f"it must be a list of 1 to {_MOST_ANTENNAS} places [x, y, z], within {_MOST_PLACE_M:g} m"
_ListedPlaces = Annotated[
    Places | None, Limits(-_MOST_PLACE_M, _MOST_PLACE_M, _WITHIN, (1, _MOST_ANTENNAS))
]


class UsualPlace(tuple[float, float, float]):
    """Place of a radar that neither its file nor its caller has said; a scene may say another."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Array(Waveform):
    """The antennas of a radar, and what follows from their places; `Radar` documents the fields."""

    tx_y: _Count = 6
    tx_z: _Count = 6
    rx_y: _Count = 8
    rx_z: _Count = 8
    tx_spacing_wavelengths: _Spacing = 4.0
    rx_spacing_wavelengths: _Spacing = 0.5
    tx_positions_m: _ListedPlaces = None
    rx_positions_m: _ListedPlaces = None
    tx_order: Annotated[
        tuple[int, ...] | None,
        Limits(wanted="it must be a list of whole numbers, each Tx once"),
    ] = None
    channels: Literal["pairs", "all"] = "pairs"
    position_m: Annotated[
        tuple[float, float, float], Limits(wanted="it must be three finite numbers [m]")
    ] = UsualPlace((-4.0, 1.0, 1.0))
    yaw_deg: Angle = 0.0
    pitch_deg: Angle = 0.0
    roll_deg: Angle = 0.0
    path_times_s: Annotated[
        tuple[float, ...] | None,
        Limits(wanted="it must be a list of times [s]"),
    ] = None
    path_m: _ListedPlaces = None
    path_angles_deg: Annotated[
        Places | None,
        Limits(
            counts=(0, MOST_CHIRPS), wanted="it must be a list of [yaw, pitch, roll] in degrees"
        ),
    ] = None

    @property
    def is_cross(self) -> bool:
        """Whether Tx and Rx are the cross of two lines, neither given as a list."""
        return self.tx_positions_m is None and self.rx_positions_m is None

    @property
    def n_tx(self) -> int:
        """Number of transmitters, and of chirps in one cycle."""
        listed = self.tx_positions_m
        return self.tx_y + self.tx_z if listed is None else len(listed)

    @property
    def n_rx(self) -> int:
        """Length of the rx axis: the number of receivers that are kept in one chirp."""
        if self.rx_positions_m is not None:
            return len(self.rx_positions_m)
        # Under `pairs` both lines have as many Rx; a radar with one line of Tx has the Rx of that
        # line.
        one_line = self.rx_y if self.tx_y else self.rx_z
        return one_line if self._pairs else self.rx_y + self.rx_z

    @property
    def _pairs(self) -> bool:
        """Whether a Tx is received by its own line alone; a list has no lines."""
        return self.channels == "pairs" and self.is_cross

    @property
    def n_channels(self) -> int:
        """Number of virtual channels, ``n_tx * n_rx``; channel = tx * n_rx + rx."""
        return self.n_tx * self.n_rx

    @cached_property
    def _order(self) -> NDArray[np.int64]:
        """Which of the Tx of the fields each row of `tx` is (tx,)."""
        return np.arange(self.n_tx) if self.tx_order is None else np.array(self.tx_order)

    @cached_property
    def tx_m(self) -> NDArray[np.float64]:
        """Positions of the transmitters in the radar's axes (tx, 3) [m], in the order of `tx`."""
        lines = self.tx_y, self.tx_z, self.tx_spacing_wavelengths
        return self._places(self.tx_positions_m, *lines)[self._order]

    @cached_property
    def rx_m(self) -> NDArray[np.float64]:
        """Positions of the receivers in the radar's axes (rx, 3) [m], in the order of `rx`."""
        lines = self.rx_y, self.rx_z, self.rx_spacing_wavelengths
        return self._places(self.rx_positions_m, *lines)

    @cached_property
    def tx(self) -> NDArray[np.float64]:
        """Positions of the transmitters (tx, 3) [m], world, in the order in which they transmit.

        Of a cross without ``tx_order`` it is the y-line, then the z-line.
        """
        return self._in_world(self.tx_m)

    @cached_property
    def rx(self) -> NDArray[np.float64]:
        """Positions of the receivers (rx, 3) [m], world: the list, or the y- and the z-line."""
        return self._in_world(self.rx_m)

    @cached_property
    def tx_lines(self) -> list[NDArray[np.int64]]:
        """Straight, evenly spaced lines of Tx, each as indices into `tx` from end to end."""
        if self.tx_positions_m is not None:
            return _runs(self.tx_m)
        # Where in the order of transmission each Tx of the fields is.
        place = np.argsort(self._order)
        return [line for line in (place[: self.tx_y], place[self.tx_y :]) if len(line)]

    @cached_property
    def rx_lines(self) -> list[NDArray[np.int64]]:
        """Straight, evenly spaced lines of Rx, each as indices into `rx` from end to end."""
        if self.rx_positions_m is not None:
            return _runs(self.rx_m)
        place = np.arange(self.rx_y + self.rx_z)
        return [line for line in (place[: self.rx_y], place[self.rx_y :]) if len(line)]

    def _places(
        self, listed: Places | None, n_y: int, n_z: int, spacing_wavelengths: float
    ) -> NDArray[np.float64]:
        if listed is not None:
            return np.array(listed, dtype=np.float64)
        # The y-line first, then the z-line, both about the middle of the array.
        spacing_m = spacing_wavelengths * self.start_wavelength_m
        positions = np.zeros((n_y + n_z, 3))
        positions[:n_y, 1] = (np.arange(n_y) - (n_y - 1) / 2) * spacing_m
        positions[n_y:, 2] = (np.arange(n_z) - (n_z - 1) / 2) * spacing_m
        return positions

    def _in_world(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        turned = places @ self.axes.T if self.is_turned else places
        return np.asarray(turned + np.asarray(self.position_m))

    @property
    def is_turned(self) -> bool:
        """Whether the radar's axes differ from the world's."""
        return (self.yaw_deg, self.pitch_deg, self.roll_deg) != (0.0, 0.0, 0.0)

    @property
    def is_moving(self) -> bool:
        """Whether the radar moves."""
        return self.path_times_s is not None

    def poses_at(self, times: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the axes and the position of the radar at some times.

        Parameters
        ----------
        times : (time,) float
            As for `path_at`.

        Returns
        -------
        axes : (time, 3, 3) float64
            Each as `axes` is.
        positions : (time, 3) float64
            Positions along the path, those that `path_at` gives.
        """
        angles, positions = self.path_at(times)
        if not self.is_moving:
            return np.broadcast_to(self.axes, (len(positions), 3, 3)), positions
        return rotation(angles), positions

    def antennas_at(self, times: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the places of all antennas at some times.

        Parameters
        ----------
        times : (time,) float
            As for `path_at`.

        Returns
        -------
        tx : (time, tx, 3) float64
            Positions of the transmitters, world, each as `tx` is [m].
        rx : (time, rx, 3) float64
            Positions of the receivers, world, each as `rx` is [m].
        """
        # A radar at rest has one place for all times, which is not copied.
        axes, positions = self.poses_at(times)
        if not self.is_moving:
            count = len(positions)
            tx, rx = (np.broadcast_to(own, (count, *own.shape)) for own in (self.tx, self.rx))
        else:
            tx, rx = (
                np.einsum("tij,aj->tai", axes, own) + positions[:, None]
                for own in (self.tx_m, self.rx_m)
            )
        return tx, rx

    def path_at(self, times: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give angles and position of the radar at some times.

        Parameters
        ----------
        times : (time,) float
            Times since the start of the capture [s].

        Returns
        -------
        angles_deg : (time, 3) float64
            Yaw, pitch and roll [deg].
        positions : (time, 3) float64
            Positions, world [m].
        """
        at = np.asarray(times, dtype=np.float64)
        positions, angles = np.empty((2, len(at), 3))
        positions[:] = self.position_m
        angles[:] = self.yaw_deg, self.pitch_deg, self.roll_deg
        # The path is added to where the radar is and how it is turned. NumPy holds the ends before
        # and after.
        for values, path in ((positions, self.path_m), (angles, self.path_angles_deg)):
            for axis, along in enumerate(() if path is None else zip(*path, strict=True)):
                values[:, axis] += np.interp(at, self.path_times_s or (), along)
        return angles, positions

    @cached_property
    def axes(self) -> NDArray[np.float64]:
        """Axes of the radar (3, 3): the columns are boresight, left and up in world axes.

        A vector of the radar's axes is ``axes @ vector`` in the world's.
        """
        return rotation(np.array([self.yaw_deg, self.pitch_deg, self.roll_deg]))

    @cached_property
    def rx_of_tx(self) -> NDArray[np.int64]:
        """Indices into `rx` of the receivers kept while each Tx transmits, (tx, rx)."""
        if not self._pairs:
            return np.tile(np.arange(self.n_rx), (self.n_tx, 1))
        # Rx are numbered along y first, so those of the z-line begin after them.
        first = np.repeat([0, self.rx_y], [self.tx_y, self.tx_z])[self._order]
        return np.asarray(first[:, None] + np.arange(self.n_rx))

    # -- angles ------------------------------------------------------------------------------------

    @cached_property
    def virtual_m(self) -> NDArray[np.float64]:
        """Virtual elements (channel, 3), Tx plus Rx of each channel in the radar's axes [m]."""
        # Far away the path over a Tx and an Rx changes with direction as their places together do.
        return np.asarray((self.tx_m[:, None] + self.rx_m[self.rx_of_tx]).reshape(-1, 3))

    @cached_property
    def patterns(self) -> tuple[LinePattern, LinePattern]:
        """Far field of all virtual elements over the sines of azimuth and of elevation.

        Each line of a cross is taken for a line without gaps, so that its angles follow
        (:eq:`angle-axis`), and both get the beam width of the longer one.
        """
        if not self.is_cross:
            y, z = (LinePattern.of(self.virtual_m[:, axis] / self.wavelength_m) for axis in (1, 2))
            return y, z
        # Spacings belong to the start of the sweep, and phases to its centre.
        spacing = self.rx_spacing_wavelengths * self.start_wavelength_m / self.wavelength_m
        counts = self.tx_y * self.rx_y, self.tx_z * self.rx_z
        width = min(180.0, math.degrees(0.886 / (max(*counts, 1) * spacing)))
        y, z = (
            LinePattern(count > 1, 1 / spacing, -math.inf, width if count > 1 else 180.0)
            for count in counts
        )
        return y, z

    @property
    def max_azimuth_deg(self) -> float:
        """Azimuth up to which no other direction in the plane looks alike [deg].

        Of a cross it is asin(lambda / 2d) (:eq:`angle-axis`), of a listed array half the sine of
        the first grating lobe, `LinePattern.grating_sine`.
        """
        return self.patterns[0].max_angle_deg

    @property
    def max_elevation_deg(self) -> float:
        """Elevation up to which no other direction looks alike [deg]; see `max_azimuth_deg`."""
        return self.patterns[1].max_angle_deg

    @property
    def max_angle_deg(self) -> float:
        """Unambiguous angle, the larger of those of azimuth and elevation [deg]."""
        # The limit of an axis that is not measured does not count.
        measured = [one.max_angle_deg for one in self.patterns if one.wide]
        return max(measured, default=self.max_azimuth_deg)

    @property
    def measures(self) -> tuple[bool, bool]:
        """Whether the radar measures azimuth, and whether it measures elevation."""
        y, z = self.patterns
        return y.wide, z.wide

    @property
    def angle_resolution_deg(self) -> float:
        """Half-power beam width at broadside, 0.886 lambda / N d of a line [deg].

        It is that of the far field (:eq:`angle-axis`), and of a listed array the narrower of both
        beam widths. Where the spacings of Tx and Rx of a cross do not fill a line without gaps, it
        is the width for a line of as many elements.
        """
        return min(self.azimuth_resolution_deg, self.elevation_resolution_deg)

    @property
    def azimuth_resolution_deg(self) -> float:
        """Half-power beam width in azimuth at broadside [deg]; 180 where it is not measured."""
        return self.patterns[0].width_deg

    @property
    def elevation_resolution_deg(self) -> float:
        """Half-power beam width in elevation at broadside [deg]; 180 where it is not measured."""
        return self.patterns[1].width_deg


def _runs(places: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Antennas (antenna, 3) that follow each other in even steps, and those that stand alone."""
    runs, begin = [], 0
    # As many as follow each other by the first step; two steps at least make a line.
    while begin < len(places):
        end = begin + 1
        steps = np.diff(places[begin:], axis=0)
        if len(steps) > 1 and np.allclose(steps[1], steps[0], rtol=1e-9, atol=1e-9):
            uneven = np.abs(steps - steps[0]).max(axis=1) > 1e-9
            end = begin + 1 + (int(uneven.argmax()) if uneven.any() else len(steps))
        runs.append(np.arange(begin, end))
        begin = end
    return runs


GRATING_DB = -3.0
"""A lobe beside the main lobe counts as a grating lobe from here on, below the main lobe [dB]."""

_PER_WAVELENGTH = 64  # points over the finest ripple of the pattern, 1 / aperture
_MOST_POINTS = 2**20
_LEAST = 1e-6  # aperture below which elements are at one place [wavelengths]


@dataclass(frozen=True)
class LinePattern:
    """What a beam of all elements shows of an echo whose sine differs by 0 to 2.

    ``wide`` is whether elements differ in their place at all. ``grating_sine`` is the difference in
    sine at which the first grating lobe is, 2 if there is none, and ``grating_db`` its power below
    the main lobe. ``width_deg`` is the half-power width of the main lobe at broadside.
    """

    wide: bool
    grating_sine: float
    grating_db: float
    width_deg: float

    @property
    def max_angle_deg(self) -> float:
        """Angle between whose two ends no echo shows at another's place [deg]."""
        return math.degrees(math.asin(min(1.0, self.grating_sine / 2)))

    @classmethod
    def of(cls, places: NDArray[np.float64]) -> LinePattern:
        """Pattern of elements at these places (element,) along the line, in wavelengths."""
        # A beam at sine s shows an echo at another sine by the difference of both, from 0 to 2.
        # Steps are a fraction of the finest ripple.
        aperture = float(np.ptp(places))
        if aperture < _LEAST:
            return cls(False, 2.0, -math.inf, 180.0)
        count = min(_MOST_POINTS, math.ceil(2 * _PER_WAVELENGTH * max(1.0, aperture)))
        sines = np.linspace(0.0, 2.0, count + 1)
        power = pattern(places, sines)
        # The half-power width, by a line between the two points about it.
        half = np.flatnonzero(power < 0.5)
        width = 180.0
        if len(half):
            end = half[0]
            inside = (power[end - 1] - 0.5) / (power[end - 1] - power[end])
            edge = sines[end - 1] + inside * (sines[end] - sines[end - 1])
            width = 2 * math.degrees(math.asin(min(1.0, edge)))
        # The main lobe ends where the power has its first minimum.
        rising = np.flatnonzero(np.diff(power) > 0)
        if not len(rising):
            return cls(True, 2.0, -math.inf, width)
        beyond = power[rising[0] :]
        peaks = np.flatnonzero((beyond[1:-1] >= beyond[:-2]) & (beyond[1:-1] > beyond[2:])) + 1
        # Lobes from -3 dB on count as grating lobes; the first of them limits the angle.
        high = peaks[beyond[peaks] > 10 ** (GRATING_DB / 10)]
        if not len(high):
            return cls(True, 2.0, -math.inf, width)
        first = rising[0] + high[0]
        # Between the steps the lobe is where a parabola through three points has its vertex.
        left, middle, right = power[first - 1 : first + 2]
        shift = 0.5 * (left - right) / (left - 2 * middle + right)
        sine = sines[first] + shift * sines[1]
        level = float(pattern(places, np.array([sine]))[0])
        return cls(True, float(sine), 10 * math.log10(level), width)


def pattern(places: NDArray[np.float64], sines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Power (sine,) of a beam of all elements (element,) [wavelengths], 1 at sine 0."""
    # Virtual elements often coincide: each place is summed once.
    distinct, count = np.unique(np.round(places, 9), return_counts=True)
    field = np.zeros(len(sines), dtype=np.complex128)
    for place, number in zip(distinct - distinct[0], count, strict=True):
        field += number * np.exp(2j * np.pi * place * sines)
    return np.abs(field / len(places)) ** 2
