"""What the last footprints of ray tubes send to each receiver, by vector physical optics.

A footprint is the triangle of a surface that a tube lights. The field reflected there,
E_r = 2 (n.E) n - E, taken as a source on the triangle (Huygens' principle), sends to a receiver in
direction r, of polarisation p,

    F = jk/sqrt(pi) Int a exp(-jk (path in + path out)) dS,
    a = ((p.E) (n.r - n.d) + (p.d) (n.E) - (r.E) (n.p)) / 2,

with d the direction in which the field arrives: the mean of what the current 2 n x H sends and of
the same with Tx and Rx swapped. Where Tx and Rx are one and there is one bounce, this is scalar
physical optics, a = n.r; at a specular point it is cos(i) p.(E - 2 (n.E) n), the sign by which a
conducting sphere returns +sqrt(pi) a.

Where light comes from one side and is received on another, a breaks off at the horizons of both,
which sends waves that no real body has. Tapered, a is multiplied by
4 (n.r) (-n.d) / (n.r - n.d)^2: 1 at specular points, 0 at horizons.

The phase is taken from the exact paths over the corners, and over the triangle it is linear. The
mean of exp(-j phase) is then a divided difference, see `rtradar.kernels.scatter.triangles`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.scatter.triangles import Tubes, radiate_tubes
from rtradar.scatter.common.polarization import Polarization
from rtradar.system.threads import in_threads

Array = NDArray[np.float64]
_TASKS = 32
"""Tasks that threads take: some receivers, and a part of the tubes that is summed on its own."""


@dataclass(frozen=True)
class Footprints:
    """Triangles where tubes end, and the field that arrives there.

    ``places (tube, 4, 3)`` are the ends of the three corner rays and the middle ray, world [m]; on
    a curved surface the middle is off the triangle. ``path (tube, 4)`` is that from the Tx to there
    over all bounces before [m], ``directions (tube, 4, 3)`` the unit vectors along which the rays
    arrive, ``normals (tube, 4, 3)`` those of the surface there, on the side that is lit. ``field
    (tube, 3)`` is the field at the middle without its phase, for a Tx that makes 1 at 1 m [1/m],
    ``surface (tube,)`` the part or face.
    """

    places: Array
    path: Array
    directions: Array
    normals: Array
    field: Array
    surface: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.surface)

    def take(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> Footprints:
        """Some of them."""
        return Footprints(*(getattr(self, field.name)[which] for field in fields(self)))

    def width(self) -> Array:
        """Area of each tube across its rays (tube,) [m^2], over which its power is spread."""
        p = self.places
        area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 2
        return np.abs((area * self.directions[:, 3]).sum(axis=1))

    def mean_paths(self, group: NDArray[np.int64], rx: Array, otherwise: Array) -> Array:
        """Mean path from the Tx to each Rx over each group (rx, group) [m].

        ``group (tube,)`` are the groups of the tubes, which count by their power. The mean is
        ``otherwise (rx, group)`` for groups without power.
        """
        power, count = self.power(), otherwise.shape[1]
        total = np.bincount(group, weights=power, minlength=count)
        means = otherwise.copy()
        for antenna, mean in zip(rx, means, strict=True):
            path = self.path[:, 3] + np.linalg.norm(antenna - self.places[:, 3], axis=1)
            weighted = np.bincount(group, weights=power * path, minlength=count)
            np.divide(weighted, total, out=mean, where=total > 0)
        return means

    def power(self) -> Array:
        """Power of each tube (tube,), for a Tx whose field is 1 at 1 m."""
        return np.asarray((self.field**2).sum(axis=1) * self.width())


def radiate(
    footprints: Footprints,
    visible: NDArray[np.bool_],
    rx: Array,
    wavenumber: Array,
    length: Array,
    *,
    polarization: Polarization,
    spreading: bool = True,
    tapered: bool = False,
) -> NDArray[np.complex128]:
    """Sum of what footprints send to receivers, (node, rx, group) complex128.

    It is a scattering length for exp(+j omega t), over R2 with ``spreading`` [m]. ``visible (rx,
    tube)`` says whether the last leg to a receiver ``rx (rx, 3)`` [m] is free; ``wavenumber
    (node,)`` [1/m]; ``length (rx, group)`` is the path whose phase is taken out [m]. Footprints are
    summed by their surface, or all together if there is one group. ``polarization`` is that of the
    receivers; ``tapered``, the integral fades toward the horizons.
    """
    chunks = math.ceil(_TASKS / len(rx))
    parts = np.zeros((chunks, len(wavenumber), *length.shape), dtype=np.complex128)
    if len(footprints):
        f = footprints
        group = np.zeros_like(f.surface) if length.shape[1] == 1 else f.surface
        arrays = (f.places, f.path, f.directions[:, 3], f.normals[:, 3], f.field, group)
        tubes = Tubes._make(np.ascontiguousarray(array) for array in arrays)
        others = visible, rx, polarization.axes, wavenumber, length
        given = (np.ascontiguousarray(array) for array in others)
        options = polarization.kind == "h", spreading, tapered
        in_threads(radiate_tubes, chunks * len(rx), tubes, *given, *options, parts)
    return 1j * np.asarray(wavenumber)[:, None, None] / np.sqrt(np.pi) * parts.sum(axis=0)
