"""Far-field echoes of a part between both antennas."""

import numpy as np
import pytest

from rtradar.kernels.scatter.far_field import far_field
from rtradar.kernels.scatter.specular_point import Geometry


@pytest.mark.parametrize("spreading", [False, True])
def test_there_is_no_echo_straight_between_both_antennas(spreading: bool) -> None:
    tx, rx, centres = np.zeros((1, 3)), np.array([[[8.0, 0, 0]]]), np.array([[[4.0, 0, 0]]])
    at = Geometry(tx, rx, centres, np.eye(3)[None, None], np.array([[0.1, 0.2, 0.3]]))
    length, amplitude = np.empty((2, 1, 1, 1))
    far_field(0, 1, at, spreading, length, amplitude)
    assert length == 8
    assert amplitude == 0
