"""What pictures say of themselves: their panels, their colours, their marks."""

from __future__ import annotations

import dataclasses
import gc
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure
from matplotlib.image import imread

import rtradar as rt
from rtradar.pipeline.processing import frame_angles
from rtradar.process import (
    WindowFunctions,
    angle_grid,
    power_map,
    range_azimuth,
    range_spectrum,
    range_time,
    spectrogram,
)
from rtradar.report import comparison, evaluation, rooms
from rtradar.report.canvas import FieldUnit
from rtradar.report.comparison import (
    draw_maps,
    draw_part_power,
    draw_power_over_time,
    draw_rdt_clouds,
)
from rtradar.report.maps import ShownMap, ghost_mark
from rtradar.report.plots import Plots
from rtradar.report.rooms import (
    ShownRoom,
    azimuth_and_walls,
    before_after,
    draw_room_maps,
    draw_room_plan,
)
from rtradar.scene import Wall, material
from rtradar.signal import synthesize
from rtradar.system import figure_style
from rtradar.system.figure_style import new_figure, save_figure

pytestmark = pytest.mark.drawn

RADAR = rt.Radar(samples_per_chirp=16, tx_y=1, tx_z=0, rx_y=2, rx_z=0)
FILE = Path("out.png")
POWER = np.random.default_rng(0).exponential(size=(16, 8))
MASK = POWER > 2


SCALLOPING_DB = {"hann": 1.42, "blackman": 1.10, "flattop": 0.01}
"""Loss of a tone in the middle between two bins; Harris (1978), table 1, has the first two."""


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Every figure that is saved, instead of its file."""
    figures: list[Figure] = []
    # As it was then, for afterwards it is emptied.

    def keep(figure: Figure, _: object) -> None:
        figures.append(pickle.loads(pickle.dumps(figure)))

    monkeypatch.setattr(figure_style, "write_png", keep)
    monkeypatch.setattr(figure_style, "write_pdf", lambda *_: None)
    return figures


WATTS = dataclasses.replace(RADAR, transmit_power_dbm=12.0)
UNIT = FieldUnit("dB re maximum", 1.0)
MAPS = {"azimuth": (np.ones((16, 8)), np.linspace(-1, 1, 8))}
ROOMS: dict[str, Callable[[rt.Radar], None]] = {
    "before_after": lambda radar: draw_room_maps(
        FILE, before_after({"As received": (POWER, MASK)}, [], radar), {}, "run"
    ),
    "walls": lambda radar: draw_room_maps(
        FILE, [azimuth_and_walls(MAPS["azimuth"], rt.Scene(), radar, [])], {}, "run"
    ),
}
SAID = {
    "range_time": "mean of channels",
    "range_doppler": "mean of channels",
    "spectrogram": "one channel",
    "range_angle": "detected cells",
    "before_after": "mean of channels",
    "walls": "detected cells",
}


NAME = r"5$ \none$"
"""A name that would be a wrong formula, and that stops a picture if it is read as one."""
ALONE = {"a": np.ones(8), NAME: np.ones(8)}
POINTS = np.random.default_rng(0).normal(size=(10, 3))
WALL = Wall(
    name=NAME,
    corner_m=(1.0, -1.0, 0.0),
    edge_u_m=(0.0, 2.0, 0.0),
    edge_v_m=(0.0, 0.0, 2.0),
    material=material("metal"),
    thickness_m=0.1,
)
ROOM = rt.Scene(walls=(WALL,))
GHOST = ghost_mark(1, 0.3, 0.0)
SHOWN = ShownRoom(
    scene=ROOM,
    radar=RADAR,
    tracks={NAME: np.zeros((3, 2))},
    paths={1: POINTS},
    key={1: NAME},
    before_after=before_after({"As received": (POWER, MASK)}, [GHOST], RADAR),
    azimuth=[azimuth_and_walls(MAPS["azimuth"], ROOM, RADAR, [GHOST])],
)
HISTORY = [{f"{side}_{name}": 0.5 for side in ("train", "test") for name in ("loss", "accuracy")}]
AXES = {"across": np.arange(8.0), "up": np.arange(16.0), "view": (None, (0.0, 15.0))}
MAP = ShownMap(
    title="", labels=("", ""), level_db=POWER, unit=UNIT, qualifier="one channel", **AXES
)
EVERY: dict[str, Callable[[], None]] = {
    "room_maps": lambda: draw_room_maps(
        FILE, [*SHOWN.before_after, *SHOWN.azimuth], {1: NAME}, NAME
    ),
    "room_plan": lambda: draw_room_plan(FILE, SHOWN, NAME),
    "power_over_time": lambda: draw_power_over_time(FILE, np.arange(8.0), ALONE, UNIT, NAME, NAME),
    "part_power": lambda: draw_part_power(FILE, [NAME] * 8, ALONE, ALONE, UNIT, NAME),
    "maps": lambda: draw_maps(FILE, {"a": MAP, NAME: MAP}, NAME, NAME),
    "rdt_clouds": lambda: draw_rdt_clouds(FILE, {"a": POINTS, NAME: POINTS}, NAME),
    "accuracies": lambda: evaluation.draw_accuracies(FILE, [(NAME, [0.5, 0.7])]),
    "confusion": lambda: evaluation.draw_confusion(FILE, np.eye(2, dtype=int), ["a", NAME], NAME),
    "transfer": lambda: evaluation.draw_transfer(FILE, ["a", NAME], np.eye(2), np.eye(2), NAME),
    "learning": lambda: evaluation.draw_learning(FILE, [HISTORY], NAME),
}


@pytest.mark.parametrize("reference", ["b", None])
def test_compared_maps_are_in_one_unit_and_say_how_each_was_made(
    drawn: list[Figure], reference: str | None
) -> None:
    # Twice the power, each below a maximum of its own; the first without clutter removal.
    given: dict[str, Any] = {"title": "", "labels": ("", ""), "qualifier": "one channel"} | AXES
    maps = {}
    for name, made, power in (("a", "", 2 * POWER), ("b", "mean removed", POWER)):
        unit = FieldUnit("dB re maximum", 1 / power.max())
        maps[name] = ShownMap(level_db=unit.level(power), made=made, unit=unit, **given)
    draw_maps(FILE, maps, "run", reference)
    (first, second), label = drawn[0].axes[:2], drawn[0].axes[2].get_ylabel()
    levels = [np.asarray(axes.images[0].get_array()) for axes in (first, second)]
    apart_db = 0.0 if reference is None else 10 * np.log10(2)
    # Maps are in float32.
    np.testing.assert_allclose(levels[0] - levels[1], apart_db, atol=1e-5)
    assert levels[1].max() == pytest.approx(0, abs=1e-9)
    assert "dB re maximum" in label
    assert "removed" not in first.get_title(loc="left")
    assert "removed" in second.get_title(loc="left")


def bars(figure: Figure) -> list[str]:
    labels = [axes.get_ylabel() for axes in figure.axes if axes.get_label() == "<colorbar>"]
    return [label.replace("\n", " ") for label in labels]


@pytest.mark.parametrize("name", SAID)
def test_colours_say_which_power_they_are_and_in_which_unit(
    drawn: list[Figure], plots_of: Callable[..., Plots], name: str
) -> None:
    expected = [f"RCS, {SAID[name]} [dBsm]", f"Received power, {SAID[name]} [dBm]"]
    if name in ROOMS:
        for radar in (RADAR, WATTS):
            ROOMS[name](radar)
        assert [bars(figure) for figure in drawn] == [[unit] for unit in expected]
        return
    if name == "spectrogram":
        expected = ["Power, one channel [dB re maximum]", expected[1]]
    expected.append(f"RCS, {SAID[name]} [dBsm]")
    for radar, loss, unit in zip((RADAR, WATTS, RADAR), (True, True, False), expected, strict=True):
        plots = plots_of(radar, parameters={"spreading": loss})
        assert bars(getattr(plots, name)().figure) == [unit]


def test_comparisons_say_their_unit(drawn: list[Figure]) -> None:
    times, one = np.arange(8.0), {"a": np.ones(8), "b": np.ones(8)}
    draw_power_over_time(FILE, times, one, UNIT, "b", "run")
    draw_part_power(FILE, [f"part {number}" for number in range(8)], one, one, UNIT, "run")
    EVERY["maps"]()
    assert drawn[0].axes[0].get_ylabel() == "Power, all parts [dB re maximum]"
    assert drawn[1].axes[0].get_xlabel() == "Power, mean over time [dB re maximum]"
    assert bars(drawn[2]) == ["Power, one channel [dB re maximum]"]


def test_every_velocity_axis_says_its_sign(
    drawn: list[Figure], plots_of: Callable[..., Plots]
) -> None:
    plots = plots_of(RADAR)
    figures = [
        getattr(plots, name)().figure for name in ("range_doppler", "spectrogram", "rdt", "spatial")
    ]
    ROOMS["before_after"](RADAR)
    draw_rdt_clouds(FILE, {"a": POINTS, "b": POINTS}, "run")
    for figure in [*figures, *drawn]:
        getters = (getattr(one, f"get_{side}label", str) for one in figure.axes for side in "xyz")
        labels = (get() for get in getters)
        velocity = {label.replace("\n", " ") for label in labels if "elocity" in label}
        # The narrow axis of a cloud has its sign on the colour bar.
        assert velocity - {"Velocity [m/s]"} == {"Velocity [m/s] (positive: receding)"}


@pytest.mark.parametrize(
    ("watts", "loss", "expected"),
    [(False, True, "dBsm"), (True, True, "dBm"), (False, False, "dBsm")],
)
def test_levels_by_hand(
    plots_of: Callable[..., Plots], watts: bool, loss: bool, expected: str
) -> None:
    """One cell of 1e-4 m2 in each of two channels at 2 m."""
    radar = WATTS if watts else RADAR
    row = int(np.abs(radar.range_m - 2.0).argmin())
    distance = float(radar.range_m[row])
    power = np.full((16, 8), 1e-12)
    power[row, 3] = 2e-4
    axes = plots_of(radar, power=power, parameters={"spreading": loss}).range_doppler()
    level = np.asarray(axes.images[0].get_array())[row, 3]
    by_hand = {
        # Skolnik: P_t lambda^2 / (4 pi)^3, isotropic; 12 dBm.
        "dBm": -40 + 12 + 20 * math.log10(299_792_458 / 14e9) - 30 * math.log10(4 * math.pi),
        "dBsm": -40 + (40 * math.log10(distance) if loss else 0),
    }[expected]
    assert level == pytest.approx(by_hand, abs=1e-9)
    assert expected in bars(axes.figure)[0]


@pytest.mark.parametrize("offset", [0.0, 0.5])
@pytest.mark.parametrize(
    ("preset", "name"),
    [
        ("paper-12ghz", "hann"), ("paper-12ghz", "blackman"),
        ("paper-77ghz", "flattop"), ("paper-77ghz", "hann"),
    ],
)  # fmt: skip
def test_a_sphere_reads_its_own_cross_section(
    plots_of: Callable[..., Plots], preset: str, offset: float, name: str
) -> None:
    """A large conducting sphere of radius a has pi a^2: 0.2 m are -9.01 dBsm, in every picture."""
    radar, radius, windows = rt.Radar.preset(preset), 0.2, WindowFunctions(name, name)
    row = round(4.0 / radar.range_bin_m)
    radar = dataclasses.replace(radar, frame_duration_s=0.02)
    distance = (row + offset) * radar.range_bin_m
    middle = np.asarray(radar.position_m) + np.array([distance + radius, 0, 0])
    # To the nearest point of the sphere and back, from the closed form of its specular point for
    # antennas close to each other.
    legs = [np.linalg.norm(antennas - middle, axis=1) - radius for antennas in (radar.tx, radar.rx)]
    chirps = np.arange(radar.chirps_per_frame)
    tx = radar.tx_of_chirp(chirps)
    there, back = legs[0][tx][:, None], legs[1][radar.rx_of_tx[tx]]
    zero = np.zeros(1, np.int64)
    echoes = rt.Echoes(
        length=(there + back)[..., None],
        amplitude=(math.sqrt(math.pi) * radius / (there * back))[None, ..., None].astype(complex),
        frequency=np.array([radar.centre_frequency_hz]),
        tx=tx,
        part=zero,
        bounces=zero + 1,
    )
    samples = synthesize(echoes, radar, radar.chirp_times(len(chirps)), dtype=np.complex64)
    spectra = range_spectrum(samples, radar, window_functions=windows)
    cube = spectra.reshape(-1, radar.n_tx, radar.n_rx, radar.samples_per_chirp)
    power = power_map(cube, radar, window_functions=windows)
    mask = power > power.max() * 1e-4
    angles = frame_angles(cube, mask, radar, windows)
    cycles = radar.cycles_per_frame
    columns = spectrogram(cube[:, 0, 0], radar, window=cycles, window_functions=windows)
    over_time, _ = range_time(spectra, radar)
    given = {
        "n_velocity": power.shape[1],
        "power": power,
        "mask": mask,
        "range_time": over_time,
        "slow_time": np.arange(float(len(over_time))),
        "range_azimuth": range_azimuth(angles, radar)[None],
        "azimuth": angle_grid(radar),
        "spectrogram": columns.power,
        "spectrogram_time": columns.time,
        "parameters": {"range_window": name, "doppler_window": name},
    }

    def peak(axes: Axes) -> float:
        return float(np.asarray(axes.images[0].get_array()).max())

    plots = plots_of(radar, **given)
    peaks = [peak(draw()) for draw in (plots.range_doppler, plots.range_time, plots.range_angle)]
    closed_form = 10 * math.log10(math.pi * radius**2)
    # In the middle of a bin nothing is lost but for channels some millimetres farther, 0.1 dB;
    # between two bins the scalloping of the window function is, and the loss over distance is that
    # of the bin, half of which is 40 log10(1 + 1 / 2 / 107), 0.08 dB at most. At 12 GHz the ends of
    # the lines are a quarter of a bin farther, and so nearer to the middle of one: up to 0.3 dB
    # less lost.
    lost, tolerance = (0.0, 0.1) if offset == 0 else (SCALLOPING_DB[name], 0.4)
    assert peaks == pytest.approx([closed_form - lost] * 3, abs=tolerance)
    # Added up over range, nothing is lost between two bins: the received power of the radar
    # equation, P_t lambda^2 sigma / ((4 pi)^3 R^4), for 12 dBm.
    watts = dataclasses.replace(radar, transmit_power_dbm=12.0)
    level = peak(plots_of(watts, **given).spectrogram())
    wavelength = 299_792_458 / radar.centre_frequency_hz
    equation = 12 + 20 * math.log10(wavelength) - 30 * math.log10(4 * math.pi)
    assert level == pytest.approx(equation + closed_form - 40 * math.log10(distance), abs=0.15)


def test_the_panel_of_detections_names_no_detector_for_it_is_not_told_which(
    plots_of: Callable[..., Plots],
) -> None:
    figure = plots_of(RADAR).range_doppler().figure
    assert not any("CFAR" in axes.get_title("left") for axes in figure.axes)


def test_ghosts_have_numbers_with_a_key(drawn: list[Figure]) -> None:
    ghosts = [ghost_mark(number, 0.3 + 0.01 * number, 0.0) for number in (1, 2, 3)]
    key = {1: "left", 2: "right", 3: "floor > left"}
    shown = before_after({"As received": (POWER, MASK)}, ghosts, RADAR)
    draw_room_maps(FILE, shown, key, "run")
    texts = [text.get_text().replace("\n", " ") for text in drawn[0].axes[0].texts]
    assert {"1", "2", "3"} <= set(texts)
    assert any("predicted over: 1 left, 2 right, 3 floor > left." in text for text in texts)


def test_every_function_that_draws_is_among_those_drawn_below() -> None:
    modules = (rooms, comparison, evaluation)
    own = {
        name
        for module in modules
        for name, thing in vars(module).items()
        if name.startswith("draw_") and thing.__module__ == module.__name__
    }
    assert own == {f"draw_{name}" for name in EVERY}


@pytest.mark.parametrize("name", EVERY)
def test_a_name_with_dollar_signs_is_drawn_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    EVERY[name]()
    image = imread(FILE)
    assert min(image.shape[:2]) > 100
    assert np.ptp(image[..., :3]) > 0.8


def test_a_saved_figure_keeps_neither_its_axes_nor_what_it_was_drawn_on(tmp_path: Path) -> None:
    """Without the collector of cycles, whose coming is chance."""

    def renderers() -> int:
        # Proxies would answer isinstance.
        return sum(type(one) is RendererAgg for one in gc.get_objects())

    gc.collect()
    gc.disable()
    before = renderers()
    try:
        figure = new_figure(3.0)
        figure.add_subplot().imshow(POWER)
        save_figure(figure, tmp_path / "out.png", pdf=tmp_path / "out.pdf")
        assert renderers() == before
    finally:
        gc.enable()
    assert figure.axes == []
    assert (tmp_path / "out.png").stat().st_size > 1000
    written = (tmp_path / "out.pdf").read_bytes()
    assert written.startswith(b"%PDF")
    assert len(written) > 1000
    assert b"CreationDate" not in written


def test_a_map_of_cross_sections_says_what_it_does_to_echoes_of_elsewhere() -> None:
    level = np.zeros((3, 4))
    grid = np.arange(4.0), np.arange(3.0)
    for scale, said in ((1.0, False), (np.ones((3, 1)), True)):
        view = None, (0.0, 2.0)
        one = {"unit": FieldUnit("dBsm", scale), "qualifier": "", "view": view}
        across, up = grid
        shown = ShownMap(title="", labels=("", ""), level_db=level, across=across, up=up, **one)
        assert ("R^4" in shown.colours) == said
