"""Joint positions that cameras and body models give, read as motions."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rtradar.motion import load_motion
from rtradar.motion.skeleton import NODES


@pytest.fixture(scope="session")
def recorded() -> Path:
    """Folder of joint positions of real people."""
    named = os.environ.get("RTRADAR_JOINTS")
    if not named:
        pytest.skip("RTRADAR_JOINTS is not set: it names the folder of joint positions")
    return Path(named)


@pytest.mark.parametrize("kind", ["mhad", "kinder_gator", "gait"])
def test_recordings_are_motions(recorded: Path, kind: str) -> None:
    motion = load_motion(sorted((recorded / kind).glob("*.npz"))[0])
    assert motion.joints == NODES
    assert motion.rate_hz >= 120
    lowest = motion.positions[..., 2].min(axis=1)
    assert -0.02 < sorted(lowest)[len(lowest) // 4] < 0.08
