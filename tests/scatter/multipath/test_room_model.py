"""A model in a room: what occludes, transmits and is left out, and which models it takes."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.scatter import build_model
from rtradar.scatter.common.poses import chirp_poses, keyframe_step
from rtradar.scatter.models.analytic import Analytic
from rtradar.scatter.multipath.image_paths import images
from rtradar.scatter.multipath.keyframes import KEYFRAMES_S
from rtradar.scatter.multipath.room_model import RoomModel
from rtradar.scatter.specular_points import solve_specular_points
from rtradar.scene import Furniture, Scene, material
from rtradar.trace.backend import Backend

Array = NDArray[np.float64]


def unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


# -- what occludes and what transmits --------------------------------------------------------------


def test_a_wall_reflects_only_where_it_is(make: Any) -> None:
    # A mirror on the left, 1 m wide; by the law of reflection the way over it is at x = -1.9 as the
    # body passes x = 0.2.
    body = make.one((0.1, 0.1, 0.1), (-1.0, 1.0, 1.0), velocity=(4.0, 0.0, 0.0))
    sheet = replace(
        make.wall("left"),
        corner_m=(-1.4, 2.5, 0.0),
        edge_u_m=(-1.0, 0.0, 0.0),
        edge_v_m=(0.0, 0.0, 3.0),
    )
    radar = make.single()
    chirps = np.arange(0, 1000, keyframe_step(radar, KEYFRAMES_S))
    found = []
    for mirror in (sheet, make.wall("left")):
        model = make.room(radar, body, mirror)
        found.append(np.abs(model.echoes(chirps).amplitude[0, :, 0, 1]))
    at = chirp_poses(radar, body, chirps)  # type: ignore[arg-type]
    _, _, point = solve_specular_points(
        Geometry(images(model.paths[1].back, at.tx), at.rx, *at[3:6]), points=True
    )
    # Both stand equally far from the wall but for the body's surface: the fraction of the way by
    # similar triangles.
    tx_gap, gap = 2.5 - 1.0, 2.5 - point[:, 0, 0, 1]
    meets = -4.0 + (point[:, 0, 0, 0] + 4.0) * tx_gap / (tx_gap + gap)
    # At an edge the field is half. At 30 degrees above the mirror, zones are 0.4 m long along it.
    deep, left = 0.5 - np.abs(meets + 1.9), found[0] / found[1]
    np.testing.assert_array_equal(left > 0.5, deep > 0)
    beyond = left[(deep < -0.35) & (meets > -1.4)]
    assert beyond[0] < 0.2
    assert (np.diff(beyond) < 0).all()
    np.testing.assert_allclose(left[deep > 0.35], 1, atol=0.2)
    # On its way in it grows smoothly, chirp by chirp.
    first = int(chirps[np.flatnonzero(deep > 0)[0]])
    moments = np.arange(first - keyframe_step(radar, KEYFRAMES_S), first + 1)
    onset = np.abs(make.room(radar, body, sheet).echoes(moments).amplitude[0, :, 0, 1])
    assert (np.diff(onset) > 0).all()


@pytest.mark.parametrize("hides", [True, False])
def test_furniture_occludes_both_legs_and_the_way_to_the_wall(
    hides: bool, backend: Backend, make: Any
) -> None:
    # A wardrobe between radar and body; the floor before it is free, but what goes over it meets
    # its side.
    place = (-1.0, 1.0, 0.0) if hides else (-1.0, -6.0, 0.0)
    wardrobe = Furniture(
        name="wardrobe", mesh="wardrobe", material=material("chipboard"), position_m=place
    )
    body = make.one(centre=(1.0, 1.0, 1.0))
    given = make.single(), body, make.wall("floor"), make.wall("left")
    options = {"furniture": (wardrobe,), "variant": backend.kind}
    model = make.room(*given, **options)
    seen = np.abs(model.echoes(np.arange(1)).amplitude[0, 0, 0]) > 0
    # The leg over the left wall passes beside it, but each echo over one wall has a straight leg as
    # well.
    np.testing.assert_array_equal(seen, not hides)
    second = make.room(*given, **options, order=2)
    seen = np.abs(second.echoes(np.arange(1)).amplitude[0, 0, 0]) > 0
    number = second.path_names.index("left > body > left")
    assert seen[number]
    assert seen[second.path_names.index("floor > body > floor")] == (not hides)


def test_furniture_occludes_by_the_backend_that_was_asked_for_also_where_no_part_does(
    make: Any,
) -> None:
    # `auto` traces nothing by itself where nothing comes near a line of sight.
    model = make.room(
        make.single(), make.one(), make.wall("left"), fidelity="auto", variant="scalar"
    )
    assert model.variant == "scalar"


def test_another_part_hides_a_leg_over_a_wall(backend: Backend, make: Any) -> None:
    # A large sphere on the way from the left wall to the small one; both are free before the radar.
    small, radar = np.array([0.0, 1.0, 1.0]), make.single()
    image = np.array(radar.position_m) * [1, -1, 1] + [0, 5, 0]
    large = small + 0.6 * unit(image - small)
    body = make.still(
        np.stack([small, large]), np.full((2, 3), [[0.05], [0.2]]), np.stack([np.eye(3)] * 2)
    )
    model = make.room(radar, body, make.wall("left"), variant=backend.kind)
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


def test_what_stays_below_the_noise_is_left_out_and_told(make: Any) -> None:
    given = (
        make.single(frame_duration_s=0.1),
        make.one(),
        make.wall("floor", "wood", 0.02),
        make.wall("left"),
    )
    model = make.room(*given)
    whole = model.echoes(np.arange(0, 100, 10))
    power = (np.abs(whole.amplitude) ** 2).mean(axis=(0, 1, 2))
    gain = 256 * 100
    of_path = np.array(model.path_names)[whole.path]
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
    again = make.room(*given).echoes(np.arange(20))
    stay = [0, model.path_names.index("body > left"), model.path_names.index("left > body")]
    # What is left is of conductors, and the same at all frequencies.
    assert len(kept.frequency) == 1
    for amplitude in again.amplitude[..., stay]:
        np.testing.assert_array_equal(kept.amplitude[0], amplitude)
    np.testing.assert_array_equal(kept.length, again.length[..., stay])


def test_the_weakest_are_left_out_as_far_as_is_tolerated(make: Any) -> None:
    given = make.single(frame_duration_s=0.1), make.one(), make.wall("floor"), make.wall("left")
    whole = make.room(*given)
    whole.prune(100, 0.0)
    echoes = whole.echoes(np.arange(0, 100, 4))
    power = (np.abs(echoes.amplitude) ** 2).mean(axis=(0, 1, 2))
    weakest = int(np.argmin(np.where(echoes.bounces > 1, power, np.inf)))
    for share, count in ((0.5, 0), (1.5, 1)):
        model = make.room(*given)
        summaries = model.prune(100, 0.0, share * power[weakest])
        assert model.left_out == count
        assert model.left_out_m2 == pytest.approx(count * power[weakest], rel=0.05)
        lost = [summary for summary in summaries if summary.dropped]
        assert [summary.path for summary in lost] == [
            whole.path_names[echoes.path[weakest]]
        ] * count
        assert all("tolerance" in summary.why for summary in lost)
    # Direct echoes stay, whatever is tolerated.
    model.prune(100, 0.0, np.inf)
    assert set(model.echoes(np.arange(4)).path.tolist()) == {0}


def test_without_noise_only_what_is_never_seen_is_left_out(make: Any) -> None:
    aside = replace(
        make.wall("floor"),
        corner_m=(20.0, 20.0, 0.0),
        edge_u_m=(1.0, 0.0, 0.0),
        edge_v_m=(0.0, 1.0, 0.0),
    )
    model = make.room(make.single(), make.one(), aside, make.wall("left"))
    summaries = {summary.path: summary for summary in model.prune(50, 0.0)}
    assert summaries["floor > body"].dropped == ["part 0"]
    assert summaries["floor > body"].power_m2 == 0
    assert "never seen" in summaries["floor > body"].why
    assert summaries["left > body"].kept == ["part 0"]
    assert summaries["left > body"].over_noise_db is None


# -- the models in a room --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"spreading": False}, "spreading may be off in free space only"),
        ({"order": -1}, "order = -1"),
        ({"order": True}, "order = True"),
        ({"materials": ["wood"]}, "allowed: perfect-conductor, skin"),
    ],
)
def test_what_has_no_meaning_is_refused(given: dict[str, object], message: str, make: Any) -> None:
    with pytest.raises(InputError, match=message) as error:
        make.room(make.single(), make.one(), make.wall("floor"), **given)
    assert "\n" not in str(error.value)


def test_direct_echoes_and_ghosts_follow_from_one_formula(make: Any) -> None:
    class Double(Analytic):
        def conductor_echo(self, at: Geometry) -> tuple[Array, Array]:
            length, amplitude = super().conductor_echo(at)
            return length + 1, 2 * amplitude

    body, radar, chirps = make.one(), make.single(), np.arange(5)
    for walls in ((), (make.wall("left"),)):
        usual, double = (
            RoomModel(
                partial(kind, body=body),
                Scene(walls=walls),
                radar,
                body,  # type: ignore[arg-type]
            ).echoes(chirps)
            for kind in (Analytic, Double)
        )
        assert double.length.shape[2] == 1 + 2 * len(walls)
        np.testing.assert_allclose(double.length, usual.length + 1, rtol=1e-12)
        np.testing.assert_allclose(double.amplitude, 2 * usual.amplitude, rtol=1e-6)


def test_an_echo_is_one_tone_where_its_wall_is_the_same_over_the_sweep(make: Any) -> None:
    # Two faces of thin plasterboard ripple over a sweep of 4 GHz; the far face of thick concrete is
    # not seen.
    walls = (make.wall("floor", "concrete", 0.2), make.wall("left", "plasterboard", 0.005))
    model = make.room(make.single(), make.one(), *walls)
    amplitude = model.echoes(np.arange(3)).amplitude
    assert len(amplitude) == 3
    for name in ("body", "floor > body", "body > floor"):
        number = model.path_names.index(name)
        np.testing.assert_array_equal(
            amplitude[..., number], np.broadcast_to(amplitude[1, ..., number], amplitude.shape[:3])
        )
    number = model.path_names.index("left > body")
    assert np.ptp(np.abs(amplitude[:, 0, 0, number])) > 0.1 * np.abs(amplitude[1, 0, 0, number])


def test_skin_over_a_wall_is_weaker_by_its_reflection(make: Any) -> None:
    given = make.single(), make.one((0.2, 0.2, 0.2)), make.wall("left")
    metal, skin = (
        make.room(*given, materials=[name]).echoes(np.arange(2))
        for name in ("perfect-conductor", "skin")
    )
    for name in ("perfect-conductor", "skin"):  # to whom the signal-to-noise ratio refers
        alone = make.room(*given, materials=[name]).person.echoes(np.arange(2))
        free = build_model("specular", *given[:2], materials=[name]).echoes(np.arange(2))
        np.testing.assert_array_equal(alone.length, free.length)
        np.testing.assert_array_equal(alone.amplitude, free.amplitude)
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


def test_direct_echoes_of_a_conductor_need_one_frequency(make: Any) -> None:
    model = make.room(make.single(), make.one(), make.wall("left", "brick"))
    chirps = np.arange(40)
    whole, direct = model.echoes(chirps), model.without_ghosts().echoes(chirps)
    assert len(whole.frequency) > 1
    assert len(direct.frequency) == 1
    np.testing.assert_array_equal(direct.frequency, whole.frequency[len(whole.frequency) // 2])
    first = np.broadcast_to(direct.amplitude, whole.amplitude[..., :1].shape)
    np.testing.assert_allclose(first, whole.amplitude[..., :1], rtol=1e-6)
