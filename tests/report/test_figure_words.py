"""What pictures say of themselves: their panels, their colours, their marks."""

from __future__ import annotations

import gc
import pickle
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure

import rtradar as rt
from rtradar.report import draw_before_after, draw_range_doppler, draw_range_time
from rtradar.report.figures import new_figure, save_figure

RADAR = rt.Radar(samples_per_chirp=16, tx_y=1, tx_z=0, rx_y=2, rx_z=0)
POWER = np.random.default_rng(0).exponential(size=(16, 8))
MASK = POWER > 2


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Every figure that is saved, instead of its file."""
    figures: list[Figure] = []
    # As it was then, for afterwards it is emptied.
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: figures.append(pickle.loads(pickle.dumps(figure))))
    return figures


def test_colours_say_which_power_they_are(drawn: list[Figure]) -> None:
    draw_range_time(Path("out.png"), POWER.T, np.arange(8.0), RADAR, "run")
    draw_range_doppler(Path("out.png"), POWER, MASK, RADAR, "run")
    labels = [figure.axes[-1].get_ylabel() for figure in drawn]
    assert labels == ["Power, mean of channels [dB re 1 m²]", "Power, all channels [dB re 1 m²]"]


def test_the_panel_of_detections_names_no_detector_for_it_is_not_told_which(drawn: list[Figure]) -> None:
    draw_range_doppler(Path("out.png"), POWER, MASK, RADAR, "run")
    assert not any("CFAR" in axes.get_title() for axes in drawn[0].axes)


@pytest.mark.parametrize("ghosts", [1, 3])
def test_a_legend_says_once_what_dots_and_circles_are(drawn: list[Figure], ghosts: int) -> None:
    draw_before_after(Path("out.png"), {"As received": (POWER, MASK)}, [("left", 0.3, 0.0)] * ghosts, RADAR, "run")
    legend = drawn[0].axes[0].get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["detected", "ghost over a wall, predicted"]


def test_a_saved_figure_keeps_neither_its_axes_nor_what_it_was_drawn_on(tmp_path: Path) -> None:
    """Without the collector of cycles, whose coming is chance."""

    def renderers() -> int:
        return sum(type(one) is RendererAgg for one in gc.get_objects())  # proxies would answer isinstance

    gc.collect()
    gc.disable()
    before = renderers()
    try:
        figure = new_figure(4, 3)
        figure.add_subplot().imshow(POWER)
        save_figure(figure, tmp_path / "out.png")
        assert renderers() == before
    finally:
        gc.enable()
    assert figure.axes == []
    assert (tmp_path / "out.png").stat().st_size > 1000
