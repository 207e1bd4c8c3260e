"""Every level of fidelity in rooms: of walls that are not there, and of one mirror."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.front_end import Antenna
from rtradar.radar import Radar
from rtradar.rcs import ellipsoid
from rtradar.scatter import build_model
from rtradar.scatter.common.interpolation import interpolation_weights
from rtradar.scatter.facets.radiation import body_facets
from rtradar.scene import Scene, Surface, room_walls
from rtradar.scene.materials import Material, PowerLaw
from rtradar.system.registries import MODELS

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
VACUUM = Material(name="vacuum", source="", bands=(PowerLaw(0.0, np.inf, 1.0, 0.0, 0.0, 0.0),))
SMALL = replace(Radar.preset("paper-12ghz"), tx_y=2, tx_z=1, rx_y=2, rx_z=2)
SIDES = ("near", "far", "right", "left", "floor", "ceiling")
# Of targets `scattering_length` chooses its own number of facets and of bounces.
RAYS, FACETS = {"rays_per_wavelength": 2.5, "bounces": 1}, {"facets": 5120}
OPTIONS = {"rays": RAYS, "physical-optics": FACETS, "reference": FACETS}
OPTIONS["auto"] = {"tolerance_complex": 0.001}
# Axis and place of a mirror, polarisation, and what an image over it does to the field: a conductor
# turns what lies in it, an upright image of what stands on it not.
MIRRORS = [("left", "v", -1), ("floor", "v", 1), ("floor", "h", -1)]


def received(echoes: Echoes, radar: Radar, which: NDArray[np.bool_] | None = None) -> Field:
    """Field (frequency, chirp, rx) of some echoes at both ends and in the middle of the sweep."""
    chosen = np.ones(len(echoes.part), dtype=bool) if which is None else which
    sweep = radar.start_frequency_hz + radar.bandwidth_hz * np.array([0.0, 0.5, 1.0])
    weights = interpolation_weights(echoes.frequency, sweep)
    amplitude = np.tensordot(weights, echoes.amplitude[..., chosen], axes=1)
    turns = sweep[:, None, None, None] / SPEED_OF_LIGHT_MPS * echoes.length[..., chosen]
    return np.asarray((amplitude * np.exp(2j * np.pi * turns)).sum(axis=3))


def error_of_vacuum(fidelity: str, radar: Radar, chirps: list[int], body_material: str) -> float:
    """Largest difference of a room of walls that are not there to free space, over the rms."""
    body = Body.from_motion(rt.synthetic_motion("walk", duration_s=0.1), material=body_material)
    # One wall stands between the radar and the body, another behind the body.
    sides = dict.fromkeys(SIDES, Surface(material=VACUUM, thickness_m=0.1))
    walls = room_walls((3.5, 5.0, 3.0), (-1.0, -2.5), sides)
    models = (
        build_model(fidelity, radar, body, scene=scene, **OPTIONS.get(fidelity, {}))
        for scene in (Scene(walls=walls[:2]), None)
    )
    room, free = (received(model.echoes(np.array(chirps)), radar) for model in models)
    return float(np.abs(room - free).max() / np.sqrt((np.abs(free) ** 2).mean()))


@pytest.mark.parametrize("fidelity", MODELS.built_in)
def test_walls_that_are_not_there_change_nothing(fidelity: str) -> None:
    assert error_of_vacuum(fidelity, SMALL, [103, 604], "perfect-conductor") < 1e-6


@pytest.mark.parametrize("fidelity", ["analytic", "specular", "physical-optics"])
def test_skin_and_patterns_are_in_rooms_what_they_are_in_free_space(fidelity: str) -> None:
    # Free space is a room without walls; walls that are not there change nothing of it. What it is
    # itself is said in tests/test_front_end.py and tests/scatter/common/test_polarization.py.
    assert error_of_vacuum(fidelity, SMALL, [103], "skin") < 1e-6
    beam = Antenna(pattern="cosine", exponent=3.0)
    shaped = replace(SMALL, tx_antenna=beam, rx_antenna=beam)
    assert error_of_vacuum(fidelity, shaped, [103], "skin") < 1e-6


@pytest.mark.parametrize("fidelity", ["analytic", "specular", "physical-optics"])
def test_a_slab_delays_echoes_from_the_first_block_on(fidelity: str, make: Any) -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", duration_s=0.1))
    scene = Scene(walls=(make.wall("left", "plasterboard", 0.2),))
    model: Any = build_model(fidelity, SMALL, body, scene=scene, **OPTIONS.get(fidelity, {}))
    first, again = (model.echoes(np.array([103])) for _ in range(2))
    over_the_wall = np.unique(first.part[first.bounces > 1], return_counts=True)[1]
    assert over_the_wall.max() > 2  # there and back, each from both faces
    for name in ("length", "amplitude", "part", "path"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))


# -- one mirror ------------------------------------------------------------------------------------


def by_hand(body: Any, tx: Array, rx: Array) -> complex:
    """Scattering of `analytic-paper`: ranges of centres, and closed cross-sections, conjugate."""
    at = body.at(np.zeros(1))
    total, k = 0j, 2 * np.pi * Radar().centre_frequency_hz / SPEED_OF_LIGHT_MPS
    for centre, frame, axes in zip(at.centres[0], at.frames[0], body.semi_axes, strict=True):
        ways = [place - centre for place in (tx, rx)]
        far = [float(np.linalg.norm(way)) for way in ways]
        x, y, z = frame.T @ (ways[0] / far[0] + ways[1] / far[1])
        theta, phi = np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
        sigma = float(ellipsoid(*axes, theta, phi))
        total += np.sqrt(sigma) / (far[0] * far[1]) * np.exp(-1j * k * sum(far))
    return total


_ALIKE = np.sqrt(0.08 * 0.2)
"""Radius of a ball that takes as many facets as a limb with these semi-axes [m]."""


def from_images(fidelity: str, body: Any, tx: Array, rx: Array, polarization: str) -> complex:
    """Field at the centre of the sweep, exp(+j omega t), of the level in free space."""
    if fidelity == "analytic-paper":
        return by_hand(body, tx, rx)
    at, frequency = body.at(np.zeros(1)), Radar().centre_frequency_hz
    target = rt.Ellipsoids(at.centres[0], at.frames[0], body.semi_axes)
    known = "reference" if fidelity == "auto" else fidelity
    given = target, tx, rx, frequency, known, polarization
    options: Any = OPTIONS.get(known, {})
    if fidelity == "auto":  # which has its facets by the sizes of parts
        wavenumber = 2 * np.pi * frequency / SPEED_OF_LIGHT_MPS
        options = {"facets": int(body_facets(body.semi_axes, wavenumber).max())}
    length = rt.scattering_length(*given, **options)[0]
    ranges = np.linalg.norm(tx), np.linalg.norm(rx)
    turns = frequency / SPEED_OF_LIGHT_MPS * (ranges[0] + ranges[1])
    return complex(length / (ranges[0] * ranges[1]) * np.exp(-2j * np.pi * turns))


def test_reflections_from_part_to_part_go_over_every_path(make: Any) -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.1))
    room: Any = build_model(
        "specular", SMALL, body, scene=Scene(walls=(make.wall("left"),)), bounces=2
    )
    echoes = room.echoes(np.array([100]))
    names = np.array(room.path_names)[echoes.path]
    double = echoes.bounces - [name.count("left") for name in names] == 2
    assert set(names[double]) == set(names)


@pytest.mark.parametrize(("side", "polarization", "sign"), MIRRORS)
@pytest.mark.parametrize("fidelity", MODELS.built_in)
def test_before_one_mirror_stand_the_radar_and_its_image(
    fidelity: str, side: str, polarization: Any, sign: int, make: Any
) -> None:
    # The ball is seen past the limb's edge.
    frames = Rotation.from_rotvec([[0.3, 0.2, 0.4], [0, 0, 0]]).as_matrix()
    axes = np.array([[0.08, 0.06, 0.2], [_ALIKE, _ALIKE, _ALIKE]])
    body = make.still(np.array([[0.0, 0.3, 1.0], [0.9, 0.15, 1.0]]), axes, frames)
    one = {"tx_y": 1, "tx_z": 0, "rx_y": 1, "rx_z": 0, "polarization": polarization}
    radar = replace(Radar(), **one, position_m=(-3.0, 0.2, 1.0))
    scene, options = Scene(walls=(make.wall(side),)), OPTIONS.get(fidelity, {})
    model = build_model(fidelity, radar, body, scene=scene, order=2, **options)
    echoes = model.echoes(np.array([0]))
    names = np.array(model.path_names)[echoes.path]
    place = radar.tx[0]
    image = np.array([-3.0, 4.8, 1.0] if side == "left" else [-3.0, 0.2, -1.0])
    ends = {f"{side} > body": (image, place), f"{side} > body > {side}": (image, image)}
    ends |= {f"body > {side}": (place, image), "body": (place, place)}
    assert set(names) == set(ends)
    for name, (tx, rx) in ends.items():
        found = received(echoes, radar, names == name)[1, 0, 0]
        free = from_images(fidelity, body, tx, rx, polarization)
        expected = np.conj(free) * sign ** name.count(side)
        assert abs(found - expected) < 0.01 * abs(expected), (name, found, expected)
