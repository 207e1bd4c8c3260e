"""Pictures of what goes into a run: `Radar.plot` and `Motion.plot`; `Scene.plot` has its own."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

import rtradar as rt


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    plt.close("all")


def test_a_radar_shows_its_array_in_millimetres_and_what_it_measures() -> None:
    radar = rt.Radar(name="a$b", tx_y=2, tx_z=0, rx_y=4, rx_z=0)
    axes = radar.plot()
    array, limits = axes.figure.axes
    assert axes is array
    virtual, rx, tx = (np.array(line.get_data()).T for line in array.lines)
    np.testing.assert_allclose(tx, 1e3 * (radar.tx - radar.position_m)[:, 1:])
    assert (len(virtual), len(rx), len(tx)) == (8, 4, 2)
    np.testing.assert_allclose(np.ptp(rx[:, 0]), 3 * 0.5e3 * radar.start_wavelength_m)
    left, right = array.get_xlim()
    assert left > 0 > right  # y to the left
    (rectangle, _) = limits.patches
    assert rectangle.get_height() == radar.max_range_m
    assert rectangle.get_width() == 2 * radar.max_velocity_mps
    axes.figure.draw_without_rendering()


def test_a_radar_with_one_channel_is_drawn_on_axes_that_are_given() -> None:
    given = Figure().add_subplot()
    axes = rt.Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0).plot(ax=given)
    assert axes is given
    assert given.figure.axes == [given]
    axes.figure.draw_without_rendering()


@pytest.mark.parametrize(("activity", "across"), [("walk", "x"), ("jumping_jack", "y")])
def test_a_motion_shows_whole_skeletons_from_the_side_where_it_is_wide(
    activity: str, across: str
) -> None:
    motion = rt.synthetic_motion(activity, seed=0)
    axes = motion.plot()
    side, above = axes.figure.axes
    assert axes is side
    assert (side.get_xlabel(), side.get_ylabel()) == (f"{across} [m]", "z [m]")
    assert above.get_xlabel() == side.get_xlabel() != above.get_ylabel()
    assert side.get_aspect() == above.get_aspect() == 1
    skeletons = [found for found in side.collections if isinstance(found, LineCollection)]
    assert len(skeletons) == 6
    first = np.concatenate(skeletons[0].get_segments())
    joints = motion.positions[0][:, ["xy".index(across), 2]]
    assert {tuple(point) for point in first} == {tuple(point) for point in joints}
    axes.figure.draw_without_rendering()
    (left, right), (low, high) = side.get_xlim(), side.get_ylim()
    assert min(left, right) <= first[:, 0].min()
    assert first[:, 0].max() <= max(left, right)
    assert low <= first[:, 1].min() < first[:, 1].max() <= high


def test_a_motion_of_one_frame_is_drawn() -> None:
    walk = rt.synthetic_motion("walk", seed=0)
    still = rt.Motion(
        name="still$",
        joints=walk.joints,
        parents=walk.parents,
        offsets=walk.offsets,
        root_positions=walk.root_positions[:1],
        rotations=walk.rotations[:1],
        rate_hz=120.0,
    )
    axes = still.plot(ax=Figure().add_subplot())
    assert len(axes.collections) == 1
    axes.figure.draw_without_rendering()


def test_axes_may_come_first_and_what_is_none_is_refused() -> None:
    scene, radar = rt.Scene.load("free-space"), rt.Radar.preset("paper-12ghz")
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.5)
    for plot in (scene.plot, radar.plot, motion.plot):
        given = Figure().add_subplot()
        assert plot(given) is given
        with pytest.raises(rt.InputError, match="ax = 3; it must be axes"):
            plot(ax=3)  # type: ignore[arg-type]
    with pytest.raises(rt.InputError, match="radar = 'x'; it must be a Radar"):
        scene.plot("x")  # type: ignore[arg-type]
