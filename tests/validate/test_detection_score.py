"""Truth, precision and missing rate of detections, against counts by hand and measured noise."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rtradar.errors import InputError
from rtradar.process import WindowFunctions, power_map, range_spectrum
from rtradar.process.window_functions import weights
from rtradar.radar import Radar
from rtradar.validate import validation_folder

sys.path.append(str(validation_folder() / "closed_forms"))
from detection_score import DetectionScore, cell_noise_power, score, target_cells

sys.path.pop()

MASKS = hnp.arrays(np.bool_, (5, 7))
SMALL = Radar(samples_per_chirp=32, frame_duration_s=0.02)


def test_counts_by_hand() -> None:
    truth = np.array([[True, True, True, False, False]])
    mask = np.array([[True, False, False, True, False]])
    found = score(mask, truth)
    assert found == DetectionScore(hits=1, false=1, missed=2)
    assert found.precision == 1 / 2
    assert found.missing_rate == 2 / 3


@given(MASKS, MASKS)
def test_a_mask_against_itself_and_its_opposite(mask: np.ndarray, truth: np.ndarray) -> None:
    found, opposite = score(mask, truth), score(~mask, truth)
    assert found.hits + found.false == mask.sum()
    assert found.hits + found.missed == truth.sum()
    assert opposite.hits == found.missed
    own = score(mask, mask)
    assert (own.false, own.missed) == (0, 0)


@given(MASKS, MASKS)
def test_scores_of_two_halves_add_up(mask: np.ndarray, truth: np.ndarray) -> None:
    assert score(mask[:2], truth[:2]) + score(mask[2:], truth[2:]) == score(mask, truth)


def test_nothing_detected_or_nothing_there_has_no_rate() -> None:
    none = score(np.zeros(3, bool), np.zeros(3, bool))
    assert math.isnan(none.precision)
    assert math.isnan(none.missing_rate)


def test_targets_stand_above_the_margin() -> None:
    # 2 x 10^(13/10) = 39.905
    np.testing.assert_array_equal(
        target_cells([[39.90, 39.91, 2.0]], 2.0, 13.0), [[False, True, False]]
    )


@pytest.mark.parametrize("channel", [None, 5])
def test_noise_power_of_a_cell_is_what_noise_leaves_there(channel: int | None) -> None:
    looks = SMALL.n_channels if channel is None else 1
    rng = np.random.default_rng(3)
    shape = (SMALL.chirps_per_frame, SMALL.n_rx, SMALL.samples_per_chirp)
    means = []
    for _ in range(40):
        noise = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * math.sqrt(0.7 / 2)
        cube = range_spectrum(noise, SMALL).reshape(
            -1, SMALL.n_tx, SMALL.n_rx, SMALL.samples_per_chirp
        )
        means.append(power_map(cube, SMALL, channel=channel).mean())
    error = np.std(means, ddof=1) / math.sqrt(len(means))
    # Four standard errors, 1.2 % (one channel) and 0.1 % (96), so that a wrong window or a lost
    # factor of 2 shows.
    assert abs(np.mean(means) - cell_noise_power(0.7, SMALL, looks)) < 4 * error


def test_noise_power_of_hann_windows_in_closed_form() -> None:
    # sum(w^2) / sum(w)^2 of a periodic Hann window of n samples is (3n/8) / (n/2)^2 = 1.5 / n.
    hann = WindowFunctions("hann", "hann")
    assert cell_noise_power(2.0, SMALL, looks=3, window_functions=hann) == pytest.approx(
        3 * 2.0 * 1.5 / 32 * 1.5 / SMALL.cycles_per_frame, rel=1e-12
    )


def test_noise_power_follows_the_window_functions() -> None:
    slow = weights("nuttall", SMALL.cycles_per_frame)
    expected = 2.0 * np.sum(weights("blackman", 32) ** 2) * np.sum(slow**2)
    windows = WindowFunctions("blackman", "nuttall")
    assert cell_noise_power(2.0, SMALL, window_functions=windows) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("mask", "truth"),
    [
        (np.zeros(3, bool), np.zeros(4, bool)),
        (np.zeros(3), np.zeros(3, bool)),
        (np.zeros(3, bool), np.zeros(3, int)),
    ],
)
def test_masks_that_do_not_fit_are_refused(mask: np.ndarray, truth: np.ndarray) -> None:
    with pytest.raises(InputError, match="boolean") as error:
        score(mask, truth)
    assert "\n" not in str(error.value)


@given(st.sampled_from([0.0, -1.0, math.nan, math.inf]))
def test_noise_that_is_none_is_refused(noise_power: float) -> None:
    with pytest.raises(InputError, match="noise_power"):
        target_cells(np.ones((2, 2)), noise_power, 13.0)


@given(st.sampled_from([math.nan, math.inf, -math.inf]))
def test_a_margin_that_is_no_number_is_refused(margin_db: float) -> None:
    with pytest.raises(InputError, match="margin_db"):
        target_cells(np.ones((2, 2)), 1.0, margin_db)
