"""The pass before the signal: echo power by hand, and what it refuses or warns of."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.echoes import Echoes
from rtradar.errors import InputError, ValidityWarning
from rtradar.radar import Radar
from rtradar.scatter import build_model
from rtradar.scatter.link_budget import LinkBudget, link_budget, power_of_parts_alone

Array = NDArray[np.float64]

RADAR = Radar(tx_y=2, tx_z=0, rx_y=2, rx_z=0, chirp_duration_s=1e-3, position_m=(-4.0, 0.0, 1.0))
N_CHIRPS = 200


@dataclass(frozen=True)
class Balls:
    """A ball and a needle's tip toward the radar, moving along x at ``speed`` from ``place``."""

    place: tuple[float, float, float] = (0.0, 0.0, 1.0)
    speed: float = 0.0
    semi_axes: Array = dataclasses.field(
        default_factory=lambda: np.array([[0.2, 0.2, 0.2], [0.01, 0.01, 0.1]])
    )
    duration_s: float = 0.2
    part_names: tuple[str, ...] = ("ball", "needle")
    names: tuple[str, ...] = ("somebody",)
    owner: NDArray[np.int64] = dataclasses.field(default_factory=lambda: np.zeros(2, np.int64))
    materials: tuple[str, ...] = ("perfect-conductor",) * 2

    def at(self, times: Array) -> Poses:
        centres = np.tile(np.asarray(self.place), (len(times), 2, 1))
        centres[..., 0] += self.speed * np.asarray(times)[:, None]
        centres[:, 1, 1] += 0.5
        along_x = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])  # the needle's c points along x
        return Poses(
            centres,
            np.broadcast_to(np.stack([np.eye(3), along_x]), (len(times), 2, 3, 3)),
            self.semi_axes,
        )


@dataclass(frozen=True)
class Silence:
    """A model of a body that nobody sees."""

    variant: str | None = None

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        shape = (len(chirps), 2, 2)
        return Echoes(
            length=np.full(shape, 8.0),
            amplitude=np.zeros((1, *shape)),
            frequency=np.array([14e9]),
            tx=chirps % 2,
            part=np.arange(2),
            bounces=np.ones(2, dtype=np.int64),
        )


def look(body: Balls, radar: Radar = RADAR, *, spreading: bool = True) -> LinkBudget:
    model = build_model("analytic", radar, body, spreading=spreading)  # type: ignore[arg-type]
    return link_budget(model, radar, body, N_CHIRPS, spreading=spreading)  # type: ignore[arg-type]


def test_power_is_that_of_the_spheres_by_hand() -> None:
    balls = dataclasses.replace(Balls(), semi_axes=np.array([[0.2, 0.2, 0.2], [0.1, 0.1, 0.1]]))
    found = look(balls)
    # pi a^2 over (R - a)^4 of each; antennas within 2 % of 4 m.
    ball = math.pi * 0.2**2 / 3.8**4
    other = math.pi * 0.1**2 / (math.hypot(4, 0.5) - 0.1) ** 4
    assert found.visible
    assert found.power == pytest.approx(ball + other, rel=1e-2)
    assert found.part_power == pytest.approx({"ball": ball, "needle": other}, rel=1e-2)
    assert sum(found.part_power.values()) == pytest.approx(found.power, rel=1e-12)
    assert found.limits == ()
    np.testing.assert_allclose(found.times, 0.5e-3 + 0.01 * np.arange(20))
    assert found.power_at.sum() / 20 == pytest.approx(found.power, rel=1e-12)
    plain = look(balls, spreading=False)
    assert plain.power == pytest.approx(math.pi * (0.2**2 + 0.1**2), rel=1e-9)


def test_a_small_share_of_small_curvature_is_counted_without_a_warning() -> None:
    (limit,) = look(Balls()).limits  # warnings are errors in tests
    # A needle's tip has radius a^2 / c = 1 mm and cross-section pi times its square; the ball's is
    # pi (0.2 m)^2.
    assert limit.name == "small_curvature"
    assert limit.share == pytest.approx((1e-3 / 0.2) ** 2, rel=0.3)
    assert "needle" in limit.message
    assert "ball" not in limit.message


def test_a_large_share_is_warned_of() -> None:
    with pytest.warns(ValidityWarning, match=r"100% of the echo power .*ball, needle"):
        found = look(dataclasses.replace(Balls(), semi_axes=np.full((2, 3), 0.01)))
    assert [limit.share for limit in found.limits] == [pytest.approx(1.0)]


def test_what_is_faster_than_the_radar_can_tell_is_warned_of() -> None:
    assert RADAR.max_velocity_mps == pytest.approx(2.677, abs=1e-3)
    plump = dataclasses.replace(Balls(), semi_axes=np.full((2, 3), 0.1))
    assert look(dataclasses.replace(plump, speed=2.6)).limits == ()
    for speed in (2.8, -2.8):
        with pytest.warns(ValidityWarning, match=r"faster than the unambiguous 2\.68 m/s"):
            (limit,) = look(dataclasses.replace(plump, speed=speed)).limits
        assert limit.name == "velocity_ambiguous"
        assert (
            limit.share > 0.4
        )  # the ball straight ahead; the other one's range rate is 0.8 % less


def test_what_shows_at_another_velocity_shows_in_another_direction_too() -> None:
    # By hand: two Tx four wavelengths of 12 GHz apart that take turns, and a wavelength of 14 GHz:
    # a sine of 12 / 14 / 8.
    fast = dataclasses.replace(Balls(), semi_axes=np.full((2, 3), 0.1), speed=2.8)
    with pytest.warns(
        ValidityWarning, match=r"at another velocity and, ahead, 6\.2 degrees beside its direction"
    ):
        look(fast)
    # One Tx alone turns all of its channels alike, and Tx at once are not turned at all.
    for radar in (
        dataclasses.replace(RADAR, tx_y=1, chirp_duration_s=2e-3),
        dataclasses.replace(RADAR, multiplexing="fdm"),
    ):
        quick = dataclasses.replace(fast, speed=1.05 * radar.max_velocity_mps)
        with pytest.warns(ValidityWarning, match="at another velocity$"):
            look(quick, radar)


def test_what_is_out_of_range_is_counted_and_refused_where_it_is_all() -> None:
    plump = dataclasses.replace(Balls(), semi_axes=np.full((2, 3), 0.1))
    edge = (
        RADAR.max_range_m - 4.0
    )  # the ball's near side reaches the range bins; the other one is farther
    with pytest.warns(ValidityWarning, match=r"beyond 9\.59 m"):
        (limit,) = look(dataclasses.replace(plump, place=(edge + 0.09, 0.0, 1.0))).limits
    assert limit.name == "beyond_range"
    assert limit.share == pytest.approx(0.5, abs=0.05)
    with pytest.raises(InputError, match=r"never within the range of radar 'custom', 9\.59 m"):
        look(dataclasses.replace(plump, place=(edge + 1.0, 0.0, 1.0)))


@pytest.mark.parametrize(("gap", "said"), [(0.28, "0.2[89]"), (0.0, "0.0[01]"), (-0.1, "0.00")])
def test_a_part_near_an_antenna_is_refused_by_its_name(gap: float, said: str) -> None:
    # Antennas stand up to 5 cm off the line to the ball: up to 1 cm farther from it.
    body = dataclasses.replace(Balls(), place=(-4.0 + 0.2 + gap, 0.0, 1.0))
    with pytest.raises(
        InputError, match=rf"at 0\.00 s the ball is {said} m from an antenna .*at least 0\.3 m"
    ):
        look(body)


def test_farther_than_that_is_allowed() -> None:
    assert look(dataclasses.replace(Balls(), place=(-4.0 + 0.2 + 0.31, 0.0, 1.0))).visible


@pytest.mark.parametrize("spreading", [True, False])
def test_nobody_visible_is_measured_against_a_square_metre_at_the_origin(spreading: bool) -> None:
    body: Body = Balls()  # type: ignore[assignment]
    with pytest.warns(ValidityWarning, match="nobody is visible"):
        found = link_budget(Silence(), RADAR, body, N_CHIRPS, spreading=spreading)
    assert not found.visible
    assert not found.power_at.any()
    assert found.power == pytest.approx(
        17**-2 if spreading else 1.0
    )  # the radar stands sqrt(17) m from the origin


def test_what_another_part_hides_is_counted() -> None:
    # The needle stands 1 m behind the ball, in its shadow from every antenna.
    @dataclass(frozen=True)
    class Behind(Balls):
        def at(self, times: Array) -> Poses:
            poses = super().at(times)
            poses.centres[:, 1] = poses.centres[:, 0] + [1.0, 0, 0]
            return poses

    body = dataclasses.replace(Behind(), semi_axes=np.array([[0.3, 0.3, 0.3], [0.1, 0.1, 0.1]]))
    model = build_model("specular", RADAR, body)  # type: ignore[arg-type]
    found = link_budget(model, RADAR, body, N_CHIRPS)  # type: ignore[arg-type]
    alone = power_of_parts_alone(partial(build_model, "specular", RADAR), RADAR, body, N_CHIRPS)
    np.testing.assert_allclose(found.power_at[:, 0], alone[:, 0], rtol=1e-12)
    assert found.part_power["needle"] == 0 < alone[:, 1].min()
