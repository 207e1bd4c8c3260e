"""The echo model `rays`: tubes, footprints, corner reflectors, and the laws of many bounces."""

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.interpolate import BarycentricInterpolator

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.scatter import build_model
from rtradar.scatter.models.rays import Rays, rays_scattering
from rtradar.scatter.target import EllipsoidGrid, MeshGrid
from rtradar.trace.backend import Backend

Array = NDArray[np.float64]
FAR = 1e6


def sheet(vertices: object, faces: object) -> trimesh.Trimesh:
    return trimesh.Trimesh(np.array(vertices, dtype=float), faces, process=False)


def sphere(radius: float = 0.05, *places: tuple[float, float, float]) -> rt.Ellipsoids:
    centres = places or ((0.0, 0.0, 0.0),)
    return rt.Ellipsoids(
        centres, np.tile(np.eye(3), (len(centres), 1, 1)), np.full((len(centres), 3), radius)
    )


def backscatter(
    target: rt.Ellipsoids | trimesh.Trimesh, tx: object, frequency: float, **model_options: object
) -> complex:
    place = np.atleast_2d(np.asarray(tx, dtype=float))
    return complex(rays_scattering(target, place, place, np.array([frequency]), **model_options)[0])  # type: ignore[arg-type]


PLATE = sheet(
    [[0, -0.1, -0.2], [0, 0.1, -0.2], [0, 0.1, 0.2], [0, -0.1, 0.2]], [[0, 1, 2], [0, 2, 3]]
)
DIHEDRAL = sheet(
    [[0, 0, -0.1], [0.2, 0, -0.1], [0.2, 0, 0.1], [0, 0, 0.1], [0, 0.2, -0.1], [0, 0.2, 0.1]],
    [[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 3]],
)
TRIHEDRAL = sheet(
    [[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2]], [[0, 1, 2], [0, 2, 3], [0, 3, 1]]
)


def test_facets_of_ellipsoids_have_the_mean_size_of_the_sphere_and_as_many_as_asked_for() -> None:
    axes = np.array([[0.1, 0.1, 0.1], [0.05, 0.05, 0.2]])
    grid = EllipsoidGrid.cover(axes, 0.005)
    area = (
        np.linalg.norm(
            np.cross(
                grid.corners[:, 1] - grid.corners[:, 0], grid.corners[:, 2] - grid.corners[:, 0]
            ),
            axis=1,
        )
        / 2
    )
    for part, surface in (
        (0, 4 * np.pi * 0.01),
        (1, 0.10247),
    ):  # the second by the formula of prolate spheroids
        own = grid.part == part
        # 1e-3: the sagitta of the facets, which cancels to its second order in the area.
        assert area[own].sum() == pytest.approx(4 * np.pi, rel=1e-3)
        wanted = surface / (np.sqrt(3) / 4 * 0.005**2)
        assert wanted * 0.98 < own.sum() < wanted * 1.1
    quarters = grid.split(np.arange(len(grid.part)))
    finer = np.linalg.norm(quarters.corners, axis=-1) - 1
    coarse = np.linalg.norm(grid.corners, axis=-1) - 1
    np.testing.assert_allclose(finer.reshape(-1, 12)[:, :1], coarse[:, :1] / 4, rtol=1e-9)


def test_facets_of_a_mesh_cover_it_and_are_as_small_as_asked_for() -> None:
    corners = np.asarray(TRIHEDRAL.triangles)
    grid = MeshGrid.cut(corners, MeshGrid.divisions(corners, 0.013))
    for cut, edge in ((grid, 0.013), (grid.split(np.arange(len(grid.face))), 0.0065)):
        sides = cut.corners - np.roll(cut.corners, 1, axis=1)
        across = np.cross(sides[:, 0], sides[:, 1])
        assert np.linalg.norm(sides, axis=-1).max() <= edge
        np.testing.assert_allclose(
            np.linalg.norm(across, axis=1).sum() / 2, TRIHEDRAL.area, rtol=1e-12
        )
        normals = TRIHEDRAL.face_normals[cut.face]
        np.testing.assert_allclose(
            across / np.linalg.norm(across, axis=1)[:, None], normals, atol=1e-9
        )


def test_a_sphere_is_that_of_physical_optics(backend: Backend) -> None:
    tx = FAR * np.array([0.36, 0.48, 0.8])
    field = backscatter(sphere(), tx, 14e9, bounces=1, variant=backend.kind)
    # 0.1 dB: facets of a third of a wavelength on a radius of 2.3 wavelengths.
    assert field == pytest.approx(complex(rt.rcs.sphere(0.05, 14e9, "po")), rel=0.0116)


def test_under_sampled_tubes_degrade_gracefully() -> None:
    reference = abs(complex(rt.rcs.sphere(0.25, 14e9, "po")))
    field = backscatter(sphere(0.25), [FAR, 0, 0], 14e9, bounces=1, rays_per_wavelength=1.0)
    # Facets of one wavelength, ten around the specular point; plain sums of one ray a facet would
    # be 12 dB too high.
    assert 20 * np.log10(abs(field) / reference) == pytest.approx(0, abs=1.0)


def test_a_plate_is_its_closed_form_on_both_sides(backend: Backend) -> None:
    reference = 2 * np.sqrt(np.pi) * 0.08 * 12e9 / SPEED_OF_LIGHT_MPS
    for side in (1, -1):
        field = backscatter(
            PLATE, [side * FAR, 0, 0], 12e9, rays_per_wavelength=1.0, variant=backend.kind
        )
        # The wavefront from 1e6 m away bends by 2.5e-8 m, twice, over the plate: 1e-5 rad.
        assert field == pytest.approx(1j * reference, rel=1e-5)


def test_a_closed_box_shows_its_front_alone_wound_either_way() -> None:
    reference = 2 * np.sqrt(np.pi) * 0.08 * 12e9 / SPEED_OF_LIGHT_MPS
    box = trimesh.creation.box((0.1, 0.2, 0.4))
    inside_out = trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False)
    for target in (box, inside_out):
        field = backscatter(target, [FAR, 0, 0], 12e9)
        # The front is 0.05 m before the origin.
        turn = np.exp(2j * 2 * np.pi * 12e9 / SPEED_OF_LIGHT_MPS * 0.05)
        assert field == pytest.approx(1j * reference * turn, rel=1e-5)


@pytest.mark.parametrize(("polarization", "turn"), [("v", -1j), ("h", 1j)])
def test_a_dihedral_turns_over_what_lies_across_its_crease(
    backend: Backend, polarization: str, turn: complex
) -> None:
    tx = FAR * np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    model_options = {
        "polarization": polarization,
        "variant": backend.kind,
        "rays_per_wavelength": 1.0,
    }
    both = backscatter(DIHEDRAL, tx, 12e9, bounces=2, **model_options) - backscatter(
        DIHEDRAL, tx, 12e9, bounces=1, **model_options
    )
    reference = np.sqrt(8 * np.pi) * 0.2 * 0.2 * 12e9 / SPEED_OF_LIGHT_MPS
    assert both == pytest.approx(turn * reference, rel=1e-4)


def test_a_trihedral_returns_after_three_bounces_and_no_more() -> None:
    tx = FAR * np.ones(3) / np.sqrt(3)
    one, two, three, four = (backscatter(TRIHEDRAL, tx, 24e9, bounces=n) for n in (1, 2, 3, 4))
    reference = np.sqrt(4 * np.pi / 3) * 0.2**2 * 24e9 / SPEED_OF_LIGHT_MPS
    assert abs(two - one) < 1e-3 * reference
    # Tubes at the edge of the aperture count whole or not at all.
    assert abs(three - two) == pytest.approx(reference, rel=0.01)
    assert four == three
    # From off its axis, too.
    one, three = (
        backscatter(TRIHEDRAL, FAR * np.array([1.0, 0.8, 1.1]), 24e9, bounces=n) for n in (1, 3)
    )
    assert abs(three) > 10 * abs(one)


def test_two_spheres_send_each_other_what_one_of_them_alone_does_not() -> None:
    pair = sphere(0.1, (0, -0.15, 0), (0, 0.15, 0))
    one, two = (backscatter(pair, [4.0, 0.1, 0.05], 24e9, bounces=n) for n in (1, 2))
    # Stationary phase over both spheres gives 0.0676 m (validation/closed_forms/rays.py works it
    # out); 1 dB for edges of shadow.
    assert 20 * np.log10(abs(two - one) / 0.0676) == pytest.approx(0, abs=1.0)


def test_pairs_keep_their_order_and_their_frequencies() -> None:
    tx = np.array([[4.0, 0, 0], [4.0, 0.1, 0], [4.0, 0, 0], [4.0, 0, 0]])
    rx = np.array([[4.0, 0, 0], [4.0, 0, 0], [4.0, 0, 0.2], [4.0, 0, 0]])
    frequency = np.array([12e9, 14e9, 12e9, 14e9])
    target = sphere(0.05, (0, 0, 0), (0, 0.15, 0))
    together = rays_scattering(target, tx, rx, frequency, bounces=1)
    # Tubes are cut for the highest frequency of a call: two frequencies alone differ by that.
    one_by_one = [
        rays_scattering(target, t[None], r[None], np.array([f]), bounces=1)[0]
        for t, r, f in zip(tx, rx, frequency, strict=True)
    ]
    np.testing.assert_allclose(together[[1, 3]], [one_by_one[1], one_by_one[3]], rtol=1e-9)
    np.testing.assert_allclose(together, one_by_one, rtol=0.02)
    assert rays_scattering(target, tx[:0], rx[:0], frequency[:0]).shape == (0,)


def walk() -> tuple[rt.Radar, rt.Body]:
    return rt.Radar.preset("paper-12ghz"), rt.Body.from_motion(rt.synthetic_motion("walk", seed=0))


@pytest.mark.slow
def test_echoes_are_the_scattering_lengths_of_the_pose() -> None:
    radar, body = walk()
    chirps = np.array([1600, 1603])
    echoes = Rays(radar, body, rays_per_wavelength=0.7, bounces=2, anchor_s=0.0).echoes(chirps)
    assert echoes.length.shape == (2, 8, 42)
    assert echoes.amplitude.shape == (echoes.frequency.size, 2, 8, 42)
    np.testing.assert_array_equal(echoes.bounces, np.repeat([1, 2], 21))
    np.testing.assert_array_equal(echoes.part, np.tile(np.arange(21), 2))
    frequency = np.array([12e9, 13.3e9, 16e9])
    amplitude = BarycentricInterpolator(echoes.frequency, echoes.amplitude)(frequency)
    for index, chirp in enumerate(chirps):
        pose, tx = body.ellipsoids((chirp + 0.5) * radar.chirp_duration_s), radar.tx[chirp % 12]
        rx = radar.rx[radar.rx_of_tx[chirp % 12]][3]
        k = 2 * np.pi * frequency / SPEED_OF_LIGHT_MPS
        path = np.exp(-1j * k[:, None] * echoes.length[index, 3])
        received = (amplitude[:, index, 3].conj() * path).sum(axis=1)
        same = {"bounces": 2, "rays_per_wavelength": 0.7 * 14 / 16}
        expected = rays_scattering(
            pose, np.tile(tx, (3, 1)), np.tile(rx, (3, 1)), frequency, **same
        )  # type: ignore[arg-type]
        expected *= np.exp(-1j * k * (np.linalg.norm(tx) + np.linalg.norm(rx))) / (
            np.linalg.norm(tx) * np.linalg.norm(rx)
        )
        # The polynomial through the nodes of the sweep; 7 and 15 leave 2 and 5 % of one bounce and
        # of two.
        np.testing.assert_allclose(received, expected, atol=0.05 * np.abs(expected).max())


@pytest.mark.slow
def test_one_bounce_is_what_specular_sees() -> None:
    radar, body = walk()
    chirps = np.array([8000])
    rays, specular = (
        Rays(radar, body, bounces=1, anchor_s=0.0).echoes(chirps),
        build_model("specular", radar, body).echoes(chirps),
    )
    middle = BarycentricInterpolator(rays.frequency, rays.amplitude)(14e9)
    seen = np.abs(specular.amplitude[0]).max(axis=(0, 1)) > 0.02 * np.abs(specular.amplitude).max()
    # A part in full view is within some per cent of geometric optics; one at an occluder's edge may
    # be half off.
    error = (
        np.abs(middle - specular.amplitude[0])[..., seen]
        / np.abs(specular.amplitude[0][..., seen]).max()
    )
    assert np.median(error) < 0.05


@pytest.mark.slow
def test_between_keyframes_echoes_are_nearly_those_of_every_chirp() -> None:
    radar, body = walk()
    chirps = np.array([16000, 16080, 16124])  # a keyframe, half way to the next, and nearly there
    plain, between = (
        Rays(radar, body, bounces=1, rays_per_wavelength=1.0, anchor_s=s).echoes(chirps)
        for s in (0.0, 10e-3)
    )
    np.testing.assert_array_equal(between.length, plain.length)
    np.testing.assert_allclose(
        between.amplitude[:, 0], plain.amplitude[:, 0], rtol=1e-12, atol=1e-12
    )
    # Parts come out from behind others meanwhile, by tubes of a wavelength.
    error = np.linalg.norm(between.amplitude - plain.amplitude) / np.linalg.norm(plain.amplitude)
    assert error < 0.05


@pytest.mark.parametrize(
    ("model_options", "message"),
    [
        ({"rays_per_wavelength": 0.0}, "rays_per_wavelength"),
        ({"rays_per_wavelength": float("nan")}, "rays_per_wavelength"),
        ({"bounces": 0}, "bounces"),
        ({"bounces": 2.5}, "bounces"),
    ],
)
def test_options_without_meaning_are_refused(
    model_options: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        backscatter(sphere(), [4, 0, 0], 12e9, **model_options)


def test_too_many_tubes_are_refused_before_they_are_made() -> None:
    for target in (sphere(100.0), sheet(PLATE.vertices * 1e4, PLATE.faces)):
        with pytest.raises(InputError, match="lower rays_per_wavelength"):
            backscatter(target, [1e5, 0, 0], 300e9)
