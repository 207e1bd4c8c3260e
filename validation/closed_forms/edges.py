"""A sphere behind the edge of a board: furniture, a moving object and a wall, by three levels.

The sphere of 0.1 m radius is 4 m from one Tx and Rx, at 12 and 77 GHz, and the board of metal is
half-way, with its edge at eight distances from the shadow line. The truth is Fresnel's knife edge
on both legs (Born and Wolf, Principles of Optics, section 8.7), to the near side of the sphere: for
each leg the mean over 101 frequencies of the sweep. The board is a slab 1 mm thick and ends 2 m
from the leg elsewhere. Sweeps are 0.5 GHz wide; for one as wide as those of the presets, 4 GHz,
figures are reported.

    python validation/closed_forms/edges.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import trimesh
from scipy.special import fresnel

import rtradar as rt
from rtradar.scatter import build_model
from rtradar.scene import Furniture, Wall, material
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import MovingEllipsoid, field_db, rms

LIGHT_MPS = 299_792_458.0
RANGE_M, RADIUS_M, BOARD_M, THICK_M, HEIGHT_M = 4.0, 0.1, 2.0, 1e-3, 1.0
OFFSETS_M = (-0.30, -0.15, -0.05, 0.02, 0.05, 0.10, 0.15, 0.30)
NEAR_M, NEAR_DB, DEEP_DB = -0.051, 1.0, 3.0
NARROW_HZ = 0.5e9
LEVELS = ("specular", "physical-optics", "auto")
KINDS = ("furniture", "object", "wall")
judged, reported = (partial(kind, key="edge") for kind in (rows.judged, rows.reported))


def radar_at(carrier_hz: float, bandwidth_hz: float) -> rt.Radar:
    """One Tx and one Rx at one place."""
    at = ((0.0, 0.0, 0.0),)
    return rt.Radar(
        name=f"{carrier_hz / 1e9:.0f} GHz",
        start_frequency_hz=carrier_hz,
        bandwidth_hz=bandwidth_hz,
        position_m=(0.0, 0.0, HEIGHT_M),
        tx_positions_m=at,
        rx_positions_m=at,
        **dict.fromkeys(("tx_y", "tx_z", "rx_y", "rx_z"), 0),
    )


def knife_edge(offset_m: float, radar: rt.Radar) -> float:
    """Field over both legs, over that without a board; the offset is that at the sphere."""
    last = RANGE_M - RADIUS_M - BOARD_M
    frequency = radar.start_frequency_hz + radar.bandwidth_hz * np.linspace(0, 1, 101)
    number = (
        offset_m
        * BOARD_M
        / RANGE_M
        * np.sqrt(2 * (BOARD_M + last) * frequency / (LIGHT_MPS * BOARD_M * last))
    )
    sine, cosine = fresnel(number)
    one_way = 0.5 + (1 + 1j) / 2 * (cosine - 1j * sine)
    return float(abs(one_way.mean()) ** 2)


def scene_with(kind: str, offset_m: float, folder: str) -> rt.Scene:
    """The board; the sphere is so far from the line of its shadow, positive if it is lit [m]."""
    edge_m = -offset_m * BOARD_M / RANGE_M
    metal = material("perfect-conductor")
    if kind == "wall":
        corner = BOARD_M - THICK_M / 2, -2.0, HEIGHT_M - 2
        sides = {"edge_u_m": (0.0, 0.0, 4.0), "edge_v_m": (0.0, edge_m + 2, 0.0)}
        wall = Wall(name="board", corner_m=corner, material=metal, thickness_m=THICK_M, **sides)
        return rt.Scene(walls=(wall,))
    low = BOARD_M - THICK_M / 2, -2.0, HEIGHT_M - 2
    high = BOARD_M + THICK_M / 2, edge_m, HEIGHT_M + 2
    file = Path(folder, f"{kind}{offset_m}.ply")
    trimesh.creation.box(bounds=[low, high]).export(file)
    given = {"position_m": (0.0, 0.0, 0.0), "metres_per_unit": 1.0}
    if kind == "object":
        return rt.Scene(objects=(rt.Object("board", file, metal, **given),))
    return rt.Scene(furniture=(Furniture("board", file, metal, **given),))


def board_rows(carrier_hz: float, bandwidth_hz: float, level: str, kind: str) -> Iterator[Row]:
    radar = radar_at(carrier_hz, bandwidth_hz)
    body = MovingEllipsoid((RANGE_M, 0.0, HEIGHT_M), (RADIUS_M,) * 3)
    chirp = np.zeros(1, dtype=np.int64)
    bare = rms(build_model(level, radar, body).echoes(chirp).amplitude)
    with tempfile.TemporaryDirectory() as folder:
        for offset_m in OFFSETS_M:
            scene = scene_with(kind, offset_m, folder)
            model = build_model(level, radar, body, scene=scene, order=0)
            got_db = float(field_db(rms(model.echoes(chirp).amplitude) / bare))
            exact_db = float(field_db(knife_edge(offset_m, radar)))
            claim = f"{radar.name}, {level}, {kind}, sweep {bandwidth_hz / 1e9:g} GHz"
            what = f"at {offset_m:+.2f} m"
            if bandwidth_hz > NARROW_HZ:
                yield reported(claim, what, "dB", got_db, reference=exact_db)
                continue
            near = offset_m > NEAR_M
            where = "near the shadow line" if near else "deep in the shadow"
            says = f"a sphere behind the edge of a board, {where}: power against the knife edge"
            limit = NEAR_DB if near else DEEP_DB
            yield judged(claim, what, "dB", got_db, limit, reference=exact_db, says=says)


def measure(quick: bool) -> list[Row]:
    found: list[Row] = []
    for carrier_hz in (12e9, 77e9):
        for level in LEVELS:
            for kind in KINDS:
                found += board_rows(carrier_hz, NARROW_HZ, level, kind)
        if not quick:
            found += board_rows(carrier_hz, 4e9, LEVELS[0], KINDS[0])
    return found


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
