"""Objects that move against `scattering_length` of their posed meshes, closed forms and images."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.motion import place
from rtradar.scatter import rigid_sheets
from rtradar.scatter.common.interpolation import interpolation_weights
from rtradar.scatter.multipath.image_paths import wall_paths
from rtradar.scatter.people_and_objects import build_model_of_all
from rtradar.scatter.rigid_echoes import PolynomialsInTime, RigidEchoes
from rtradar.scene import Wall, material, reflection, slab

RADAR = dataclasses.replace(
    rt.Radar.preset("paper-12ghz"), tx_y=2, tx_z=1, rx_y=2, rx_z=2, position_m=(0.0, 0.0, 1.0)
)


def field(echoes: rt.Echoes) -> NDArray[np.complex128]:
    """Field (node, chirp, rx) of all echoes of an object."""
    k = 2 * np.pi * echoes.frequency / SPEED_OF_LIGHT_MPS
    turns = np.exp(-1j * k[:, None, None, None] * echoes.length)
    return np.asarray((echoes.amplitude.conj() * turns).sum(axis=3))


def box(motion: rt.Turning | rt.FollowingPath | None, made_of: str = "metal") -> rt.Object:
    mesh = trimesh.creation.box((0.03, 0.3, 0.2))
    return rt.Object("box", mesh, made_of, position_m=(2.5, 0.3, 1.1), motion=motion)


@pytest.mark.parametrize("yaw_deg", [7.0, 25.0, 80.0])
def test_it_returns_what_physical_optics_of_the_posed_mesh_does(yaw_deg: float) -> None:
    still = dataclasses.replace(box(None), yaw_deg=yaw_deg)
    model = RigidEchoes(RADAR, still, 0.1, None)
    found = field(model.echoes(np.arange(2)))
    posed = trimesh.Trimesh(still.triangles().vertices, still.shape.faces, process=False)
    tx = np.repeat(RADAR.tx[RADAR.tx_of_chirp(np.arange(2))], RADAR.n_rx, axis=0)
    rx = RADAR.rx[RADAR.rx_of_tx[RADAR.tx_of_chirp(np.arange(2))]].reshape(-1, 3)
    ranges = np.linalg.norm(tx, axis=1) * np.linalg.norm(rx, axis=1)
    # The largest that it ever returns, broadside, scales the error.
    k = 2 * np.pi * model.frequency[1] / SPEED_OF_LIGHT_MPS
    most = k * 0.3 * 0.2 / np.sqrt(np.pi) / 2.5**2
    for node, frequency in enumerate(model.frequency):
        expected = rt.scattering_length(posed, tx, rx, frequency, fidelity="physical-optics")
        path = np.linalg.norm(tx, axis=1) + np.linalg.norm(rx, axis=1)
        expected = expected / ranges * np.exp(-2j * np.pi * frequency * path / SPEED_OF_LIGHT_MPS)
        np.testing.assert_allclose(found[node].ravel(), expected, atol=0.005 * most)


def test_between_its_nodes_the_sweep_is_met_as_well() -> None:
    still = dataclasses.replace(box(None), yaw_deg=25.0)
    radar = dataclasses.replace(RADAR, bandwidth_hz=RADAR.bandwidth_hz * 1.07)
    models = [RigidEchoes(one, still, 0.1, None) for one in (RADAR, radar)]
    own = models[0].echoes(np.arange(1))
    # Another sweep has other nodes.
    weights = interpolation_weights(models[0].frequency, models[1].frequency)
    between = dataclasses.replace(
        own,
        amplitude=np.tensordot(weights, own.amplitude, axes=1),
        frequency=models[1].frequency,
    )
    expected = field(models[1].echoes(np.arange(1)))
    np.testing.assert_allclose(field(between), expected, atol=0.005 * np.abs(expected).max())


def test_knots_in_time_give_what_every_chirp_gives() -> None:
    turning = box(rt.Turning(rate_hz=0.2))
    model = RigidEchoes(RADAR, turning, 0.5, None)
    chirps = np.arange(1200)
    assert model._knot_s > 3 * RADAR.cycle_duration_s
    found = field(model.echoes(chirps))[:, 700:712]
    # What is kept of one pass gives the next what it would find itself.
    after = np.arange(1200, 2400)
    again = RigidEchoes(RADAR, turning, 0.5, None).echoes(after)
    np.testing.assert_array_equal(model.echoes(after).amplitude, again.amplitude)
    expected = field(model.echoes(chirps[700:712]))
    np.testing.assert_allclose(found, expected, atol=0.003 * np.abs(expected).max())


def test_how_fast_it_turns_does_not_depend_on_the_length_of_the_capture() -> None:
    # 199 equal parts of 100 s are a turn each.
    turning = box(rt.Turning(rate_hz=1.99, phase_deg=90))
    knots_s = [RigidEchoes(RADAR, turning, duration_s, None)._knot_s for duration_s in (3.0, 100.0)]
    assert knots_s[1] == pytest.approx(knots_s[0], rel=0.05)


def test_a_plate_of_wood_reflects_by_its_coefficient() -> None:
    ahead = dataclasses.replace(box(None), position_m=(2.5, 0.0, 1.0))
    plates = [
        RigidEchoes(RADAR, dataclasses.replace(ahead, material=material(name)), 0.1, None)
        for name in ("perfect-conductor", "wood")
    ]
    conductor, wood = (field(own.echoes(np.arange(1))) for own in plates)
    eta = material("wood").eta(np.array([RADAR.centre_frequency_hz]))[0]
    expected = -reflection(eta, 1.0, "te")
    np.testing.assert_allclose(wood / conductor, expected, atol=0.02 * abs(expected))


def test_the_velocity_that_is_ambiguous_is_said() -> None:
    fast = box(rt.Turning(rate_hz=60))
    (limit,) = RigidEchoes(RADAR, fast, 0.5, None).limits
    assert limit.name == "object_velocity_ambiguous"
    assert 0 < limit.share < 1
    assert RigidEchoes(RADAR, box(rt.Turning(rate_hz=0.5)), 0.5, None).limits == ()


def test_too_near_to_an_antenna_is_refused() -> None:
    coming = box(rt.FollowingPath(velocity_mps=(-5, 0, 0)))
    with pytest.raises(rt.InputError, match=r"the object 'box' is 0\.\d+ m from an antenna"):
        RigidEchoes(RADAR, coming, 0.5, None)


def test_a_corner_reflector_on_a_cart_returns_three_bounces() -> None:
    radar = dataclasses.replace(
        RADAR, tx_y=1, tx_z=0, rx_y=1, rx_z=0, start_frequency_hz=11.9e9, bandwidth_hz=0.2e9
    )
    radar = dataclasses.replace(radar, position_m=(-4.0, 3.0, 1.0))
    cart = rt.Object(
        "cart",
        "trihedral",
        "metal",
        position_m=(96, 3, 1),
        yaw_deg=180,
        motion=rt.FollowingPath(velocity_mps=(-1, 0, 0)),
    )
    body = Body.from_motion(place(rt.synthetic_motion("punch", seed=0), duration_s=0.1))
    world = build_model_of_all("specular", radar, body, scene=rt.Scene(objects=(cart,)))
    echoes = world.echoes(np.arange(4))
    own = echoes.part == len(body.part_names)
    assert set(echoes.bounces[own]) == {1, 2, 3}
    only = dataclasses.replace(
        echoes,
        length=echoes.length[..., own],
        amplitude=echoes.amplitude[..., own],
        part=echoes.part[own],
        bounces=echoes.bounces[own],
    )
    power = np.abs(field(only)[1, :, 0]) ** 2 * 100.0**4
    wavelength = SPEED_OF_LIGHT_MPS / 12e9
    closed = 4 * np.pi * 0.4**4 / (3 * wavelength**2)
    np.testing.assert_allclose(10 * np.log10(power / closed), 0, atol=0.3)


def test_a_pass_may_need_more_knots_of_bounces_than_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rigid_sheets, "_KEPT_KNOTS", 2)
    monkeypatch.setattr(rigid_sheets, "_PASSING", 1)
    radar = dataclasses.replace(RADAR, tx_y=1, tx_z=0, rx_y=1, rx_z=0)
    turning = rt.Turning(rate_hz=0.5)
    corner = rt.Object(
        "corner", "dihedral", "metal", position_m=(3, 0, 1), yaw_deg=180, motion=turning
    )
    body = Body.from_motion(place(rt.synthetic_motion("punch", seed=0), duration_s=0.1))
    world = build_model_of_all("specular", radar, body, scene=rt.Scene(objects=(corner,)))
    moving, chirps = world.objects[0][0], np.arange(0, 40, 5)
    found = field(moving.echoes(chirps))
    np.testing.assert_allclose(field(moving.echoes(chirps[-1:])), found[:, -1:], atol=1e-6)


def wall(made_of: str, x: float, normal_x: float) -> Wall:
    """A wall of 20 m across x that faces the given side."""
    edges = ((0.0, 20.0, 0.0), (0.0, 0.0, 20.0))
    first, second = edges if normal_x > 0 else edges[::-1]
    return Wall(
        name="wall",
        corner_m=(x, -10.0, -10.0),
        edge_u_m=first,
        edge_v_m=second,
        material=material(made_of),
        thickness_m=0.0125,
    )


def test_a_wall_before_it_leaves_what_its_slab_lets_through_twice() -> None:
    ahead = dataclasses.replace(box(None), position_m=(2.5, 0.0, 1.0))
    chirp = np.arange(1)
    board = wall("plasterboard", 1.0, -1.0)
    free = field(RigidEchoes(RADAR, ahead, 0.1, None).echoes(chirp))
    model = RigidEchoes(RADAR, ahead, 0.1, None, walls=(board,))
    found = field(model.echoes(chirp))
    eta = board.material.eta(model.frequency)
    _, through = slab(eta, board.thickness_m, model.frequency, 1.0, "te")
    # Over the same way through air, out and back.
    k = 2 * np.pi * model.frequency / SPEED_OF_LIGHT_MPS
    expected = (through * np.exp(1j * k * board.thickness_m))[:, None, None] ** 2
    np.testing.assert_allclose(found / free, np.broadcast_to(expected, found.shape), atol=0.02)


def test_over_a_conducting_wall_it_is_its_mirror_image() -> None:
    behind = wall("perfect-conductor", -1.0, 1.0)
    # Wall, object, wall: the radar sees the object mirrored in the plane x = -1 m.
    (path,) = (
        own for own in wall_paths((behind,), np.array(RADAR.position_m), 2) if own.order == 2
    )
    own = dataclasses.replace(box(None), yaw_deg=20.0)
    mirrored = dataclasses.replace(own, yaw_deg=-20.0, position_m=(-4.5, 0.3, 1.1))
    chirp = np.arange(2)
    found = field(RigidEchoes(RADAR, own, 0.1, None, walls=(behind,), path=path).echoes(chirp))
    expected = field(RigidEchoes(RADAR, mirrored, 0.1, None).echoes(chirp))
    np.testing.assert_allclose(found, expected, atol=0.01 * np.abs(expected).max())


def test_polynomials_of_degree_seven_are_met() -> None:
    rng = np.random.default_rng(0)
    times, tx = rng.uniform(0.1, 0.2, 40), rng.integers(0, 3, 40)
    knots = PolynomialsInTime(times, 0.01)
    powers = np.arange(8)[:, None, None, None, None]
    terms = rng.normal(size=(8, 3, 2, 4, 5, 2)).view(np.complex128)[..., 0]

    def field(at: np.ndarray) -> np.ndarray:
        return (terms * (at / 0.2)[:, None, None, None, None, None] ** powers).sum(axis=1)

    found = knots.between(field(knots.numbers * 0.01), tx)
    expected = np.moveaxis(field(times)[np.arange(40), tx], 2, 0)
    np.testing.assert_allclose(found, expected, rtol=1e-5)
