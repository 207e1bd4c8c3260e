"""Threads that stay."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from rtradar.threads import in_threads


def test_results_come_in_the_order_of_the_items() -> None:
    assert in_threads(lambda item: item * item, range(20)) == [item * item for item in range(20)]
    assert in_threads(str, range(0)) == []


def test_an_error_in_a_thread_is_raised() -> None:
    def fail(item: int) -> None:
        raise ValueError(f"item {item}")

    with pytest.raises(ValueError, match="item 0"):
        in_threads(fail, range(2))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_forked_process_has_threads_of_its_own() -> None:
    program = """
import os
from rtradar.threads import in_threads
in_threads(str, range(4))
child = os.fork()
if child == 0:
    os._exit(0 if in_threads(str, range(4)) == ["0", "1", "2", "3"] else 1)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    assert subprocess.run([sys.executable, "-W", "ignore", "-c", program], timeout=60, check=False).returncode == 0
