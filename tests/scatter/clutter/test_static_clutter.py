"""Static clutter as a whole: one list of echoes, what is kept and dropped, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.clutter import static_clutter
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scene import Furniture, Scene, Surface, material, room_walls

RADAR = Radar(tx_y=2, tx_z=1, rx_y=2, rx_z=2)
SURFACES = {
    side: Surface(
        material=material("concrete"),
        thickness_m=0.2,
        roughness_m=0.0005 if side == "floor" else 0.0,
    )
    for side in ("near", "far", "right", "left", "floor", "ceiling")
}
ROOM = Scene(
    name="room",
    walls=room_walls((6.0, 4.5, 2.6), (-4.8, -2.0), SURFACES),
    furniture=(
        Furniture(name="chair", mesh="chair", material=material("wood"), position_m=(0, 0, 0)),
    ),
)


@pytest.fixture(scope="module")
def clutter() -> Clutter:
    return Clutter(RADAR, ROOM, variant="scalar", order=1)


def test_objects_are_told_apart_and_sorted(clutter: Clutter) -> None:
    names = {(item.name, item.kind) for item in clutter.kept}
    assert names == {
        *((side, "mirror") for side in SURFACES),
        ("floor", "rough"),
        ("chair", "furniture"),
    }
    cells = [item.cell_m2 for item in clutter.kept]
    assert cells == sorted(cells, reverse=True)
    echoes = list(clutter.cycle())
    counts = np.bincount(-1 - np.concatenate([own.part for own in echoes]))
    np.testing.assert_array_equal(counts, [item.echoes for item in clutter.kept])
    assert clutter.n_echoes == counts.sum()
    np.testing.assert_array_equal([own.tx for own in echoes], [np.arange(RADAR.n_tx)] * len(echoes))


def test_what_is_far_below_the_noise_is_dropped_with_a_reason(clutter: Clutter) -> None:
    gain = RADAR.samples_per_chirp * RADAR.cycles_per_frame * RADAR.n_channels
    middle = clutter.kept[3].cell_m2
    pruned = clutter.prune(middle * gain, margin_db=0.0)
    assert pruned.kept == clutter.kept[:4]
    assert len(pruned.objects) == 4
    assert [item.name for item in pruned.dropped] == [item.name for item in clutter.kept[4:]]
    assert all("dB below the noise" in item.reason for item in pruned.dropped)
    assert clutter.dropped == ()
    assert clutter.prune(middle * gain, margin_db=300.0).kept == clutter.kept
    assert clutter.prune(0.0).kept == clutter.kept


def test_the_strongest_cell_is_what_the_range_spectrum_shows(clutter: Clutter) -> None:
    # A mirror's is one echo: its amplitude squared, in every channel.
    for item, echoes in zip(clutter.kept, clutter.objects, strict=True):
        if item.kind == "mirror":
            middle = np.abs(echoes.amplitude[len(echoes.frequency) // 2]) ** 2
            assert item.cell_m2 == pytest.approx(middle.max())
        else:
            assert item.power_m2 / 100 < item.cell_m2 < item.power_m2 * item.echoes


def test_what_is_too_far_for_the_sampling_is_named() -> None:
    far = Clutter(
        replace(RADAR, samples_per_chirp=64), replace(ROOM, furniture=()), variant="scalar", order=1
    )
    assert {item.name for item in far.dropped} == {"far", "right"}
    assert all("farther than the 2.4 m" in item.reason for item in far.dropped)
    assert "near" in {item.name for item in far.kept}


def test_free_space_has_none() -> None:
    clutter = Clutter(RADAR, Scene(), variant="scalar")
    assert clutter.kept == ()
    assert list(clutter.cycle()) == []


@pytest.mark.parametrize("order", [-1, 4, 1.5, True])
def test_an_order_without_meaning_is_refused(order: int) -> None:
    with pytest.raises(InputError, match="order"):
        Clutter(RADAR, Scene(), variant="scalar", order=order)


def test_a_room_is_traced_once_for_all_who_walk_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    chair = Furniture(name="chair", mesh="chair", material=material("wood"), position_m=(0, -1, 0))
    scene = Scene(furniture=(chair,), radar_position_m=(-4.0, 0.0, 1.1))
    first = Clutter(RADAR, scene, variant="scalar")
    for traced in ("specular_returns", "furniture_returns", "rough_returns"):
        monkeypatch.setattr(static_clutter, traced, None)
    again = Clutter(RADAR, replace(scene, person_position_m=(0.5, 0.2)), variant="scalar")
    assert again.objects[0] is first.objects[0]
    moved = replace(scene, furniture=(replace(chair, position_m=(0, -1.1, 0)),))
    with pytest.raises(TypeError):  # it would have to be traced
        Clutter(RADAR, moved, variant="scalar")
