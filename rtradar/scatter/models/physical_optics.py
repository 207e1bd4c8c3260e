"""The echo models of physical optics: `physical-optics` and `reference`.

The former computes a carrier at every chirp, times a slow envelope; the latter sums over every
facet, at every chirp and receiver.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, Ellipsoids, Poses
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.common.poses import (
    BuiltInModel,
    check_option,
    chirp_poses,
    has_mesh,
    one_echo_a_part,
)
from rtradar.scatter.double_reflections import (
    DoubleReflections,
    TwoBounceModel,
    check_bounces,
    double_scattering,
)
from rtradar.scatter.facets.envelope import ArrayEnvelope
from rtradar.scatter.facets.skin import facets_of_people
from rtradar.scatter.facets.target import facet_scattering
from rtradar.scatter.specular_points import solve_specular_points
from rtradar.system.threads import thread_map
from rtradar.trace.backend import select, use
from rtradar.trace.tracers import BodyTracer

if TYPE_CHECKING:
    import trimesh


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
    # Reflections from part to part are added by geometric optics.
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
        Least number per ellipsoid, 20 to 1 310 720; None: by wavelength and size, 1280 to 4500 at
        12 to 16 GHz and 7000 to 22 000 at 77 to 81 GHz. A mesh is always divided by the wavelength.
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
        # Options first, before anything is traced.
        check_bounces("physical-optics", bounces)
        allowed = f"a whole number from 1 to {_MOST_FREQUENCIES}"
        fine = frequencies in range(1, _MOST_FREQUENCIES + 1)
        check_option("physical-optics", "frequencies", frequencies, fine, allowed)
        positive = {"anchor_s": anchor_s, "tolerance": tolerance, "unevenness": unevenness}
        for name, value in positive.items():
            check_option("physical-optics", name, value, 0 < value < math.inf, "positive")
        # The facets, of ellipsoids or of skins, and what antennas see of them.
        self._radar, self._body = radar, body
        self._surface = facets_of_people(
            "physical-optics",
            radar,
            body,
            variant=variant,
            spreading=spreading,
            nodes=frequencies,
            facets=facets,
            # An edge that crosses a limb fades over half an interval, not a whole one.
            look_s=anchor_s / 2,
        )
        self.variant: str | None = self._surface.variant
        if bounces == 2:
            if has_mesh(body):
                raise InputError(_NO_DOUBLES.format("take body = 'ellipsoids'"))
            tracer = BodyTracer(use(select(variant)), body.semi_axes)
            self.doubles = DoubleReflections(radar, body, tracer, spreading=spreading)
        # The sum over facets divided by the carrier, from keyframe to keyframe.
        self._envelope = ArrayEnvelope(
            radar,
            body,
            self._surface,
            anchor_s=anchor_s,
            tolerance=tolerance,
            unevenness=unevenness,
        )

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        chirps = np.asarray(chirps, dtype=np.int64)
        at = chirp_poses(self._radar, self._body, chirps)
        # The carrier of the specular point, exact at every chirp, times the slow envelope.
        length, strength = self._surface.carriers(at)
        amplitude = self._envelope.times(chirps, at.tx_index, strength)
        single = one_echo_a_part(at.tx_index, length, amplitude, self._surface.frequency)
        return self._with_doubles(single, chirps)


NODES = 7
"""Frequencies over the sweep. What is left of a part whose specular point is occluded comes from
beside it, and its phase changes over the sweep: three frequencies would not follow it."""


class Reference(BuiltInModel):
    """`reference`: all facets at every chirp.

    The other levels are compared with it.

    Occlusion: facet by facet. Each Tx and Rx is asked at every chirp which corners it sees.

    Parameters
    ----------
    facets : int, optional
        Least number per part, 20 to 1 310 720; None: by wavelength and size, 1280 to 4500 at 12 to
        16 GHz and 7000 to 22 000 at 77 to 81 GHz. A mesh is always divided by the wavelength.
    """

    accepts_meshes = True
    scattering = staticmethod(facet_scattering)
    relative_cost = 200.0

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        facets: int | None = None,
    ) -> None:
        self._radar, self._body = radar, body
        self._surface = facets_of_people(
            "reference",
            radar,
            body,
            variant=variant,
            spreading=spreading,
            nodes=NODES,
            facets=facets,
            look_s=radar.cycle_duration_s,
        )
        self.variant: str | None = self._surface.variant

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        chirps = np.asarray(chirps, dtype=np.int64)
        at = chirp_poses(self._radar, self._body, chirps)
        # Lengths are those of the specular points; the phases of the facets are relative to them.
        length, _, _ = solve_specular_points(at)
        # One Tx and all Rx at each chirp: every pair of the first with another one.
        antennas = np.concatenate([at.tx[:, None], at.rx], axis=1)
        pairs = np.array([(0, 1 + receiver) for receiver in range(at.rx.shape[1])])
        times = np.minimum(self._radar.centres_of(chirps), self._body.duration_s)

        def field(i: int) -> NDArray[np.complex128]:
            pose = Poses(at.centres[[i]], at.frames[[i]], at.semi_axes)
            given = antennas[i], pairs, length[i], np.arange(length.shape[2])
            return self._surface.field(float(times[i]), pose, *given)

        amplitude = np.stack(thread_map(field, range(len(chirps))), axis=1)
        return one_echo_a_part(at.tx_index, length, amplitude, self._surface.frequency)
