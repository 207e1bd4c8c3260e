"""The echo model `physical-optics`: a carrier at every chirp, times a slow envelope."""

from __future__ import annotations

import math
from itertools import groupby
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, Ellipsoids
from rtradar.body.body import Poses
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.kernels.scatter.envelope import fill_envelope
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayNodes, array_nodes, spread_nodes
from rtradar.scatter.common.keyframes import keyframe_before
from rtradar.scatter.common.poses import (
    chirp_poses,
    has_mesh,
    one_echo_a_part,
    owners_of,
)
from rtradar.scatter.double_reflections import (
    TwoBounceModel,
    check_bounces,
    double_scattering,
)
from rtradar.scatter.facets.body import FacetBody
from rtradar.scatter.facets.envelope import TOGETHER, Envelope, Sample, Scale, whole_echo
from rtradar.scatter.facets.skin import SkinFacets
from rtradar.scatter.facets.target import facet_scattering
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer

if TYPE_CHECKING:
    import trimesh

_COARSE, _FINE = (2, 1), (6, 2)
"""Tx times Rx nodes per line of the array: for parts alike all over it, and for the others."""

_MOST_FREQUENCIES = 9

_NO_DOUBLES = (
    "physical-optics: bounces = 2; reflections from part to part are those of ellipsoids: leave "
    "bounces out, or {}"
)


def optics_scattering(
    target: Ellipsoids | trimesh.Trimesh,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    frequency: NDArray[np.float64],
    polarization: Literal["v", "h"] = "v",
    variant: str = "auto",
    facets: int | None = None,
    bounces: int = 1,
) -> NDArray[np.complex128]:
    """Scattering length (n,) by physical optics, see `facet_scattering` and `PhysicalOptics`."""
    check_bounces("physical-optics", bounces)
    if bounces == 2 and not isinstance(target, Ellipsoids):
        raise InputError(_NO_DOUBLES.format("give rt.Ellipsoids"))
    pairs = tx, rx, frequency
    field = facet_scattering(target, *pairs, polarization, variant, facets)
    if bounces == 2 and isinstance(target, Ellipsoids):
        tracer = BodyTracer(use(select(variant)), target.semi_axes)
        field += double_scattering(target, *pairs, polarization, tracer)
    return field


class PhysicalOptics(TwoBounceModel):
    """`physical-optics`: facets fixed to the body, interpolated between keyframes.

    The path over the specular point is exact at every chirp. At the keyframes facets are summed for
    a few frequencies and places of the array.

    Occlusion: facet by facet. Each Tx and Rx is asked at the keyframes which corners it sees.

    Parameters
    ----------
    facets : int, optional
        Least number per ellipsoid, 20 to 1 310 720; None: by the wavelength, 5120 at 12 GHz and
        20 480 at 77 GHz for a grown person. A mesh is always divided by the wavelength.
    anchor_s : float
        Time between keyframes [s], above 0; where the echo bends it comes down to an eighth of it.
    tolerance : float
        Bend of a part's echo, over the root of the power of the whole person, above which keyframes
        come closer; above 0.
    unevenness : float
        Change of a part's echo over the array, over the same, above which it is computed at more
        places of the array; above 0.
    frequencies : int
        Number of frequencies over the sweep, 1 to 9. Where a part is half occluded at 12 GHz, three
        leave an error of 3.1 % of the field and five 1.9 %
        (``tests/scatter/models/test_physical_optics.py``), but the IF takes longer.
    bounces : int
        1, or 2 for reflections from part to part as well, by geometric optics
        (`rtradar.scatter.double_reflections`); meshes have none of these.

    Raises
    ------
    InputError
        Where an option is out of range.

    Notes
    -----
    The carrier of a part goes by the specular point of its ellipsoid, of a mesh too.
    Equation :eq:`envelope` of the theory page; :eq:`po` in each keyframe.
    """

    accepts_meshes = True
    scattering = staticmethod(optics_scattering)
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
        bounces: int = 1,
    ) -> None:
        check_bounces("physical-optics", bounces)
        if frequencies not in range(1, _MOST_FREQUENCIES + 1):
            raise InputError(
                f"physical-optics: frequencies = {frequencies}; it must be a whole number from "
                f"1 to {_MOST_FREQUENCIES}"
            )
        positive = {"anchor_s": anchor_s, "tolerance": tolerance, "unevenness": unevenness}
        for name, value in positive.items():
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"physical-optics: {name} = {value}; it must be positive")
        self._radar, self._body = radar, body
        common: dict[str, Any] = {"variant": variant, "spreading": spreading, "nodes": frequencies}
        self._surface: FacetBody | SkinFacets
        if not has_mesh(body):
            self._surface = FacetBody(radar, body, facets=facets, **common)
        elif facets is None:
            # An edge that crosses a limb fades over half an interval, not a whole one.
            self._surface = SkinFacets(radar, body, look_s=anchor_s / 2, **common)
        else:
            raise InputError(
                f"physical-optics: facets = {facets}; a mesh is divided by the wavelength: leave "
                "facets out, or take body = 'ellipsoids'"
            )
        self.variant: str | None = self._surface.variant
        if bounces == 2:
            if has_mesh(body):
                raise InputError(_NO_DOUBLES.format("take body = 'ellipsoids'"))
            tracer = BodyTracer(use(select(variant)), body.semi_axes)
            self._reflect_twice(radar, body, tracer, spreading=spreading)
        self._coarse, self._fine = array_nodes(radar, *_COARSE), array_nodes(radar, *_FINE)
        # From coarse nodes to fine ones, which stand at antennas or between them.
        self._spread = spread_nodes(radar, _COARSE, _FINE)
        self._unevenness = unevenness
        self._step = max(1, round(anchor_s / radar.chirp_interval_s))
        end = math.ceil(body.duration_s / (self._step * radar.chirp_interval_s))
        self._envelope = Envelope(self._sample, owners_of(body), tolerance, end)

    def _sample(self, place: float, parts: NDArray[np.int64], whole: Scale | None) -> Sample:
        """Envelope at the fine nodes, from the coarse ones unless it differs over the array."""
        time = min((place * self._step + 0.5) * self._radar.chirp_interval_s, self._body.duration_s)
        pose = self._body.at([time])
        coarse = self._at_nodes(time, pose, self._coarse, parts)
        ratio, strength = self._spread @ coarse.ratio, self._spread @ coarse.strength
        echo = coarse.ratio * coarse.strength
        scale = whole_echo(coarse, owners_of(self._body)) if whole is None else whole[parts]
        uneven = (
            np.abs(echo - echo.mean(axis=1, keepdims=True)).max(axis=(0, 1))
            > self._unevenness * scale
        )
        if uneven.any():
            fine = self._at_nodes(time, pose, self._fine, parts[uneven])
            ratio[:, :, uneven], strength[:, uneven] = fine.ratio, fine.strength
        return Sample(ratio, strength)

    def _at_nodes(
        self, time: float, pose: Poses, nodes: ArrayNodes, parts: NDArray[np.int64]
    ) -> Sample:
        antennas, pairs = nodes.antennas, nodes.pairs
        centres, frames = (
            np.repeat(array[:, parts], len(pairs), axis=0) for array in (pose.centres, pose.frames)
        )
        ends = antennas[pairs[:, 0]], antennas[pairs[:, 1], None]
        length, strength = self._surface.carriers(
            Geometry(*ends, centres, frames, pose.semi_axes[parts])
        )
        amplitude = self._surface.field(time, pose, nodes, length[:, 0], parts)
        specular = strength[:, 0]
        # Without a specular point there is next to nothing to see either: antennas on opposite
        # sides.
        ratio = np.where(specular != 0, amplitude / np.where(specular != 0, specular, 1.0), 0.0)
        return Sample(ratio, np.abs(specular))

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        chirps = np.asarray(chirps, dtype=np.int64)
        at = chirp_poses(self._radar, self._body, chirps)
        length, strength = self._surface.carriers(at)
        amplitude = np.empty((len(self._surface.frequency), *length.shape), dtype=np.complex128)
        intervals, rest = keyframe_before(self._radar, chirps, self._step)
        envelope, weights = self._envelope, self._fine.weights
        # Power is measured at keyframes, where nothing is asked of what comes after.
        between = set(intervals[rest != 0].tolist())
        in_order = sorted(set(intervals.tolist()))
        for _, group in groupby(in_order, key=lambda interval: interval // TOGETHER):
            together = list(group)
            envelope.prepare_keyframes(k for k in together if k not in between)
            envelope.prepare_courses(between.intersection(together))
            for interval in together:
                inside = np.flatnonzero(intervals == interval)
                if interval in between:
                    fraction = self._radar.slots_of(chirps[inside]) / self._step - interval
                    course = tuple(envelope.course(interval))
                    given = inside, fraction, at.tx_index, weights, course
                    fill_envelope(*given, strength, amplitude)
                else:
                    ratio = envelope.keyframe(interval).ratio[:, None]
                    over_array = weights[at.tx_index[inside]] @ ratio
                    amplitude[:, inside] = over_array * strength[inside]
        single = one_echo_a_part(at.tx_index, length, amplitude, self._surface.frequency)
        return self._with_doubles(single, chirps)
