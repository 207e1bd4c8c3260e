"""The sliding windows: those of the radar's schedule, however the stream is cut."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtradar.errors import InputError
from rtradar.process import SlidingWindows
from rtradar.radar import Radar


def tiny_radar(n_tx: int, cycles_per_frame: float, cycles_per_hop: float) -> Radar:
    cycle = n_tx * 1e-4
    return Radar(
        tx_y=n_tx,
        tx_z=0,
        rx_y=1,
        rx_z=0,
        samples_per_chirp=2,
        chirp_duration_s=1e-4,
        frame_duration_s=cycles_per_frame * cycle,
        frame_hop_s=cycles_per_hop * cycle,
    )


def numbered(n_chirps: int, radar: Radar) -> np.ndarray:
    """Chirps that carry their own number."""
    shape = (n_chirps, radar.n_rx, radar.samples_per_chirp)
    return np.broadcast_to(np.arange(n_chirps)[:, None, None], shape).astype(np.complex64)


@given(data=st.data())
@settings(max_examples=200, deadline=None)
def test_any_cut_gives_the_windows_of_the_schedule(data: st.DataObject) -> None:
    radar = tiny_radar(
        data.draw(st.integers(1, 4), "n_tx"),
        data.draw(st.floats(1.0, 9.0), "frame"),
        # Halves make ties of the rounding; hops under a cycle repeat starts; hops over the frame
        # leave chirps unused.
        data.draw(
            st.one_of(st.floats(0.1, 25.0), st.sampled_from([0.25, 0.5, 1.5, 2.5, 12.5])), "hop"
        ),
    )
    n_chirps = data.draw(st.integers(0, 150), "chirps")
    cuts = data.draw(st.lists(st.integers(0, n_chirps), max_size=12), "cuts")
    stream = SlidingWindows(radar)
    starts = []
    for block in np.split(numbered(n_chirps, radar), sorted(cuts)):
        for index, start, cube in stream.push(block):
            assert index == len(starts)
            assert cube.shape == (
                radar.cycles_per_frame,
                radar.n_tx,
                radar.n_rx,
                radar.samples_per_chirp,
            )
            first = start * radar.n_tx
            np.testing.assert_array_equal(
                cube[..., 0].real.ravel(), np.arange(first, first + radar.chirps_per_frame)
            )
            starts.append(start)
    assert starts == radar.window_starts(n_chirps).tolist()
    assert stream.n_chirps == n_chirps


def test_a_hop_far_below_a_cycle_costs_no_more_than_one_of_a_cycle() -> None:
    radar = tiny_radar(2, 3, 1e-5)
    stream = SlidingWindows(radar)
    assert (
        [start for _, start, _ in stream.push(numbered(40, radar))]
        == list(range(18))
        == radar.window_starts(40).tolist()
    )
    assert stream._candidate <= 18


@pytest.mark.parametrize("preset", ["paper-12ghz", "paper-77ghz"])
def test_presets(preset: str) -> None:
    radar = Radar.preset(preset)
    thin = Radar(
        name=preset,
        start_frequency_hz=radar.start_frequency_hz,
        chirp_duration_s=radar.chirp_duration_s,
        rx_y=1,
        rx_z=1,
        samples_per_chirp=1,
    )
    n = round(0.7 / radar.chirp_duration_s)
    stream = SlidingWindows(thin)
    starts = [
        start
        for block in np.array_split(numbered(n, thin), 13)
        for _, start, _ in stream.push(block)
    ]
    assert starts == radar.window_starts(n).tolist()
    assert len(starts) == 25


def test_memory_stays_at_one_and_a_quarter_windows() -> None:
    radar = tiny_radar(2, 10, 2)
    stream = SlidingWindows(radar)
    size = stream._buffer.nbytes
    for _ in stream.push(numbered(5000, radar)):
        pass
    # A quarter of 20 chirps, and one receiver.
    assert stream._buffer.nbytes == size == 25 * radar.samples_per_chirp * 8


def test_windows_cannot_be_written() -> None:
    radar = tiny_radar(1, 2, 1)
    _, _, cube = next(SlidingWindows(radar).push(numbered(4, radar)))
    with pytest.raises(ValueError, match="read-only"):
        cube[:] = 0


def test_wrong_shape_and_windows_left_behind() -> None:
    radar = tiny_radar(1, 2, 1)
    stream = SlidingWindows(radar)
    with pytest.raises(InputError, match="needs"):
        stream.push(np.zeros((3, 1, 3), np.complex64))
    stream.push(numbered(4, radar))
    with pytest.raises(RuntimeError, match="take every window"):
        stream.push(numbered(4, radar))
