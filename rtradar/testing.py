"""Fixtures of pytest and tolerances for the tests of programs that use rtradar.

A test suite takes them by one line of its ``conftest.py``::

    pytest_plugins = ["rtradar.testing"]

A test takes ``rtradar_radar`` and ``rtradar_scene``, which are small, and ``rtradar_variant``: it
runs by each that works on the machine. Needs pytest, which nothing else of this package imports.
"""

from __future__ import annotations

from typing import NamedTuple

import pytest

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scene import Scene, Wall, material

SAME_LEVEL = 1e-6
"""Largest difference of range-Doppler maps by one level on two backends, over the map's peak."""


class Tolerance(NamedTuple):
    """How far a level is from another judge of the same echoes.

    ``complex_error`` is the rms of the difference of received spectra over their rms, ``power_db``
    that of the power of a frame [dB].
    """

    complex_error: float
    power_db: float


_FROM_REFERENCE = {
    "analytic-paper": Tolerance(1.43, 0.69),
    "analytic": Tolerance(0.35, 0.44),
    "specular": Tolerance(0.11, 0.12),
    "auto": Tolerance(0.11, 0.12),
    "physical-optics": Tolerance(0.022, 0.02),
    "rays": Tolerance(0.033, 0.04),
    "reference": Tolerance(0.0, 0.0),
}


def tolerance(fidelity: str) -> Tolerance:
    """Return how far a level may be from the level ``reference`` for a person who moves.

    Parameters
    ----------
    fidelity : str
        Name of a level of this package.

    Returns
    -------
    Tolerance
        Largest errors over four activities at 12 and 77 GHz, as ``validation/cost/trade.py``
        measured them.

    Raises
    ------
    InputError
        Where no error of that level was measured.
    """
    if fidelity not in _FROM_REFERENCE:
        raise InputError(
            f"no error of level '{fidelity}' was measured; known: {', '.join(_FROM_REFERENCE)}"
        )
    return _FROM_REFERENCE[fidelity]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test that takes ``rtradar_variant`` once by each that works on this machine."""
    if "rtradar_variant" in metafunc.fixturenames:
        from rtradar.trace.backend import available

        metafunc.parametrize("rtradar_variant", available())


@pytest.fixture(scope="session")
def rtradar_radar() -> Radar:
    """A radar of few samples with a line of antennas along y, for runs of a tenth of a second."""
    return Radar(
        name="small",
        samples_per_chirp=128,
        chirp_duration_s=250e-6,
        frame_duration_s=0.05,
        tx_y=2,
        tx_z=0,
        rx_y=4,
        rx_z=0,
    )


@pytest.fixture(scope="session")
def rtradar_scene() -> Scene:
    """A scene with one metal wall on the left of the radar: few echoes on each path."""
    left = Wall(
        name="left",
        corner_m=(-4.4, 2.7, 0.0),
        edge_u_m=(6.8, 0.0, 0.0),
        edge_v_m=(0.0, 0.0, 2.5),
        material=material("metal"),
        thickness_m=0.01,
    )
    return Scene(name="one wall", walls=(left,))
