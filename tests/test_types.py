"""A user's program passes mypy --strict, and its mistakes do not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_a_program_of_a_user_has_types_throughout() -> None:
    assert (ROOT / "rtradar" / "py.typed").is_file()
    # From cold, mypy reads the packages below for 20 s.
    cache = ROOT / ".mypy_cache" / "program"
    program = str(ROOT / "tests" / "typed_program.py")
    command = [sys.executable, "-m", "mypy", "--strict", f"--cache-dir={cache}", "--config-file="]
    own = os.environ | {"MYPYPATH": "", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [*command, program], cwd=ROOT / "tests", env=own, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
