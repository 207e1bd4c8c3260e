"""The echo model `auto`: each part at each time by the cheapest candidate within a tolerance."""

from __future__ import annotations

import math
from collections import Counter
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.kernels.elementary import smoothstep
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.echo_sets import at_nodes
from rtradar.scatter.common.keyframes import KeyframeCache, keyframe_before
from rtradar.scatter.common.poses import BuiltInModel, ChirpPoses, EchoModel, chirp_poses, owners_of
from rtradar.scatter.fresnel_zones.keyframes import BEND, ZoneFractions
from rtradar.scatter.fresnel_zones.visible_fraction import SHADOW_RAYS
from rtradar.scatter.models.analytic import far_field_echo
from rtradar.scatter.models.auto_selection import (
    ANALYTIC,
    CANDIDATES,
    FRESNEL,
    LEFT_OUT,
    PHYSICAL_OPTICS,
    SPECULAR,
    ErrorBudget,
    error_budget,
    select_candidates,
)
from rtradar.scatter.models.fresnel import zone_nodes
from rtradar.scatter.models.physical_optics import PhysicalOptics
from rtradar.scatter.models.reference import Reference
from rtradar.scatter.specular_point.solver import StartPoints, solve_specular_points
from rtradar.scatter.specular_point.visibility import SpecularVisibility
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer

_INSTANTS_S = 25e-3
"""Time between the instants at which candidates are selected; a limb at 5 m/s goes 12 cm."""

_INSTANTS_AT_ONCE = 32

_POWER_RAYS = 64
"""Shadow rays to a part where only power matters: at edges they leave an error of 0.035 in the
visible fraction (``validation/other_methods/fresnel.py``)."""

_POWER_BEND = 0.1
"""Bend that asks for finer keyframes where only power matters: cubics miss at most an eighth of it,
0.0125 of a part's return."""

_MARGIN = 0.7
"""Fraction of a complex tolerance that the error budget may use: it knows neither the far ends of
the array, nor the time between instants."""

_LEAST_COMPLEX = 1e-3


_KEPT_CHUNKS, _PASSING = 25, 4
"""Chunks of instants kept: the first 20 s of a recording, read twice, and what a block needs."""


class Planned(NamedTuple):
    """Some instants: ``chosen (time, part)``, and ``in_view (time, part)`` of a `ErrorBudget`."""

    chosen: NDArray[np.int64]
    in_view: NDArray[np.bool_]


class _Group(NamedTuple):
    """Echoes of some parts, all by one candidate, as in `Echoes`; amplitudes may be real."""

    length: NDArray[np.float64]
    amplitude: NDArray[np.inexact]
    frequency: NDArray[np.float64]
    part: NDArray[np.int64]
    bounces: NDArray[np.int64]


class Auto(BuiltInModel):
    """`auto`: for each part, every 25 ms, the cheapest that keeps a tolerance.

    Occlusion: as chosen. What is chosen for a part asks as it does alone.

    Parameters
    ----------
    tolerance_db : float
        Largest error of the power of a frame, of each person [dB], above 0.
    tolerance_complex : float, optional
        Largest rms error of the received field over its rms, of each person, 0.001 and more; None:
        only the power matters.

    Raises
    ------
    InputError
        Where a tolerance is out of range.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        tolerance_db: float = 0.5,
        tolerance_complex: float | None = None,
    ) -> None:
        if not (math.isfinite(tolerance_db) and tolerance_db > 0):
            raise InputError(
                f"auto: tolerance_db = {tolerance_db}; it must be positive (--tolerance-db)"
            )
        if tolerance_complex is not None and not (
            math.isfinite(tolerance_complex) and tolerance_complex >= _LEAST_COMPLEX
        ):
            raise InputError(
                f"auto: tolerance_complex = {tolerance_complex}; it must be at least "
                f"{_LEAST_COMPLEX}, a fraction of the rms field (--tolerance-complex)"
            )
        self._radar, self._body, self._variant, self._spreading = radar, body, variant, spreading
        # A decibel down is a smaller fraction than one up.
        self._power_fraction = 1 - 10 ** (-tolerance_db / 10)
        self._complex_fraction = None if tolerance_complex is None else _MARGIN * tolerance_complex
        self._shadow_rays = _POWER_RAYS if tolerance_complex is None else SHADOW_RAYS
        self._starts = StartPoints(radar, body)
        self._step = max(1, round(_INSTANTS_S / radar.chirp_interval_s))
        self._planned: KeyframeCache[int, Planned] = KeyframeCache(_KEPT_CHUNKS, _PASSING)
        # For `account`: parts and instants (candidate, part) and by reason, and as bits of a number
        # the chunks that are in it.
        self._counts = np.zeros((len(CANDIDATES), len(body.part_names)), dtype=np.int64)
        self._why: Counter[str] = Counter()
        self._counted = 0
        self.variant: str | None = None

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps: one for each part and each candidate that it goes by."""
        chirps = np.asarray(chirps, dtype=np.int64)
        at = chirp_poses(self._radar, self._body, chirps)
        weights, cut = self._weights(chirps)
        found = []
        for candidate in range(ANALYTIC, len(CANDIDATES)):
            parts = np.flatnonzero((weights[candidate] > 0).any(axis=0))
            if len(parts):
                found.append(
                    (self._by(candidate, at, chirps, parts, cut), weights[candidate][:, parts])
                )
        if not found:
            # Nobody is seen: one part represents all, with nothing to return.
            found.append(
                (self._by(ANALYTIC, at, chirps, np.array([0]), cut), np.zeros((len(chirps), 1)))
            )
        frequency = max((group.frequency for group, _ in found), key=len)
        part = np.concatenate([group.part for group, _ in found])
        # Filled in place: to make each group complex and join them afterwards would cost more than
        # the closed forms.
        length = np.empty((*found[0][0].length.shape[:2], len(part)))
        amplitude = np.empty((len(frequency), *length.shape), dtype=np.complex128)
        begin = 0
        for group, weight in found:
            own = slice(begin, begin + len(group.part))
            length[..., own] = group.length
            values = at_nodes(group.amplitude, group.frequency, frequency)
            np.multiply(values, weight[:, None], out=amplitude[..., own])
            begin = own.stop
        return Echoes(
            length=length,
            amplitude=amplitude,
            frequency=frequency,
            tx=at.tx_index,
            part=part,
            bounces=np.concatenate([group.bounces for group, _ in found]),
        )

    def account(self) -> dict[str, Any]:
        """What was modelled how, and why, as fractions of part and time so far, for JSON."""
        names = self._body.part_names
        whole = self._counts.sum()
        return {
            "ways": {
                name: float(count / whole)
                for name, count in zip(CANDIDATES, self._counts.sum(axis=1), strict=True)
            },
            "why": {reason: float(count / whole) for reason, count in self._why.items()},
            "parts": {
                part: {
                    name: float(fraction)
                    for name, fraction in zip(CANDIDATES, counts / counts.sum(), strict=True)
                }
                for part, counts in zip(names, self._counts.T, strict=True)
            },
        }

    def _count(self, chosen: NDArray[np.int64], budget: ErrorBudget) -> None:
        """Add some instants, chosen (time, part), to what `account` returns."""
        # Of what the next cheaper candidate leaves wrong, is most due to curvature?
        cheaper = np.maximum(chosen[:, None] - 1, ANALYTIC)
        wrong, optics = (
            np.take_along_axis(errors, cheaper, axis=1)[:, 0]
            for errors in (budget.wrong, budget.optics)
        )
        curved = optics > wrong
        higher = chosen > ANALYTIC
        for reason, where in {
            "left out: hidden": chosen == LEFT_OUT,
            "analytic: enough": chosen == ANALYTIC,
            "higher: hidden": higher & budget.hidden,
            "higher: cut by an edge": higher & ~budget.hidden & ~budget.in_view,
            "higher: in full view, curvature": higher & budget.in_view & curved,
            "higher: in full view, near field": higher & budget.in_view & ~curved,
        }.items():
            self._why[reason] += int(where.sum())
        self._counts += (chosen == np.arange(len(CANDIDATES))[:, None, None]).sum(axis=1)

    def _weights(self, chirps: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Weights (candidate, chirp, part) of sum at most 1, and parts that others cut (part,)."""
        parts = np.arange(len(self._body.part_names))
        interval, rest = keyframe_before(self._radar, chirps, self._step)
        fraction = smoothstep(rest / self._step)[:, None]
        weights = np.zeros((len(CANDIDATES), len(chirps), len(parts)))
        cut = np.zeros(len(parts), dtype=bool)
        for end, weight in ((interval, 1 - fraction), (interval + 1, fraction)):
            for instant in np.unique(end):
                planned, row = self._plan(int(instant))
                here = np.flatnonzero(end == instant)
                weights[planned.chosen[row], here[:, None], parts] += weight[here]
                cut |= ~planned.in_view[row]
        weights[LEFT_OUT] = 0
        return weights, cut

    def _at_edges(self, time: float) -> NDArray[np.bool_]:
        """Parts (part,) that go by `fresnel` within an instant or two of a time [s]."""
        before = int(time / self._radar.chirp_interval_s) // self._step
        instants = [self._plan(max(0, before + i)) for i in (-1, 0, 1, 2)]
        return np.any([planned.chosen[row] == FRESNEL for planned, row in instants], axis=0)

    def _plan(self, instant: int) -> tuple[Planned, int]:
        """The chunk of instants that holds this one, and its row."""
        chunk, row = divmod(instant, _INSTANTS_AT_ONCE)
        return self._planned.get(chunk, partial(self._look_ahead, chunk)), row

    def _look_ahead(self, chunk: int) -> Planned:
        # One more on either side, for what a part needs there it is given here, too.
        instants = np.arange(-1, _INSTANTS_AT_ONCE + 1) + chunk * _INSTANTS_AT_ONCE
        times = (np.maximum(instants, 0) * self._step + 0.5) * self._radar.chirp_interval_s
        poses = self._body.at(np.minimum(times, self._body.duration_s))
        budget = error_budget(
            self._radar,
            poses,
            self._tracer,
            spreading=self._spreading,
            shadow_rays=self._shadow_rays,
        )
        chosen = np.empty(budget.true.shape, dtype=np.int64)
        # A tolerance is one for each person, whoever else is there.
        for person in range(owners_of(self._body).max() + 1):
            own = owners_of(self._body) == person
            alone = ErrorBudget(**{name: a[..., own] for name, a in budget._asdict().items()})
            tolerances = self._power_fraction, self._complex_fraction
            chosen[:, own] = select_candidates(alone, *tolerances)
        chosen = chosen[1:-1]
        budget = ErrorBudget(**{name: array[1:-1] for name, array in budget._asdict().items()})
        # Later ones are looked at again in the next pass, and are not to count twice.
        if not self._counted >> chunk & 1:
            self._counted |= 1 << chunk
            self._count(chosen, budget)
        # Copies, which do not hold what they are cut from.
        return Planned(chosen.copy(), budget.in_view.copy())

    def _by(
        self,
        candidate: int,
        at: ChirpPoses,
        chirps: NDArray[np.int64],
        parts: NDArray[np.int64],
        cut: NDArray[np.bool_],
    ) -> _Group:
        if candidate >= PHYSICAL_OPTICS:
            facets = candidate == PHYSICAL_OPTICS
            echoes = (self._physical_optics if facets else self._reference).echoes(chirps)
            return _Group(
                echoes.length[..., parts],
                echoes.amplitude[..., parts],
                echoes.frequency,
                echoes.part[parts],
                echoes.bounces[parts],
            )
        bodies = at.centres[:, parts], at.frames[:, parts], at.semi_axes[parts]
        geometry = Geometry(at.tx, at.rx, *bodies)
        frequency = np.array([self._radar.centre_frequency_hz])
        values: NDArray[np.inexact]
        if candidate == ANALYTIC:
            length, values = far_field_echo(geometry, spreading=self._spreading)
        else:
            start = self._starts.at(chirps, parts)
            length, values, _ = solve_specular_points(
                geometry,
                start=start,
                polarization=self._radar.polarization,
                spreading=self._spreading,
            )
            if candidate == SPECULAR and cut[parts].any():
                values *= self._specular_points.at(chirps, parts)[0]
        values = values[None]
        if candidate == FRESNEL and cut[parts].any():
            frequency = zone_nodes(self._radar)
            values = values * self._zones.at(chirps, parts).conj()
        return _Group(length, values, frequency, parts, np.ones(len(parts), dtype=np.int64))

    @cached_property
    def _tracer(self) -> BodyTracer:
        return BodyTracer(self._mitsuba, self._body.semi_axes)

    def _mitsuba(self) -> Any:
        """Load Mitsuba for the first ray."""
        backend = select(self._variant)
        self.variant = backend.kind
        return use(backend)

    @cached_property
    def _specular_points(self) -> SpecularVisibility:
        return SpecularVisibility(self._radar, self._body, self._tracer)

    @cached_property
    def _zones(self) -> ZoneFractions:
        frequency = zone_nodes(self._radar)
        given = self._radar, self._body, frequency, self._tracer, self._at_edges
        bend = _POWER_BEND if self._complex_fraction is None else BEND
        return ZoneFractions(*given, shadow_rays=self._shadow_rays, bend=bend)

    @cached_property
    def _physical_optics(self) -> EchoModel:
        return self._traced(PhysicalOptics)

    @cached_property
    def _reference(self) -> EchoModel:
        return self._traced(Reference)

    def _traced(self, kind: type[PhysicalOptics | Reference]) -> EchoModel:
        model = kind(self._radar, self._body, variant=self._variant, spreading=self._spreading)
        self.variant = model.variant
        return model
