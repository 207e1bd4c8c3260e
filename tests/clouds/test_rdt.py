"""The streamed RDT surface equals that of the whole volume; the cloud is a fair sample of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare

from rtradar.clouds.rdt import RdtCloud, UniformSample, _surface
from rtradar.errors import InputError
from rtradar.radar import Radar

RADAR = Radar.preset("paper-12ghz")


def rdt_isosurface(volume: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The surface of a whole volume at once, closed a hop before and after it."""
    hop = RADAR.frame_hop_s
    around = np.concatenate([[times[0] - hop], times, [times[-1] + hop]])
    return _surface(np.pad(volume, ((1, 1), (0, 0), (0, 0))), around, RADAR)


def sample_centres(
    vertices: np.ndarray, faces: np.ndarray, n_points: int = 3000, seed: int = 0
) -> np.ndarray:
    """A sample of the centres of triangles, as of `RdtCloud`."""
    sample = UniformSample(n_points, seed)
    sample.add(np.asarray(vertices)[np.asarray(faces)].mean(axis=1))
    return sample.filled()


def random_volume(
    seed: int, shape: tuple[int, int, int], filling: float
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    # Windows begin at cycle boundaries, so their spacing is not exactly even.
    return rng.random(shape) < filling, 0.05 + np.cumsum(0.025 + rng.uniform(-4e-4, 4e-4, shape[0]))


def stream(volume: np.ndarray, times: np.ndarray, n_points: int, seed: int = 0) -> RdtCloud:
    cloud = RdtCloud(RADAR, n_points=n_points, seed=seed)
    for mask, time in zip(volume, times, strict=True):
        cloud.push(mask, time)
    return cloud


@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(1, 7), st.integers(1, 12), st.integers(1, 13)),
    filling=st.sampled_from([0.02, 0.3, 0.5, 0.9, 1.0]),
    n_points=st.integers(1, 400),
)
@settings(max_examples=60, deadline=None)
def test_slabs_make_the_whole_surface(
    seed: int, shape: tuple[int, int, int], filling: float, n_points: int
) -> None:
    volume, times = random_volume(seed, shape, filling)
    vertices, faces = rdt_isosurface(volume, times)
    np.testing.assert_array_equal(
        stream(volume, times, n_points, seed=7).finish().points,
        sample_centres(vertices, faces, n_points, seed=7),
    )
    # As many points as triangles: every centre exactly once, in an order that the seed decides.
    result = stream(volume, times, max(1, len(faces)), seed=3).finish()
    assert result.n_triangles == len(faces)
    assert result.n_voxels == volume.sum()
    np.testing.assert_array_equal(
        result.points, sample_centres(vertices, faces, max(1, len(faces)), seed=3)
    )
    centres = vertices[faces].mean(axis=1)
    np.testing.assert_array_equal(
        np.sort(result.points.view("f8,f8,f8").ravel()), np.sort(centres.view("f8,f8,f8").ravel())
    )


@given(seed=st.integers(0, 2**32 - 1), filling=st.sampled_from([0.05, 0.5, 1.0]))
@settings(max_examples=30, deadline=None)
def test_surface_is_closed(seed: int, filling: float) -> None:
    volume, times = random_volume(seed, (4, 5, 6), filling)
    _, faces = rdt_isosurface(volume, times)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    # Each edge of a closed oriented surface is passed as often one way as the other.
    ways = np.unique(edges, axis=0, return_counts=True)
    back = np.unique(edges[:, ::-1], axis=0, return_counts=True)
    np.testing.assert_array_equal(ways[0], back[0])
    np.testing.assert_array_equal(ways[1], back[1])


def test_one_detection_is_an_octahedron_in_its_place() -> None:
    n_velocity = 133
    volume = np.zeros((3, 256, n_velocity), bool)
    volume[1, 120, 70] = True
    times = np.array([0.05, 0.0751, 0.1])
    vertices, faces = rdt_isosurface(volume, times)
    assert len(vertices) == 6
    assert len(faces) == 8
    middle = np.array([0.0751, RADAR.range_m[120], RADAR.velocity_mps(n_velocity)[70]])
    half = np.array([0.0125, RADAR.range_bin_m / 2, RADAR.velocity_bin_mps / 2])
    offsets = (vertices - middle) / half
    expected = np.concatenate([np.eye(3), -np.eye(3)])
    order = np.lexsort(np.round(offsets).T)
    # Times lie 0.05 % off even spacing, and the half bin in time follows the neighbours.
    np.testing.assert_allclose(offsets[order], expected[np.lexsort(expected.T)], atol=0.005)
    assert stream(volume, times, 10).finish().n_triangles == 8


def test_detections_at_the_ends_are_closed_half_a_hop_outside() -> None:
    vertices, _ = rdt_isosurface(np.ones((1, 1, 1), bool), np.array([1.0]))
    np.testing.assert_allclose(vertices.min(axis=0)[:2], [1.0 - 0.0125, -RADAR.range_bin_m / 2])
    np.testing.assert_allclose(vertices.max(axis=0)[:2], [1.0 + 0.0125, RADAR.range_bin_m / 2])


def test_too_few_triangles_are_drawn_with_replacement() -> None:
    volume = np.zeros((1, 9, 9), bool)
    volume[0, 4, 4] = True
    result = stream(volume, np.array([1.0]), 3000).finish()
    assert result.points.shape == (3000, 3)
    assert result.n_triangles == 8
    counts = np.unique(result.points, axis=0, return_counts=True)[1]
    assert len(counts) == 8
    assert chisquare(counts).pvalue > 1e-4  # the seed is fixed


def test_same_seed_same_cloud_other_seed_other_cloud() -> None:
    volume, times = random_volume(1, (6, 20, 20), 0.2)
    a, b, c = (stream(volume, times, 100, seed).finish().points for seed in (5, 5, 6))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)


def test_nothing_detected_is_an_empty_cloud() -> None:
    volume = np.zeros((3, 8, 8), bool)
    result = stream(volume, np.arange(3.0), 3000).finish()
    assert result.points.shape == (0, 3)
    assert (result.n_triangles, result.n_voxels) == (0, 0)
    vertices, faces = rdt_isosurface(volume, np.arange(3.0))
    assert vertices.shape == faces.shape == (0, 3)
    assert RdtCloud(RADAR).finish().points.shape == (0, 3)


def test_mask_may_be_reused_by_the_caller() -> None:
    volume, times = random_volume(2, (5, 9, 9), 0.3)
    cloud, mask = RdtCloud(RADAR, n_points=50), np.empty((9, 9), bool)
    for slice_, time in zip(volume, times, strict=True):
        mask[:] = slice_
        cloud.push(mask, time)
    np.testing.assert_array_equal(cloud.finish().points, stream(volume, times, 50).finish().points)


def pushed(mask: np.ndarray) -> RdtCloud:
    return stream(mask[None], np.array([1.0]), 5)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: RdtCloud(RADAR).push(np.ones((4, 4)), 0.0), "bool"),
        (lambda: RdtCloud(RADAR).push(np.ones((4, 4), bool), np.nan), "finite"),
        (lambda: stream(np.ones((2, 4, 4), bool), np.array([1.0, 1.0]), 5), "later"),
        (lambda: pushed(np.ones((4, 4), bool)).push(np.ones((4, 5), bool), 2.0), "before it"),
    ],
)
def test_bad_input_is_refused(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


def sample_of(n: int, cuts: list[int], n_rows: int, seed: int = 0) -> UniformSample:
    sample = UniformSample(n_rows, seed, columns=2)
    rows = np.column_stack([np.arange(n), -np.arange(n)]).astype(float)
    for part in np.split(rows, sorted(min(cut, n) for cut in cuts)):
        sample.add(part)
    return sample


@settings(max_examples=50)
@given(
    n=st.integers(0, 60), n_rows=st.integers(1, 40), cuts=st.lists(st.integers(0, 60), max_size=4)
)
def test_rows_are_of_the_stream_without_repeats_however_it_is_cut(
    n: int, n_rows: int, cuts: list[int]
) -> None:
    sample = sample_of(n, cuts, n_rows)
    rows = sample.rows()
    assert sample.n_seen == n
    assert len(rows) == len({*rows[:, 0]}) == min(n, n_rows)
    np.testing.assert_array_equal(rows[:, 0], -rows[:, 1])
    np.testing.assert_array_equal(rows, sample_of(n, [], n_rows).rows())


@given(n=st.integers(0, 20))
def test_filled_repeats_rows_where_there_are_too_few(n: int) -> None:
    filled = sample_of(n, [], 10).filled()
    assert len(filled) == (10 if n else 0)
    assert {*filled[:, 0]} <= set(range(n))


def test_every_row_is_as_likely() -> None:
    counts, first = np.zeros(20), np.zeros(20)
    for seed in range(2000):
        chosen = sample_of(20, [7], 5, seed).rows()[:, 0].astype(int)
        counts[chosen] += 1
        first[chosen[0]] += 1
    # 500 each, standard deviation sqrt(2000 x 1/4 x 3/4) = 19.4: five of them.
    assert np.abs(counts - 500).max() < 97
    # And 100 each come first, standard deviation 9.7: the first part of a sample is a sample.
    assert np.abs(first - 100).max() < 49


@pytest.mark.parametrize(("n_rows", "seed"), [(0, 0), (1.5, 0), (True, 0), (3, -1)])
def test_counts_are_counts(n_rows: object, seed: int) -> None:
    with pytest.raises(InputError, match="whole number"):
        UniformSample(n_rows, seed)  # type: ignore[arg-type]
