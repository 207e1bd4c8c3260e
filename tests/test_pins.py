"""Versions are pinned: constraints.txt has every package that rtradar and its extras need."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from types import ModuleType

import pytest

import rtradar

CONSTRAINTS = Path(__file__).resolve().parents[1] / "constraints.txt"


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def needed() -> set[str]:
    """All installed packages that rtradar needs, and those that they need."""
    found: set[str] = set()
    waiting = [("rtradar", "all")]
    while waiting:
        name, extras = waiting.pop()
        try:
            listed = requires(name) or []
        except PackageNotFoundError:
            continue  # of another system or Python, or of an extra that is not installed
        for line in listed:
            requirement, _, marker = line.partition(";")
            if "extra ==" in marker and extras != "all":
                continue
            found_name = re.match(r"\s*([A-Za-z0-9._-]+)(\[.*?\])?", requirement)
            assert found_name is not None
            child = plain(found_name[1])
            if child not in found:
                found.add(child)
                waiting.append((child, ""))
    # pip is what reads the constraints.
    return {name for name in found if installed(name)} - {"rtradar", "pip"}


def installed(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True


def test_every_package_has_one_pinned_version() -> None:
    lines = [line for line in CONSTRAINTS.read_text().splitlines() if re.match("[^#]", line)]
    pins = dict(line.split("==") for line in lines)
    assert len(pins) == len(lines)
    missing = sorted(needed() - {plain(name) for name in pins})
    assert missing == []


def test_pins_are_those_of_a_report_of_pip(script: Callable[[str], ModuleType]) -> None:
    report = [
        {"metadata": {"name": name, "version": version}, "is_direct": name == "rtradar"}
        for name, version in (
            *(("torch", "2.13.0+cpu"), ("Jinja2", "3.1.6"), ("rtradar", "0.2.0"), ("pip", "26.3")),
            *(("nvidia-cublas", "13.1"), ("triton", "3.8.0"), ("mypy_extensions", "1.2.0")),
        )
    ]
    pinned = script("constraints.py").pins(report)
    assert pinned == ["jinja2==3.1.6", "mypy-extensions==1.2.0", "torch==2.13.0"]


def test_the_search_follows_what_needs_what() -> None:
    if not installed("rtradar"):
        pytest.skip("rtradar runs from its source, and is not installed")
    assert {"numpy", "mitsuba", "drjit", "llvmlite"} <= needed()


def test_what_is_cited_is_this_version() -> None:
    root = CONSTRAINTS.parent
    cited = re.search(r"^version: (\S+)$", (root / "CITATION.cff").read_text(), re.MULTILINE)
    assert cited
    assert cited[1] == rtradar.__version__
    assert f"version = {{{cited[1]}}}" in (root / "docs" / "citing.md").read_text()
