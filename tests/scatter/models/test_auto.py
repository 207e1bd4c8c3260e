"""The model that chooses: what it tells beforehand, what it chooses, and what it hands on."""

import dataclasses
import gc
import itertools
import tracemalloc
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import rtradar as rt
from rtradar.antenna import Antenna
from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.errors import InputError
from rtradar.motion import place
from rtradar.radar import Radar
from rtradar.scatter import build_model
from rtradar.scatter.models.auto import Auto
from rtradar.scatter.models.auto_selection import (
    ANALYTIC,
    CANDIDATES,
    FRESNEL,
    LEFT_OUT,
    PHYSICAL_OPTICS,
    REFERENCE,
    SPECULAR,
    ErrorBudget,
    error_budget,
    select_candidates,
)
from rtradar.trace.backends.backend import Backend, select, use
from rtradar.trace.body_tracer import BodyTracer

Array = NDArray[np.float64]
RADAR = rt.Radar.preset("paper-12ghz")
SPHERE = np.full((2, 3), 0.2)


def two_spheres(aside: float) -> Poses:
    """A sphere at the origin, and another 1 m before it, this far beside the line to the radar."""
    ahead = np.asarray(RADAR.position_m) / np.linalg.norm(RADAR.position_m)
    across = np.array([-ahead[1], ahead[0], 0]) / np.hypot(ahead[0], ahead[1])
    centres = np.array([[np.zeros(3), ahead + aside * across]])
    return Poses(centres, np.broadcast_to(np.eye(3), (1, 2, 3, 3)), SPHERE)


def look(radar: Radar, poses: Poses) -> ErrorBudget:
    return error_budget(radar, poses, BodyTracer(use(select("cpu")), poses.semi_axes))


def test_a_sphere_behind_another_counts_as_hidden_and_the_other_in_view() -> None:
    budget = look(RADAR, two_spheres(0.0))
    assert budget.hidden.tolist() == [[True, False]]
    assert budget.in_view.tolist() == [[False, True]]
    assert budget.true[0, 0] == 0
    assert budget.power[0, SPECULAR, 0] == 0
    assert budget.power[0, ANALYTIC, 0] > 0


def test_a_sphere_beside_another_counts_as_in_view() -> None:
    budget = look(RADAR, two_spheres(1.0))
    assert budget.in_view.all()
    # In full view only the near field is left: pi a^2 / (R1 R2)^2 with R to the specular point, by
    # both ways.
    distance = np.linalg.norm(np.asarray(RADAR.position_m)) - 0.2
    assert budget.power[0, ANALYTIC, 0] == pytest.approx(np.pi * 0.2**2 / distance**4, rel=0.02)
    assert budget.true[0, 0] == pytest.approx(
        np.pi * 0.2**2 / (distance**2 * (distance + 0.2) ** 2), rel=0.02
    )
    assert budget.wrong[0, SPECULAR, 0] == 0


def test_a_part_counts_by_what_the_antennas_let_through_of_it() -> None:
    poses = two_spheres(1.0)
    beam = dataclasses.replace(RADAR, tx_antenna=Antenna(pattern="cosine", exponent=9.0))
    budget, plain = (look(radar, poses) for radar in (beam, RADAR))
    way = poses.centres[0] - np.asarray(RADAR.position_m)
    # By the directions of the centres; those of the specular points lie up to a degree beside them.
    expected = (way[:, 0] / np.linalg.norm(way, axis=1)) ** 9
    for name in ("true", "wrong", "optics", "power"):
        before, after = getattr(plain, name)[0], getattr(budget, name)[0]
        np.testing.assert_allclose(after, before * expected, rtol=0.05, err_msg=name)


def test_half_behind_an_edge_a_quarter_of_the_power_is_left_and_specular_errs_by_half() -> None:
    # Seen from 4.2 m, the edge of a sphere of 0.2 m that is 1 m nearer touches the line to the
    # middle of the far one.
    distance = np.linalg.norm(np.asarray(RADAR.position_m))
    # sin of the angle between both is that of the edge, 0.2 / distance of the nearer centre: a
    # right triangle.
    near = distance - 1.0
    budget = look(RADAR, two_spheres(0.2 * near / np.sqrt(near**2 - 0.2**2)))
    free = np.pi * 0.2**2 / ((distance - 0.2) ** 2 * distance**2)
    # A curved edge leaves a little more or less than the straight one's half of the field.
    assert np.sqrt(budget.true[0, 0] / free) == pytest.approx(0.5, abs=0.1)
    assert np.sqrt(budget.wrong[0, SPECULAR, 0] / free) == pytest.approx(0.5, abs=0.1)
    assert budget.wrong[0, FRESNEL, 0] < 0.01 * free


def budget_of(
    wrong: list[list[float]], true: list[float], hidden: list[bool] | None = None
) -> ErrorBudget:
    """One instant: ``wrong`` a part, without reference; powers are off by nothing."""
    squares = np.zeros((1, len(CANDIDATES), len(true)))
    for part, row in enumerate(wrong):
        squares[0, : len(row), part] = row
    power = np.repeat(np.array(true)[None, None], len(CANDIDATES), axis=1)
    return ErrorBudget(
        true=np.array([true]),
        power=power,
        wrong=squares,
        optics=np.zeros_like(squares),
        in_view=np.ones((1, len(true)), dtype=bool),
        hidden=np.array([hidden or [False] * len(true)]),
    )


def test_the_cheapest_way_that_will_do_is_chosen_for_each_part() -> None:
    #                        left out, analytic, specular, fresnel, physical-optics
    budget = budget_of(
        [[1, 1e-6, 1e-6, 1e-6, 1e-6], [1, 0.5, 1e-6, 1e-6, 1e-6], [1, 0.5, 0.5, 1e-6, 1e-6]],
        [1, 1, 1],
    )
    assert select_candidates(budget, 10.0, 0.1).tolist() == [[ANALYTIC, SPECULAR, FRESNEL]]
    assert select_candidates(budget, 10.0, 1.0).tolist() == [[ANALYTIC, ANALYTIC, ANALYTIC]]


def test_what_needs_facets_brings_the_edges_along_and_nothing_less_than_all_is_the_reference() -> (
    None
):
    budget = budget_of([[1, 0.5, 0.5, 0.5, 1e-6], [1, 0.5, 0.5, 1e-6, 1e-6]], [1, 1])
    assert select_candidates(budget, 10.0, 0.1).tolist() == [[PHYSICAL_OPTICS, PHYSICAL_OPTICS]]
    budget = budget_of([[1, 0.5, 0.5, 0.5, 0.5]], [1])
    assert select_candidates(budget, 10.0, 0.1).tolist() == [[REFERENCE]]


def test_only_what_is_hidden_is_left_out_and_not_where_it_is_seen_next() -> None:
    budget = budget_of([[1e-6, 1e-6], [1e-6, 1e-6]], [1, 1], [True, False])
    assert select_candidates(budget, 10.0, None).tolist() == [[LEFT_OUT, ANALYTIC]]
    seen = budget._replace(hidden=np.array([[False, False]]))
    both = ErrorBudget(
        *(
            np.concatenate([np.asarray(a), np.asarray(a), np.asarray(b)])
            for a, b in zip(budget, seen, strict=True)
        )
    )
    assert select_candidates(both, 10.0, None)[:, 0].tolist() == [LEFT_OUT, ANALYTIC, ANALYTIC]


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(0.001, 0.5), st.floats(0.001, 0.5))
def test_what_is_chosen_keeps_the_tolerances_that_were_error_budget(
    seed: int, power_fraction: float, complex_fraction: float
) -> None:
    rng = np.random.default_rng(seed)
    true = rng.random((5, 6))
    scale = np.array([1, 0.3, 0.1, 0.03, 0.01, 0])[:, None]
    budget = ErrorBudget(
        true=true,
        power=true[:, None] * (1 + scale * rng.normal(size=(5, len(CANDIDATES), 6))),
        wrong=true[:, None] * (scale * rng.random((5, len(CANDIDATES), 6))) ** 2,
        optics=np.zeros((5, len(CANDIDATES), 6)),
        in_view=np.zeros((5, 6), dtype=bool),
        hidden=rng.random((5, 6)) < 0.1,
    )
    chosen = select_candidates(budget, power_fraction, complex_fraction)[:, None]
    whole = true.sum(axis=1)
    wrong = np.take_along_axis(budget.wrong, chosen, axis=1).sum(axis=(1, 2))
    power = np.take_along_axis(budget.power, chosen, axis=1).sum(axis=(1, 2))
    assert (wrong <= complex_fraction**2 * whole * (1 + 1e-9)).all()
    assert (np.abs(power - whole) <= power_fraction * whole * (1 + 1e-9)).all()
    assert (budget.hidden | (chosen[:, 0] > LEFT_OUT)).all()


@dataclass(frozen=True)
class Passing:
    """A large sphere that passes before a small one, at 2 m/s."""

    duration_s: float = 0.4
    part_names: tuple[str, ...] = ("target", "curtain")
    semi_axes: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.semi_axes is None:
            object.__setattr__(self, "semi_axes", np.array([[0.1, 0.1, 0.1], [0.25, 0.25, 0.25]]))

    @property
    def owner(self) -> NDArray[np.int64]:
        return np.zeros(len(self.semi_axes), dtype=np.int64)

    def at(self, times: Array) -> Poses:
        y = 2.0 * (np.asarray(times) - 0.1)
        n = len(self.semi_axes)
        centres = np.zeros((len(y), n, 3))
        centres[:, 1:, 0], centres[:, 1:, 1] = -0.5, y[:, None]
        return Poses(centres, np.broadcast_to(np.eye(3), (len(y), n, 3, 3)), self.semi_axes)


def passing_radar() -> Radar:
    return Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, chirp_duration_s=1e-3, position_m=(-4.0, 0.0, 0.0))


def test_with_nothing_hidden_and_a_wide_tolerance_it_is_analytic() -> None:
    body = Body.from_motion(place(rt.synthetic_motion("jumping_jack", seed=0, duration_s=0.5)))
    model = build_model("auto", RADAR, body, tolerance_db=10.0)
    chirps = np.arange(0, 48)
    ours, theirs = model.echoes(chirps), build_model("analytic", RADAR, body).echoes(chirps)
    np.testing.assert_array_equal(ours.part, theirs.part)
    np.testing.assert_array_equal(ours.length, theirs.length)
    np.testing.assert_allclose(ours.amplitude, theirs.amplitude, rtol=1e-12)


def test_nothing_is_loaded_where_no_part_comes_near_a_line_of_sight() -> None:
    alone = Passing(part_names=("target",), semi_axes=np.full((1, 3), 0.1))
    model = Auto(passing_radar(), alone, tolerance_db=10.0)  # type: ignore[arg-type]
    assert model.echoes(np.arange(3)).part.tolist() == [0]
    assert model.variant is None


def test_a_hidden_part_has_no_echo_and_fades_in_smoothly(backend: Backend) -> None:
    model = Auto(passing_radar(), Passing(), variant=backend.kind, tolerance_db=0.1)  # type: ignore[arg-type]
    assert model.echoes(np.array([100])).part.tolist() == [1]
    strength = [
        np.abs(model.echoes(np.array([chirp])).amplitude[0, 0, 0]) for chirp in range(100, 400)
    ]
    parts = [model.echoes(np.array([chirp])).part for chirp in range(100, 400)]
    target = np.array([power[part == 0].sum() for power, part in zip(strength, parts, strict=True)])
    assert target[0] == 0
    assert target[-1] == pytest.approx(np.sqrt(np.pi) * 0.1 / 3.9**2, rel=0.05)
    # The edge passes in some 40 ms: from one millisecond to the next never more than a tenth.
    assert np.abs(np.diff(target)).max() < 0.1 * target[-1]


def test_the_account_says_all_and_adds_up(backend: Backend) -> None:
    model = Auto(passing_radar(), Passing(), variant=backend.kind, tolerance_db=0.1)  # type: ignore[arg-type]
    model.echoes(np.arange(0, 400, 10))
    account = model.account()
    assert sum(account["ways"].values()) == pytest.approx(1)
    assert sum(account["why"].values()) == pytest.approx(1)
    assert account["ways"]["left-out"] == account["why"]["left out: hidden"] > 0
    assert account["why"]["higher: cut by an edge"] > 0
    assert account["parts"]["curtain"]["left-out"] == 0
    for ways in account["parts"].values():
        assert sum(ways.values()) == pytest.approx(1)


@dataclass(frozen=True)
class Swinging(Passing):
    """The same, to and fro for minutes."""

    duration_s: float = 100.0

    def at(self, times: Array) -> Poses:
        return super().at(0.1 + 0.2 * np.sin(2 * np.pi * np.asarray(times) / 4))


def _bytes_of_arrays() -> int:
    """Bytes of all NumPy arrays that live: Python's own tables and free lists vary by chance."""
    of_arrays = tracemalloc.DomainFilter(inclusive=True, domain=np.lib.tracemalloc_domain)
    traces = tracemalloc.take_snapshot().filter_traces([of_arrays]).traces
    return sum(trace.size for trace in traces)


@pytest.mark.slow
def test_what_is_kept_does_not_grow_with_the_capture() -> None:
    model = Auto(passing_radar(), Swinging(), tolerance_db=10.0)  # type: ignore[arg-type]
    held, first_pass = [], {}
    tracemalloc.start()
    try:
        for _ in range(2):  # power, then the signal
            for begin in range(0, 64_000, 800):  # 1 ms each
                model.echoes(np.array([begin]))
                if begin in (30_400, 63_200):
                    gc.collect()
                    held.append(_bytes_of_arrays())
            first_pass = first_pass or model.account()
    finally:
        tracemalloc.stop()
    # 33 s more, and all of it again: not a byte. To keep every chunk that was looked ahead would
    # double it.
    assert held[1:] == held[:1] * 3
    # Nothing counts twice.
    assert model.account() == first_pass
    assert 0 < first_pass["ways"]["left-out"] < 1


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.2, 0.1, 0.05])
def test_a_complex_tolerance_is_met_by_a_kick(share: float) -> None:
    body = Body.from_motion(place(rt.synthetic_motion("kick", seed=0, duration_s=0.8)))
    chirps = (
        np.linspace(3600, 8000, 12).astype(np.int64)[:, None] // 12 * 12 + np.array([0, 5])
    ).ravel()
    found, truth = (
        _field(model, chirps)
        for model in (
            build_model("auto", RADAR, body, tolerance_complex=share),
            build_model("reference", RADAR, body),
        )
    )
    assert np.sqrt((np.abs(found - truth) ** 2).mean() / (np.abs(truth) ** 2).mean()) < share


def _field(model: object, chirps: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Received field (chirp, rx) at the middle of the sweep."""
    echoes = model.echoes(chirps)  # type: ignore[attr-defined]
    at, value = RADAR.centre_frequency_hz, 0j
    for node, frequency in enumerate(echoes.frequency):
        others = np.delete(echoes.frequency, node)
        value = value + echoes.amplitude[node] * np.prod((at - others) / (frequency - others))
    return (np.conj(value) * np.exp(-2j * np.pi * at * echoes.length / 299_792_458.0)).sum(axis=-1)


def test_bad_tolerances_are_refused_in_one_line() -> None:
    for model_options, word in itertools.chain(
        (
            ({"tolerance_db": value}, "tolerance_db")
            for value in (0.0, -1.0, float("nan"), float("inf"))
        ),
        (
            ({"tolerance_complex": value}, "tolerance_complex")
            for value in (0.0, -0.1, float("nan"))
        ),
    ):
        with pytest.raises(InputError, match=word) as caught:
            Auto(passing_radar(), Passing(), **model_options)  # type: ignore[arg-type]
        assert "\n" not in str(caught.value)
