"""Echoes in Python, against the closed form of a sphere, the IF samples, and two levels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.errors import InputError
from rtradar.pipeline.output.truth import CYCLES_COMPARED

RADAR = replace(rt.Radar.preset("paper-12ghz"), tx_y=2, tx_z=0, rx_y=3, rx_z=0)
KICK = rt.synthetic_motion("kick", duration_s=0.5)


def test_each_echo_has_its_chirp_receiver_part_path_and_person() -> None:
    people = [rt.Person(KICK, (0.0, 0.6)), rt.Person(KICK, (0.5, -0.6))]
    capture = rt.simulate(people, RADAR, duration_s=0.2, fidelity="specular")
    echoes = capture.echoes(start_s=0.05, duration_s=0.01)
    assert echoes["length_m"].dims == ("chirp", "rx", "echo")
    times = echoes["time"].values
    assert 0.05 <= times.min() < 0.05 + RADAR.chirp_interval_s
    assert 0.06 - RADAR.chirp_interval_s <= times.max() < 0.06
    np.testing.assert_array_equal(echoes["tx"], RADAR.tx_of_chirp(echoes["chirp"].values))
    assert set(echoes["person"].values.tolist()) == {0, 1}
    assert set(echoes["path"].values.tolist()) == {"body"}
    assert len(set(echoes["part"].values.tolist())) == 42
    assert echoes["visible"].dtype == bool
    np.testing.assert_array_equal(echoes["visible"], echoes["amplitude"] != 0)
    assert 0.5 < float(echoes["visible"].mean()) < 1


def test_they_are_those_that_make_the_samples() -> None:
    """A sum of beats, sample by sample, in the middle of a chirp."""
    capture = rt.simulate(KICK, RADAR, duration_s=0.2, fidelity="specular", snr_db=float("inf"))
    echoes, samples = capture.echoes(duration_s=0.02), capture.samples
    tau = echoes["length_m"].values[..., None] / 299_792_458.0
    t = samples["fast_time"].values
    start_hz, slope = RADAR.start_frequency_hz, RADAR.slope_hz_per_s
    beat = np.exp(2j * np.pi * (start_hz * tau + slope * tau * t - slope * tau**2 / 2))
    expected = (echoes["amplitude"].values[..., None] * beat).sum(axis=2)
    found = samples.values[: len(expected)]
    # Single precision of the samples.
    assert np.abs(found - expected).max() < 2e-5 * np.abs(expected).max()


def test_in_a_room_the_walls_name_the_paths(beside_a_wall: tuple[rt.Radar, rt.Scene]) -> None:
    capture = rt.simulate(KICK, *beside_a_wall, duration_s=0.2, keep_all=True, fidelity="specular")
    echoes = capture.echoes(duration_s=0.001)
    assert {"body", "left > body", "body > left"} <= set(echoes["path"].values.tolist())
    # A way over the wall is longer than the direct one of the same part.
    part = echoes["part"].values[0]
    own = echoes.isel(chirp=0, rx=0, echo=echoes["part"].values == part)
    by_path = dict(zip(own["path"].values.tolist(), own["length_m"].values.tolist(), strict=False))
    assert by_path["left > body"] > by_path["body"]


def test_no_chirp_and_too_many_are_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    capture = rt.simulate(KICK, RADAR, duration_s=0.2, fidelity="analytic")
    with pytest.raises(InputError, match=r"^[^\n]*no chirp is between start_s = 3\.0[^\n]*$"):
        capture.echoes(start_s=3.0)
    monkeypatch.setattr("rtradar.pipeline.processing.MEMORY_LIMIT_BYTES", 1_000_000)
    with pytest.raises(InputError, match=r"take them for a shorter time \(start_s, duration_s\)"):
        capture.echoes()


def test_two_levels_are_compared_part_by_part(tmp_path: Path) -> None:
    levels = ("analytic", "specular")
    out = tmp_path / "out"
    echoes = rt.compare(KICK, RADAR, out=out, fidelities=levels, duration_s=0.15).echoes
    assert echoes["field_m"].dims == ("fidelity", "chirp", "rx", "part")
    assert echoes.sizes["chirp"] == CYCLES_COMPARED * RADAR.n_tx
    assert echoes.attrs["reference"] == "specular"
    own, other = (echoes.sel(fidelity=level) for level in ("specular", "analytic"))
    assert (own["field_difference_m"] == 0).all()
    np.testing.assert_array_equal(other["field_m"] - own["field_m"], other["field_difference_m"])
    # The far-field formula's range is off by less than a centimetre, where both see a part.
    both = np.isfinite(other["length_difference_m"].values)
    assert both.any()
    assert np.abs(other["length_difference_m"].values[both]).max() < 0.02


@pytest.mark.slow
def test_several_recordings_have_no_echoes_of_their_own(small: rt.Radar, tmp_path: Path) -> None:
    several = rt.pipeline.compare_recordings(
        [KICK, rt.synthetic_motion("walk", duration_s=0.5)],
        small,
        out=tmp_path / "out",
        fidelities=("analytic-paper", "analytic"),
        duration_s=0.15,
    )
    with pytest.raises(InputError, match="of one recording"):
        several.echoes  # noqa: B018
