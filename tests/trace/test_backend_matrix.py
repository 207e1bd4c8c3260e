"""A walk by `specular` on each libLLVM that the machine has, on none, and on the scalar backend.

Each is a process of its own, for Dr.Jit takes one libLLVM for the life of a process. All must have
the echoes of the scalar backend.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from rtradar.testing import SAME_LEVEL
from rtradar.trace.probe import ENVIRONMENT_VARIABLE, Library, candidates, probe_backend

pytestmark = pytest.mark.slow

CHILD = """
import json, sys, warnings
import numpy as np
import rtradar as rt
from rtradar.trace import backend

radar, variant, hidden, out = sys.argv[1:]
if hidden:
    backend.candidates = lambda: []
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always", backend.BackendWarning)
    chosen = backend.select(variant)
    walk = rt.synthetic_motion("walk", seed=0, duration_s=0.2)
    simulation = rt.simulate(walk, radar, variant=variant, heading_deg=80, duration_s=0.1)
    echoes = simulation.echoes()
np.savez(out, length=echoes.length_m, amplitude=echoes.amplitude)
version = backend.loaded_llvm_version()
print(json.dumps([chosen.kind, version, *{str(one.message) for one in caught}]))
"""


class Answer(NamedTuple):
    """Backend that a process chose, libLLVM that it loaded, what it warned of, and its echoes."""

    kind: str
    version: str
    warnings: list[str]
    length: NDArray[np.float64]
    amplitude: NDArray[np.complex128]


Walk = Callable[..., Answer]


@pytest.fixture(scope="module")
def walk(small_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Walk:
    """Let a process compute the walk, with a libLLVM that is named, by default as it finds it."""

    def compute(variant: str = "auto", named: str | None = None, hidden: str = "") -> Answer:
        out = tmp_path_factory.mktemp("echoes") / "echoes.npz"
        environment: dict[str, Any] = {**os.environ}
        environment.pop(ENVIRONMENT_VARIABLE, None)
        if named:
            environment[ENVIRONMENT_VARIABLE] = named
        command = [sys.executable, "-c", CHILD, str(small_file), variant, hidden, str(out)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        kind, version, *warned = json.loads(done.stdout.splitlines()[-1])
        with np.load(out) as echoes:
            return Answer(kind, version, warned, echoes["length"], echoes["amplitude"])

    return compute


@pytest.fixture(scope="module")
def by_scalar(walk: Walk) -> Answer:
    return walk("scalar")


def library(major: int, *, or_newer: bool = False) -> Library:
    """A libLLVM of the system of that version; the test is skipped where there is none."""
    for one in candidates():
        found = int((one.version or "0").split(".")[0])
        if one.origin != "wheel" and (found == major or (or_newer and found > major)):
            return one
    newer = " or newer" * or_newer
    pytest.skip(f"no libLLVM {major}{newer} of the system: apt-get install libllvm{major}")


def assert_same(answer: Answer, other: Answer) -> None:
    np.testing.assert_array_equal(answer.length, other.length)
    largest = np.abs(other.amplitude).max()
    assert np.abs(answer.amplitude - other.amplitude).max() <= SAME_LEVEL * largest


def test_the_scalar_backend_sees_that_parts_occlude_each_other(by_scalar: Answer) -> None:
    assert (by_scalar.kind, by_scalar.warnings) == ("scalar", [])
    occluded = (by_scalar.amplitude == 0).mean(axis=(0, 1))
    assert 3 <= np.count_nonzero(occluded > 0.5) <= 15  # of 21 parts


def test_llvm_of_the_wheel(walk: Walk, by_scalar: Answer) -> None:
    wheels = [one for one in candidates() if one.origin == "wheel"]
    if not wheels:
        pytest.skip("no libLLVM of a wheel: pip install karellen-llvm-core (x86-64 Linux)")
    answer = walk("llvm")
    assert (answer.kind, answer.warnings) == ("llvm", [])
    assert str(wheels[0].version) in answer.version
    assert_same(answer, by_scalar)


def test_llvm_of_the_system_from_19_on(walk: Walk, by_scalar: Answer) -> None:
    given = library(19, or_newer=True)
    answer = walk("llvm", given.path)
    assert (answer.kind, answer.warnings) == ("llvm", [])
    assert answer.version.split(".")[0] == str(given.version).split(".")[0]
    assert_same(answer, by_scalar)


@pytest.mark.parametrize("major", [15, 16])
def test_a_libllvm_that_aborts_is_passed_over(walk: Walk, by_scalar: Answer, major: int) -> None:
    given = library(major)
    assert probe_backend("llvm_ad_rgb", given, fresh=True).finding == "aborts the process"
    answer = walk("auto", given.path)
    assert (answer.kind, answer.version.split(".")[0]) != ("llvm", str(major))
    assert (answer.kind == "llvm") != any("install one: " in text for text in answer.warnings)
    assert_same(answer, by_scalar)


def test_without_any_libllvm_scalar_serves(walk: Walk, by_scalar: Answer) -> None:
    answer = walk("auto", "/nowhere/libLLVM.so", "hidden")
    assert (answer.kind, answer.version) == ("scalar", "none")
    assert any("(there is none); install one: " in text for text in answer.warnings)
    assert_same(answer, by_scalar)
