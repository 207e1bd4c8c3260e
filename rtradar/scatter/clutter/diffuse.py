"""Diffuse returns of rough walls: points fixed in the wall, with phases fixed to it.

The share of the reflected power that roughness takes from the mirrored wave, 1 - exp(-(2 k s)^2 cos_i cos_s) (Ament, Proc.
IRE 41 (1953) 142, made reciprocal by the mean of both angles), goes into all directions before the wall by Lambert's law: the
effective roughness of Degli-Esposti, Fuschini, Vitucci and Falciasecca, IEEE Trans. Antennas Propag. 55 (2007) 143, with
S^2 from the height of the surface instead of a fit. So the power per area is

    sigma0 = 4 S^2 |R|^2 cos_i cos_s,

R of the smooth slab at the angle of each leg, its polarisation as it arrives; over half of space it adds up to S^2 |R|^2 of
what arrives, and mirrored and diffuse power together to what a smooth wall mirrors. All of it is taken as co-polar. Other walls
on the way let through on both legs what their slabs do.

A point stands for its cell of a jittered grid, two range bins wide: where cells are seen from so near that a range bin
holds few, the diffuse return is grainier than that of a real wall, its mean power is right.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.clutter.behind_walls import behind_walls
from rtradar.scatter.clutter.returns import RoomEchoes
from rtradar.scatter.common.polarization import antenna_field
from rtradar.scatter.multipath.wall_interaction import height, reflect
from rtradar.scene import Scene, Wall
from rtradar.system.seeds import stream
from rtradar.trace.room_tracer import RoomTracer

Array = NDArray[np.float64]
CELL_BINS, CELL_M = 2.0, 0.1
"""Width of a cell, in range bins, and the most of it."""
MOST_POINTS = 40_000
"""Of one face of a wall; a larger one gets wider cells."""


def rough_returns(
    radar: Radar, scene: Scene, tracer: RoomTracer, seed: int
) -> Iterator[RoomEchoes]:
    """Diffuse returns of every face of a rough wall that antennas stand before.

    Parameters
    ----------
    radar : Radar
    scene : Scene
    tracer : RoomTracer
        Tracer of the room's furniture, which may occlude points.
    seed : int
        Together with the wall and the face it fixes places and phases.

    Yields
    ------
    RoomEchoes
    """
    for number, wall in enumerate(scene.walls):
        if wall.roughness_m == 0:
            continue
        for back in (False, True):
            if (height(wall, radar.tx, back=back) > 0).any() and (
                height(wall, radar.rx, back=back) > 0
            ).any():
                rng = np.random.default_rng(stream(seed, number, int(back)))
                points, area, phase = _points(
                    wall, back, min(CELL_BINS * radar.range_bin_m, CELL_M), rng
                )
                echoes = _echoes(wall, back, points, area, phase, radar, scene, tracer)
                if echoes.n_echoes:
                    yield echoes


def _points(
    wall: Wall, back: bool, cell_m: float, rng: np.random.Generator
) -> tuple[Array, float, Array]:
    """Points (point, 3) of a jittered grid on a face, the area of each cell [m^2] and the phases (point,)."""
    edges = np.array(wall.edge_u_m), np.array(wall.edge_v_m)
    cell_m = max(cell_m, np.sqrt(wall.area_m2 / MOST_POINTS))
    counts = [ceil(np.linalg.norm(edge) / cell_m) for edge in edges]
    cells = np.indices(counts).reshape(2, -1)
    u, v = (cells + rng.random(cells.shape)) / np.array(counts)[:, None]
    corner = np.array(wall.corner_m) - (wall.thickness_m if back else 0.0) * wall.normal
    points = corner + u[:, None] * edges[0] + v[:, None] * edges[1]
    return points, wall.area_m2 / len(points), rng.uniform(0, 2 * np.pi, len(points))


def _echoes(
    wall: Wall,
    back: bool,
    points: Array,
    area: float,
    phase: Array,
    radar: Radar,
    scene: Scene,
    tracer: RoomTracer,
) -> RoomEchoes:
    frequency = np.array([radar.centre_frequency_hz])
    smooth = replace(wall, roughness_m=0.0)
    normal = -wall.normal if back else wall.normal

    def legs(antennas: Array) -> tuple[Array, Array, Array]:
        """Distances, cosines and field strengths of the wave that a smooth wall would send back, (antenna, point)."""
        ways = points - antennas[:, None]
        distance = np.linalg.norm(ways, axis=-1)
        ways /= distance[..., None]
        sent = antenna_field(ways, radar.polarization, x_for_steep=True).astype(np.complex128)
        field = reflect(smooth, sent, ways, frequency)[0]
        strength = np.sqrt((np.abs(field) ** 2).sum(axis=-1)) * ~tracer.blocked(
            antennas[:, None], points
        )
        return distance, np.maximum(-(ways @ normal), 0.0), strength

    kept = radar.rx_of_tx
    (far_t, cos_t, field_t), (far_r, cos_r, field_r) = legs(radar.tx), legs(radar.rx)
    cosines = cos_t[:, None] * cos_r[kept]
    waves = 2 * np.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS * wall.roughness_m
    scattered = -np.expm1(-((2 * waves) ** 2) * cosines)
    # |R|^2 as the geometric mean of both legs' own.
    power = 4 * scattered * cosines * field_t[:, None] * field_r[kept] * area
    amplitude = np.sqrt(power) / (far_t[:, None] * far_r[kept]) * np.exp(1j * phase)
    returns = RoomEchoes(
        name=wall.name,
        kind="rough",
        length=far_t[:, None] + far_r[kept],
        amplitude=amplitude[None],
        frequency=frequency,
        bounces=np.ones(len(points), dtype=np.int64),
        points=points[None, None, :, None],
    ).heard(radar)
    return behind_walls(returns, radar, scene).heard(radar)
