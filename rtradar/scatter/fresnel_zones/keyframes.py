"""Shares of the return left to the parts of a moving body, antenna by antenna: at anchors, and smoothly between them.

Over the array V is a polynomial through at most six nodes along a line of Tx and three along a line of Rx: half a metre
of array sees an edge half a metre before a part move by several Fresnel zones (``validation/other_methods/fresnel.py``: 1.0 % rms at
12 GHz; two along the line of Rx give 1.9 %, four along that of Tx 7 %). In time it is a cubic through anchors 10 ms
apart, and 1.25 ms (12 GHz) or 0.5 ms (77 GHz) apart for each part and interval in which it bends; slopes are those of
the parabola through neighbours, so that what comes out has no corners, whatever the spacing on either side. Rays are
traced at the anchors 10 ms apart; in between the outlines of the parts that they met at either end are followed in
closed form.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.blends import hermite_weights
from rtradar.kernels.jit import compiled
from rtradar.radar import Radar
from rtradar.scatter.common.array_interpolation import array_nodes
from rtradar.scatter.common.keyframe_cache import FirstCome
from rtradar.scatter.common.poses import anchor_step
from rtradar.scatter.fresnel_zones.interval import FresnelInterval
from rtradar.scatter.fresnel_zones.occluders import RX_NODES, TX_NODES, middle_zones
from rtradar.scatter.fresnel_zones.visible_fraction import zone_shares

_KEPT_ANCHORS = 1024
"""Anchors remembered, 10 s of them in some 40 MB, so that the pass that measures power and the pass that makes the signal trace
once; longer recordings trace again from there on."""

_PASSING = 32
"""Anchors, and intervals between them, that are held at a time: a block of chirps and what lies around it."""

_FINE, _FINE_FREQUENCY_HZ = 8, 14e9
"""Anchors to 10 ms where the share bends, at that frequency; Fresnel zones are as narrow as the root of the wavelength."""

_BEND = 0.02
"""Second difference over 10 ms that asks for finer anchors: a cubic misses an eighth of it or less."""


class ZoneShares:
    """Shares of the returns of a moving body over a capture.

    Parameters
    ----------
    radar : Radar
    body : Body
    frequency : (frequency,) float64
        Where shares are wanted [Hz].
    occluders : callable
        ``occluders(time)``: which parts may stand before others (part, part) bool, hidden first, at an anchor [s] and 10 ms
        after, such as `TracedHiders`; parts with none are in full view.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        frequency: NDArray[np.float64],
        occluders: Callable[[float], NDArray[np.bool_]],
    ) -> None:
        self._radar, self._body, self._occluders = radar, body, occluders
        self._wavenumber = 2 * np.pi * frequency / SPEED_OF_LIGHT_MPS
        self._nodes = array_nodes(radar, TX_NODES, RX_NODES)
        self._step = anchor_step(radar)
        self._fine = min(
            round(_FINE * max(1.0, radar.centre_frequency_hz / _FINE_FREQUENCY_HZ) ** 0.5),
            self._step,
        )
        self._anchors: FirstCome[int, tuple[NDArray[np.bool_], NDArray[np.complex128]]] = FirstCome(
            _KEPT_ANCHORS, _PASSING
        )
        self._intervals: OrderedDict[int, FresnelInterval] = OrderedDict()

    def at(
        self, chirps: NDArray[np.int64], parts: NDArray[np.int64] | None = None
    ) -> NDArray[np.complex128]:
        """Shares V at these chirps, numbered from the start of the capture.

        Parameters
        ----------
        chirps : (chirp,) int64
        parts : (part,) int64, optional
            Which are wanted; all if left out.

        Returns
        -------
        (frequency, chirp, rx, part) complex128
        """
        chirps = np.asarray(chirps, dtype=np.int64)
        if parts is None:
            parts = np.arange(len(self._body.part_names))
        out = np.empty(
            (len(self._wavenumber), len(chirps), self._radar.n_rx, len(parts)), dtype=np.complex128
        )
        spread = self._nodes.weights[self._radar.tx_of_chirp(chirps)]
        number = chirps // self._step
        for interval in np.unique(number):
            inside = np.flatnonzero(number == interval)
            where = (chirps[inside] / self._step - interval) * self._fine
            if where.any():
                fine, nodes, slopes = self._cubics(int(interval), parts)
            else:
                # At an anchor alone neighbours do not matter.
                nodes = np.stack([self._anchor(int(interval))[1][..., parts]] * 2)
                fine, slopes = np.zeros(nodes.shape[-1], dtype=bool), np.zeros_like(nodes)
            _blend(nodes, slopes, fine, where, spread[inside], inside, out)
        return out

    def _shares(
        self,
        times: NDArray[np.float64],
        pose: NDArray[np.int64],
        part: NDArray[np.int64],
        occluders: NDArray[np.bool_],
    ) -> NDArray[np.complex128]:
        """Shares (share, frequency, pair), each of a part at one of the times (time,) [s], behind ``occluders (part, part)``."""
        centres, frames, semi_axes = self._body.at(times)
        used, place = np.unique(part, return_inverse=True)
        tx, rx, points, k = middle_zones(
            self._radar, centres[:, used], frames[:, used], semi_axes[used]
        )
        return zone_shares(
            tx[place],
            rx[place],
            points[place, pose],
            part,
            pose,
            (centres, frames, semi_axes),
            np.broadcast_to(self._nodes.antennas, (len(part), *self._nodes.antennas.shape)),
            self._nodes.pairs,
            occluders[part],
            np.broadcast_to(self._wavenumber, (len(part), len(self._wavenumber))),
            k[place],
        )

    def _time(self, chirp: float) -> float:
        # Past the end of the recording the body rests in its last pose; before the capture nothing moved.
        return min((max(chirp, 0.0) + 0.5) * self._radar.chirp_interval_s, self._body.duration_s)

    def _anchor(self, number: int) -> tuple[NDArray[np.bool_], NDArray[np.complex128]]:
        """Who hides whom at an anchor (part, part), and shares (frequency, pair, part)."""
        number = max(number, 0)

        def find() -> tuple[NDArray[np.bool_], NDArray[np.complex128]]:
            time = self._time(number * self._step)
            occluders = self._occluders(time)
            shares = np.ones(
                (len(self._wavenumber), len(self._nodes.pairs), len(occluders)), dtype=np.complex128
            )
            hidden = np.flatnonzero(occluders.any(axis=1))
            if len(hidden):
                pose = np.zeros(len(hidden), dtype=np.int64)
                shares[..., hidden] = np.moveaxis(
                    self._shares(np.array([time]), pose, hidden, occluders), 0, -1
                )
            return occluders, shares

        return self._anchors.get(number, find)

    def _interval(self, number: int, nodes: slice, parts: NDArray[np.int64]) -> FresnelInterval:
        """An interval of which these nodes in between are known, of these parts."""
        interval = self._intervals.get(number)
        if interval is None:
            anchors = [self._anchor(number + i) for i in (-1, 0, 1, 2)]
            around = np.stack([shares for _, shares in anchors])
            bend = np.abs(np.diff(around, 2, axis=0)).max(axis=(0, 1, 2))
            fine = (
                (bend > _BEND)
                if self._fine > 1 and number >= 0
                else np.zeros(bend.shape, dtype=bool)
            )
            interval = FresnelInterval(
                fine, around[1:3].copy(), anchors[1][0] | anchors[2][0], self._fine - 1
            )
            self._intervals[number] = interval
            if len(self._intervals) > _PASSING:
                self._intervals.popitem(last=False)
        self._intervals.move_to_end(number)
        node, part = interval.missing(nodes, parts)
        if len(node):
            used, pose = np.unique(node, return_inverse=True)
            times = np.array(
                [self._time((number + (i + 1) / self._fine) * self._step) for i in used]
            )
            interval.keep(node, part, self._shares(times, pose, part, interval.occluders))
        return interval

    def _cubics(
        self, number: int, parts: NDArray[np.int64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.complex128], NDArray[np.complex128]]:
        """Of an interval: which parts are fine, nodes and slopes (node, frequency, pair, part), a fine spacing the unit."""
        # Of its neighbours no more than the node beside it.
        before, here, after = (
            self._interval(number + i, inner, parts)
            for i, inner in ((-1, slice(self._fine - 2, None)), (0, slice(None)), (1, slice(0, 1)))
        )
        nodes = here.nodes(parts)
        slopes = np.empty_like(nodes)
        slopes[1:-1] = (nodes[2:] - nodes[:-2]) / 2
        for end, left, right in ((0, before, here), (-1, here, after)):
            wide_left, wide_right = (
                np.where(one.fine[parts], 1, self._fine) for one in (left, right)
            )
            rise_left = (nodes[end] - left.beside(-1, parts)) / wide_left
            rise_right = (right.beside(0, parts) - nodes[end]) / wide_right
            slopes[end] = (rise_left * wide_right + rise_right * wide_left) / (
                wide_left + wide_right
            )
        return here.fine[parts], nodes, slopes


@compiled()
def _blend(nodes, slopes, fine, where, spread, inside, out):
    """Cubics in time, then the polynomials over the array."""
    frequencies, pairs, parts = nodes.shape[1:]
    last = nodes.shape[0] - 1
    value = np.empty(pairs, dtype=np.complex128)
    for f in range(frequencies):
        for part in range(parts):
            still = True
            for node in range(last + 1):
                if node == 0 or node == last or fine[part]:
                    for pair in range(pairs):
                        if (
                            nodes[node, f, pair, part] != nodes[0, f, 0, part]
                            or slopes[node, f, pair, part] != 0
                        ):
                            still = False
            for i in range(len(inside)):
                if still:
                    # Exactly: the polynomials add up to 1 only nearly.
                    out[f, inside[i], :, part] = nodes[0, f, 0, part]
                    continue
                width = 1 if fine[part] else last
                first = min(int(where[i]), last - 1) if fine[part] else 0
                h0, h1, g0, g1 = hermite_weights((where[i] - first) / width, width)
                for pair in range(pairs):
                    value[pair] = (
                        h0 * nodes[first, f, pair, part]
                        + h1 * nodes[first + width, f, pair, part]
                        + g0 * slopes[first, f, pair, part]
                        + g1 * slopes[first + width, f, pair, part]
                    )
                for receiver in range(out.shape[2]):
                    total = 0j
                    for pair in range(pairs):
                        if spread[i, receiver, pair] != 0:
                            total += spread[i, receiver, pair] * value[pair]
                    out[f, inside[i], receiver, part] = total
