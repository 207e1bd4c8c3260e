"""Edges of walls against Kirchhoff's sum over the face, and against walls that end nowhere."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from rtradar.scatter.multipath.image_paths import Face, corners
from rtradar.scatter.multipath.wall_edges import WallEdges
from rtradar.scene import Surface, Wall, material, room_walls

Array = NDArray[np.float64]

WAVELENGTH_M = 0.025
CONDUCTOR = material("perfect-conductor")
ENDLESS_M = 1e6
"""Resolution at which all that edges send arrives together with the rest."""


def wall(name: str = "sheet", **changes: object) -> Wall:
    own = {
        "name": name,
        "corner_m": (0.0, -0.4, 0.7),
        "edge_u_m": (0.0, 0.9, 0.0),
        "edge_v_m": (0.0, 0.0, 0.6),
        "material": CONDUCTOR,
        "thickness_m": 0.01,
    }
    return Wall(**{**own, **changes})  # type: ignore[arg-type]


def box_of(name: str, thickness_m: float) -> tuple[Wall, ...]:
    surface = Surface(material=material(name), thickness_m=thickness_m)
    sides = ("near", "far", "right", "left", "floor", "ceiling")
    return room_walls((6.0, 4.0, 2.5), (-4.0, -2.0), dict.fromkeys(sides, surface))


def kirchhoff(sheet: Wall, source: Array, target: Array) -> complex:
    """Sum over the face, over the straight leg from the source's image: midpoints an eighth wide.

    The mean of both cosines is Kirchhoff's obliquity factor.
    """
    edges = [np.array(edge) for edge in (sheet.edge_u_m, sheet.edge_v_m)]
    steps = [int(np.ceil(8 * np.linalg.norm(edge) / WAVELENGTH_M)) for edge in edges]
    u, v = ((np.indices(steps).reshape(2, -1).T + 0.5) / steps).T
    points = np.array(sheet.corner_m) + u[:, None] * edges[0] + v[:, None] * edges[1]
    wide, high = np.linalg.norm(edges, axis=1)
    here = np.ones(len(points), dtype=bool)
    for left, low, across, up in sheet.openings:
        here &= ~(
            (np.abs(u * wide - left - across / 2) < across / 2)
            & (np.abs(v * high - low - up / 2) < up / 2)
        )
    points, area = points[here], sheet.area_m2 / len(points)
    away = [points - place for place in (source, target)]
    first, last = (np.linalg.norm(one, axis=1) for one in away)
    cosines = sum(
        np.abs(one @ sheet.normal) / size for one, size in zip(away, (first, last), strict=True)
    )
    k = 2 * np.pi / WAVELENGTH_M
    total = (cosines / 2 * np.exp(-1j * k * (first + last)) / (first * last)).sum() * area
    height = (source - np.array(sheet.corner_m)) @ sheet.normal
    straight = float(np.linalg.norm(target - source + 2 * height * sheet.normal))
    return complex(1j * k / (2 * np.pi) * total * straight * np.exp(1j * k * straight))


def over(sheet: Wall, source: Array, targets: Array) -> NDArray[np.complex128]:
    edges = WallEdges([sheet], WAVELENGTH_M, ENDLESS_M)
    return edges.leg((Face(sheet, back=False),), source, targets)[1]


@pytest.mark.parametrize(
    ("source", "start", "stop", "error"),
    [
        # Across one edge, nearly head on, and far from the others.
        ((3.0, 0.05, 1.0), (2.0, 0.0, 1.0), (2.0, 2.6, 1.0), 0.03),
        # At 45 degrees to the face, and not along its edges, by a corner.
        ((2.0, -2.2, 1.4), (1.5, 1.6, 0.4), (1.5, 3.4, 0.6), 0.08),
    ],
)
def test_a_sheet_reflects_as_the_sum_over_its_face(
    source: tuple[float, ...], start: tuple[float, ...], stop: tuple[float, ...], error: float
) -> None:
    sheet = wall()
    targets = np.linspace(start, stop, 13)
    exact = np.array([kirchhoff(sheet, np.array(source), place) for place in targets])
    got = over(sheet, np.array(source), targets)
    # The legs go from the middle of the sheet well into the dark.
    assert abs(exact[0]) > 0.8
    assert abs(exact[-1]) < 0.2
    np.testing.assert_allclose(got, exact, rtol=0, atol=error)


def test_a_sheet_smaller_than_the_zone_reflects_by_its_area() -> None:
    # The zone of legs of 3 m is 19 cm wide: a sheet of 6 cm sends area / (wavelength x 1.5 m).
    small = wall(edge_u_m=(0, 0.06, 0), edge_v_m=(0, 0, 0.06), corner_m=(0, -0.03, 0.97))
    source = np.array([3.0, 0.0, 1.0])
    (got,) = over(small, source, source[None])
    assert abs(got) == pytest.approx(0.06**2 / (WAVELENGTH_M * 1.5), rel=0.01)
    assert got == pytest.approx(kirchhoff(small, source, source), abs=2e-3)


def test_a_doorway_reflects_nothing_and_lets_through_what_the_wall_does_not() -> None:
    door = wall(
        corner_m=(0, -1.0, 0.0),
        edge_u_m=(0, 2.0, 0),
        edge_v_m=(0, 0, 2.0),
        openings=((0.6, 0.3, 0.8, 1.4),),
    )
    source = np.array([2.5, 0.0, 1.0])
    targets = np.linspace((2.0, 0.0, 1.0), (2.0, 1.6, 1.0), 9)
    exact = np.array([kirchhoff(door, source, place) for place in targets])
    np.testing.assert_allclose(over(door, source, targets), exact, rtol=0, atol=0.04)
    mirrored = targets * [-1, 1, 1]
    across, met = WallEdges([door], WAVELENGTH_M, ENDLESS_M).passage(0, source, mirrored)
    assert across.all()
    # What passes meets the same points of the front as what is reflected.
    np.testing.assert_allclose(met, over(door, source, targets), rtol=0, atol=1e-9)


def test_far_from_its_edges_a_wall_is_endless_and_beside_them_not_there() -> None:
    sheet = wall(corner_m=(0, -5, -5), edge_u_m=(0, 10, 0), edge_v_m=(0, 0, 10))
    edges = WallEdges([sheet], WAVELENGTH_M, 0.075)
    leg, source = (Face(sheet, back=False),), np.array([3.0, 0.2, 0.1])
    targets = np.array([[2.0, 1.0, 0.5], [2.0, 14.0, 0.0]])
    np.testing.assert_array_equal(edges.leg(leg, source, targets)[1], [1, 0])
    assert not edges.passage(0, source, targets * [-1, 1, 1])[0][1]


def test_over_the_sweep_an_edge_fades_as_the_mean_of_its_frequencies() -> None:
    # 10 to 14 GHz: the mean over the sweep of the field in the cell of the mirrored leg.
    sheet, source = wall(), np.array([3.0, 0.05, 1.0])
    targets = np.linspace((2.0, 0.3, 1.0), (2.0, 1.6, 1.0), 40)
    leg = (Face(sheet, back=False),)
    whole = [
        WallEdges([sheet], 0.299792458 / ghz, ENDLESS_M).leg(leg, source, targets)[1]
        for ghz in np.linspace(10, 14, 41)
    ]
    resolution_m = 0.299792458 / 4
    got = WallEdges([sheet], WAVELENGTH_M, resolution_m).leg(leg, source, targets)[1]
    np.testing.assert_allclose(got, np.mean(whole, axis=0), rtol=0, atol=0.05)


def test_edges_on_other_walls_are_not_free() -> None:
    box = box_of("plasterboard", 0.0125)
    # One stands on the floor and ends inside the right wall; one floats, one leans on the far wall.
    stands = wall("stands", corner_m=(0, -2.01, 0), edge_u_m=(0, 2, 0), edge_v_m=(0, 0, 2))
    floats = wall("floats", corner_m=(0, 0.5, 1), edge_u_m=(0, 1, 0), edge_v_m=(0, 0, 1))
    edges = WallEdges([*box, stands, floats], WAVELENGTH_M, ENDLESS_M)
    free = [sides[0].free.tolist() for sides in edges._sides]
    assert free[:6] == [[[False, False], [False, False]]] * 6
    assert free[6:] == [[[False, True], [False, True]], [[True, True], [True, True]]]


def test_in_a_box_legs_run_as_between_endless_walls() -> None:
    box = box_of("plasterboard", 0.0125)
    rng = np.random.default_rng(0)
    low, high = np.array([-4.0, -2.0, 0.0]), np.array([2.0, 2.0, 2.5])
    antennas, points = (rng.uniform(low, high, (200, 3)) for _ in range(2))
    edges = WallEdges(box, WAVELENGTH_M, ENDLESS_M)
    for first, second in pairwise(box):
        leg = Face(first, back=False), Face(second, back=False)
        along, valid = corners(leg, antennas, points)
        places, weight = edges.leg(leg, antennas, points)
        np.testing.assert_array_equal(weight, valid)
        for mine, other in zip(places, along, strict=True):
            np.testing.assert_array_equal(mine, other)


def test_walls_that_are_crossed_are_those_that_a_leg_passes_through() -> None:
    box = box_of("concrete", 0.2)
    edges = WallEdges(box, WAVELENGTH_M, ENDLESS_M)
    rng = np.random.default_rng(0)
    source, targets = np.array([0.0, 0.0, 1.0]), rng.uniform(-4, 4, (40, 3))
    for target in targets[:, None]:
        passed = [
            number for number in range(len(box)) if edges.passage(number, source, target)[0].any()
        ]
        # A wall may be missed beside its edges, and its plane be crossed.
        assert set(passed) <= set(edges.crossed(source, target))
    assert WallEdges([], WAVELENGTH_M, ENDLESS_M).crossed(source, targets) == []
