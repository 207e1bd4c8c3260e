"""Pictures of a run: the limits of their axes, their titles and notes, and whose axes they use."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

import rtradar as rt
from rtradar.clouds import SpatialCloud
from rtradar.report.canvas import above_floor, fitted_limits
from rtradar.report.plots import Plots
from rtradar.system.figure_style import DARK, fit, new_figure, theme_of

RADAR = rt.Radar(samples_per_chirp=64, tx_y=1, tx_z=0, rx_y=2, rx_z=0)
PICTURES = ("range_doppler", "range_time", "spectrogram", "range_angle", "rdt", "spatial")
LONG = "a_recording-of.somebody_who-walks.through_the-laboratory.007.amc, paper-12ghz, specular"
BINS = np.arange(100.0)


def texts(figure: Figure) -> list[Text]:
    """Every text that is seen, once the figure is laid out."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    found = {text for text in figure.findobj(Text) if text.get_text().strip()}
    for axes in figure.axes:  # labels of ticks beyond the limits are not drawn
        for axis in (axes.xaxis, axes.yaxis, *([axes.zaxis] if hasattr(axes, "zaxis") else [])):
            low, high = sorted(axis.get_view_interval())
            outside = [tick for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high]
            found -= {label for tick in outside for label in (tick.label1, tick.label2)}
    return [text for text in found if text.get_visible() and text.get_alpha() != 0]


def test_limits_have_what_is_detected_a_margin_and_no_handful_of_outliers() -> None:
    counts = np.zeros(100)
    counts[40:60] = 50
    # Edges 39.5 to 59.5, and 15 % of 20 bins at each side.
    assert fitted_limits(counts, BINS) == pytest.approx((36.5, 62.5))
    counts[[2, 97]] = 3
    assert fitted_limits(counts, BINS) == pytest.approx((36.5, 62.5))
    counts[2] = 4
    assert fitted_limits(counts, BINS)[0] < 2
    assert fitted_limits(counts, BINS, handful=4)[0] == pytest.approx(36.5)


def test_few_detections_are_all_shown() -> None:
    counts = np.zeros(100)
    counts[[20, 70]] = 3
    low, high = fitted_limits(counts, BINS)
    assert low < 20
    assert high > 70


def test_limits_stay_within_the_axis_and_are_the_axis_if_nothing_is_there() -> None:
    counts = np.zeros(100)
    assert fitted_limits(counts, BINS) == (-0.5, 99.5)
    counts[99] = 5
    low, high = fitted_limits(counts, BINS)
    assert high == 99.5
    assert low == pytest.approx(98.5 - 3.5)  # eight bins, as far as the axis goes
    assert fitted_limits(counts, BINS, include=30.0)[0] < 30


def test_the_floor_of_a_map_is_6_db_above_its_median_or_50_db_below_its_peak() -> None:
    noise = np.array([1.0, 1.0, 1.0, 3.9, 4.1])
    assert above_floor(noise).tolist() == [False, False, False, False, True]
    loud = np.array([0.0, 0.0, 0.0, 0.0, 0.9e-5, 1.1e-5, 1.0])
    assert above_floor(loud).tolist() == [False] * 5 + [True] * 2


def test_a_map_is_limited_to_its_detections(plots_of: Callable[..., Plots]) -> None:
    power = np.ones((64, 32))
    power[20:30, 18:24] = 1e4
    axes = plots_of(RADAR, n_velocity=32, power=power, mask=power > 10).range_doppler()
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    velocity, step = RADAR.velocity_mps(32), RADAR.velocity_mps(32)[1] - RADAR.velocity_mps(32)[0]
    assert left == pytest.approx(min(velocity[16], velocity[18]) - 1.2 * step, abs=step)
    assert right == pytest.approx(velocity[23] + 1.5 * step, abs=step)
    assert low == pytest.approx(RADAR.range_m[20] - 2 * RADAR.range_bin_m, abs=RADAR.range_bin_m)
    assert high == pytest.approx(RADAR.range_m[29] + 2 * RADAR.range_bin_m, abs=RADAR.range_bin_m)


@pytest.mark.parametrize("name", PICTURES)
def test_every_text_is_whole_and_covers_no_other(plots_of: Callable[..., Plots], name: str) -> None:
    figure = getattr(plots_of(RADAR, title=LONG), name)().figure
    seen = texts(figure)
    boxes = [text.get_window_extent() for text in seen]
    assert any("walks.through" in text.get_text().replace("\n", "") for text in seen)
    # Letters are readable where the picture is 420 pixels wide.
    pixels = 420 / figure.get_size_inches()[0] / 72
    assert min(text.get_fontsize() for text in seen) * pixels >= 8
    for text, box in zip(seen, boxes, strict=True):
        assert min(box.x0, box.y0) >= 0, text
        assert box.x1 <= figure.bbox.x1, text
        assert box.y1 <= figure.bbox.y1, text
    for (one, here), (other, there) in combinations(zip(seen, boxes, strict=True), 2):
        # The box about a slanting text is larger than the text.
        if not (one.get_rotation() % 90 or other.get_rotation() % 90):
            assert not here.overlaps(there), (one, other)


def test_high_clouds_stand_beside_each_other_under_one_title(
    plots_of: Callable[..., Plots],
) -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform([-4, -4, -4], [4, 6, 6], (400, 3))
    cloud = SpatialCloud(points, points[:, 2], points[:, 0] + 5, points[:, 0] + 5)
    cross = rt.Radar(samples_per_chirp=64, tx_y=1, tx_z=1, rx_y=2, rx_z=2)
    plots = plots_of(cross, title=LONG, spatial=cloud)
    maps = plots.maps.assign(range_elevation=plots.maps["range_azimuth"])
    figure = dataclasses.replace(plots, maps=maps).spatial().figure
    seen = texts(figure)
    upper, lower = figure.axes[0].get_window_extent(), figure.axes[1].get_window_extent()
    assert upper.x1 < lower.x0
    bar = figure.axes[2].get_window_extent()
    assert bar.height == pytest.approx(upper.height, rel=0.02)
    title = next(text for text in seen if "Spatial cloud" in text.get_text())
    box = title.get_window_extent()
    assert not any(box.overlaps(axes.get_window_extent()) for axes in figure.axes)


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_drawn_on_the_axes_that_are_given(
    plots_of: Callable[..., Plots], name: str
) -> None:
    figure = new_figure(4.0)
    figure.set_facecolor(DARK.page)
    own = figure.add_subplot(projection="3d" if name == "rdt" else None)
    assert getattr(plots_of(RADAR), name)(own) is own
    # Colours follow the background.
    assert theme_of(own) is DARK
    assert {label.get_color() for label in own.get_xticklabels()} == {DARK.text}
    assert [axes for axes in figure.axes if axes.get_label() != "<colorbar>"] == [own]
    with pytest.raises(rt.InputError, match="ax = 'x'; it must be axes of Matplotlib"):
        getattr(plots_of(RADAR), name)(ax="x")


def test_a_notebook_shows_what_is_drawn_without_axes(plots_of: Callable[..., Plots]) -> None:
    made = plots_of(RADAR)
    own = Plots(made.maps, made.points, made.spatial_cloud, made.radar, made.summary)
    try:
        figure = own.range_time().figure
        assert plt.fignum_exists(figure.number)
    finally:
        plt.close("all")
    made.range_time()
    assert plt.get_fignums() == []  # files of a run leave pyplot alone


def test_a_picture_says_which_frame_it_is(plots_of: Callable[..., Plots]) -> None:
    plots = plots_of(RADAR)
    assert "window of most energy" in plots.range_doppler().get_title("left")
    assert "window at 0.50 s" in plots.range_doppler(time_s=0.5).get_title("left")
    for wrong in (9.0, "1"):
        with pytest.raises(rt.InputError, match=f"time_s = {wrong!r}"):
            plots.range_doppler(time_s=wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("missed", [0, 9])
def test_self_masking_is_told_where_the_strongest_cells_are_not_detected(
    plots_of: Callable[..., Plots], missed: int
) -> None:
    power = np.arange(64 * 8.0).reshape(64, 8)
    mask = power >= 64 * 8 - 40
    mask.ravel()[64 * 8 - missed :] = False
    mask.ravel()[:missed] = True
    axes = plots_of(RADAR, power=power, mask=mask).range_doppler()
    notes = " ".join(" ".join(text.get_text().split()) for text in axes.texts)
    assert ("9 of the 40 strongest cells are not detected" in notes) == bool(missed)


def test_a_spectrogram_shows_an_echo_at_its_velocity(plots_of: Callable[..., Plots]) -> None:
    power = np.full((16, 8), 1e-6)
    power[:, 6] = 1.0
    image = plots_of(RADAR, spectrogram=power).spectrogram().images[0]
    velocity = RADAR.velocity_mps(8)
    assert image.get_cursor_data is not None
    assert np.argmax(np.asarray(image.get_array())[:, 3]) == 6
    assert image.get_extent()[2] < velocity[0] < velocity[-1] < image.get_extent()[3]
    assert image.origin == "lower"


def test_what_a_radar_does_not_measure_is_no_picture(plots_of: Callable[..., Plots]) -> None:
    plots = plots_of(RADAR)
    none = dataclasses.replace(plots, maps=plots.maps.drop_vars("range_azimuth"))
    for name in ("range_angle", "spatial"):
        with pytest.raises(rt.InputError, match=f"{name}: radar 'custom' measures no angle"):
            getattr(none, name)()
    with pytest.raises(rt.InputError, match="no z axis"):
        plots.rdt(ax=new_figure(3.0).add_subplot())


def test_a_part_of_the_points_is_drawn_and_all_are_counted(
    plots_of: Callable[..., Plots], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rtradar.report.plots._DOTS", 4)
    title = plots_of(RADAR).spatial().get_title("left").replace("\n", " ")
    assert title.startswith("Spatial cloud, 10 points (4 drawn: one in 3 of those at most 40 dB")


def test_lines_fit_and_no_letter_is_lost() -> None:
    lines = fit(LONG, 150.0, 10.5).split("\n")
    assert len(lines) > 3
    assert "".join(lines).replace(" ", "") == LONG.replace(" ", "")
    assert fit("W" * 60, 100.0, 10.0).replace("\n", "") == "W" * 60
