"""The same seed gives the same bits, with any number of threads."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from rtradar.threads import environment_of

RADAR = "tx_y = 2\ntx_z = 2\nrx_y = 4\nrx_z = 4\nchirp_duration_s = 125e-6\nsamples_per_chirp = 128\nframe_duration_s = 0.05\n"


def bits(folder: Path) -> dict[str, bytes]:
    """Every map and cloud as bytes."""
    found = {}
    with h5py.File(folder / "maps.h5") as maps:
        found |= {name: data[()].tobytes() for name, data in maps.items()}
    for name in ("cloud_rdt.npz", "cloud_xyz.npz"):
        with np.load(folder / name) as cloud:
            found |= {f"{name} {key}": cloud[key].tobytes() for key in cloud.files}
    return found


@pytest.mark.slow
@pytest.mark.parametrize("options", [["--fidelity", "analytic"], ["--fidelity", "specular"]])
def test_one_thread_and_three_give_the_same_bits(tmp_path: Path, options: list[Any]) -> None:
    (tmp_path / "small.toml").write_text(RADAR)
    found = []
    for threads in (1, 3):
        out = tmp_path / str(threads)
        command = [sys.executable, "-m", "rtradar", "run", "synthetic:kick", "--duration", "0.2", "--out", str(out), *options]
        command += ["--radar", str(tmp_path / "small.toml"), "--variant", "llvm" if "specular" in options else "auto"]
        done = subprocess.run(command, env={**os.environ, **environment_of(threads)}, capture_output=True, text=True, check=False)
        if "--variant llvm" in done.stderr:
            pytest.skip("no LLVM backend here")
        assert done.returncode == 0, done.stderr
        found.append(bits(out))
    assert len(found[0]) > 10
    assert [name for name in found[0] if found[0][name] != found[1].get(name)] == []
