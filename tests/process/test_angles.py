"""Angles of point echoes written down by hand: place, sign, sharpness, odd radars, and the maps."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.process import range_spectrum
from rtradar.process.angles import (
    angle,
    angle_grid,
    angle_spectra,
    find_peaks,
    range_azimuth,
    range_elevation,
)
from rtradar.process.spectra import cell_spectra
from rtradar.process.steering import (
    range_walk,
    sine_grid,
    steering,
    steering_everywhere,
    taper_weights,
    virtual_lines,
)
from rtradar.radar import Radar
from rtradar.radar.display import measured_angles
from rtradar.scatter.validity import folded_angle_deg

Array = NDArray[np.float64]

C = 299_792_458.0
LOW, HIGH = Radar.preset("paper-12ghz"), Radar.preset("paper-77ghz")
# A tenth of the window: as good for what does not move.
SHORT = dataclasses.replace(LOW, frame_duration_s=0.01)


def place_of(range_m: float, azimuth_deg: float, elevation_deg: float) -> Array:
    """In the radar's frame [m]."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    direction = [
        np.cos(elevation) * np.cos(azimuth),
        np.cos(elevation) * np.sin(azimuth),
        np.sin(elevation),
    ]
    return range_m * np.array(direction)


def echo(radar: Radar, place: Array, velocity: float = 0.0) -> NDArray[np.complex64]:
    """IF of one window, in whose middle the point is at ``place``; a length is that at the centre
    of its chirp."""
    chirps = np.arange(radar.chirps_per_frame)
    away = velocity * (
        (chirps + 0.5) * radar.chirp_duration_s - len(chirps) * radar.chirp_duration_s / 2
    )
    at = np.asarray(radar.position_m) + place + away[:, None] * place / np.linalg.norm(place)
    tx = chirps % radar.n_tx
    there = np.linalg.norm(radar.tx[tx] - at, axis=1)
    back = np.linalg.norm(radar.rx[radar.rx_of_tx[tx]] - at[:, None], axis=2)
    tau = ((there[:, None] + back) / C)[..., None]
    slope = radar.bandwidth_hz / radar.chirp_duration_s
    fast = np.arange(radar.samples_per_chirp) * radar.chirp_duration_s / radar.samples_per_chirp
    phase = radar.start_frequency_hz * tau + slope * tau * fast - slope * tau**2 / 2
    return np.exp(2j * np.pi * (phase % 1)).astype(np.complex64)


def spectra_of(radar: Radar, x: NDArray[np.complex64], range_m: float, **options: object):  # type: ignore[no-untyped-def]
    """Angle spectra of the cell at this range that does not move."""
    cube = range_spectrum(x, radar).reshape(-1, radar.n_tx, radar.n_rx, radar.samples_per_chirp)
    row = round(range_m / radar.range_bin_m)
    values = cell_spectra(cube, radar, [row], [len(cube) // 2])
    return angle_spectra(values, radar, [row * radar.range_bin_m], [0.0], **options)


@pytest.mark.parametrize(
    ("direction", "speed"),
    [
        ((0.0, 0.0), 3.0), ((-14.0, -3.0), 0.0), ((30.0, 10.0), -3.0), ((-40.0, 20.0), 3.0),
        ((12.0, -30.0), -3.0),
    ],
)  # fmt: skip
def test_a_point_at_four_metres(direction: tuple[float, float], speed: float) -> None:
    found = np.degrees(angle(echo(LOW, place_of(4.0, *direction), speed), LOW, 4.0, speed))
    # Measured 0.022 at most: half a range bin in distance, and elements that change bins.
    np.testing.assert_allclose(found, direction, atol=0.05)


@pytest.mark.parametrize(("direction", "speed"), [((-14.0, 25.0), -3.0), ((60.0, 0.0), 2.0)])
def test_a_point_at_77_ghz(direction: tuple[float, float], speed: float) -> None:
    radar = dataclasses.replace(HIGH, frame_duration_s=0.02)
    found = np.degrees(angle(echo(radar, place_of(4.0, *direction), speed), radar, 4.0, speed))
    # Measured 0.01 at -14 degrees, 0.13 at 60, where half a degree of angle is a quarter of a
    # degree of its sine.
    np.testing.assert_allclose(found, direction, atol=0.2)


@given(
    azimuth=st.floats(-55, 55),
    elevation=st.floats(-55, 55),
    range_m=st.floats(1.0, 9.0),
    bins=st.integers(-5, 5),
)
@settings(max_examples=25, deadline=None)
def test_any_point_in_view(azimuth: float, elevation: float, range_m: float, bins: int) -> None:
    sines = (
        math.sin(math.radians(azimuth)) * math.cos(math.radians(elevation)),
        math.sin(math.radians(elevation)),
    )
    speed = bins * SHORT.velocity_bin_mps
    found = angle(echo(SHORT, place_of(range_m, azimuth, elevation), speed), SHORT, range_m, speed)
    back = math.sin(found[0]) * math.cos(found[1]), math.sin(found[1])
    # In sines, for the azimuth of a high elevation is a small difference of large numbers. A beam
    # is 0.03 wide.
    np.testing.assert_allclose(back, sines, atol=2e-3)


def test_motion_left_in_turns_the_azimuth_by_hand() -> None:
    # Between two Tx, 4 wavelengths of the start (0.0999 m) apart, the path grows by 2 v T: as from
    # the sine -2 v T / 0.0999 = -0.003753. The Rx know nothing of it: a straight line through all
    # phases has the fraction of the Tx in the spread of the virtual line, 46.67 / (46.67 + 1.31)
    # wavelengths squared. So a sign turned round shows as twice 0.2 degrees.
    x = echo(LOW, place_of(4.0, 0.0, 0.0), 3.0)
    cube = range_spectrum(x, LOW).reshape(-1, 12, 8, 256)
    values = cell_spectra(cube, LOW, [107], [66 + 28])
    for velocity, sine in ((0.0, -0.003753 * 0.9727), (3.0, 0.0)):
        seen = angle_spectra(values, LOW, LOW.range_m[[107]], [velocity], taper="uniform")
        assert find_peaks(seen.sines, seen.y).sine[0, 0] == pytest.approx(sine, abs=5e-5)


@pytest.mark.parametrize(
    ("radar", "beside"), [(LOW, 1.02), pytest.param(HIGH, 1.16, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("side", [1, -1])
def test_an_echo_that_is_folded_shows_beside_its_direction(
    radar: Radar, beside: float, side: int
) -> None:
    # One Tx is 1 / 12 of a turn after the other, which is a sine of lambda / (12 x 4 lambda of the
    # start).
    assert folded_angle_deg(radar) == pytest.approx(beside, abs=0.005)
    fast, unambiguous = 1.2 * side * radar.max_velocity_mps, 2 * radar.max_velocity_mps
    found = np.degrees(
        angle(echo(radar, place_of(5.0, 0, 0), fast), radar, 5.0, fast - side * unambiguous)
    )
    # A Tx sees through eight Rx, whose own beam draws it back by some hundredths.
    np.testing.assert_allclose(found, -side * beside, atol=0.05)


def test_what_is_not_turned_shows_where_it_is() -> None:
    for fields in (
        {"tx_y": 1, "tx_z": 1},
        {"multiplexing": "fdm"},
        {"tx_y": 6, "rx_y": 1, "tx_z": 0, "rx_z": 0, "multiplexing": "fdm"},
    ):
        assert folded_angle_deg(Radar(**fields)) == 0
    assert folded_angle_deg(Radar(tx_y=0)) > 0
    # On a planar board the wrong turns are no plane wave: the largest beam is far off.
    assert folded_angle_deg(Radar.preset("iwr1843")) == pytest.approx(77, abs=1)
    # Two Tx at one place, for two polarisations.
    twice = {"tx_positions_m": ((0.0, 0.0, 0.0),) * 2, "rx_positions_m": ((0.0, 0.01, 0.0),) * 1}
    assert folded_angle_deg(Radar(**twice)) == 0


def test_focusing_gains_and_sharpens() -> None:
    x = echo(SHORT, place_of(4.0, 0.0, 0.0))
    sharp, flat = (
        spectra_of(SHORT, x, 4.0, focus=focus, taper="uniform") for focus in (True, False)
    )
    # 4.1 dB by the closed form of the 48 paths.
    assert 10 * np.log10(sharp.y.max() / flat.y.max()) == pytest.approx(4.08, abs=0.1)
    sine_step = np.diff(sharp.sines)[0]
    widths = [
        np.degrees(np.count_nonzero(seen.y[0] > seen.y.max() / 2) * sine_step)
        for seen in (sharp, flat)
    ]
    assert widths == pytest.approx(
        [1.8, 5.5], abs=np.degrees(sine_step)
    )  # counted in steps of the grid


def test_an_echo_of_amplitude_one_reads_one() -> None:
    range_m = 107 * SHORT.range_bin_m
    for taper in ("uniform", "taylor"):
        seen = spectra_of(SHORT, echo(SHORT, place_of(range_m, 0.0, 0.0)), range_m, taper=taper)
        # 0.02: the elements at the ends are 8 mm, a fifth of a bin, farther away.
        assert seen.y.max() == pytest.approx(1, abs=0.02)
        assert seen.z.max() == pytest.approx(1, abs=0.02)


def test_taper_is_the_taylor_window_on_a_full_line() -> None:
    line = virtual_lines(LOW)[1]
    assert line is not None
    weights = taper_weights(line, "taylor")
    far = np.abs(np.fft.fft(weights, 4096)) ** 2
    lobes = far[
        116:2048
    ].max()  # beyond the main lobe: A = arccosh(10^(25/20)) / pi, first zero 1.35 x 4096 / 48 = 115
    # With 4 lobes kept equal the approximation of -25 dB is good to half a decibel.
    assert 10 * np.log10(lobes) == pytest.approx(-25, abs=0.5)
    assert weights.sum() == pytest.approx(1)


@pytest.mark.parametrize("channels", ["pairs", "all"])
def test_one_line_alone(channels: str) -> None:
    radar = dataclasses.replace(SHORT, tx_z=0, rx_z=0, channels=channels)
    assert virtual_lines(radar)[1] is None
    azimuth, elevation = angle(echo(radar, place_of(4.0, 20.0, 0.0)), radar, 4.0, 0.0)
    assert math.isnan(elevation)
    assert math.degrees(azimuth) == pytest.approx(20, abs=0.05)
    upright = dataclasses.replace(SHORT, tx_y=0, rx_y=0, channels=channels)
    assert virtual_lines(upright)[0] is None
    azimuth, elevation = angle(echo(upright, place_of(4.0, 0.0, -15.0)), upright, 4.0, 0.0)
    assert math.isnan(azimuth)
    assert math.degrees(elevation) == pytest.approx(-15, abs=0.05)


@pytest.mark.parametrize("array", [{"tx_y": 1, "rx_y": 2}, {"tx_y": 2, "rx_y": 1}], ids=str)
def test_two_channels_are_a_line(array: dict[str, int]) -> None:
    radar = dataclasses.replace(SHORT, tx_z=0, rx_z=0, tx_spacing_wavelengths=0.5, **array)
    assert measured_angles(radar)
    line = virtual_lines(radar)[0]
    assert line is not None
    np.testing.assert_allclose(np.diff(line.tx_m + line.rx_m), [C / 12e9 / 2], rtol=1e-9)
    assert not measured_angles(dataclasses.replace(radar, tx_y=1, rx_y=1))


def test_all_channels_give_the_angles_of_the_pairs() -> None:
    radar = dataclasses.replace(SHORT, channels="all")
    line = virtual_lines(radar)[1]
    assert line is not None
    np.testing.assert_array_equal(
        line.channels[:9], [6 * 16 + 8 + i for i in range(8)] + [7 * 16 + 8]
    )
    place = place_of(4.0, -20.0, 9.0)
    both = [angle(echo(one, place), one, 4.0, 0.0) for one in (radar, SHORT)]
    np.testing.assert_allclose(both[0], both[1], atol=1e-5)  # complex64


@pytest.mark.parametrize(
    "fields",
    [
        {"tx_y": 1, "rx_y": 1, "tx_z": 0, "rx_z": 0},
        {"tx_y": 4, "rx_y": 0, "tx_z": 0, "rx_z": 4, "channels": "all"},
    ],
)
def test_no_line_no_angle(fields: dict) -> None:
    radar = dataclasses.replace(SHORT, **fields)
    x = np.zeros((radar.chirps_per_frame, radar.n_rx, radar.samples_per_chirp), np.complex64)
    with pytest.raises(InputError, match="no line of at least 2 channels"):
        angle(x, radar, 4.0, 0.0)


@pytest.mark.parametrize(
    ("range_m", "velocity", "message"),
    [
        (9.7, 0.0, "range_m = 9.7; it must lie between 0"),
        (-0.1, 0.0, "range_m"),
        (math.nan, 0.0, "range_m"),
        (4.0, 80.0, "velocity = 80.0; it must lie between"),
        (4.0, -80.0, "velocity"),
        (4.0, math.nan, "velocity"),
    ],
)
def test_cells_outside_the_map(range_m: float, velocity: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        angle(echo(SHORT, place_of(4.0, 0.0, 0.0)), SHORT, range_m, velocity)


def test_samples_that_cannot_be_used() -> None:
    x = echo(SHORT, place_of(4.0, 0.0, 0.0))
    with pytest.raises(InputError, match="IF samples have shape"):
        angle(x[:, :4], SHORT, 4.0, 0.0)
    with pytest.raises(InputError, match="no whole TDM cycle"):
        angle(x[:11], SHORT, 4.0, 0.0)
    with pytest.raises(InputError, match="no echo at all"):
        angle(0 * x, SHORT, 4.0, 0.0)
    x[3, 2, 1] = np.nan
    with pytest.raises(InputError, match="NaN or infinity"):
        angle(x, SHORT, 4.0, 0.0)


def test_spectra_of_shapes_that_do_not_fit() -> None:
    with pytest.raises(InputError, match="values, range_m and velocity have shapes"):
        angle_spectra(np.zeros((3, 1, 96), np.complex64), LOW, np.zeros(3), np.zeros(3))
    values = np.zeros((1, 2 * range_walk(LOW) + 1, 96), np.complex64)
    with pytest.raises(InputError, match="NaN or infinity"):
        angle_spectra(values, LOW, [np.nan], [0.0])
    with pytest.raises(InputError, match="range_m must lie"):
        angle_spectra(values, LOW, [10.0], [0.0])


def test_peaks_of_hand_made_spectra() -> None:
    sines = np.linspace(-1, 1, 201)
    shape = np.exp(-(((sines - 0.303) / 0.05) ** 2))
    power = np.stack(
        [
            shape + 0.4 * np.exp(-(((sines + 0.41) / 0.05) ** 2)),
            shape + 0.05 * np.exp(-(((sines + 0.4) / 0.05) ** 2)),
        ]
    )
    peaks = find_peaks(sines, (power + 1e-6).astype(np.float32))
    # The second spectrum's weaker hill is 13 dB down: no peak. A parabola through logarithms is
    # exact on a Gaussian.
    np.testing.assert_array_equal(peaks.real, [[True, True, False], [True, False, False]])
    np.testing.assert_allclose(peaks.sine[0, :2], [0.303, -0.41], atol=1e-5)
    np.testing.assert_allclose(peaks.power[0, :2], [1.0, 0.4], rtol=1e-4)


def test_a_spectrum_that_rests_and_rises_on_has_no_peak_there() -> None:
    power = np.zeros((2, 201), dtype=np.float32)
    power[:, 50:56] = [[1, 2, 2, 3, 2, 1], [1, 3, 3, 2, 2, 1]]
    peaks = find_peaks(np.linspace(-1, 1, 201), power)
    assert peaks.real.sum(axis=1).tolist() == [1, 1]
    np.testing.assert_allclose(peaks.sine[:, 0], [-0.47, -0.485], atol=1e-5)


def test_a_spectrum_of_noise_has_one_peak_mostly() -> None:
    # Exponential power, as of noise in 4-fold oversampled beams of 48 channels; an echo 14 dB above
    # it, just detected.
    random = np.random.default_rng(1)
    noise = (
        np.abs(
            np.fft.fft(
                random.standard_normal((2000, 48)) + 1j * random.standard_normal((2000, 48)), 192
            )
        )
        ** 2
        / 96
    )
    noise[:, 100] += 25
    extra = (
        find_peaks(np.linspace(-0.8, 0.8, 192), noise.astype(np.float32))
        .real[:, 1:]
        .any(axis=1)
        .mean()
    )
    # Law: median 0.69 of the mean, 11 dB above it 8.7 means, exp(-8.7) in each of 48 beams: 0.8 %,
    # about twice that between the beams too.
    assert extra < 0.03


def test_maps_put_a_point_where_it_is() -> None:
    radar = SHORT
    x = echo(radar, place_of(4.0, 25.0, 40.0))
    seen = spectra_of(radar, x, 4.0)
    across, up = range_azimuth(seen, radar), range_elevation(seen, radar)
    grid = np.degrees(angle_grid(radar))
    assert across.shape == up.shape == (256, len(grid))
    step = grid[1] - grid[0]
    # Without the cosine of 40 degrees it would be at 18.9.
    assert abs(grid[across[107].argmax()] - 25) < step
    assert abs(grid[up[107].argmax()] - 40) < step
    assert across.sum() == pytest.approx(across[107].sum())
    # Between points of the grid power is read along straight lines: 0.2 dB low at most.
    assert up.max() == pytest.approx(seen.z.max(), rel=0.05)


def test_maps_sum_over_cells_and_name_the_line_that_is_missing() -> None:
    seen = spectra_of(SHORT, echo(SHORT, place_of(4.0, 0.0, 0.0)), 4.0)
    twice = dataclasses.replace(
        seen,
        y=np.repeat(seen.y, 2, axis=0),
        z=np.repeat(seen.z, 2, axis=0),
        range_m=seen.range_m.repeat(2),
    )
    np.testing.assert_allclose(
        range_azimuth(twice, SHORT), 2 * range_azimuth(seen, SHORT), rtol=1e-12
    )
    with pytest.raises(InputError, match="no line of at least 2 channels along y"):
        range_azimuth(dataclasses.replace(seen, y=None), SHORT)
    with pytest.raises(InputError, match="no line of at least 2 channels along z"):
        range_elevation(dataclasses.replace(seen, z=None), SHORT)
    flat = range_azimuth(dataclasses.replace(seen, z=None), SHORT)
    assert flat.max() > 0


def test_a_line_too_long_for_its_beams_to_be_kept_is_refused() -> None:
    wide = Radar(tx_y=2, tx_z=0, rx_y=2, rx_z=0, tx_spacing_wavelengths=1e9)
    with pytest.raises(
        InputError, match=r"a line 1.17e\+09 wavelengths long.* lessen tx_spacing_wavelengths"
    ):
        sine_grid(wide)


def test_the_grid_of_sines_ends_at_the_unambiguous_angle() -> None:
    grid = sine_grid(LOW)
    assert grid[-1] == pytest.approx(
        0.857, abs=1e-3
    )  # 12 / 14: half a wavelength of the start is 0.583 of the centre's
    np.testing.assert_allclose(grid, -grid[::-1], atol=1e-15)
    # A quarter of a resolution cell: the wavelength over 47 virtual spacings of 0.583 wavelengths.
    assert np.diff(grid).max() <= 1 / (47 * 7 / 12) / 4


@pytest.mark.parametrize("alike", [True, False])
def test_lines_share_the_weights_of_their_beams_only_if_they_have_the_same_elements(
    alike: bool,
) -> None:
    radar = SHORT if alike else dataclasses.replace(SHORT, tx_y=8)
    along_y, along_z = (steering_everywhere(radar, axis) for axis in (1, 2))
    assert (along_y is along_z) == alike
    own = steering(radar, 2, np.arange(radar.samples_per_chirp), "taylor")
    for shared, computed in zip(along_z, own, strict=True):
        np.testing.assert_array_equal(shared, computed)


HALF = LOW.wavelength_m / 2
ANYWHERE = {
    "tilted": {
        "tx_positions_m": [(0, 0, 0), (0, 0, HALF)],
        "rx_positions_m": [(0, k * HALF, k * HALF / 2) for k in range(5)],
    },
    "deep": {
        "tx_positions_m": [(0, 0, 0), (0.01, 4 * HALF, 0), (0, 0, 4 * HALF)],
        "rx_positions_m": [(0, k * HALF, j * HALF) for k in range(4) for j in range(4)],
    },
    "carriers": {
        "tx_positions_m": [(0, 0, 0), (0, 4 * HALF, 0)],
        "rx_positions_m": [(0, k * HALF, j * HALF) for k in range(4) for j in range(2)],
        "multiplexing": "fdm",
        "carrier_step_hz": 200e6,
    },
    "wide": {
        "tx_positions_m": [(0, 0, 0), (0, 20 * HALF, 0)],
        "rx_positions_m": [(0, k * HALF, j * 2 * HALF) for k in range(20) for j in range(2)],
    },
}


@pytest.mark.parametrize("focus", [True, False])
@pytest.mark.parametrize("array", ANYWHERE)
def test_antennas_anywhere_add_up_in_the_direction_of_a_point(array: str, focus: bool) -> None:
    """Each channel has the phase of its own path, in the range bin in which that path ends."""
    radar = Radar(name=array, **ANYWHERE[array])
    walk, bins = range_walk(radar), np.array([20, 60, 61, 61])
    sines = np.array([(0.3, -0.2), (-0.55, 0.15), (0.0, 0.0), (0.6, 0.25)])
    direction = np.column_stack([np.sqrt(1 - (sines**2).sum(axis=1)), sines])
    range_m = bins * radar.range_bin_m
    values = np.zeros((len(bins), 2 * walk + 1, radar.n_channels), np.complex64)
    for cell, (away, toward) in enumerate(zip(range_m, direction, strict=True)):
        for tx in range(radar.n_tx):
            for rx in range(radar.n_rx):
                places = radar.tx_m[tx], radar.rx_m[radar.rx_of_tx[tx, rx]]
                path = sum(np.linalg.norm(away * toward - place) for place in places)
                if not focus:
                    path = 2 * away - sum(place @ toward for place in places)
                offset = round((path - 2 * away) / (2 * radar.range_bin_m)) if focus else 0
                frequency = radar.centre_frequency_hz + radar.tx_offset_hz[tx]
                turns = path * frequency / C - 2 * away * radar.centre_frequency_hz / C - offset / 2
                channel = tx * radar.n_rx + rx
                values[cell, walk + offset, channel] = np.exp(2j * np.pi * turns)
    if array == "wide" and focus:
        assert (values[:, walk] == 0).any()  # some echoes end in other bins
    nothing = angle_spectra(values[:0], radar, range_m[:0], range_m[:0], focus=focus)
    assert nothing.y.shape == nothing.z.shape == (0, len(nothing.sines))
    seen = angle_spectra(values, radar, range_m, np.zeros(len(bins)), focus=focus)
    for axis, power in enumerate((seen.y, seen.z)):
        assert power is not None
        peaks = find_peaks(seen.sines, power)
        beam = radar.wavelength_m / np.ptp(radar.virtual_m[:, 1 + axis])
        np.testing.assert_allclose(peaks.sine[:, 0], sines[:, axis], atol=beam / 20)
        # Beside the peak channels are read in other bins, where these echoes have nothing.
        np.testing.assert_allclose(peaks.power[:, 0], 1, atol=0.05)
