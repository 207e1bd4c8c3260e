"""The table of what an installation brings: sizes, who imports what, and its rows."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.metadata import PathDistribution
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


def test_a_package_is_as_large_as_its_files_and_links_count_once(
    script: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    (tmp_path / "one.dist-info").mkdir()
    (tmp_path / "libone.so.1").write_bytes(bytes(3_000_000))
    (tmp_path / "libone.so").symlink_to("libone.so.1")
    record = "libone.so.1,,\nlibone.so,,\ngone.py,,\n"
    (tmp_path / "one.dist-info" / "RECORD").write_text(record, encoding="utf-8")
    one = PathDistribution(tmp_path / "one.dist-info")
    assert script("cost/installed.py").megabytes(one) == 3.0


def test_the_first_step_that_imports_a_package_is_named(
    script: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    installed = script("cost/installed.py")
    steps = {"first": "import numpy", "second": "import numpy, jinja2"}
    monkeypatch.setattr(installed, "STEPS", steps)
    found = installed.importers()
    assert (found["numpy"], found["jinja2"]) == ("first", "second")


def test_small_packages_are_one_row_of_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("docutils", reason="pages are built by what the extra docs brings")
    monkeypatch.syspath_prepend(ROOT / "docs")
    rows = [
        {"package": name, "mb": mb, "first": first}
        for name, mb, first in (("large", 70.4, "rooms"), ("odd", 6.0, ""), ("a", 2.0, ""))
    ]
    table = import_module("write_performance").installed({"installed": rows})
    assert table.splitlines()[2:] == [
        "| large | 70 | rooms |",
        "| odd | 6 | - |",
        "| 1 others | 2 |  |",
        "| all | 78 |  |",
    ]
