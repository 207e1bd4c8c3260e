"""Slabs as sums of delayed echoes: exact, few where few serve, the same for person and clutter."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.errors import InputError, ValidityWarning
from rtradar.radar import Radar
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.models.specular import Specular
from rtradar.scatter.multipath.slabs import Term, room_series
from rtradar.scene import Furniture, Material, Scene, Wall, material, own_material, slab
from rtradar.scene.slab import slab_passes

Array = NDArray[np.float64]
C = SPEED_OF_LIGHT_MPS
PRESET = Radar.preset("paper-12ghz")
FREQUENCY = np.linspace(12e9, 16e9, 401)


def pane(made: str | Material, thickness: float, x: float = -2.0, *, beside: bool = False) -> Wall:
    """Across the way from a radar at x = -4 to a body at x = 0; or beside it, at y = 1.6."""
    along = (40.0, 0.0, 0.0), (0.0, 0.0, 40.0)
    edges = along if beside else ((0.0, 0.0, 40.0), (0.0, 40.0, 0.0))
    return Wall(
        name="side" if beside else "pane",
        corner_m=(-20.0, 1.6, -20.0) if beside else (x, -20.0, -20.0),
        edge_u_m=edges[0],
        edge_v_m=edges[1],
        material=material(made) if isinstance(made, str) else made,
        thickness_m=thickness,
    )


BALL = (0.12, 0.12, 0.12)


def spectrum(
    length: Array, amplitude: NDArray[np.complexfloating], nodes: Array
) -> NDArray[np.complex128]:
    """Sum of echoes with phases (frequency, ...), of amplitudes (node, ..., echo)."""
    weights = np.ones((len(FREQUENCY), len(nodes)))
    for column, node in enumerate(nodes):
        for other in np.delete(nodes, column):
            weights[:, column] *= (FREQUENCY - other) / (node - other)
    turns = np.exp(-2j * np.pi / C * FREQUENCY.reshape(-1, *(1,) * length.ndim) * length)
    return np.asarray((np.tensordot(weights, amplitude, axes=1).conj() * turns).sum(axis=-1))


def of(echoes: Echoes) -> NDArray[np.complex128]:
    return spectrum(echoes.length, echoes.amplitude, echoes.frequency)


# -- the series ------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["te", "tm"])
@pytest.mark.parametrize("name", ["brick", "glass", "concrete", "vacuum"])
def test_passes_add_up_to_the_slab(name: str, kind: str) -> None:
    cosine = np.linspace(0.05, 1.0, 20)
    args = material(name).eta(14e9), 0.02, 14e9, cosine, kind
    for first, exact in enumerate(slab(*args)):  # type: ignore[arg-type]
        each = [slab_passes(*args, passes) for passes in range(first, 300, 2)]  # type: ignore[arg-type]
        np.testing.assert_allclose(sum(each), exact, atol=1e-10)
        for count in (0, 1, 4):
            rest = slab_passes(*args, first + 2 * count, rest=True)  # type: ignore[arg-type]
            np.testing.assert_allclose(sum(each[:count]) + rest, exact, atol=1e-12)


def test_passes_of_a_conductor_and_at_grazing_incidence() -> None:
    metal = complex(0.0, -np.inf)
    assert [slab_passes(metal, 0.1, 14e9, 0.5, kind, 0) for kind in ("te", "tm")] == [-1.0, 1.0]  # type: ignore[arg-type]
    assert slab_passes(metal, 0.1, 14e9, 0.5, "te", 1) == 0
    # Whole half waves of a lossless slab: nothing enters.
    assert slab_passes(1.25, C / 14e9, 14e9, 0.0, "te", 1, rest=True) == 0


def test_a_term_without_its_delay_turns_little() -> None:
    wall, cosine = pane("brick", 0.24), np.array(0.8)
    (_, (first, *_)) = (
        room_series((wall,), PRESET, most_nodes=3, enough=0.015, bounces=1).walls[0].terms
    )
    extra = first.extra_m(0.24, cosine)
    # On a straight way through a slab of index n: n d / cos of the angle inside, less what is lost
    # to the side.
    inside = np.sqrt(1 - (1 - 0.8**2) / 3.91)
    assert extra == pytest.approx(0.24 * (np.sqrt(3.91) * inside - 0.8), abs=1e-4)
    phase = np.unwrap(np.angle(first.coefficient(wall, cosine, FREQUENCY, "te")))
    assert np.ptp(phase) < 0.02
    assert Term(1, rest=True).extra_m(0.24, cosine) == 0


@pytest.mark.parametrize(
    ("name", "thickness"), [("perfect-conductor", 0.1), ("concrete", 0.2), ("glass", 0.003)]
)
def test_what_is_smooth_stays_one_echo(name: str, thickness: float) -> None:
    (one,), frequency = room_series(
        (pane(name, thickness),), PRESET, most_nodes=3, enough=0.015, bounces=1
    )
    assert [term.whole for term in one.terms[0]] == [True]
    # Concrete of 20 cm is as good as a half-space: one node, and what comes through, 107 dB down,
    # asks for none.
    assert len(frequency) == {"perfect-conductor": 1, "concrete": 1, "glass": 3}[name]
    if name == "glass":
        assert [term.whole for term in one.terms[1]] == [True]


def test_thick_walls_are_held_by_few_terms_and_three_nodes() -> None:
    for name, thickness, most in (
        ("brick", 0.24, 2),
        ("brick", 0.1, 4),
        ("plasterboard", 0.025, 4),
        ("wood", 0.1, 2),
    ):
        (one,), frequency = room_series(
            (pane(name, thickness),), PRESET, most_nodes=3, enough=0.015, bounces=1
        )
        assert one.held == (True, True)
        assert max(len(terms) for terms in one.terms) <= most
        assert len(frequency) <= 3


# -- the person ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "thickness"),
    [("brick", 0.24), ("glass", 0.02), ("plasterboard", 0.0125), ("plasterboard", 0.003)],
)
def test_a_sphere_behind_a_thick_wall_has_the_exact_slab(
    name: str, thickness: float, make: Any
) -> None:
    body, radar = make.one(BALL, (0.0, 0.0, 1.0)), Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0)
    wall = pane(name, thickness)
    behind = make.room(radar, body, wall, order=0).echoes(np.arange(1))
    free = Specular(radar, body).echoes(np.arange(1))
    way = np.array([4.0, -1.0, 0.0]) - 0.0
    cosine = abs(way[0]) / np.linalg.norm(way)
    passed = slab(wall.material.eta(FREQUENCY), thickness, FREQUENCY, cosine, "te")[1]
    passed_tm = slab(wall.material.eta(FREQUENCY), thickness, FREQUENCY, cosine, "tm")[1]
    # The antenna is at y = 1, in the plane of the wave and the normal, so v is TE.
    assert not np.allclose(passed, passed_tm, rtol=1e-3)
    exact = (
        of(free)[:, 0, 0] * (passed * np.exp(2j * np.pi * FREQUENCY / C * thickness * cosine)) ** 2
    )
    error = np.abs(of(behind)[:, 0, 0] - exact).max() / np.sqrt((np.abs(exact) ** 2).mean())
    assert error < 0.02


def test_the_person_behind_brick_is_farther_for_every_antenna_and_while_moving(make: Any) -> None:
    body = make.one(BALL, (0.0, 0.0, 1.0), velocity=(0.5, 1.5, 0.0))
    model = make.room(PRESET, body, pane("brick", 0.24), order=0)
    # Between two keyframes, from both ends of the lines.
    chirps = 12 * 67 + np.arange(12)
    echoes, free = model.echoes(chirps), model.person.echoes(chirps)
    strongest = int((np.abs(echoes.amplitude[0]) ** 2).mean(axis=(0, 1)).argmax())
    farther = echoes.length[..., strongest] - free.length[..., 0]
    start = body.at(PRESET.centres_of(chirps)).centres[:, 0] - np.array([0.12, 0.0, 0.0])
    tx, rx = PRESET.tx[np.arange(12)], PRESET.rx[PRESET.rx_of_tx]
    expected = np.zeros_like(farther)
    for antennas in (np.broadcast_to(tx[:, None], rx.shape), rx):
        ways = start[:, None] - antennas
        cosine = ways[..., 0] / np.linalg.norm(ways, axis=-1)
        expected += 0.24 * (np.sqrt(3.91 - 1 + cosine**2) - cosine)
    # The specular point is not just where this takes it to be, 2 cm away at most.
    np.testing.assert_allclose(farther, expected, atol=1.5e-3)
    assert np.ptp(farther) > 2e-3


def test_one_pruned_echo_list_for_all_of_a_capture(make: Any) -> None:
    # It walks out from behind a partition of brick.
    partition = replace(pane("brick", 0.1), corner_m=(-2.0, -3.0, -20.0), edge_v_m=(0.0, 3.5, 0.0))
    body = make.one(BALL, (0.0, -1.2, 1.0), velocity=(0.0, 3.0, 0.0))
    model = make.room(PRESET, body, partition, order=1)
    n_chirps = int(0.9 / PRESET.chirp_duration_s)
    (direct, *_) = model.prune(n_chirps, 0.0)
    assert direct.kept == ["part 0"]
    early, late = (
        model.echoes(np.arange(4)),
        model.echoes(np.arange(n_chirps - 400, n_chirps - 396)),
    )
    np.testing.assert_array_equal(early.path, late.path)
    power = [(np.abs(echoes.amplitude) ** 2).mean(axis=(0, 1, 2)) for echoes in (early, late)]
    # Behind it each wave has a delay, beside it none has.
    assert power[0][0] == 0
    assert power[0][1:].max() > 0
    assert power[1][0] > 0
    assert model.not_followed == {}


@pytest.mark.parametrize(("name", "thickness"), [("brick", 0.11), ("plasterboard", 0.025)])
def test_ghosts_off_a_wall_whose_back_answers(name: str, thickness: float, make: Any) -> None:
    body, radar = make.one(BALL, (2.0, -0.3, 1.0)), Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0)
    found = {}
    for made, depth in ((name, thickness), ("perfect-conductor", 0.1)):
        model = make.room(radar, body, pane(made, depth, beside=True), order=2)
        echoes = model.echoes(np.arange(1))
        for path in ("side > body", "side > body > side"):
            own = np.array(model.path_names)[echoes.path] == path
            found[path, made] = spectrum(
                echoes.length[..., own], echoes.amplitude[..., own], echoes.frequency
            )[:, 0, 0]
    for path, power in (("side > body", 1), ("side > body > side", 2)):
        # The image of the antenna, its leg to where the sphere is met, and so the angle on the
        # wall.
        image = np.array([radar.tx[0, 0], 3.2 - radar.tx[0, 1], 1.0])
        centre, back = body.centres[0], radar.tx[0] if power == 1 else image
        point = centre
        for _ in range(100):
            legs = [(place - point) / np.linalg.norm(place - point) for place in (image, back)]
            point = centre + 0.12 * sum(legs) / np.linalg.norm(sum(legs))
        cosine = abs(legs[0][1])
        exact = (
            found[path, "perfect-conductor"]
            * (-slab(material(name).eta(FREQUENCY), thickness, FREQUENCY, cosine, "te")[0]) ** power
        )
        error = np.abs(found[path, name] - exact).max() / np.sqrt((np.abs(exact) ** 2).mean())
        assert error < 0.02, path


# -- what is not held ------------------------------------------------------------------------------


def dispersive() -> Material:
    """Its permittivity falls from 5.8 to 2.4 over the sweep."""
    return own_material("odd", source="a test", low_hz=11.9e9, high_hz=16.1e9, a=1e4, b=-3.0, c=0.0)


def test_a_wall_that_is_not_followed_is_a_limit(tmp_path: Path) -> None:
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.3)
    radar = replace(
        PRESET, tx_y=1, tx_z=0, rx_y=1, rx_z=0, chirp_duration_s=PRESET.cycle_duration_s
    )
    scene = Scene(walls=(pane("concrete", 0.3, x=-3.0),))
    with pytest.warns(
        ValidityWarning, match=r"walls whose coefficient over the sweep is not known to 2%.*: pane"
    ):
        result = rt.run(motion, radar, scene, order=0, variant="cpu")
    (limit,) = (one for one in result.summary["limits"] if one["name"] == "wall_frequency_response")
    assert limit["share"] == pytest.approx(1.0)
    assert "pane" in limit["message"]


# -- static clutter --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "thickness"),
    [("brick", 0.11), ("brick", 0.24), ("concrete", 0.1), ("plasterboard", 0.0125)],
)
def test_a_mirror_of_a_thick_wall_is_held_to_a_thousandth(name: str, thickness: float) -> None:
    radar = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, samples_per_chirp=512)
    (own,) = Clutter(radar, Scene(walls=(pane(name, thickness, beside=True),)), order=1).objects
    ours = spectrum(own.length, own.amplitude, own.frequency)[:, 0, 0]
    distance = 2 * (1.6 - radar.position_m[1])
    reflected = slab(material(name).eta(FREQUENCY), thickness, FREQUENCY, 1.0, "te")[0]
    exact = (
        -np.sqrt(4 * np.pi) / distance * reflected * np.exp(-2j * np.pi * FREQUENCY / C * distance)
    )
    assert np.abs(ours - exact).max() < 1e-3 * np.abs(exact).max()
    # What a polynomial follows stays one echo.
    assert (own.n_echoes == 1) == (name == "plasterboard")


def test_a_reflector_behind_brick_is_delayed_and_weakened_on_both_legs() -> None:
    radar = Radar(
        tx_y=1, tx_z=0, rx_y=1, rx_z=0, samples_per_chirp=512, position_m=(-4.0, 0.0, 1.0)
    )
    corner = Furniture(
        name="corner",
        mesh="trihedral",
        material=material("perfect-conductor"),
        position_m=(0.0, 0.0, 1.0),
        yaw_deg=180.0,
    )
    rough = replace(
        pane("perfect-conductor", 0.1, x=0.5),
        name="rough",
        corner_m=(0.5, -0.05, 0.95),
        edge_u_m=(0.0, 0.0, 0.1),
        edge_v_m=(0.0, 0.1, 0.0),
        roughness_m=5e-4,
    )
    wall = pane("brick", 0.24)
    passed = slab(wall.material.eta(FREQUENCY), 0.24, FREQUENCY, 1.0, "te")[1] * np.exp(
        2j * np.pi * FREQUENCY / C * 0.24
    )
    for kind, walls, furniture in (("reflector", (), (corner,)), ("rough", (rough,), ())):
        found = []
        for more in ((), (wall,)):
            objects = Clutter(
                radar,
                Scene(walls=(*walls, *more), furniture=furniture),
                order=0,
            ).objects
            (own,) = (one for one in objects if one.kind == kind)
            found.append(spectrum(own.length, own.amplitude, own.frequency)[:, 0, 0])
        free, behind = found
        # Straight on within a degree or two, where the way through the slab is 0.1 mm longer.
        assert np.abs(behind - free * passed**2).max() < 0.1 * np.abs(free * passed**2).max(), kind


def test_clutter_that_cannot_be_followed_is_refused() -> None:
    radar = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, samples_per_chirp=512)
    with pytest.raises(
        InputError,
        match=r"^clutter of scene '.*': over the sweep the return 'side' is off by .*allowed is "
        r"0\.001",
    ):
        Clutter(radar, Scene(walls=(pane(dispersive(), 3.0, beside=True),)), order=1)
