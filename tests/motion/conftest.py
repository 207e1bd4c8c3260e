"""Small files to read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rtradar.motion import Motion
from rtradar.motion.formats import skeletons
from rtradar.system import row_files

ASF = """# a comment
:version 1.10
:name two
:units
  mass 1.0
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name first
    direction 0 1 0
    length 10
    axis 0 0 0 XYZ
    dof rx ry rz
  end
  begin
    id 2
    name second
    direction 1 0 0
    length 5
    axis 0 0 90 XYZ
    dof rx
  end
:hierarchy
  begin
    root first
    first second
  end
"""

AMC = """#!OML:ASF X:\\f\u00fcr\\two.ASF
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 0 0 0
first 0 0 0
second 0
2
root 1 2 3 0 90 0
first 0 0 450
second 90
"""


@pytest.fixture
def asf_files(tmp_path: Path) -> tuple[Path, Path]:
    """Write a motion of two frames and a skeleton of two bones, with mixed line ends."""
    asf, amc = tmp_path / "two.asf", tmp_path / "two.amc"
    asf.write_bytes(ASF.replace("\n", "\r\n").encode("latin-1"))
    amc.write_bytes(AMC.replace("\n", "\r\n", 2).encode("latin-1"))
    return amc, asf


@pytest.fixture
def in_pieces(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """From then on blocks are of three or four frames, and wait in files."""

    def cut() -> None:
        monkeypatch.setattr(row_files, "_MOST_IN_MEMORY", 0)
        monkeypatch.setattr(row_files, "_ROWS_AT_ONCE", 3)
        monkeypatch.setattr(skeletons, "FRAMES_AT_ONCE", 4)

    return cut


@pytest.fixture
def same() -> Callable[[Motion, Motion], None]:
    """Holds one motion to another."""

    def same(ours: Motion, theirs: Motion) -> None:
        assert ours.joints == theirs.joints
        # Rounding of arrays of other lengths, of which the processor takes several numbers at once.
        for name in ("offsets", "root_positions", "rotations", "positions"):
            np.testing.assert_allclose(
                getattr(ours, name), getattr(theirs, name), atol=1e-14, err_msg=name
            )

    return same
