"""Far-field echoes of ellipsoids against their plain reference."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rtradar.kernels.scatter.far_field import far_field, far_field_reference
from rtradar.kernels.scatter.specular_point import Geometry


@pytest.mark.parametrize("spreading", [False, True])
@pytest.mark.parametrize("receivers", [1, 8, 11])
def test_far_field_echoes_are_those_of_the_reference(receivers: int, spreading: bool) -> None:
    rng = np.random.default_rng(receivers)
    tx, rx = rng.normal(0, 0.3, (5, 3)), rng.normal(0, 0.3, (5, receivers, 3))
    centres = np.array([4.0, 0.0, 1.0]) + rng.normal(0, 0.4, (5, 6, 3))
    # Straight between both antennas there is no bisector.
    tx[0], centres[0, 0], rx[0, 0] = [0, 0, 0], [4, 0, 0], [8, 0, 0]
    frames = Rotation.random(30, random_state=1).as_matrix().reshape(5, 6, 3, 3)
    at = Geometry(tx, rx, centres, frames, rng.uniform(0.03, 0.3, (6, 3)))
    length, amplitude = np.empty((2, 5, receivers, 6))
    far_field(0, len(length), at, spreading, length, amplitude)
    expected = far_field_reference(at, spreading)
    np.testing.assert_allclose(length, expected[0], rtol=1e-13)
    np.testing.assert_allclose(amplitude, expected[1], rtol=1e-12)
    assert length[0, 0, 0] == 8
    assert amplitude[0, 0, 0] == 0
