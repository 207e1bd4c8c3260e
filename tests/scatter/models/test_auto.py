"""The level that chooses: what it takes for which tolerance, and that it is that level."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Body
from rtradar.errors import InputError
from rtradar.motion import place
from rtradar.radar import Radar
from rtradar.scatter import account_of, build_model
from rtradar.scatter.models.auto import CANDIDATES, Auto, choose_level, optics_error

RADARS = {name: rt.Radar.preset(name) for name in ("paper-12ghz", "paper-77ghz")}
RADAR = RADARS["paper-12ghz"]
BODY = Body.from_motion(place(rt.synthetic_motion("kick", seed=0, duration_s=0.8)))
LEVELS = list(CANDIDATES)
CHIRPS = np.arange(8)
SMALL = dataclasses.replace(RADAR, tx_y=2, tx_z=0, rx_y=2, rx_z=0)


def narrow(frequency: float) -> Radar:
    """A radar of narrow band that begins at this frequency [Hz]."""
    return dataclasses.replace(SMALL, start_frequency_hz=frequency, bandwidth_hz=0.2e9)


@pytest.mark.parametrize(
    ("radar", "tolerances", "level"),
    [
        ("paper-12ghz", {}, "specular"),
        ("paper-77ghz", {}, "specular"),
        ("paper-12ghz", {"tolerance_db": 0.1}, "physical-optics"),
        ("paper-12ghz", {"tolerance_db": 0.05}, "reference"),
        ("paper-12ghz", {"tolerance_complex": 0.2}, "specular"),
        ("paper-12ghz", {"tolerance_complex": 0.1}, "physical-optics"),
        ("paper-77ghz", {"tolerance_complex": 0.15}, "specular"),
        ("paper-12ghz", {"tolerance_complex": 0.05}, "physical-optics"),
        ("paper-12ghz", {"tolerance_complex": 0.03}, "reference"),
    ],
)
def test_the_cheapest_level_that_will_do_is_taken(
    radar: str, tolerances: dict[str, float], level: str
) -> None:
    given = {"tolerance_db": 0.5, "tolerance_complex": None} | tolerances
    assert choose_level(RADARS[radar], BODY, **given)[0] == level  # type: ignore[arg-type]


@settings(max_examples=60)
@given(
    st.floats(1e9, 300e9),
    st.floats(1e-4, 20.0),
    st.floats(1e-4, 20.0),
    st.none() | st.floats(1e-3, 3.0),
    st.floats(0.0, 1.0),
)
def test_a_tighter_tolerance_never_takes_a_cheaper_level(
    frequency: float, first_db: float, second_db: float, whole: float | None, fraction: float
) -> None:
    radar = narrow(frequency)
    tighter = None if whole is None else max(1e-3, fraction * whole)
    loose, tight = (
        LEVELS.index(choose_level(radar, BODY, *tolerances)[0])
        for tolerances in (
            (max(first_db, second_db), whole),
            (min(first_db, second_db), tighter),
        )
    )
    assert tight >= loose


def test_the_estimate_falls_with_frequency_and_rises_as_parts_shrink() -> None:
    errors = [optics_error(narrow(hz), BODY) for hz in (3e9, 6e9, 12e9, 24e9, 77e9)]
    assert errors == sorted(errors, reverse=True)

    class Small:
        semi_axes = BODY.semi_axes / 20
        part_names, owner = BODY.part_names, BODY.owner

    assert optics_error(RADAR, Small()) > 1.5 * optics_error(RADAR, BODY)  # type: ignore[arg-type]

    class Two:
        """The person, and a small one."""

        semi_axes = np.concatenate([BODY.semi_axes, Small.semi_axes])
        owner = np.concatenate([BODY.owner, BODY.owner + 1])

    assert optics_error(RADAR, Two()) == pytest.approx(optics_error(RADAR, Small()))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("tolerance_db", "level", "scene"),
    [
        (0.5, "specular", None),
        (0.1, "physical-optics", None),
        (0.01, "reference", None),
        (0.5, "specular", "living-room"),
        pytest.param(0.1, "physical-optics", "living-room", marks=pytest.mark.slow),
    ],
)
def test_its_echoes_are_those_of_the_level(
    tolerance_db: float, level: str, scene: str | None
) -> None:
    room = None if scene is None else rt.Scene.load(scene)
    radar = SMALL if room is None else room.place(SMALL)
    chirps = CHIRPS[:2] if level == "reference" else CHIRPS
    model = build_model("auto", radar, BODY, scene=room, tolerance_db=tolerance_db)
    ours = model.echoes(chirps)
    theirs = build_model(level, radar, BODY, scene=room).echoes(chirps)
    for name in ("length", "amplitude", "frequency", "tx", "part", "bounces"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    account = account_of(model)
    assert account is not None
    assert account["ways"][level] == 1.0


def test_the_account_says_all_and_adds_up() -> None:
    model = Auto(RADAR, BODY, tolerance_db=0.1)
    model.echoes(CHIRPS[:2])
    account = model.account()
    assert account["ways"] == {"specular": 0.0, "physical-optics": 1.0, "reference": 0.0}
    assert list(account["why"].values()) == [1.0]
    (why,) = account["why"]
    assert "allowed" in why
    assert f"{optics_error(RADAR, BODY):.3f} by specular" in why
    assert set(account["parts"]) == set(BODY.part_names)
    assert all(ways == account["ways"] for ways in account["parts"].values())


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.2, 0.1, 0.05])
def test_a_complex_tolerance_is_met_by_a_kick(share: float) -> None:
    chirps = (
        np.linspace(3600, 8000, 12).astype(np.int64)[:, None] // 12 * 12 + np.array([0, 5])
    ).ravel()
    found, truth = (
        _field(model, chirps)
        for model in (
            build_model("auto", RADAR, BODY, tolerance_complex=share),
            build_model("reference", RADAR, BODY),
        )
    )
    assert np.sqrt((np.abs(found - truth) ** 2).mean() / (np.abs(truth) ** 2).mean()) < share


def _field(model: Any, chirps: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Received field (chirp, rx) at the middle of the sweep."""
    echoes = model.echoes(chirps)
    at, value = RADAR.centre_frequency_hz, 0j
    for node, frequency in enumerate(echoes.frequency):
        others = np.delete(echoes.frequency, node)
        value = value + echoes.amplitude[node] * np.prod((at - others) / (frequency - others))
    return (np.conj(value) * np.exp(-2j * np.pi * at * echoes.length / 299_792_458.0)).sum(axis=-1)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["tolerance_db", "tolerance_complex"])
def test_bad_tolerances_are_refused_in_one_line(name: str, value: float) -> None:
    with pytest.raises(InputError, match=f"{name} = ") as caught:
        Auto(SMALL, BODY, **{name: value})  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
