"""The echo model `physical-optics`: the exact carrier of the specular point at every chirp, times a slowly changing envelope."""

from __future__ import annotations

import math
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.kernels.blends import hermite_weights
from rtradar.kernels.jit import compiled
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayNodes, array_nodes, spread_nodes
from rtradar.scatter.common.poses import BuiltInModel, chirp_poses
from rtradar.scatter.facets.envelope import (
    PIECES,
    TOGETHER,
    Envelope,
    Sample,
    stretch,
    whole_echo,
)
from rtradar.scatter.facets.moving_body import FacetBody
from rtradar.scatter.specular_point.solver import solve_specular_points

_COARSE, _FINE = (2, 1), (6, 2)
"""Tx times Rx nodes per line of the array: of parts whose echo is alike all over it, and of the others."""

_MOST_FREQUENCIES = 9


@compiled()
def _fill(chirps, share, tx, weights, ratio, slope, known, strength, amplitude):
    """Amplitude (node, chirp, rx, part) at these chirps, which stand at these shares of the way from anchor to anchor."""
    nodes, pairs, parts = ratio.shape[1:]
    receivers = weights.shape[1]
    for i in range(len(chirps)):
        chirp, place = chirps[i], share[i] * PIECES
        ends, cubic = np.empty((2, parts), dtype=np.int64), np.empty((4, parts))
        for part in range(parts):
            left, right = stretch(known[:, part], place)
            ends[0, part], ends[1, part] = left, right
            cubic[0, part], cubic[1, part], cubic[2, part], cubic[3, part] = hermite_weights(
                (place - left) / (right - left), right - left
            )
        own = weights[tx[chirp]]
        value = np.empty(parts, dtype=np.complex128)
        amplitude[:, chirp] = 0
        for pair in range(pairs):
            # Where nodes stand at antennas a transmitter needs but a few of the pairs.
            used = False
            for receiver in range(receivers):
                used |= own[receiver, pair] != 0
            if not used:
                continue
            for node in range(nodes):
                for part in range(parts):
                    left, right = ends[0, part], ends[1, part]
                    value[part] = (
                        cubic[0, part] * ratio[left, node, pair, part]
                        + cubic[1, part] * ratio[right, node, pair, part]
                        + cubic[2, part] * slope[left, node, pair, part]
                        + cubic[3, part] * slope[right, node, pair, part]
                    )
                for receiver in range(receivers):
                    weight, out = own[receiver, pair], amplitude[node, chirp, receiver]
                    for part in range(parts):
                        out[part] += weight * value[part] * strength[chirp, receiver, part]


class PhysicalOptics(BuiltInModel):
    """`physical-optics`: specular point at every chirp, facets at anchors, three frequencies and a few places of the array.

    Parameters
    ----------
    radar : Radar
    body : Body
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend.
    spreading : bool
        Whether amplitudes hold 1 / (R1 R2).
    facets : int, optional
        Least number per part; None: by the wavelength, 5120 at 12 GHz and 20 480 at 77 GHz for a grown person.
    anchor_s : float
        Between anchors [s]; where the echo bends they come down to an eighth of it.
    tolerance : float
        Bend of a part's echo, over the root of the whole body's power, above which anchors come closer.
    unevenness : float
        Change of a part's echo over the array, over the same, above which it is computed at more places of the array.
    frequencies : int
        Over the sweep. Three leave 3 % where a part is half hidden at 12 GHz, five 1.5 %, and a longer synthesis of the IF.

    Raises
    ------
    InputError
        Where an option is out of range.

    Notes
    -----
    Equation :eq:`envelope` of the theory page; :eq:`po` in each anchor.
    """

    accepts_meshes = True
    relative_cost = 12.0

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        facets: int | None = None,
        anchor_s: float = 10e-3,
        tolerance: float = 0.05,
        unevenness: float = 0.02,
        frequencies: int = 3,
    ) -> None:
        if frequencies not in range(1, _MOST_FREQUENCIES + 1):
            raise InputError(
                f"physical-optics: frequencies = {frequencies}; it must be a whole number from 1 to {_MOST_FREQUENCIES}"
            )
        for name, value in (
            ("anchor_s", anchor_s),
            ("tolerance", tolerance),
            ("unevenness", unevenness),
        ):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"physical-optics: {name} = {value}; it must be positive")
        self._radar, self._body, self._spreading = radar, body, spreading
        self._surface = FacetBody(
            radar, body, variant=variant, spreading=spreading, facets=facets, nodes=frequencies
        )
        self.variant: str | None = self._surface.variant
        self._coarse, self._fine = array_nodes(radar, *_COARSE), array_nodes(radar, *_FINE)
        # From coarse nodes to fine ones, which stand at antennas or between them.
        self._spread = spread_nodes(radar, _COARSE, _FINE)
        self._unevenness = unevenness
        self._step = max(1, round(anchor_s / radar.chirp_interval_s))
        end = math.ceil(body.duration_s / (self._step * radar.chirp_interval_s))
        self._envelope = Envelope(self._sample, len(body.part_names), tolerance, end)

    def _sample(self, place: float, parts: NDArray[np.int64], whole: float | None) -> Sample:
        """Envelope at the fine nodes: computed there where it differs over the array, else spread from the coarse ones."""
        time = min((place * self._step + 0.5) * self._radar.chirp_interval_s, self._body.duration_s)
        pose = self._body.at([time])
        coarse = self._at_nodes(pose, self._coarse, parts)
        ratio, strength = self._spread @ coarse.ratio, self._spread @ coarse.strength
        echo = coarse.ratio * coarse.strength
        scale = whole_echo(coarse) if whole is None else whole
        uneven = (
            np.abs(echo - echo.mean(axis=1, keepdims=True)).max(axis=(0, 1))
            > self._unevenness * scale
        )
        if uneven.any():
            fine = self._at_nodes(pose, self._fine, parts[uneven])
            ratio[:, :, uneven], strength[:, uneven] = fine.ratio, fine.strength
        return Sample(ratio, strength)

    def _at_nodes(self, pose: Poses, nodes: ArrayNodes, parts: NDArray[np.int64]) -> Sample:
        antennas, pairs = nodes.antennas, nodes.pairs
        centres, frames = (
            np.repeat(array[:, parts], len(pairs), axis=0) for array in (pose.centres, pose.frames)
        )
        length, strength, _ = solve_specular_points(
            Geometry(
                antennas[pairs[:, 0]],
                antennas[pairs[:, 1], None],
                centres,
                frames,
                pose.semi_axes[parts],
            ),
            polarization=self._radar.polarization,
            spreading=self._spreading,
        )
        amplitude = self._surface.amplitude(
            pose.centres,
            pose.frames,
            antennas[None],
            pairs,
            length[None, :, 0],
            self._surface.seen(pose.centres[0], pose.frames[0], antennas, parts),
            np.arange(len(antennas))[None],
            parts,
        )[:, 0]
        mirrored = strength[:, 0]
        # Without a specular point there is next to nothing to see either: antennas on opposite sides.
        ratio = np.where(mirrored != 0, amplitude / np.where(mirrored != 0, mirrored, 1.0), 0.0)
        return Sample(ratio, np.abs(mirrored))

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        chirps = np.asarray(chirps, dtype=np.int64)
        at = chirp_poses(self._radar, self._body, chirps)
        length, strength, _ = solve_specular_points(
            at, polarization=self._radar.polarization, spreading=self._spreading
        )
        parts = length.shape[2]
        amplitude = np.empty((len(self._surface.frequency), *length.shape), dtype=np.complex128)
        intervals = chirps // self._step
        # Power is measured at anchors, where nothing is asked of what comes after.
        between = set(intervals[chirps % self._step != 0].tolist())
        for _, group in groupby(
            sorted(set(intervals.tolist())), key=lambda interval: interval // TOGETHER
        ):
            together = list(group)
            self._envelope.prepare_anchors(
                interval for interval in together if interval not in between
            )
            self._envelope.prepare_courses(between.intersection(together))
            for interval in together:
                inside = np.flatnonzero(intervals == interval)
                if interval in between:
                    share, course = (
                        chirps[inside] / self._step - interval,
                        self._envelope.course(interval),
                    )
                    _fill(
                        inside, share, at.tx_index, self._fine.weights, *course, strength, amplitude
                    )
                    continue
                over_array = (
                    self._fine.weights[at.tx_index[inside]]
                    @ self._envelope.anchor(interval).ratio[:, None]
                )
                amplitude[:, inside] = over_array * strength[inside]
        return Echoes(
            length=length,
            amplitude=amplitude,
            frequency=self._surface.frequency,
            tx=at.tx_index,
            part=np.arange(parts),
            bounces=np.ones(parts, dtype=np.int64),
        )
