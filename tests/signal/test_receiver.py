"""What a receiver adds: no division into blocks changes it, and only what is above noise is kept.

`validation/closed_forms/receiver.py` holds each effect against its closed form.
"""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import rtradar as rt
from rtradar.signal import receive
from rtradar.signal.receiver import Expected, Mover, ReceiverStage

RAMPS = rt.Interferer(
    start_frequency_hz=12e9, slope_hz_per_s=6.399e13, ramp_s=6.2e-5, period_s=6.25e-5, power_dbm=-60
)
FULL: dict[str, Any] = {
    "phase_noise_hz": (1e4, 1e6),
    "phase_noise_dbc_hz": (-60.0, -90.0),
    "leakage_db": -50.0,
    "channel_gain_db": 0.5,
    "channel_phase_deg": 5.0,
    "interferer": RAMPS,
}
OF_ADC: dict[str, Any] = {
    "iq_gain_db": 0.5,
    "iq_phase_deg": 3.0,
    "adc_bits": 8,
    "adc_full_scale_dbm": -50.0,
    "dc_dbm": -70.0,
    "highpass_hz": (1e5, 2e5),
}


def radar(multiplexing: str = "tdm", **fields: Any) -> rt.Radar:
    return rt.Radar(
        tx_y=2,
        tx_z=0,
        rx_y=3,
        rx_z=0,
        samples_per_chirp=32,
        frame_duration_s=3.75e-3,
        multiplexing=multiplexing,  # type: ignore[arg-type]
        transmit_power_dbm=10.0,
        receiver=rt.Receiver(**fields),
    )


def stage(radar: rt.Radar, noise_m2: float = 0.0, **options: Any) -> ReceiverStage:
    expected = Expected((Mover(1e-2, 9e-2, 4e-8),), noise_m2, noise_m2 / 100)
    return ReceiverStage(radar, expected, n_chirps=60, **options)


def one_echo(radar: rt.Radar, first: int, n: int) -> rt.Echoes:
    length = np.broadcast_to(6 + 0.01 * np.arange(first, first + n)[:, None, None], (n, 3, 1))
    return rt.Echoes(
        length=length,
        amplitude=np.full((1, n, 3, 1), 0.1 + 0j),
        frequency=np.array([radar.centre_frequency_hz]),
        tx=radar.tx_of_chirp(np.arange(first, first + n)),
        part=np.zeros(1, np.int64),
        bounces=np.ones(1, np.int64),
    )


def received(made: ReceiverStage, radar: rt.Radar, first: int, n: int) -> NDArray[np.complex64]:
    samples = np.full((n, 3, 32), 0.1 + 0.02j, np.complex64)
    phases = made.phases(one_echo(radar, first, n), first)
    made.turn_moving(samples, phases)
    made.transmit(samples, phases, first)
    of_all = receive(samples, radar, first)
    made.receive(of_all, first)
    return of_all


@pytest.mark.parametrize("multiplexing", ["tdm", "fdm", "ddm"])
@given(cuts=st.lists(st.integers(1, 29), max_size=4))
@settings(max_examples=10, deadline=None)
def test_how_a_capture_is_cut_into_blocks_does_not_matter(
    multiplexing: str, cuts: list[int]
) -> None:
    fields = FULL if multiplexing == "fdm" else FULL | OF_ADC
    its = radar(multiplexing, **fields)
    made = stage(its)
    assert all(effect.modelled for effect in made.effects)
    edges = sorted({0, 60, *(2 * cut for cut in cuts)})
    blocks = [received(made, its, begin, end - begin) for begin, end in pairwise(edges)]
    np.testing.assert_array_equal(np.concatenate(blocks), received(made, its, 0, 60))


def test_what_is_below_the_noise_is_left_out_and_listed() -> None:
    made = stage(radar(**FULL | OF_ADC | {"adc_full_scale_dbm": 100.0}), noise_m2=1e13)
    names = ["leakage", "phase_noise", "channels", "interferer", "iq", "highpass", "dc"]
    assert [effect.name for effect in made.effects] == [*names, "quantisation", "clipping"]
    levels = [effect.level_db for effect in made.effects[:-1]]
    assert all(level is not None and level < -10 for level in levels)
    assert not any(effect.modelled for effect in made.effects[:-1])
    its = radar()
    np.testing.assert_array_equal(received(made, its, 0, 8), np.complex64(0.1 + 0.02j))


def test_everything_is_kept_on_demand() -> None:
    made = stage(radar(**FULL | OF_ADC), noise_m2=1e15, keep_all=True)
    assert all(effect.modelled for effect in made.effects)


def test_seeds_make_other_phase_noise_and_other_channels() -> None:
    its = radar(**FULL)
    ours, other = (received(stage(its, seed=seed), its, 0, 4) for seed in (0, 1))
    assert (ours != other).any()
    phases = stage(its).phases(one_echo(its, 0, 80), 0)
    assert phases is not None
    assert len(np.unique(phases[:, 0, 0])) == 80  # no cycle repeats another
    channels = [radar(channel_phase_deg=5.0, seed=seed) for seed in (0, 1)]
    ours, other = (received(stage(its), its, 0, 4) for its in channels)
    assert (ours != other).any()


def test_noise_that_is_not_small_is_refused() -> None:
    its = radar(phase_noise_hz=[1e6], phase_noise_dbc_hz=[-10.0])
    with pytest.raises(rt.InputError, match=r"up to 0\.3 rad are modelled"):
        stage(its)


def test_a_run_lists_the_effects_of_its_receiver() -> None:
    fields = {"iq_phase_deg": 3.0, "leakage_db": -60.0, "channel_gain_db": 1e-6}
    its = dataclasses.replace(rt.Radar.preset("paper-12ghz"), receiver=rt.Receiver(**fields))
    motion = rt.synthetic_motion("walk", duration_s=0.3)
    options: Any = {"fidelity": "analytic", "duration_s": 0.12}
    found = {one["name"]: one for one in rt.run(motion, its, **options).summary["receiver"]}
    assert [found[name]["modelled"] for name in ("leakage", "channels", "iq")] == [
        True,
        False,
        True,
    ]
    with pytest.raises(rt.InputError, match="need the loss with distance"):
        rt.run(motion, its, spreading=False, **options)


@pytest.mark.slow
def test_an_object_that_moves_may_clip_the_converter() -> None:
    # A corner reflector on a cart 2 m ahead, and somebody far behind it, whose echoes are weak.
    fields = {"phase_noise_hz": (1e4, 1e6), "phase_noise_dbc_hz": (-80, -100)}
    its = dataclasses.replace(
        radar(adc_full_scale_dbm=-60.0, **fields), samples_per_chirp=256, bandwidth_hz=1e9
    )
    cart = rt.Object(
        "cart", "trihedral", "metal", position_m=(-2.0, 1.0, 0.9), yaw_deg=180,
        motion=rt.FollowingPath(velocity_mps=(-1.0, 0.0, 0.0)),
    )  # fmt: skip
    person = rt.Person(rt.synthetic_motion("stand", duration_s=0.02), (4.0, 0.0))
    options: Any = {"fidelity": "specular", "duration_s": 0.01, "snr_db": 20.0}
    alone, both = (
        {one["name"]: one for one in rt.run(who, its, **options).summary["receiver"]}
        for who in ([person], [person, cart])
    )
    assert not alone["clipping"]["modelled"]
    assert both["clipping"]["modelled"]
    said = float(both["clipping"]["note"].split()[2])
    assert both["phase_noise"]["level_db"] > alone["phase_noise"]["level_db"] + 20
    samples = rt.simulate([person, cart], its, **options).samples.values
    full = np.sqrt(10**-6 * 1e-3 / its.watts_per_m2)
    assert np.abs(samples.real).max() == pytest.approx(full, rel=1e-5)
    # The note is about what the samples of an ideal converter reach.
    wider = dataclasses.replace(
        its, receiver=dataclasses.replace(its.receiver, adc_full_scale_dbm=0.0)
    )
    ideal = rt.simulate([person, cart], wider, **options).samples.values
    assert said == pytest.approx(20 * np.log10(np.abs(ideal).max() / full), abs=3.0)
