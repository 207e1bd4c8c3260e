"""The person in a room: against the image theorem, hand-computed paths, and `mirror` itself."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body.body import Poses
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.motion.placement import place
from rtradar.radar import Radar
from rtradar.scatter import build_model
from rtradar.scatter.common.keyframes import keyframe_step
from rtradar.scatter.common.polarization import copolar
from rtradar.scatter.common.poses import chirp_poses
from rtradar.scatter.echo_models import models_that
from rtradar.scatter.models.analytic import Analytic
from rtradar.scatter.models.specular import Specular
from rtradar.scatter.multipath.image_paths import images, wall_paths
from rtradar.scatter.multipath.room_model import KEYFRAMES_S, RoomModel
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.scene import Furniture, Scene, Surface, Wall, material, room_walls
from rtradar.trace.backends.backend import Backend

Array = NDArray[np.float64]
SIDES = {
    "floor": ((-10.0, -10.0, 0.0), (20.0, 0.0, 0.0), (0.0, 20.0, 0.0)),
    "left": ((-10.0, 2.5, -10.0), (20.0, 0.0, 0.0), (0.0, 0.0, 20.0)),
}


@dataclass(frozen=True)
class Still:
    """Parts that stand where they are, or go with one velocity."""

    centres: Array
    axes: Array
    frames: Array
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    duration_s: float = 1.0

    @property
    def part_names(self) -> tuple[str, ...]:
        return tuple(f"part {i}" for i in range(len(self.centres)))

    @property
    def semi_axes(self) -> Array:
        return self.axes

    def at(self, times: Array) -> Poses:
        moved = self.centres + np.asarray(times)[:, None, None] * np.array(self.velocity)
        return Poses(
            moved, np.broadcast_to(self.frames, (len(times), *self.frames.shape)), self.axes
        )


def one(
    axes: tuple[float, float, float] = (0.1, 0.15, 0.3),
    centre: tuple[float, ...] = (0.0, 0.3, 1.2),
    **more: object,
) -> Still:
    frame = Rotation.from_euler("xyz", [0.3, -0.2, 0.5]).as_matrix()
    return Still(np.array([centre]), np.array([axes]), frame[None], **more)  # type: ignore[arg-type]


def wall(side: str, name: str = "perfect-conductor", thickness: float = 0.1) -> Wall:
    corner, u, v = SIDES[side]
    return Wall(
        name=side,
        corner_m=corner,
        edge_u_m=u,
        edge_v_m=v,
        material=material(name),
        thickness_m=thickness,
    )


def single(**fields: object) -> Radar:
    """One Tx, one Rx, both at one place."""
    return Radar(
        **({"tx_y": 1, "tx_z": 0, "rx_y": 1, "rx_z": 0, "chirp_duration_s": 1e-3} | fields)
    )  # type: ignore[arg-type]


def unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def by_name(model: RoomModel, name: str) -> int:
    """Place of the echo of a one-part body over that path."""
    return [path.name for path in model.paths].index(name)


# -- paths -----------------------------------------------------------------------------------------


def box(name: str = "concrete") -> tuple[Wall, ...]:
    surface = Surface(material=material(name), thickness_m=0.2)
    sides = dict.fromkeys(("near", "far", "right", "left", "floor", "ceiling"), surface)
    return room_walls((7.0, 5.0, 2.5), (-4.5, -2.5), sides)


def test_the_paths_of_a_box_are_counted() -> None:
    # Order 2: two reflections out (6 x 5, no wall twice running), two back, or one on each way (6 x
    # 6).
    counts = [len(wall_paths(box(), np.array([-4.0, 1.0, 1.0]), order)) for order in (0, 1, 2)]
    assert counts == [1, 13, 13 + 30 + 30 + 36]
    paths = wall_paths(box(), np.array([-4.0, 1.0, 1.0]), 2)
    assert [path.name for path in paths[:3]] == ["body", "body > near", "body > far"]
    assert len({path.name for path in paths}) == len(paths)


def test_an_image_over_two_walls_keeps_the_length_of_the_path() -> None:
    antenna, point = np.array([-4.0, 1.0, 1.0]), np.array([0.3, 0.2, 1.4])
    (path,) = (p for p in wall_paths(box(), antenna, 2) if p.name == "floor > left > body")
    # Over the floor and the left wall, y = 2.5, in whatever order: both coordinates mirrored.
    np.testing.assert_allclose(images(path.out, antenna), [-4.0, 4.0, -1.0])
    assert np.linalg.norm(images(path.out, antenna) - point) == pytest.approx(
        np.sqrt(4.3**2 + 3.8**2 + 2.4**2), abs=1e-12
    )


# -- the image theorem -----------------------------------------------------------------------------


@pytest.mark.parametrize("polarization", ["v", "h"])
@pytest.mark.parametrize("side", ["floor", "left"])
def test_out_and_back_over_a_conducting_plane_is_an_image_of_the_body(
    side: str, polarization: str, backend: Backend
) -> None:
    body = one()
    radar = replace(Radar.preset("paper-12ghz"), polarization=polarization)
    model = build_model(
        "specular", radar, body, scene=Scene(walls=(wall(side),)), variant=backend.kind, order=2
    )  # type: ignore[arg-type]
    chirps = np.arange(24)
    echoes = model.echoes(chirps)
    number = by_name(model, f"{side} > body > {side}")
    turn = np.diag([1.0, 1.0, -1.0]) if side == "floor" else np.diag([1.0, -1.0, 1.0])
    shift = np.zeros(3) if side == "floor" else np.array([0.0, 5.0, 0.0])
    at = chirp_poses(radar, body, chirps)  # type: ignore[arg-type]
    length, amplitude, _ = solve_specular_points(
        Geometry(at.tx, at.rx, at.centres @ turn + shift, turn @ at.frames, at.semi_axes),
        polarization=polarization,
    )
    # Of third order in the distance of a receiver from the middle of its line: 4 cm.
    np.testing.assert_allclose(echoes.length[..., number], length[..., 0], rtol=0, atol=1e-7)
    # Between the ends of a line of antennas the polarisation is drawn straight, and the return is
    # that of one specular point.
    np.testing.assert_allclose(echoes.amplitude[0, ..., number], amplitude[..., 0], rtol=0.01)
    assert echoes.bounces[number] == 3
    assert echoes.part[number] == 0


@pytest.mark.parametrize("polarization", ["v", "h"])
@pytest.mark.parametrize("side", ["floor", "left"])
def test_one_way_over_a_conducting_plane_by_hand(
    side: str, polarization: str, backend: Backend
) -> None:
    body, radar = one(), single(polarization=polarization)
    model = build_model(
        "specular", radar, body, scene=Scene(walls=(wall(side),)), variant=backend.kind
    )  # type: ignore[arg-type]
    echoes = model.echoes(np.arange(1))
    turn = np.diag([1.0, 1.0, -1.0]) if side == "floor" else np.diag([1.0, -1.0, 1.0])
    shift = np.zeros(3) if side == "floor" else np.array([0.0, 5.0, 0.0])
    antenna = np.array(radar.position_m)
    image = turn @ antenna + shift
    poses = chirp_poses(radar, body, np.arange(1))  # type: ignore[arg-type]
    length, strength, point = (
        value[0, 0, 0]
        for value in solve_specular_points(
            Geometry(image[None], antenna[None, None], *poses[3:]), polarization="v", points=True
        )
    )
    bare = strength / copolar(image - point, antenna - point, "v")
    # The antenna's field along the way it really goes; a conductor turns the part along itself
    # round.
    up = np.array([0.0, 0.0, 1.0])

    def sent(way: Array) -> Array:
        return unit(up - (up @ way) * way) if polarization == "v" else unit(np.cross(way, up))

    over_wall = -turn @ sent(turn @ unit(point - image))
    straight = sent(unit(point - antenna))
    normal = unit(unit(image - point) + unit(antenna - point))
    expected = -bare * straight @ (2 * (normal @ over_wall) * normal - over_wall)
    for name in (f"{side} > body", f"body > {side}"):
        number = by_name(model, name)
        assert echoes.length[0, 0, number] == pytest.approx(length, abs=1e-9)
        # `mirror` settles its point to 1e-7 of a semi-axis, factors are complex64.
        assert echoes.amplitude[0, 0, 0, number] == pytest.approx(expected, rel=1e-5)


def test_floor_out_and_a_side_wall_back_by_hand(backend: Backend) -> None:
    # Concrete a metre thick is a half-space: 0.36 S/m leave exp(-30) of what goes through.
    radius, centre = 0.2, np.array([0.5, 0.2, 1.1])
    body, radar = one((radius,) * 3, tuple(centre)), single()
    walls = (wall("floor", "concrete", 1.0), wall("left", "concrete", 1.0))
    model = build_model(
        "specular", radar, body, scene=Scene(walls=walls), variant=backend.kind, order=2
    )  # type: ignore[arg-type]
    echoes = model.echoes(np.arange(1))
    antenna = np.array(radar.position_m)
    tx, rx = antenna * [1, 1, -1], antenna * [1, -1, 1] + [0, 5, 0]
    at = Poses(centre[None, None], np.eye(3)[None, None], np.full((1, 3), radius))
    length, strength, point = (
        value[0, 0, 0]
        for value in solve_specular_points(Geometry(tx[None], rx[None, None], *at), points=True)
    )
    bare = strength / copolar(tx - point, rx - point, "v")
    eta = material("concrete").eta(echoes.frequency[0])

    def reflected(arriving: Array, field: Array, normal: Array) -> Array:
        """ITU-R P.2040-3, eqs (31a, b), TE and TM apart; TM along the rest of the field."""
        across = unit(np.cross(arriving, normal))
        leaving = arriving - 2 * (arriving @ normal) * normal
        cosine = -arriving @ normal
        root = np.sqrt(eta - 1 + cosine**2)
        te = (cosine - root) / (cosine + root)
        tm = (eta * cosine - root) / (eta * cosine + root)
        return te * (field @ across) * across + tm * (
            field @ np.cross(across, arriving)
        ) * np.cross(across, leaving)

    up = np.array([0.0, 0.0, 1.0])
    down, aside = (point - tx) * [1, 1, -1], (point - rx) * [1, -1, 1]
    fields = []
    for way, normal in ((unit(down), up), (unit(aside), np.array([0.0, -1.0, 0.0]))):
        fields.append(reflected(way, unit(up - (up @ way) * way), normal))
    normal = unit(point - centre)
    expected = -bare * fields[1] @ (2 * (normal @ fields[0]) * normal - fields[0])
    number = by_name(model, "floor > body > left")
    assert echoes.length[0, 0, number] == pytest.approx(length, abs=1e-9)
    # Amplitudes of Echoes are conjugate. Half-space and slab, and the polynomial over the sweep,
    # agree to 1e-3 here.
    assert echoes.amplitude[0, 0, 0, number] == pytest.approx(np.conj(expected), rel=2e-3)


# -- against mirror, chirp by chirp ----------------------------------------------------------------


def test_lengths_over_walls_are_those_of_mirror_at_every_chirp(backend: Backend) -> None:
    body = rt.Body.from_motion(
        place(rt.synthetic_motion("kick", seed=1), start_s=0.9, duration_s=0.2)
    )
    radar = Radar.preset("paper-12ghz")
    scene = Scene(walls=box())
    model = build_model("specular", radar, body, scene=scene, variant=backend.kind)
    chirps = np.arange(0, 2000, 41)
    echoes, at = model.echoes(chirps), chirp_poses(radar, body, chirps)
    off, strength = [], []
    for number, path in enumerate(model.paths[1:], start=1):
        own = slice(21 * number, 21 * (number + 1))
        seen = np.abs(echoes.amplitude[0, ..., own]) > 0
        length, amplitude, _ = solve_specular_points(
            Geometry(images(path.out, at.tx), images(path.back, at.rx), *at[3:])
        )
        off.append(np.abs(echoes.length[..., own] - length)[seen])
        assert np.isfinite(echoes.length).all()
        strength.append(amplitude[seen].size)
    assert sum(strength) > 10_000
    # A phase of 0.01 rad at 77 GHz is 6 um.
    assert np.concatenate(off).max() < 1e-6


def test_any_block_of_chirps_gets_the_same_echoes(backend: Backend) -> None:
    body = one(velocity=(-1.0, 0.5, 0.0))
    radar = single(tx_y=2, rx_y=2)
    scene = Scene(walls=box())
    chirps = np.arange(13, 60)
    whole = build_model("specular", radar, body, scene=scene, variant=backend.kind).echoes(chirps)  # type: ignore[arg-type]
    model = build_model("specular", radar, body, scene=scene, variant=backend.kind)  # type: ignore[arg-type]
    pieces = [model.echoes(block) for block in np.split(chirps, [7, 8, 30])]
    np.testing.assert_array_equal(np.concatenate([piece.length for piece in pieces]), whole.length)
    np.testing.assert_array_equal(
        np.concatenate([piece.amplitude for piece in pieces], axis=1), whole.amplitude
    )


# -- what occludes and what transmits --------------------------------------------------------------


def test_an_empty_scene_is_specular_itself(backend: Backend) -> None:
    body, radar, chirps = (
        one(velocity=(-1.0, 0.0, 0.0)),
        Radar.preset("paper-12ghz"),
        np.arange(100),
    )
    alone = Specular(radar, body, variant=backend.kind)  # type: ignore[arg-type]
    ours = RoomModel(alone, Scene(), radar, body).echoes(chirps)  # type: ignore[arg-type]
    free = Specular(radar, body, variant=backend.kind).echoes(chirps)  # type: ignore[arg-type]
    np.testing.assert_array_equal(ours.length, free.length)
    np.testing.assert_array_equal(ours.amplitude, free.amplitude)


def test_a_slab_before_the_radar_lets_its_square_through(backend: Backend) -> None:
    body = one((0.2, 0.2, 0.2), (0.0, 1.0, 1.0))
    radar = single()
    plasterboard = Wall(
        name="partition",
        corner_m=(-2.0, -2.0, 0.0),
        edge_u_m=(0.0, 6.0, 0.0),
        edge_v_m=(0.0, 0.0, 3.0),
        material=material("plasterboard"),
        thickness_m=0.003,
    )
    model = build_model(
        "specular", radar, body, scene=Scene(walls=(plasterboard,)), variant=backend.kind
    )  # type: ignore[arg-type]
    echoes, free = (
        model.echoes(np.arange(2)),
        Specular(radar, body, variant=backend.kind).echoes(np.arange(2)),
    )  # type: ignore[arg-type]
    # Straight on: two faces and all that goes to and fro between them, by hand, less as much air.
    root = np.sqrt(material("plasterboard").eta(echoes.frequency))
    wave = 2 * np.pi * echoes.frequency / SPEED_OF_LIGHT_MPS
    face, inside = (1 - root) / (1 + root), np.exp(-1j * wave * root * 0.003)
    through = (1 - face**2) * inside / (1 - face**2 * inside**2) * np.exp(1j * wave * 0.003)
    ratio = echoes.amplitude[:, :, 0, 0] / free.amplitude[:, :, 0, 0]
    # Factors are kept in complex64.
    np.testing.assert_allclose(ratio, np.conj(through**2)[:, None] * np.ones(2), rtol=1e-6)
    np.testing.assert_allclose(echoes.length[..., 0], free.length[..., 0], rtol=1e-14)
    # Tx before it, body behind: no wave is reflected from one to the other.
    np.testing.assert_array_equal(echoes.amplitude[..., 1:], 0)


def test_behind_metal_there_is_nothing(backend: Backend) -> None:
    sheet = replace(
        wall("left", "metal"),
        corner_m=(-2.0, -2.0, 0.0),
        edge_u_m=(0.0, 6.0, 0.0),
        edge_v_m=(0.0, 0.0, 3.0),
    )
    model = build_model(
        "specular", single(), one(), scene=Scene(walls=(sheet,)), variant=backend.kind
    )  # type: ignore[arg-type]
    np.testing.assert_array_equal(model.echoes(np.arange(3)).amplitude, 0)


def test_a_wall_reflects_only_where_it_is(backend: Backend) -> None:
    # A mirror on the left, 1 m wide; by the law of reflection the way over it is at x = -1.9 as the
    # body passes x = 0.2.
    body = one((0.1, 0.1, 0.1), (-1.0, 1.0, 1.0), velocity=(4.0, 0.0, 0.0))
    sheet = replace(
        wall("left"), corner_m=(-1.4, 2.5, 0.0), edge_u_m=(-1.0, 0.0, 0.0), edge_v_m=(0.0, 0.0, 3.0)
    )
    radar = single()
    model = build_model("specular", radar, body, scene=Scene(walls=(sheet,)), variant=backend.kind)  # type: ignore[arg-type]
    chirps = np.arange(0, 1000, keyframe_step(radar, KEYFRAMES_S))
    echoes = model.echoes(chirps)
    at = chirp_poses(radar, body, chirps)  # type: ignore[arg-type]
    _, _, point = solve_specular_points(
        Geometry(images(model.paths[1].back, at.tx), at.rx, *at[3:]), points=True
    )
    # Both stand equally far from the wall but for the body's surface: the fraction of the way by
    # similar triangles.
    tx_gap, gap = 2.5 - 1.0, 2.5 - point[:, 0, 0, 1]
    meets = -4.0 + (point[:, 0, 0, 0] + 4.0) * tx_gap / (tx_gap + gap)
    np.testing.assert_array_equal(
        np.abs(echoes.amplitude[0, :, 0, 1]) > 0, (meets >= -2.4) & (meets <= -1.4)
    )
    seen = np.abs(echoes.amplitude[0, :, 0, 1]) > 0
    assert 0 < seen.sum() < len(seen)
    # On its way in it fades: between two keyframes it is neither all nor nothing.
    first = int(chirps[np.flatnonzero(seen)[0]])
    fade = np.abs(
        model.echoes(np.arange(first - keyframe_step(radar, KEYFRAMES_S), first + 1)).amplitude[
            0, :, 0, 1
        ]
    )
    assert fade[0] == 0
    assert (np.diff(fade) > 0).all()


@pytest.mark.parametrize("hides", [True, False])
def test_furniture_occludes_both_legs_and_the_way_to_the_wall(
    hides: bool, backend: Backend
) -> None:
    # A wardrobe between radar and body; the floor before it is free, but what goes over it meets
    # its side.
    place = (-1.0, 1.0, 0.0) if hides else (-1.0, -6.0, 0.0)
    wardrobe = Furniture(
        name="wardrobe", mesh="wardrobe", material=material("chipboard"), position_m=place
    )
    scene = Scene(walls=(wall("floor"), wall("left")), furniture=(wardrobe,))
    body = one(centre=(1.0, 1.0, 1.0))
    model = build_model("specular", single(), body, scene=scene, variant=backend.kind)  # type: ignore[arg-type]
    seen = np.abs(model.echoes(np.arange(1)).amplitude[0, 0, 0]) > 0
    # The leg over the left wall passes beside it, but each echo over one wall has a straight leg as
    # well.
    np.testing.assert_array_equal(seen, not hides)
    second = build_model("specular", single(), body, scene=scene, variant=backend.kind, order=2)  # type: ignore[arg-type]
    seen = np.abs(second.echoes(np.arange(1)).amplitude[0, 0, 0]) > 0
    number = by_name(second, "left > body > left")
    assert seen[number]
    assert seen[by_name(second, "floor > body > floor")] == (not hides)


def test_another_part_hides_a_leg_over_a_wall(backend: Backend) -> None:
    # A large sphere on the way from the left wall to the small one; both are free before the radar.
    small, radar = np.array([0.0, 1.0, 1.0]), single()
    image = np.array(radar.position_m) * [1, -1, 1] + [0, 5, 0]
    large = small + 0.6 * unit(image - small)
    body = Still(
        np.stack([small, large]), np.full((2, 3), [[0.05], [0.2]]), np.stack([np.eye(3)] * 2)
    )
    model = build_model(
        "specular", radar, body, scene=Scene(walls=(wall("left"),)), variant=backend.kind
    )  # type: ignore[arg-type]
    echoes = model.echoes(np.arange(1))
    seen = {
        (name, part): bool(abs(echoes.amplitude[0, 0, 0, 2 * i + part]) > 0)
        for i, name in enumerate(path.name for path in model.paths)
        for part in (0, 1)
    }
    assert seen == {
        ("body", 0): True,
        ("body", 1): True,
        ("left > body", 0): False,
        ("body > left", 0): False,
        ("left > body", 1): True,
        ("body > left", 1): True,
    }


# -- leaving out -----------------------------------------------------------------------------------


def test_what_stays_below_the_noise_is_left_out_and_told(backend: Backend) -> None:
    body, radar = one(), single(frame_duration_s=0.1)
    scene = Scene(walls=(wall("floor", "wood", 0.02), wall("left")))
    model = build_model("specular", radar, body, scene=scene, variant=backend.kind)  # type: ignore[arg-type]
    whole = model.echoes(np.arange(0, 100, 10))
    power = (np.abs(whole.amplitude) ** 2).mean(axis=(0, 1, 2))
    gain = 256 * 100
    of_path = np.array(model.path_names)
    floor, left = (power[of_path == f"{name} > body"].sum() for name in ("floor", "left"))
    assert 0 < floor < left
    # A noise that the floor's echo is below by 11 dB, and the left wall's is not.
    summaries = model.prune(100, floor * gain * 10**1.1)
    kept = model.echoes(np.arange(20))
    names = {summary.path: summary for summary in summaries}
    assert names["floor > body"].dropped == ["part 0"]
    assert "10 dB below" in names["floor > body"].why
    assert names["floor > body"].over_noise_db == pytest.approx(-11.0, abs=0.01)
    assert names["left > body"].kept == ["part 0"]
    assert names["left > body"].why == ""
    assert names["body"].kept == ["part 0"]
    assert kept.length.shape[2] == 3
    again = build_model("specular", radar, body, scene=scene, variant=backend.kind).echoes(
        np.arange(20)
    )  # type: ignore[arg-type]
    stay = [0, by_name(model, "body > left"), by_name(model, "left > body")]
    np.testing.assert_array_equal(kept.amplitude, again.amplitude[..., stay])
    np.testing.assert_array_equal(kept.length, again.length[..., stay])


def test_without_noise_only_what_is_never_seen_is_left_out(backend: Backend) -> None:
    aside = replace(
        wall("floor"),
        corner_m=(20.0, 20.0, 0.0),
        edge_u_m=(1.0, 0.0, 0.0),
        edge_v_m=(0.0, 1.0, 0.0),
    )
    model = build_model(
        "specular", single(), one(), scene=Scene(walls=(aside, wall("left"))), variant=backend.kind
    )  # type: ignore[arg-type]
    summaries = {summary.path: summary for summary in model.prune(50, 0.0)}
    assert summaries["floor > body"].dropped == ["part 0"]
    assert summaries["floor > body"].power_m2 == 0
    assert "never seen" in summaries["floor > body"].why
    assert summaries["left > body"].kept == ["part 0"]
    assert summaries["left > body"].over_noise_db is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"spreading": False}, "spreading may be off in free space only"),
        ({"order": -1}, "order = -1"),
        ({"order": True}, "order = True"),
        ({"fidelity": "rays"}, f"allowed in a room: {', '.join(models_that('supports_rooms'))}$"),
        ({"material": "wood"}, "allowed: perfect-conductor, skin"),
    ],
)
def test_what_has_no_meaning_is_refused(given: dict[str, object], message: str) -> None:
    scene = Scene(walls=(wall("floor"),))
    options = {"fidelity": "specular"} | given
    with pytest.raises(InputError, match=message) as error:
        build_model(radar=single(), body=one(), scene=scene, variant="scalar", **options)  # type: ignore[arg-type]
    assert "\n" not in str(error.value)


def test_direct_echoes_and_ghosts_follow_from_one_formula() -> None:
    class Double(Analytic):
        def conductor_echo(self, at: Geometry) -> tuple[Array, Array]:
            length, amplitude = super().conductor_echo(at)
            return length + 1, 2 * amplitude

    body, radar, chirps = one(), single(), np.arange(5)
    for walls in ((), (wall("left"),)):
        usual, double = (
            RoomModel(kind(radar, body), Scene(walls=walls), radar, body).echoes(chirps)
            for kind in (Analytic, Double)
        )
        assert double.length.shape[2] == 1 + 2 * len(walls)
        np.testing.assert_allclose(double.length, usual.length + 1, rtol=1e-12)
        np.testing.assert_allclose(double.amplitude, 2 * usual.amplitude, rtol=1e-6)


def test_analytic_has_the_same_paths_with_its_own_returns() -> None:
    body, radar = one((0.1, 0.1, 0.1)), single()
    scene = Scene(walls=(wall("left"),))
    model = build_model("analytic", radar, body, scene=scene)  # type: ignore[arg-type]
    echoes = model.echoes(np.arange(5))
    assert model.variant is None
    # A sphere's cross-section is pi a^2 from everywhere; at equal azimuths of mirror image and wall
    # the field stays vertical.
    point = np.linalg.norm(np.array(radar.position_m) - np.array([0.0, 0.3, 1.2]))
    assert abs(echoes.amplitude[0, 0, 0, 0]) == pytest.approx(
        np.sqrt(np.pi) * 0.1 / (point - 0.1) ** 2, rel=1e-6
    )
    image = np.array(radar.position_m) * [1, -1, 1] + [0, 5, 0]
    assert echoes.length[0, 0, 1] == pytest.approx(
        point + np.linalg.norm(image - [0.0, 0.3, 1.2]) - 0.2, abs=0.05
    )
    assert (np.abs(echoes.amplitude[0, 0, 0, 1:]) > 0).all()


def test_an_echo_is_one_tone_where_its_wall_is_the_same_over_the_sweep(backend: Backend) -> None:
    # Two faces of thin plasterboard ripple over a sweep of 4 GHz; the far face of thick concrete is
    # not seen.
    walls = (wall("floor", "concrete", 0.2), wall("left", "plasterboard", 0.005))
    model = build_model("specular", single(), one(), scene=Scene(walls=walls), variant=backend.kind)  # type: ignore[arg-type]
    amplitude = model.echoes(np.arange(3)).amplitude
    assert len(amplitude) == 3
    for name in ("body", "floor > body", "body > floor"):
        number = by_name(model, name)
        np.testing.assert_array_equal(
            amplitude[..., number], np.broadcast_to(amplitude[1, ..., number], amplitude.shape[:3])
        )
    number = by_name(model, "left > body")
    assert np.ptp(np.abs(amplitude[:, 0, 0, number])) > 0.1 * np.abs(amplitude[1, 0, 0, number])


@pytest.mark.parametrize("name", ["perfect-conductor", "skin"])
def test_the_person_alone_is_specular_in_free_space(name: str, backend: Backend) -> None:
    body, radar, chirps = (
        one(velocity=(-1.0, 0.0, 0.0)),
        Radar.preset("paper-12ghz"),
        np.arange(100),
    )
    scene = Scene(walls=(wall("floor", "concrete"),))
    room = build_model("specular", radar, body, scene=scene, variant=backend.kind, material=name)  # type: ignore[arg-type]
    free = Specular(radar, body, variant=backend.kind, material=name).echoes(chirps)  # type: ignore[arg-type]
    alone = room.person.echoes(chirps)
    np.testing.assert_array_equal(alone.length, free.length)
    np.testing.assert_array_equal(alone.amplitude, free.amplitude)
    # Its direct echo in the room is the same, for the floor is beside it.
    direct = room.echoes(chirps).amplitude[1, ..., 0]
    # In the room the reflection of skin follows the sweep and the ends of the lines, here it is
    # that of the middle.
    np.testing.assert_allclose(direct, free.amplitude[0, ..., 0], rtol=2e-3)


def test_skin_over_a_wall_is_weaker_by_its_reflection(backend: Backend) -> None:
    scene, chirps = Scene(walls=(wall("left"),)), np.arange(2)
    body = one((0.2, 0.2, 0.2))
    metal, skin = (
        build_model(
            "specular", single(), body, scene=scene, variant=backend.kind, material=name
        ).echoes(chirps)  # type: ignore[arg-type]
        for name in ("perfect-conductor", "skin")
    )
    # The specular point is met at 20 degrees by a field across the plane of incidence: TE by hand,
    # and nearly alike.
    eta = material("skin").eta(metal.frequency)[0]
    ratio = skin.amplitude[0, 0, 0, 1] / metal.amplitude[0, 0, 0, 1]
    image = np.array([-4.0, 4.0, 1.0])
    ways = [
        unit(place - np.array([0.0, 0.3, 1.2])) for place in (image, np.array([-4.0, 1.0, 1.0]))
    ]
    cosine = np.sqrt((1 + ways[0] @ ways[1]) / 2)
    root = np.sqrt(eta - 1 + cosine**2)
    # The sphere's radius moves the angle by a degree, and the field is a little out of the plane.
    assert ratio == pytest.approx(np.conj((root - cosine) / (root + cosine)), rel=0.01)
