"""Static clutter as a whole, what is kept and refused, and diffuse returns in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.clutter import static_clutter
from rtradar.scatter.clutter.returns import RoomEchoes
from rtradar.scatter.clutter.static_clutter import Clutter, rough_returns
from rtradar.scatter.multipath.slabs import WHOLE, after_slab
from rtradar.scene import Furniture, Scene, Surface, Wall, material, room_walls, slab
from rtradar.trace.backend import select, use
from rtradar.trace.occluders import Occluders

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


FAR = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, position_m=(-8, 0, 1), samples_per_chirp=1024)
WAVENUMBER = 2 * np.pi * 14e9 / SPEED_OF_LIGHT_MPS


def wall(turn_deg: float = 0.0, roughness_m: float = 0.002) -> Wall:
    """One square metre at x = 0, facing the radar, turned about the vertical through its middle."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    edge = np.array([s, -c, 0.0])
    corner = -edge / 2 + [0, 0, 0.5]
    return Wall(
        name="wall",
        corner_m=tuple(corner),
        edge_u_m=tuple(edge),
        edge_v_m=(0, 0, 1),
        material=material("concrete"),
        thickness_m=0.2,
        roughness_m=roughness_m,
    )


def rough(radar: Radar, *walls: Wall) -> list[RoomEchoes]:
    scene = Scene(
        walls=tuple(replace(each, name=f"wall {index}") for index, each in enumerate(walls))
    )
    return list(rough_returns(radar, scene, Occluders(use(select("scalar")), scene)))


@pytest.mark.parametrize("turn_deg", [0.0, 40.0, 70.0])
@pytest.mark.parametrize("roughness_m", [0.0005, 0.002, 0.01])
def test_power_per_area_is_that_of_the_closed_form(turn_deg: float, roughness_m: float) -> None:
    (echoes,) = rough(FAR, wall(turn_deg, roughness_m))
    cosine = np.cos(np.radians(turn_deg))
    fraction = 1 - np.exp(-((2 * WAVENUMBER * roughness_m * cosine) ** 2))
    mirrored, _ = slab(material("concrete").eta(14e9), 0.2, 14e9, cosine, "te")
    expected = 4 * fraction * np.abs(mirrored) ** 2 * cosine**2
    # From 8 m the square metre is seen within 3.6 degrees, more where it is turned: 1 / R^4 and
    # cosines vary over it.
    assert echoes.power_m2() * 8**4 == pytest.approx(expected, rel=0.06)


def test_mirrored_and_diffuse_power_are_what_a_smooth_wall_mirrors() -> None:
    # Straight onto the wall: diffuse power by Lambert's law over half of space, sigma0 = 4 p cos
    # cos.
    for roughness in (0.0005, 0.002, 0.005):
        (echoes,) = rough(FAR, wall(0.0, roughness))
        diffuse = echoes.power_m2() * 8**4 / 4
        field, ahead = np.array([0, 0, 1.0 + 0j]), np.array([1.0, 0, 0])
        smooth, mirrored = (
            np.abs(after_slab(wall(0.0, height), field, ahead, [14e9], WHOLE[0])[0, 2]) ** 2
            for height in (0.0, roughness)
        )
        assert diffuse + mirrored == pytest.approx(smooth, rel=0.03)


def test_phases_and_places_stay_with_the_wall() -> None:
    (here,) = rough(FAR, wall())
    (there,) = rough(replace(FAR, position_m=(-6.0, 1.5, 1.2)), wall())
    np.testing.assert_array_equal(here.points, there.points)
    np.testing.assert_allclose(np.angle(here.amplitude), np.angle(there.amplitude), atol=1e-12)
    (again,) = rough(FAR, wall())
    np.testing.assert_array_equal(here.amplitude, again.amplitude)


def test_each_wall_has_its_own() -> None:
    one, other = rough(FAR, wall(), wall())
    assert np.abs(one.points - other.points).max() > 0.01
    phases = [np.exp(1j * np.angle(echoes.amplitude)) for echoes in (one, other)]
    assert np.abs(phases[0] - phases[1]).max() > 1


def test_sums_over_phases_are_speckle() -> None:
    (echoes,) = rough(replace(FAR, bandwidth_hz=4e9), wall())
    values = np.exp(1j * np.angle(echoes.amplitude[0, 0, 0]))
    # A hundred and more phases at random: their mean is below 3 / sqrt(n).
    assert len(values) > 100
    assert abs(values.mean()) < 3 / np.sqrt(len(values))


def test_smooth_walls_and_walls_from_behind() -> None:
    assert rough(FAR, wall(0.0, 0.0)) == []
    behind = replace(FAR, position_m=(8.0, 0, 1))
    (echoes,) = rough(behind, wall())
    # The back is one thickness nearer.
    np.testing.assert_allclose(echoes.points[..., 0], 0.2, atol=1e-12)
