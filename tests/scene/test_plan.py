"""The plan of a scene: all that is there, in metres, and no name over another."""

from __future__ import annotations

from itertools import combinations

import matplotlib.pyplot as plt
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

import rtradar as rt
from rtradar.scene import Furniture, material
from rtradar.scene.plan import MOST_NAMES
from rtradar.system.registries import scene_files


def named(axes: Axes) -> list[Text]:
    """Names that are written inside the axes."""
    axes.figure.draw_without_rendering()
    return [text for text in axes.texts if text.get_text() and text.get_zorder() == 10]


@pytest.mark.parametrize("name", scene_files())
def test_every_part_of_a_scene_has_its_name_and_none_covers_another(name: str) -> None:
    scene = rt.Scene.load(name)
    axes = scene.plot(ax=Figure(figsize=(6, 5), layout="constrained").add_subplot())
    texts = named(axes)
    shown = {text.get_text().split(":")[0] for text in texts}
    note = " ".join(text.get_text().lower() for text in axes.texts)
    for part in (*scene.walls, *scene.furniture):
        assert part.name in shown or part.name in note, part.name
    assert {"radar", "person"} <= shown
    boxes = [text.get_window_extent() for text in texts]
    assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]
    outer = axes.get_window_extent()
    assert all(box.x0 >= outer.x0 and box.x1 <= outer.x1 for box in boxes)
    assert axes.get_aspect() == 1
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")


def test_a_plan_has_a_figure_of_its_own_and_shows_a_radar_without_a_place() -> None:
    axes = rt.Scene(name="a$b$").plot(rt.Radar(position_m=(-7.0, 3.0, 1.0)))
    assert axes.figure in map(plt.figure, plt.get_fignums())
    plt.close(axes.figure)
    low, high = axes.get_xlim()
    assert low < -7 < 0 < high
    assert any((line.get_xdata()[0], line.get_ydata()[0]) == (-7.0, 3.0) for line in axes.lines)


def test_names_of_a_hall_of_chairs_do_not_overprint() -> None:
    wood = material("wood")
    chairs = [
        Furniture(
            name=f"chair {x} {y}", mesh="chair", material=wood, position_m=(0.6 * x, 0.6 * y, 0)
        )
        for x in range(12)
        for y in range(10)
    ]
    axes = rt.Scene(furniture=chairs).plot(ax=Figure().add_subplot())
    texts = named(axes)
    assert 10 < len(texts) <= MOST_NAMES + 2
    boxes = [text.get_window_extent() for text in texts]
    assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]
    (note,) = [text.get_text() for text in axes.texts if "not named" in text.get_text()]
    assert f"{len(chairs) - (len(texts) - 2)} pieces" in note


def test_a_doorway_is_a_gap_in_the_wall() -> None:
    scene = rt.Scene.load("doorway")
    axes = scene.plot(ax=Figure().add_subplot())
    lines = [line.get_xydata() for line in axes.lines]
    spans = sorted(
        tuple(line[:, 1].round(3).tolist())
        for line in lines
        if len(line) == 2 and (line[:, 0] == -2.2).all()
    )
    assert spans == [(-2.2, -0.3), (0.6, 2.2)]
