"""What the last footprints of tubes of rays send to each receiver: vector physical optics, linear phase, float64.

A footprint is the triangle of a surface that a tube lights. The field reflected there, E_r = 2 (n.E) n - E, taken as a source
on the triangle (Huygens' principle), sends to a receiver in direction r, of polarisation p,

    F = jk/sqrt(pi) Int a exp(-jk (path in + path out)) dS,
    a = ((p.E) (n.r - n.d) + (p.d) (n.E) - (r.E) (n.p)) / 2,

d the direction in which the field arrives: the mean of what the current 2 n x H sends and of the same with Tx and Rx swapped.
Where Tx and Rx are one and there is one bounce this is scalar physical optics, a = n.r; at a specular point it is
cos(i) p.(E - 2 (n.E) n), the sign by which a conducting sphere returns +sqrt(pi) a.

Where light comes from one side and is heard on another, a breaks off at the horizons of both, which sends waves that no
real body has. Tapered, a is multiplied by 4 (n.r) (-n.d) / (n.r - n.d)^2: 1 at specular points, 0 at horizons.

The phase is taken from the exact paths over the corners, and over the triangle it is linear: the mean of exp(-j phase) is
then a divided difference (Gordon, IEEE Trans. Antennas Propag. 23 (1975) 590, in the form of Hermite and Genocchi).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from numba import prange
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled
from rtradar.kernels.phasor import phasor
from rtradar.kernels.scatter.triangles import mean_of_phasor
from rtradar.scatter.common.polarization import STEEP

Array = NDArray[np.float64]
_TASKS = (
    32  # that threads share: some receivers, and a share of the tubes that is summed on its own
)


@dataclass(frozen=True)
class Footprints:
    """Triangles where tubes end, and the field that arrives there.

    Parameters
    ----------
    places : (tube, 4, 3) float64
        Where the three corner rays and the middle ray end, world [m]; on a curved surface the middle is off the triangle.
    path : (tube, 4) float64
        From the Tx to there over all bounces before [m].
    directions : (tube, 4, 3) float64
        Unit vectors along which the four rays arrive.
    normals : (tube, 4, 3) float64
        Unit normals of the surface there, on the side that is lit.
    field : (tube, 3) float64
        The field at the middle without its phase, for a Tx that makes 1 at 1 m [1/m].
    surface : (tube,) int64
        Part or face.
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
        """Area of each tube across its rays (tube,) [m^2]: what holds the power that the tube carries."""
        p = self.places
        area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 2
        return np.abs((area * self.directions[:, 3]).sum(axis=1))


def radiate(
    footprints: Footprints,
    visible: NDArray[np.bool_],
    group: NDArray[np.int64],
    rx: Array,
    wavenumber: Array,
    length: Array,
    *,
    polarization: Literal["v", "h"] = "v",
    spreading: bool = True,
    tapered: bool = False,
) -> NDArray[np.complex128]:
    """Sum of what footprints send to receivers.

    Parameters
    ----------
    footprints : Footprints
    visible : (rx, tube) bool
        Whether the last leg is free.
    group : (tube,) int64
        Which sum each footprint goes to.
    rx : (rx, 3) float64
        [m].
    wavenumber : (node,) float64
        [1/m].
    length : (rx, group) float64
        Path whose phase is taken out [m].
    polarization : {"v", "h"}
        Polarization of the receiving antennas.
    spreading : bool
        Whether the last leg's 1 / R2 is in.
    tapered : bool
        Whether the integral fades toward the horizons.

    Returns
    -------
    (node, rx, group) complex128
        Scattering length for exp(+j omega t), over R2 with ``spreading`` [m].
    """
    parts = np.zeros(
        (math.ceil(_TASKS / len(rx)), len(wavenumber), *length.shape), dtype=np.complex128
    )
    if len(footprints):
        f, c = footprints, np.ascontiguousarray
        _radiate(
            c(f.places),
            c(f.path),
            c(f.directions[:, 3]),
            c(f.normals[:, 3]),
            c(f.field),
            c(visible),
            c(group),
            c(rx),
            c(wavenumber),
            c(length),
            polarization == "h",
            spreading,
            tapered,
            parts,
        )
    return 1j * np.asarray(wavenumber)[:, None, None] / np.sqrt(np.pi) * parts.sum(axis=0)


@compiled(parallel=True)
def _radiate(
    places,
    path,
    direction,
    normal,
    field,
    visible,
    group,
    rx,
    wavenumber,
    length,
    horizontal,
    spreading,
    tapered,
    out,
):
    tubes, receivers, nodes, chunks = len(places), len(rx), len(wavenumber), len(out)
    for task in prange(chunks * receivers):
        chunk, receiver = task // receivers, task % receivers
        x, y, z = rx[receiver, 0], rx[receiver, 1], rx[receiver, 2]
        u = np.empty(3)
        # Interleaved, for hidden tubes come in runs.
        for tube in range(chunk, tubes, chunks):
            if not visible[receiver, tube]:
                continue
            p0, p1, p2, middle = places[tube, 0], places[tube, 1], places[tube, 2], places[tube, 3]
            ax, ay, az = p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]
            bx, by, bz = p2[0] - p0[0], p2[1] - p0[1], p2[2] - p0[2]
            # Normal of the triangle times its area, on the lit side.
            nx, ny, nz = (ay * bz - az * by) / 2, (az * bx - ax * bz) / 2, (ax * by - ay * bx) / 2
            dx, dy, dz = direction[tube, 0], direction[tube, 1], direction[tube, 2]
            ex, ey, ez = field[tube, 0], field[tube, 1], field[tube, 2]
            if nx * normal[tube, 0] + ny * normal[tube, 1] + nz * normal[tube, 2] < 0:
                nx, ny, nz = -nx, -ny, -nz
            n_d, n_e = nx * dx + ny * dy + nz * dz, nx * ex + ny * ey + nz * ez
            sx, sy, sz = x - middle[0], y - middle[1], z - middle[2]
            leg = math.sqrt(sx * sx + sy * sy + sz * sz)
            sx, sy, sz = sx / leg, sy / leg, sz / leg
            # Polarisation: h = up x s, v = s x h; straight above, x stands in for up.
            if sx * sx + sy * sy < STEEP * STEEP:
                hx, hy, hz = 0.0, -sz, sy
            else:
                hx, hy, hz = -sy, sx, 0.0
            size = math.sqrt(hx * hx + hy * hy + hz * hz)
            hx, hy, hz = hx / size, hy / size, hz / size
            if horizontal:
                qx, qy, qz = hx, hy, hz
            else:
                qx, qy, qz = sy * hz - sz * hy, sz * hx - sx * hz, sx * hy - sy * hx
            n_s = nx * sx + ny * sy + nz * sz
            weight = (ex * qx + ey * qy + ez * qz) * (n_s - n_d) + (
                qx * dx + qy * dy + qz * dz
            ) * n_e
            weight -= (ex * sx + ey * sy + ez * sz) * (nx * qx + ny * qy + nz * qz)
            weight /= 2
            if tapered:
                weight *= max(-4 * n_s * n_d, 0.0) / (n_s - n_d) ** 2
            if spreading:
                weight /= leg
            own = group[tube]
            mean = 0.0
            for corner in range(3):
                wx, wy, wz = (
                    x - places[tube, corner, 0],
                    y - places[tube, corner, 1],
                    z - places[tube, corner, 2],
                )
                u[corner] = (
                    path[tube, corner]
                    - length[receiver, own]
                    + math.sqrt(wx * wx + wy * wy + wz * wz)
                )
                mean += u[corner] / 3
            # A bow of the path across the triangle, quadratic, is on average 3/4 of what it is in the middle.
            bow = 0.75 * (path[tube, 3] + leg - length[receiver, own] - mean)
            for node in range(nodes):
                k = wavenumber[node]
                real, imaginary = mean_of_phasor(
                    k * (u[0] - mean), k * (u[1] - mean), k * (u[2] - mean)
                )
                phase = k * (mean + bow)
                cosine, sine = phasor(phase / (2 * math.pi))
                out[chunk, node, receiver, own] += weight * complex(
                    real * cosine + imaginary * sine, imaginary * cosine - real * sine
                )
