"""The paper's method in plain NumPy against `analytic-paper` and our CFAR with its multiplier."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import Body
from rtradar.process import os_cfar
from rtradar.scatter import build_model


@pytest.fixture(scope="module")
def paper(script: Callable[[str], ModuleType]) -> ModuleType:
    return script("other_methods/paper_numpy.py")


@pytest.mark.parametrize("name", ["paper-12ghz", "paper-77ghz"])
def test_if_samples_are_those_of_analytic_paper(paper: ModuleType, name: str) -> None:
    radar = rt.Radar.preset(name)
    first = 5 * radar.n_tx
    chirps = np.arange(first, first + 2 * radar.n_tx)
    body = Body.from_motion(rt.synthetic_motion("kick", seed=1, duration_s=0.5))
    times = radar.chirp_times(len(chirps), first)
    ours = rt.signal.synthesize(
        build_model("analytic-paper", radar, body).echoes(chirps), radar, times
    )
    theirs = paper.if_samples(radar, paper.Poses(*body.at(times)), first)
    # 3000 rad of phase at 77 GHz in float64.
    assert np.abs(ours - theirs).max() < 1e-10 * np.abs(ours).max()


def test_cfar_is_ours_with_the_papers_multiplier(paper: ModuleType) -> None:
    power = np.random.default_rng(0).exponential(size=(40, 30)) ** 2
    mask = paper.os_cfar(power)
    assert 0 < mask.sum() < mask.size / 4
    assert (mask == os_cfar(power, quantile=paper.QUANTILE, scale=paper.OS_SCALE)).all()


def test_a_frame_has_all_its_stages_whatever_part_of_it_is_synthesised(paper: ModuleType) -> None:
    radar = rt.Radar(frame_duration_s=6e-3, samples_per_chirp=32)  # 8 cycles
    for cycles in (1, 8):
        seconds = paper.frame_seconds(radar, paper.poses(radar, cycles))
        assert list(seconds) == ["echoes and IF", "noise", "range", "doppler", "cfar"]
        assert min(seconds.values()) > 0
