"""Physical optics of one target between antennas that are far apart from each other."""

import numpy as np
import pytest
import trimesh

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.scatter.facets import Waves
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.facets.radiation import with_obliquity

RADIUS_M, FREQUENCY_HZ, FAR_M = 0.03, 14e9, 1e4

# What physical optics is, not how far it is from the truth.
pytestmark = pytest.mark.filterwarnings(
    "ignore:.*radius of curvature:rtradar.errors.ValidityWarning"
)


def spheres(*centres_and_radii: tuple[tuple[float, float, float], float]) -> rt.Ellipsoids:
    centres, radii = zip(*centres_and_radii, strict=True)
    frames = [np.eye(3)] * len(centres)
    return rt.Ellipsoids(centres, frames, [(radius,) * 3 for radius in radii])


def optics(target: object, tx: object, rx: object, polarization: str = "v") -> complex:
    given = {"fidelity": "physical-optics", "polarization": polarization}
    return complex(rt.scattering_length(target, tx, rx, FREQUENCY_HZ, **given)[0])


@pytest.mark.parametrize("polarization", ["v", "h"])
@pytest.mark.parametrize("body", ["ellipsoid", "mesh"])
def test_forward_scatter_is_that_of_the_area_that_hides_the_transmitter(
    body: str, polarization: str
) -> None:
    sphere = spheres(((0, 0, 0), RADIUS_M))
    target = sphere if body == "ellipsoid" else trimesh.creation.icosphere(4, RADIUS_M)
    field = optics(target, [FAR_M, 0, 0], [-FAR_M, 0, 0], polarization)
    # Babinet: the field of a hole of this area, jk A / sqrt(pi), whatever the body behind is like.
    wavenumber = 2 * np.pi * FREQUENCY_HZ / SPEED_OF_LIGHT_MPS
    assert abs(field) == pytest.approx(wavenumber * np.sqrt(np.pi) * RADIUS_M**2, rel=3e-3)
    # The unit vector of h is across the line of sight to each antenna, and these are opposite.
    assert np.sign(field.imag) == (1 if polarization == "v" else -1)


def test_a_thin_sheet_radiates_to_both_sides_alike() -> None:
    sheet = trimesh.Trimesh([[0, -0.1, -0.1], [0, 0.1, -0.1], [0, 0, 0.1]], [[0, 1, 2]])
    ahead, behind = (optics(sheet, [FAR_M, 0, 0], [x, 0, 0]) for x in (FAR_M, -FAR_M))
    assert abs(behind) == pytest.approx(abs(ahead), rel=1e-6)


@pytest.mark.parametrize("kind", ["ellipsoids", "mesh"])
def test_another_part_hides_the_receiver_from_what_radiates_through_its_own(kind: str) -> None:
    # Tx sees both, from x; Rx is on y, behind the larger one, and the lit side of the small one
    # faces Rx partly and partly not.
    small, large = ((0, 0, 0), RADIUS_M), ((-0.2, 1.0, 0), 0.3)
    if kind == "ellipsoids":
        pair, alone = spheres(small, large), spheres(large)
    else:
        meshes = [trimesh.creation.icosphere(4, radius) for _, radius in (small, large)]
        meshes[1].apply_translation(large[0])
        pair, alone = trimesh.util.concatenate(meshes), meshes[1]
    antennas = [FAR_M, 0, 0], [0, FAR_M, 0]
    assert optics(pair, *antennas) == pytest.approx(optics(alone, *antennas), rel=1e-3)


def test_near_the_transmitter_it_is_reciprocal() -> None:
    target = rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [(0.03, 0.05, 0.12)])
    tx, rx = [3.0, 0.0, 0.4], [3.0, 0.15, 0.4]
    assert optics(target, tx, rx) == pytest.approx(optics(target, rx, tx), rel=2e-3)


@pytest.mark.parametrize(("angle_deg", "alike"), [(5.0, True), (150.0, True), (178.0, False)])
def test_in_a_run_a_body_casts_no_shadow_of_its_own(angle_deg: float, alike: bool) -> None:
    # The shadow on what stands behind is that of the clutter.
    angle = np.radians(angle_deg)
    to_tx = np.array([4.0, 0.0, 0.1]).reshape(1, 1, 1, 3)
    to_rx = np.array([4.0 * np.cos(angle), 4.0 * np.sin(angle), 0.1]).reshape(1, 1, 1, 3)
    waves = Waves(np.array([[0, 1]]), np.zeros((1, 1)), np.ones((1, 1)), spreading=True)
    given = waves, to_tx, to_rx, np.eye(3)[None, None], Polarization("v")
    whole, factor = with_obliquity(*given, shadow=True)
    run, in_run = with_obliquity(*given, shadow=False)
    assert np.array_equal(run.currents, whole.currents) == alike
    np.testing.assert_array_equal(in_run, factor)
    if not alike:
        np.testing.assert_array_equal(run.currents[..., :4], 0)
