"""The page of theory and the docstrings: citations exist and are used, and the code agrees."""

from __future__ import annotations

import ast
import re
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import integrate, special, stats

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.process import WindowFunctions
from rtradar.scatter.multipath.slabs import Term
from rtradar.scene import reflection, slab
from rtradar.scene.slab import slab_passes

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "theory.rst").read_text(encoding="utf-8")
LABELS = re.findall(r"^\s+:label: (\S+)$", PAGE, re.MULTILINE)
RADAR = rt.Radar(tx_y=2, tx_z=0, rx_y=3, rx_z=0, samples_per_chirp=64)


@cache
def citations() -> Counter[str]:
    """Labels that docstrings of the package cite, with their number."""
    cited: Counter[str] = Counter()
    for path in (ROOT / "rtradar").rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(source)) if ":eq:" in source else ():
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                cited.update(re.findall(r":eq:`([^`]+)`", ast.get_docstring(node) or ""))
    return cited


def test_every_equation_has_a_label_of_its_own() -> None:
    assert len(LABELS) == len(set(LABELS)) == PAGE.count(".. math::") > 30


def test_every_label_that_is_cited_exists() -> None:
    assert sorted(set(citations()) - set(LABELS)) == []
    assert sorted(set(re.findall(r":eq:`([^`]+)`", PAGE)) - set(LABELS)) == []


def test_every_equation_is_cited() -> None:
    assert sorted(set(LABELS) - set(citations())) == []


# The equations of the page, written down once more and compared with the code, except for those
# whose closed form other tests have.


def test_if_signal_and_its_spectrum() -> None:
    """(if-signal) from (chirp): sweep times delayed conjugate; (received-spectrum): conjugate."""
    length, amplitude = 3.1, 0.4 - 0.3j
    echoes = rt.Echoes(
        length=np.full((1, 1, 1), length),
        amplitude=np.full((1, 1, 1, 1), amplitude),
        frequency=[12e9],
        tx=[0],
        part=[0],
        bounces=[1],
    )
    got = rt.signal.synthesize(echoes, RADAR, RADAR.chirp_times(1))[0, 0]
    t, tau = np.arange(64) / RADAR.sample_rate_hz, length / SPEED_OF_LIGHT_MPS

    def turns(at: np.ndarray) -> np.ndarray:
        return RADAR.start_frequency_hz * at + RADAR.slope_hz_per_s * at**2 / 2

    # 12e9 turns a second for 62 us, of which a double keeps 1e-10.
    np.testing.assert_allclose(
        got, amplitude * np.exp(2j * np.pi * (turns(t) - turns(t - tau))), atol=1e-8
    )
    frequency = RADAR.start_frequency_hz + RADAR.slope_hz_per_s * t
    received = np.conj(amplitude) * np.exp(-2j * np.pi * frequency * tau)
    rest = np.exp(-1j * np.pi * RADAR.slope_hz_per_s * tau**2)  # of the mixer alone
    np.testing.assert_allclose(got, np.conj(received) * rest, atol=1e-8)


def test_axes_of_the_maps() -> None:
    radar, c = rt.Radar.preset("paper-12ghz"), SPEED_OF_LIGHT_MPS
    wavelength, cycle = c / (12e9 + 4e9 / 2), 12 * 62.5e-6
    spacing = c / 12e9 / 2
    expected = [c / 8e9, c / 8e9 * 256, wavelength / (4 * cycle), wavelength / (2 * 133 * cycle)]
    assert [
        radar.range_bin_m,
        radar.max_range_m,
        radar.max_velocity_mps,
        radar.velocity_bin_mps,
    ] == pytest.approx(expected)
    angles = np.degrees(
        [np.arcsin(wavelength / (2 * spacing)), 0.886 * wavelength / (48 * spacing)]
    )
    assert [radar.max_angle_deg, radar.angle_resolution_deg] == pytest.approx(angles)
    assert radar.chirp_times(3) == pytest.approx(62.5e-6 * np.array([0.5, 1.5, 2.5]))
    assert list(radar.tx_of_chirp(np.arange(11, 14))) == [11, 0, 1]


def test_range_doppler() -> None:
    random = np.random.default_rng(0)
    x = random.normal(size=(8, 3, 64)) + 1j * random.normal(size=(8, 3, 64))
    fast, slow = (0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n) for n in (64, 4))
    k, velocity, tx, rx = 5, -1, 1, 2
    turn = np.exp(-2j * np.pi * (k * np.arange(64) / 64 + velocity * np.arange(4)[:, None] / 4))
    expected = (slow[:, None] * fast * x[tx::2, rx] * turn).sum() / (slow.sum() * fast.sum())
    hann = WindowFunctions("hann", "hann")
    found = rt.process.range_doppler(x, RADAR, window_functions=hann)
    assert found.values[k, velocity + 2, tx * 3 + rx] == pytest.approx(expected, rel=1e-12)


def test_radii_and_cross_section_of_an_ellipsoid() -> None:
    axes, theta, phi = np.array([0.1, 0.2, 0.35]), 0.7, 1.9
    n = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    h = np.sqrt((axes**2 * n**2).sum())
    smaller, larger = rt.rcs.ellipsoid_radii(*axes, theta, phi)
    assert smaller * larger == pytest.approx(axes.prod() ** 2 / h**4)
    assert smaller + larger == pytest.approx(((axes**2).sum() - (axes**4 * n**2).sum() / h**2) / h)
    assert rt.rcs.ellipsoid(*axes, theta, phi) == pytest.approx(np.pi * smaller * larger)


def test_mirror_return_of_a_sphere_near_by() -> None:
    """(mirror-matrix) of a sphere and one antenna: 2/R + 2/a, curvatures of wave and sphere."""
    radius, distance = 0.3, 2.0
    sphere = rt.Ellipsoids(np.zeros((1, 3)), np.eye(3)[None], np.full((1, 3), radius))
    antenna, k = np.array([[distance, 0.0, 0.0]]), 2 * np.pi * 77e9 / SPEED_OF_LIGHT_MPS
    way = distance - radius
    h = 2 / way + 2 / radius
    expected = (
        2 * np.sqrt(np.pi) / h * (distance / way) ** 2 * np.exp(-1j * k * (2 * way - 2 * distance))
    )
    got = rt.scattering_length(sphere, antenna, antenna, 77e9, "specular", variant="scalar")
    # A phase of 1000 radians, of which float64 keeps 1e-13; the visibility of the mesh is 1.
    assert got[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("method", "tolerance"), [("go", 1e-12), ("po", 1e-7)])
def test_spheres(method: str, tolerance: float) -> None:
    radius, frequency = 0.05, 12e9
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT_MPS
    if method == "go":
        expected = np.sqrt(np.pi) * radius * np.exp(2j * k * radius)
    else:  # (po) far away, over the cap of heights z = a cos: n.s = z/a, dS = 2 pi a dz
        parts = [
            integrate.quad(lambda z, f=f: z / radius * f(2 * k * z) * 2 * np.pi * radius, 0, radius)
            for f in (np.cos, np.sin)
        ]
        expected = 1j * k / np.sqrt(np.pi) * (parts[0][0] + 1j * parts[1][0])
    assert rt.rcs.sphere(radius, frequency, method) == pytest.approx(expected, rel=tolerance)


def test_mean_of_a_phase_over_a_triangle() -> None:
    """(facet) against quadrature over the triangle; the sum over facets has tests of its own."""
    phases = np.array([0.3, 2.1, -1.7])
    others = [[1, 2], [0, 2], [0, 1]]
    closed = 2 * sum(
        np.exp(1j * phases[i]) / np.prod(1j * (phases[i] - phases[o])) for i, o in enumerate(others)
    )

    def at(v: float, u: float) -> complex:
        return 2 * np.exp(
            1j * (phases[0] + u * (phases[1] - phases[0]) + v * (phases[2] - phases[0]))
        )

    real = integrate.dblquad(lambda v, u: at(v, u).real, 0, 1, 0, lambda u: 1 - u)[0]
    imaginary = integrate.dblquad(lambda v, u: at(v, u).imag, 0, 1, 0, lambda u: 1 - u)[0]
    assert closed == pytest.approx(real + 1j * imaginary, rel=1e-7)


@pytest.mark.parametrize("polarization", ["te", "tm"])
def test_walls(polarization: str) -> None:
    eta, thickness, frequency, cosine = 5.3 - 0.2j, 0.05, 14e9, 0.6
    root = np.sqrt(eta - (1 - cosine**2))
    outer = cosine if polarization == "te" else eta * cosine
    r, q = (
        (outer - root) / (outer + root),
        np.exp(-2j * np.pi * frequency / SPEED_OF_LIGHT_MPS * thickness * root),
    )
    assert reflection(eta, cosine, polarization) == pytest.approx(r)
    expected = r * (1 - q**2) / (1 - r**2 * q**2), (1 - r**2) * q / (1 - r**2 * q**2)
    assert slab(eta, thickness, frequency, cosine, polarization) == pytest.approx(expected)
    passes = [slab_passes(eta, thickness, frequency, cosine, polarization, p) for p in range(4)]
    assert passes == pytest.approx(
        [r, (1 - r**2) * q, -(1 - r**2) * r * q**2, (1 - r**2) * r**2 * q**3]
    )
    for p in range(4):
        longer = p * thickness * np.sqrt(5.3 - (1 - cosine**2)) - p % 2 * thickness * cosine
        assert Term(p, rest=False, index_squared=5.3).extra_m(
            thickness, np.array(cosine)
        ) == pytest.approx(longer)


def test_noise() -> None:
    assert rt.signal.Noise.for_snr(0.2, 13.0).power == pytest.approx(0.2 * 10**-1.3)


def test_cfar_laws() -> None:
    alpha, cells, rank = rt.process.os_scale(48, 0.75, 1e-4), 48, 36
    steps = cells - np.arange(rank)
    assert np.prod(steps / (steps + alpha)) == pytest.approx(1e-4, rel=1e-9)
    looks = 8
    alpha = rt.process.os_scale(cells, 0.75, 1e-4, looks)
    law = stats.beta(rank, cells - rank + 1)
    rate = law.expect(
        lambda u: special.gammaincc(looks, alpha * special.gammaincinv(looks, u)), epsabs=1e-12
    )
    assert rate == pytest.approx(
        1e-4, rel=1e-4
    )  # what the quadrature over U, which peaks sharply, leaves
    assert stats.f.sf(
        rt.process.ca_scale(cells, 1e-4, looks), 2 * looks, 2 * cells * looks
    ) == pytest.approx(1e-4, rel=1e-9)
    assert rt.process.ca_scale(cells, 1e-4) == pytest.approx(cells * (1e-4 ** (-1 / cells) - 1))
