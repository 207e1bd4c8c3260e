"""Kernels of rooms against their references."""

from __future__ import annotations

import numpy as np

from rtradar.kernels.scatter import rooms
from rtradar.kernels.scatter.nearby_points import Ellipsoids
from rtradar.kernels.scatter.rooms import Blend, LegAntennas, PartPoints, PathFactors, SlabDelays

RNG = np.random.default_rng(5)
CHIRPS, NODES, LINES, RX, RX_ENDS, ECHOES = 7, 2, 2, 3, 4, 5


def test_amplitudes_are_blended_over_time_and_the_array() -> None:
    interval, line = RNG.integers(0, 3, CHIRPS), RNG.integers(0, LINES, CHIRPS)
    blend = Blend(
        interval,
        RNG.random(CHIRPS),
        line,
        RNG.random((CHIRPS, 2)),
        RNG.random((CHIRPS, RX, RX_ENDS)),
    )
    shape = LINES, 2, RX_ENDS, ECHOES
    ends = [
        PathFactors(
            RNG.normal(size=(3, NODES, *shape, 2)).astype(np.float32).view(np.complex64)[..., 0],
            RNG.random((3, *shape)) > 0.5,
        )
        for _ in range(2)
    ]
    bare = RNG.normal(size=(CHIRPS, RX, ECHOES))
    out = np.empty((NODES, CHIRPS, RX, ECHOES), dtype=np.complex64)
    rooms.path_amplitudes(bare, *ends, blend, out)
    expected = rooms.path_amplitudes_reference(bare, *ends, blend)
    np.testing.assert_allclose(out, expected, atol=1e-5 * np.abs(expected).max())


def test_slabs_make_paths_longer_on_both_legs() -> None:
    antennas = LegAntennas(RNG.normal(size=(2, 4, 3)) - 5, RNG.normal(size=(2, 4, RX, 3)) - 5)
    tx_index, part = RNG.integers(0, 4, CHIRPS), np.array([0, 1, 0, 1, 1])
    points = PartPoints(RNG.normal(size=(CHIRPS, ECHOES, 3)), part)
    frames = np.linalg.qr(RNG.normal(size=(CHIRPS, 2, 3, 3)))[0]
    axes = np.array([[0.1, 0.2, 0.3], [0.2, 0.2, 0.4]])
    bodies = Ellipsoids(RNG.normal(size=(CHIRPS, 2, 3)), frames, axes)
    slabs = np.array([[1.0, 0, 0, 0.1, 4.0], [0, 0.6, 0.8, 0.2, 3.0], [0, 1.0, 0, 0.05, 2.5]])
    # Without a slab, with two on the way out, and with one on each.
    legs = np.array([[[0, 0, 0], [1, 0, 0]], [[0, 0, 2], [0, 2, 2]], [[1, 1, 2], [0, 2, 3]]])
    delays = SlabDelays(np.array([0, 3, 4]), legs, np.array([1, 2, 3]), slabs)
    length = 8 + RNG.random((CHIRPS, RX, ECHOES))
    out = np.empty((CHIRPS, RX, 3))
    rooms.delayed_lengths(antennas, tx_index, points, bodies, delays, length, out)
    expected = rooms.delayed_lengths_reference(antennas, tx_index, points, bodies, delays, length)
    np.testing.assert_allclose(out, expected, rtol=1e-13)
    np.testing.assert_array_equal(out[..., 0], length[..., 0])


def test_clutter_fades_from_keyframe_to_keyframe() -> None:
    kept, changed = RNG.normal(size=(2, 4, RX, 16, 2)).astype(np.float32).view(np.complex64)[..., 0]
    fraction, tx = RNG.random(CHIRPS).astype(np.float32), RNG.integers(0, 4, CHIRPS)
    before = np.full((CHIRPS, RX, 16), 1 + 2j, dtype=np.complex64)
    out = before.copy()
    rooms.add_fading(kept, changed, fraction, tx, out)
    expected = before + rooms.add_fading_reference(kept, changed, fraction, tx)
    np.testing.assert_allclose(out, expected, rtol=1e-6)
