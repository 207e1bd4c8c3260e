"""The models `reference` and `physical-optics`: their parts, and how far they are apart."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body.body import Poses
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.elementary import hermite_weights
from rtradar.kernels.scatter.facets import stretch
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.scatter.common.interpolation import array_nodes, spread_nodes
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.facets.envelope import TOGETHER, ArrayEnvelope, Envelope, Sample
from rtradar.scatter.facets.target import facet_scattering
from rtradar.scatter.models.physical_optics import PhysicalOptics, Reference
from rtradar.scatter.models.specular import Specular
from rtradar.scatter.specular_points import solve_specular_points

Array = NDArray[np.float64]
PLACES = 8


@dataclass(frozen=True)
class Passing:
    """A limb that turns, and a sphere that passes before it and hides it for a while."""

    speed: float = 2.0
    duration_s: float = 0.2
    part_names: tuple[str, ...] = ("limb", "sphere")

    @property
    def semi_axes(self) -> Array:
        return np.array([[0.05, 0.05, 0.16], [0.06, 0.06, 0.06]])

    @property
    def owner(self) -> NDArray[np.int64]:
        return np.zeros(len(self.semi_axes), dtype=np.int64)

    def at(self, times: Array) -> Poses:
        times = np.asarray(times)
        turn = Rotation.from_rotvec(np.outer(0.2 + 1.5 * times, [0.1, 0.97, 0.2])).as_matrix()
        sphere = np.stack(
            [
                np.full_like(times, -0.5),
                0.17 + self.speed * (times - 0.03),
                np.full_like(times, 1.0),
            ],
            axis=-1,
        )
        centres = np.stack([np.broadcast_to([0.0, 0.05, 1.0], sphere.shape), sphere], axis=1)
        frames = np.stack([turn, np.broadcast_to(np.eye(3), turn.shape)], axis=1)
        return Poses(centres, frames, self.semi_axes)


def small_radar(**changes: object) -> rt.Radar:
    """Two Tx and two Rx a line, the ends of the paper's lines, in 1.5 ms cycles."""
    changes = {"tx_y": 2, "tx_z": 1, "rx_y": 2, "rx_z": 2, "chirp_duration_s": 0.5e-3} | changes
    whole = rt.Radar.preset("paper-12ghz")
    return dataclasses.replace(
        whole, tx_spacing_wavelengths=20.0, rx_spacing_wavelengths=3.5, **changes
    )  # type: ignore[arg-type]


def spectrum(echoes: rt.Echoes, frequency: float) -> NDArray[np.complex128]:
    """H (chirp, rx, echo) = conj(amplitude) exp(-j k length)."""
    nodes = echoes.frequency
    lagrange = [
        np.prod([(frequency - other) / (node - other) for other in nodes if other != node])
        if len(nodes) > 1
        else 1.0
        for node in nodes
    ]
    amplitude = np.tensordot(lagrange, echoes.amplitude, axes=1)
    return np.asarray(
        np.conj(amplitude) * np.exp(-2j * np.pi * frequency / SPEED_OF_LIGHT_MPS * echoes.length)
    )


def error(ours: rt.Echoes, reference: rt.Echoes) -> float:
    """rms|H - Href| / rms|Href| over chirps, receivers and three frequencies, all parts."""
    pairs = [
        (spectrum(ours, f).sum(axis=2), spectrum(reference, f).sum(axis=2))
        for f in (12e9, 14e9, 16e9)
    ]
    return float(
        np.sqrt(
            sum(np.sum(np.abs(a - b) ** 2) for a, b in pairs)
            / sum(np.sum(np.abs(b) ** 2) for _, b in pairs)
        )
    )


# -- reference
# ----------------------------------------------------------------------------------------------


def test_reference_is_the_scattering_length_of_each_pose() -> None:
    radar, body = small_radar(), Passing(speed=0.0)
    chirps = np.array([4, 30])
    echoes = Reference(radar, body, facets=1280).echoes(chirps)  # type: ignore[arg-type]
    for row, chirp in enumerate(chirps):
        pose = body.at([(chirp + 0.5) * radar.chirp_duration_s])
        # About the middle of the sphere, so that the phase over the origin is that of metres, not
        # of the radar's place.
        tx = np.tile(radar.tx[chirp % 3], (2, 1))
        rx = radar.rx[radar.rx_of_tx[chirp % 3]]
        target = rt.Ellipsoids(pose.centres[0], pose.frames[0], pose.semi_axes)
        for frequency, ours in zip(echoes.frequency, echoes.amplitude[:, row], strict=True):
            f = facet_scattering(target, tx, rx, np.full(2, frequency), facets=1280)
            far = np.linalg.norm(tx, axis=1), np.linalg.norm(rx, axis=1)
            k = 2 * np.pi * frequency / SPEED_OF_LIGHT_MPS
            expected = f / (far[0] * far[1]) * np.exp(-1j * k * (far[0] + far[1]))
            got = (np.conj(ours) * np.exp(-1j * k * echoes.length[row])).sum(axis=1)
            np.testing.assert_allclose(got, expected, atol=1e-6 * np.abs(expected).max())


def test_reference_answers_for_any_chirps_alike() -> None:
    model = Reference(small_radar(), Passing(), facets=320)  # type: ignore[arg-type]
    together, alone = model.echoes(np.array([3, 4, 20])), model.echoes(np.array([4]))
    np.testing.assert_allclose(together.amplitude[:, 1:2], alone.amplitude, rtol=1e-12)
    np.testing.assert_array_equal(together.length[1:2], alone.length)
    assert together.amplitude.shape == (7, 3, 2, 2)


def test_spreading_can_be_left_out() -> None:
    radar, body = small_radar(), Passing(speed=0.0)
    near, free = (
        Reference(radar, body, facets=1280, spreading=spread).echoes(np.array([60]))  # type: ignore[arg-type]
        for spread in (True, False)
    )
    # Nearly monostatic: R_T = R_R = length / 2 at the specular point, and facets that count stand
    # within 2 cm of 3.5 m.
    seen = np.abs(near.amplitude) > 1e-4
    np.testing.assert_allclose(
        np.abs(free.amplitude)[seen],
        (np.abs(near.amplitude) * (near.length / 2) ** 2)[seen],
        rtol=0.01,
    )


# -- physical optics
# ----------------------------------------------------------------------------------------------


def test_physical_optics_is_close_to_the_reference_while_a_shadow_passes() -> None:
    radar, body = small_radar(), Passing()
    chirps = np.arange(10, 190, 7)
    model_options = {"facets": 1280}
    reference = Reference(radar, body, **model_options).echoes(chirps)  # type: ignore[arg-type]
    ours, fewer = (
        PhysicalOptics(radar, body, frequencies=n, **model_options).echoes(chirps)  # type: ignore[arg-type]
        for n in (5, 3)
    )
    np.testing.assert_array_equal(ours.length, reference.length)
    hidden = np.abs(reference.amplitude[3, :, :, 0])
    assert hidden.min() < 0.6 * hidden.max()  # the shadow is there
    # The accuracy promised at 12 GHz of a body; where half of all there is is half hidden it takes
    # five frequencies.
    assert error(ours, reference) < 0.02
    assert error(fewer, reference) < 0.04
    assert error(Specular(radar, body).echoes(chirps), reference) > 0.05  # type: ignore[arg-type]


def test_the_carrier_stays_where_polarisation_leaves_nothing() -> None:
    """Over walls, whose images may stand far apart, the co-polar part changes its sign."""
    body = rt.Body.from_motion(rt.synthetic_motion("walk", duration_s=0.1))
    surface = PhysicalOptics(rt.Radar.preset("paper-12ghz"), body)._surface
    (centres,), frames, semi_axes = body.at([0.0])
    head = body.part_names.index("head")
    tx = centres[head] + np.array([-4.0, 0.0, 1.0])

    def at(angle: float) -> Geometry:
        rx = centres[head] + 4 * np.array([-np.cos(angle), 0.2, np.sin(angle)])
        return Geometry(tx[None], rx[None, None], centres[None], frames, semi_axes)

    angles = np.linspace(1.0, 2.0, 50)
    v = Polarization("v")
    copolar, carrier = (
        np.array([found(at(angle))[0, 0, head] for angle in angles])
        for found in (
            lambda at: solve_specular_points(at, polarization=v)[1],
            lambda at: surface.carriers(at)[1],
        )
    )
    assert copolar.min() < 0 < copolar.max()
    assert carrier.min() > 0.5 * carrier.max()


def test_blocks_of_chirps_do_not_matter() -> None:
    radar, body = small_radar(), Passing()
    chirps = np.arange(15, 65)
    whole = PhysicalOptics(radar, body, facets=320).echoes(chirps)  # type: ignore[arg-type]
    model = PhysicalOptics(radar, body, facets=320)  # type: ignore[arg-type]
    for some in (chirps[:7], chirps[20:21], chirps[7:20]):
        part = model.echoes(some)
        np.testing.assert_allclose(
            part.amplitude, whole.amplitude[:, some - 15], rtol=1e-9, atol=1e-15
        )


@pytest.mark.parametrize("option", ["anchor_s", "tolerance", "unevenness", "frequencies"])
def test_options_out_of_range_are_refused(option: str) -> None:
    with pytest.raises(InputError, match=f"{option} = -1"):
        PhysicalOptics(small_radar(), Passing(), **{option: -1})  # type: ignore[arg-type]


# -- the array
# ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes", [{}, {"channels": "all"}, {"tx_z": 0}, {"tx_y": 1, "rx_y": 1, "rx_z": 1}]
)
@pytest.mark.parametrize("nodes", [(1, 1), (2, 1), (4, 2)])
def test_nodes_carry_polynomials_over_the_array(
    changes: dict[str, object], nodes: tuple[int, int]
) -> None:
    radar = small_radar(**({"tx_y": 6, "tx_z": 6, "rx_y": 8, "rx_z": 8} | changes))
    found = array_nodes(radar, *nodes)
    rng = np.random.default_rng(0)
    slope_t, slope_r = rng.normal(size=(2, 3)) * (np.array(nodes)[:, None] > 1)

    def value(tx: Array, rx: Array) -> Array:
        # As many powers as the nodes of the lines can carry, whatever the line.
        along = (tx - radar.position_m) @ slope_t
        return np.asarray(
            (1 + along + (along**2 if nodes[0] > 2 else 0))
            * (1 + (rx - radar.position_m) @ slope_r)
        )

    at_nodes = value(found.antennas[found.pairs[:, 0]], found.antennas[found.pairs[:, 1]])
    for tx in range(radar.n_tx):
        expected = value(np.tile(radar.tx[tx], (radar.n_rx, 1)), radar.rx[radar.rx_of_tx[tx]])
        np.testing.assert_allclose(found.weights[tx] @ at_nodes, expected, rtol=1e-10)


def test_coarse_nodes_spread_to_fine_ones() -> None:
    radar = small_radar(tx_y=6, tx_z=6, rx_y=8, rx_z=8)
    few, many = array_nodes(radar, 2, 1), array_nodes(radar, 4, 2)
    value = few.antennas[few.pairs[:, 0]] @ [1.0, 2.0, 3.0]
    np.testing.assert_allclose(
        spread_nodes(radar, (2, 1), (4, 2)) @ value,
        many.antennas[many.pairs[:, 0]] @ [1.0, 2.0, 3.0],
    )


# -- the envelope
# ----------------------------------------------------------------------------------------------


def envelope_of(
    law: Callable[[float], complex], tolerance: float = 0.05
) -> tuple[Envelope, list[float]]:
    """An envelope of two parts, one by the law, the other 1; and the places where it was asked."""
    asked: list[float] = []

    def sample(place: float, parts: NDArray[np.int64], whole: Array | None) -> Sample:
        asked.append(place)
        ratio = np.array([law(place), 1.0 + 0j])[parts]
        return Sample(np.tile(ratio, (3, 2, 1)), np.ones((2, len(parts))))

    return Envelope(sample, np.zeros(2, dtype=np.int64), tolerance, PLACES), asked


def between(envelope: Envelope, index: int, fraction: Array) -> NDArray[np.complex128]:
    """Ratio (time, part) at these fractions of the way from a keyframe to the next."""
    ratio, slope, known = envelope.course(index)
    out = np.empty((len(fraction), 2), dtype=np.complex128)
    for row, place in enumerate(fraction * PLACES):
        for part in range(2):
            left, right = stretch(known[:, part], place)
            values = ratio[left], ratio[right], slope[left], slope[right]
            weights = hermite_weights((place - left) / (right - left), right - left)
            out[row, part] = sum(
                weight * value[0, 0, part] for weight, value in zip(weights, values, strict=True)
            )
    return out


def test_a_slow_envelope_is_interpolated_from_the_keyframes_alone() -> None:
    def law(t: float) -> complex:
        return complex(np.exp(0.3j * t))

    envelope, asked = envelope_of(law, tolerance=0.1)
    fraction = np.linspace(0, 1, 50, endpoint=False)
    got = between(envelope, 4, fraction)
    # A cubic through slopes by neighbours: (0.3)^3 / 6 / 4 at the most.
    np.testing.assert_allclose(got[:, 0], [law(4 + s) for s in fraction], atol=1.5e-3)
    np.testing.assert_allclose(got[:, 1], 1, rtol=1e-15)
    assert all(place == round(place) for place in asked)
    # They may be asked for backwards.
    for index in [*range(40, 0, -1), 40, 20, 1]:
        got, expected = between(envelope, index, fraction), [law(index + s) for s in fraction]
        np.testing.assert_allclose(got[:, 0], expected, atol=1.5e-3)


def test_where_it_bends_keyframes_come_closer_and_the_error_falls() -> None:
    def law(t: float) -> complex:
        return complex(
            1 / (1 + np.exp(-(t - 4.4) / 0.05))
        )  # from 0 to 1 within a fifth of an interval

    fraction = np.linspace(0, 1, 200, endpoint=False)
    errors = []
    for tolerance in (10.0, 0.05):
        envelope, asked = envelope_of(law, tolerance)
        errors.append(
            np.abs(between(envelope, 4, fraction)[:, 0] - [law(4 + s) for s in fraction]).max()
        )
    assert {4 + 3 / PLACES, 4 + 4 / PLACES} <= set(asked)
    assert errors[0] > 0.3
    assert errors[1] < 0.05


@pytest.mark.parametrize("step", [1, 3, 5])
def test_what_is_prepared_is_as_without_and_found_once(step: int) -> None:
    def law(t: float) -> complex:
        return complex(np.exp(3j * np.sin(t)))  # bends in every interval

    fraction = np.linspace(0, 1, 9, endpoint=False)
    prepared, asked = envelope_of(law)
    plain, _ = envelope_of(law)
    for first in range(0, 32, TOGETHER):
        courses = range(first, first + TOGETHER, step)
        prepared.prepare_courses(courses)
        for index in courses:
            np.testing.assert_array_equal(
                between(prepared, index, fraction), between(plain, index, fraction)
            )
    assert len(asked) == len(set(asked)) > 21
    assert any(place != round(place) for place in asked)


@given(st.integers(0, 2**32 - 1))
def test_an_envelope_has_one_value_and_one_slope_at_a_keyframe(seed: int) -> None:
    phases = np.random.default_rng(seed).uniform(0, 3, 40)

    def law(t: float) -> complex:
        return complex(np.exp(1j * np.interp(t, np.arange(40) / 4, phases)))

    envelope, _ = envelope_of(law)
    step = 1e-5
    before = between(envelope, 3, np.array([1 - step, 1.0]))[:, 0]
    after = between(envelope, 4, np.array([0.0, step]))[:, 0]
    np.testing.assert_allclose(before[1], after[0], atol=1e-12)
    # Slopes reach tens an interval; the second derivative times the step is what they may differ
    # by.
    np.testing.assert_allclose(before[1] - before[0], after[1] - after[0], atol=1e-6)


class PlaceAlongY:
    """In place of the facets: the echo of a part over its carrier is where the part is along y."""

    frequency = np.array([14e9])

    def carriers(self, at: Geometry) -> tuple[Array, Array]:
        one = np.ones((len(at.tx), 1, at.centres.shape[1]))
        return one, one

    def field(self, time: float, pose: Poses, *given: Array) -> NDArray[np.complex128]:
        _, pairs, _, parts = given
        return np.tile(pose.centres[0, parts, 1] + 0j, (1, len(pairs), 1))


@pytest.mark.parametrize("gap_s", [None, 0.0437])
@pytest.mark.parametrize("multiplexing", ["tdm", "fdm", "ddm", "bpm"])
def test_an_envelope_is_that_of_the_times_of_chirps(multiplexing: str, gap_s: float | None) -> None:
    radar = small_radar(
        tx_y=4, tx_z=0, rx_y=4, rx_z=0, channels="all", multiplexing=multiplexing,
        chirps_per_frame=72, frame_period_s=gap_s, idle_s=1e-4,
        adc_start_s=2e-4, adc_rate_hz=256 / 2.5e-4,
    )  # fmt: skip
    body, chirps = Passing(), np.arange(200)
    given = {"anchor_s": 7e-3, "tolerance": -1.0, "unevenness": 1.0}  # divided everywhere
    envelope = ArrayEnvelope(radar, body, PlaceAlongY(), **given)  # type: ignore[arg-type]
    strength = np.ones((len(chirps), radar.n_rx, 2))
    found = envelope.times(chirps, radar.tx_of_chirp(chirps), strength)[0, :, :, 1]
    exact = body.at(radar.centres_of(chirps)).centres[:, 1, 1]
    np.testing.assert_allclose(found, np.tile(exact[:, None], radar.n_rx), rtol=0, atol=1e-12)
