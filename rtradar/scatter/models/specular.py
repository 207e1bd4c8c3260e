"""The echo model `specular`: near-field geometric optics per chirp, with traced occlusion."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.common.poses import check_option, chirp_poses, one_echo_a_part
from rtradar.scatter.double_reflections import (
    DoubleReflections,
    TwoBounceModel,
    check_bounces,
    double_scattering,
)
from rtradar.scatter.facets.envelope import ArrayEnvelope, visible_fractions_of
from rtradar.scatter.facets.target import visible_fractions
from rtradar.scatter.specular_points import (
    SpecularVisibility,
    solve_specular_points,
    unobstructed,
    with_second_term,
)
from rtradar.scatter.target import sum_of_echoes, target_geometry
from rtradar.trace.backend import select, use
from rtradar.trace.tracers import BodyTracer

Visibility = Literal["sharp", "gradual"]


def _check(bounces: int, terms: int, visibility: str) -> None:
    """Raise InputError where there is no such option."""
    check_bounces("specular", bounces)
    allowed = "1, for geometric optics, or 2 for the next term in powers of 1/k as well"
    check_option("specular", "terms", terms, terms in (1, 2), allowed)
    known = get_args(Visibility)
    check_option("specular", "visibility", visibility, visibility in known, " or ".join(known))


def _scattering_length(
    target: Ellipsoids,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    frequency: NDArray[np.float64],
    polarization: Literal["v", "h"],
    variant: str = "auto",
    bounces: int = 1,
    terms: int = 1,
    visibility: Visibility = "sharp",
) -> NDArray[np.complex128]:
    """Scattering length of one target."""
    _check(bounces, terms, visibility)
    at, sent = target_geometry(target, tx, rx), Polarization(polarization)
    # Each part as if it stood alone.
    length, amplitude, points = solve_specular_points(at, polarization=sent, points=True)
    tracer = BodyTracer(use(select(variant)), target.semi_axes)
    tracer.pose(target.centres, target.frames)
    # What other parts leave of it: a fraction of its facets, or all or nothing.
    if visibility == "gradual":
        given = target, tx, rx, frequency, polarization, variant
        left = visible_fractions(*given)[:, None]
    else:
        left = unobstructed(tracer, at.tx, at.rx, points).astype(np.complex128)
    if terms == 2:
        k = 2 * np.pi * frequency[:, None, None] / SPEED_OF_LIGHT_MPS
        left *= with_second_term(at, points, sent, k)
    field = sum_of_echoes(length, amplitude * left, at, frequency)
    if bounces == 2:
        field += double_scattering(target, tx, rx, frequency, polarization, tracer)
    return field


class Specular(TwoBounceModel):
    """`specular`: near-field geometric optics for each Tx and Rx.

    Specular point, curvature and spreading are solved in float64 at every chirp.

    Occlusion: the specular point is visible or not. Each Tx and Rx is asked every 10 ms.

    With ``visibility="gradual"`` a part that others cut has the fraction of its return that is left
    when its facets are summed as by `physical-optics`, with shadows over without; equation
    :eq:`visible-fraction` of the theory page. A part in full view needs no sum.

    Parameters
    ----------
    visibility : {"sharp", "gradual"}
        ``sharp``: the specular point decides alone; ``gradual``: what is left of the part's facets.
    bounces : int
        1, or 2 for reflections from part to part as well (`rtradar.scatter.double_reflections`); of
        these a path is visible or not.
    terms : int
        1, or 2 for the second term of geometric optics as well
        (`rtradar.scatter.specular_points`), at the middle of the sweep.

    Raises
    ------
    InputError
        Where an option is none of these.
    """

    fast_over_walls = True
    relative_cost = 1.5
    scattering = staticmethod(_scattering_length)

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        bounces: int = 1,
        terms: int = 1,
        visibility: Visibility = "sharp",
    ) -> None:
        _check(bounces, terms, visibility)
        self._terms = terms
        self._radar, self._body, self._spreading = radar, body, spreading
        backend = select(variant)
        self.variant: str | None = backend.kind
        self._tracer = BodyTracer(use(backend), body.semi_axes)
        self._visibility: SpecularVisibility | ArrayEnvelope
        if visibility == "gradual":
            self._visibility = visible_fractions_of(
                radar, body, variant=variant, spreading=spreading
            )
        else:
            self._visibility = SpecularVisibility(radar, body, self._tracer)
        if bounces == 2:
            self.doubles = DoubleReflections(radar, body, self._tracer, spreading=spreading)
        if bounces == 2 or terms == 2 or visibility == "gradual":
            # Each path over walls has these of its own.
            self.fast_over_walls = False

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        at, visibility = chirp_poses(self._radar, self._body, chirps), self._visibility
        # Sharp visibility is known at keyframes, which also say where the search begins.
        weight, start = (
            visibility.at(chirps) if isinstance(visibility, SpecularVisibility) else (1.0, None)
        )
        sent = Polarization(self._radar.polarization, at.axes)
        length, amplitude, points = solve_specular_points(
            at,
            start=start,
            polarization=sent,
            spreading=self._spreading,
            points=self._terms == 2,
        )
        # A ramp between visible and occluded is a real weight, the same for the whole sweep.
        frequency = np.array([self._radar.centre_frequency_hz])
        echo = (amplitude * weight)[None].astype(np.complex128)
        # What is left of the facets is complex, and may change over the sweep.
        if isinstance(visibility, ArrayEnvelope):
            echo = visibility.times(chirps, at.tx_index, amplitude)
            frequency = visibility.frequency
        if self._terms == 2:
            k = np.array(2 * np.pi * self._radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS)
            # The amplitude of an echo is the conjugate of the scattering length.
            echo *= with_second_term(at, points, sent, k).conj()
        single = one_echo_a_part(at.tx_index, length, echo, frequency)
        return self._with_doubles(single, chirps)
