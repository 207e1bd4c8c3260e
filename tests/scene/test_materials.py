"""Materials: the figures of the Recommendation and of Gabriel, their limits, and one's own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtradar.errors import InputError
from rtradar.scene.materials import MATERIALS, VACUUM_PERMITTIVITY_FPM, material, own_material

ROOMS = (12e9, 16e9, 77e9, 81e9)


def conductivity(name: str, frequency_hz: float) -> float:
    return float(
        -material(name).eta(frequency_hz).imag * 2 * np.pi * frequency_hz * VACUUM_PERMITTIVITY_FPM
    )


@pytest.mark.parametrize(
    ("name", "ghz", "permittivity", "sigma"),
    [
        # By hand from table 3 of ITU-R P.2040-3: 0.0462 x 10^0.7822 and so on.
        ("vacuum", 10, 1.0, 0.0),
        ("concrete", 10, 5.24, 0.27981),
        ("brick", 10, 3.91, 0.034401),
        ("plasterboard", 10, 2.73, 0.073947),
        ("wood", 10, 1.99, 0.055452),
        ("glass", 10, 6.31, 0.078652),
        ("glass", 220, 5.79, 3.0605),
        ("ceiling-board", 10, 1.48, 0.013073),
        ("ceiling-board", 450, 1.52, 1.5580),
        ("chipboard", 10, 2.58, 0.13075),
        ("plywood", 10, 2.71, 0.33),
        ("marble", 10, 7.074, 0.046405),
        ("floorboard", 77, 3.66, 1.5597),
        ("metal", 10, 1.0, 1e7),
        ("very-dry-ground", 10, 3.0, 0.049670),
        ("medium-dry-ground", 10, 11.915, 1.4930),
        ("wet-ground", 10, 11.943, 2.9929),
    ],
)
def test_figures_of_the_recommendation(
    name: str, ghz: float, permittivity: float, sigma: float
) -> None:
    # Five digits are written above.
    assert material(name).eta(ghz * 1e9).real == pytest.approx(permittivity, rel=5e-5)
    assert conductivity(name, ghz * 1e9) == pytest.approx(sigma, rel=5e-5)


@pytest.mark.parametrize(
    ("ghz", "permittivity", "sigma"),
    # Tissue tables of IFAC-CNR after Gabriel et al. 1996, "Skin (Dry)"; 60 GHz also in Wu et al.
    # 2015: 7.98 - j 10.90.
    [(1.0, 40.94, 0.900), (2.45, 38.01, 1.464), (10.0, 31.29, 8.014), (60.0, 7.98, 36.40)],
)
def test_skin_against_published_figures(ghz: float, permittivity: float, sigma: float) -> None:
    # The tables are rounded to three or four digits.
    assert material("skin").eta(ghz * 1e9).real == pytest.approx(permittivity, rel=1e-3)
    assert conductivity("skin", ghz * 1e9) == pytest.approx(sigma, rel=1e-3)


@pytest.mark.parametrize(
    ("khz", "permittivity", "sigma"),
    # Table 3 of doi:10.1186/s12938-018-0473-9, dry skin after Gabriel: slower than radars, so the
    # law itself is asked.
    [
        (10, 1133.6, 0.00020),
        (100, 1119.2, 0.00045),
        (200, 1104.8, 0.00105),
        (400, 1076.3, 0.00305),
        (1000, 990.76, 0.0132),
    ],
)
def test_slow_terms_of_skin_against_published_figures(
    khz: float, permittivity: float, sigma: float
) -> None:
    eta = material("skin").bands[0].eta(np.array(khz * 1e3))
    assert eta.real == pytest.approx(permittivity, abs=0.06)  # as the table is rounded
    assert -eta.imag * 2 * np.pi * khz * 1e3 * VACUUM_PERMITTIVITY_FPM == pytest.approx(
        sigma, rel=0.03, abs=1e-7
    )


def test_imaginary_part_by_the_rule_of_the_recommendation() -> None:
    # eta = eps_r - j 17.98 sigma / f, where 17.98 stands for 17.975.
    assert material("concrete").eta(60e9) == pytest.approx(
        5.24 - 1j * 17.98 * 0.0462 * 60**0.7822 / 60, rel=2e-5
    )


@pytest.mark.parametrize("name", sorted(MATERIALS))
def test_no_material_makes_waves_grow(name: str) -> None:
    held = MATERIALS[name]
    frequency = np.geomspace(1e6, 500e9, 400)
    frequency = frequency[held.holds(frequency)]
    assert len(frequency) > 10
    eta = held.eta(frequency)
    assert np.all(eta.imag <= 0)
    assert name == "perfect-conductor" or np.all(eta.real >= 1)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("brick", 1e9, 40e9),
        ("marble", 1e9, 60e9),
        ("floorboard", 50e9, 100e9),
        ("wet-ground", 1e9, 10e9),
        ("skin", 1e9, 100e9),
    ],
)
def test_limits_belong_to_it_and_nothing_beyond(name: str, low: float, high: float) -> None:
    assert np.isfinite(material(name).eta([low, high])).all()
    for outside in (low * 0.999, high * 1.001):
        with pytest.raises(InputError, match=f"material '{name}' at "):
            material(name).eta([low, outside])


def test_refusal_names_limits_and_what_would_do() -> None:
    with pytest.raises(InputError) as caught:
        material("brick").eta(77e9)
    message = str(caught.value)
    assert "\n" not in message
    assert "'brick' at 77 GHz" in message
    assert "1 to 40 GHz" in message
    known = message.split("known there: ")[1]
    assert "concrete" in known
    assert "plywood" not in known


def test_between_two_bands_there_is_nothing() -> None:
    with pytest.raises(InputError, match=r"0\.1 to 100 GHz and 220 to 450 GHz"):
        material("glass").eta(150e9)


@pytest.mark.parametrize("frequency", [0.0, -1e9, np.nan, np.inf])
def test_frequencies_without_meaning(frequency: float) -> None:
    with pytest.raises(InputError):
        material("concrete").eta(frequency)


def test_shapes_stay() -> None:
    frequency = np.linspace(12e9, 16e9, 6).reshape(2, 3)
    assert material("skin").eta(frequency).shape == (2, 3)
    assert material("skin").eta(12e9).shape == ()
    assert material("glass").eta(frequency)[1, 2] == material("glass").eta(16e9)


def test_conductors() -> None:
    assert [name for name in MATERIALS if MATERIALS[name].conducts] == [
        "metal",
        "perfect-conductor",
    ]
    assert np.isinf(material("perfect-conductor").eta(ROOMS)).all()


@pytest.mark.parametrize("name", ["Concrete", "", "brik", 3])
def test_unknown_material(name: Any) -> None:
    with pytest.raises(InputError, match="is unknown; allowed: brick, ceiling-board, "):
        material(name)


def test_own_material_is_a_power_law() -> None:
    mine = own_material(
        "old brick",
        source="measured by us",
        low_hz=70e9,
        high_hz=90e9,
        a=4.0,
        b=-0.1,
        c=0.02,
        d=0.5,
    )
    assert mine.eta(80e9).real == pytest.approx(4 * 80**-0.1)
    assert mine.source == "measured by us"
    assert not mine.conducts
    with pytest.raises(
        InputError, match="'old brick' at 60 GHz: measured by us gives it for 70 to 90 GHz"
    ):
        mine.eta(60e9)


GOOD = {"source": "here", "low_hz": 1e9, "high_hz": 2e9, "a": 4.0}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("source", ""),
        ("low_hz", 0),
        ("high_hz", 0.5e9),
        ("a", 0.5),
        ("b", -1.0),
        ("d", 10**400),
    ],
)
def test_own_material_without_meaning(key: str, value: Any) -> None:
    constants: dict[str, Any] = (
        {**GOOD, "b": 1.0, key: value} if key == "b" and value > 0 else {**GOOD, key: value}
    )
    if key == "b":
        constants["high_hz"] = 80e9  # 4 f^-1 falls below 1 there
    with pytest.raises(InputError) as caught:
        own_material("mine", **constants)
    assert "\n" not in str(caught.value)
    assert "'mine'" in str(caught.value)


def test_own_material_cannot_take_a_known_name() -> None:
    with pytest.raises(InputError, match=r"belongs to ITU-R P.2040-3"):
        own_material("brick", **GOOD)


@given(
    name=st.text(max_size=5),
    values=st.fixed_dictionaries(
        {
            key: st.one_of(st.floats(), st.integers(), st.text(max_size=3), st.none(), st.just(1e9))
            for key in ("source", "low_hz", "high_hz", "a", "b", "c", "d")
        }
    ),
)
def test_anything_gives_a_material_or_one_line(name: str, values: dict[str, Any]) -> None:
    try:
        made = own_material(name, **values)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017  both ways out are right
    else:
        assert np.all(made.eta([made.bands[0].low_hz, made.bands[0].high_hz]).imag <= 0)
