"""The examples in docstrings of public names give what they say."""

from __future__ import annotations

import doctest
import inspect
import runpy
from collections.abc import Iterator
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

PAGES = runpy.run_path(str(Path(__file__).parents[1] / "docs" / "api_pages.py"))
MUST = {
    *("Motion", "Radar", "Result", "Scene", "process_samples", "run", "scattering_length"),
    "simulate",
}


def examples() -> Iterator[doctest.DocTest]:
    """Examples of public classes with their members, and of public functions, each once."""
    finder, seen = doctest.DocTestFinder(exclude_empty=True), set()
    for package in PAGES["PACKAGES"]:
        for name, thing in PAGES["public"](package).items():
            if id(thing) in seen or not (inspect.isclass(thing) or inspect.isroutine(thing)):
                continue
            seen.add(id(thing))
            # Without a module, or a class would be searched only where it is defined.
            yield from (test for test in finder.find(thing, name, module=False, globs={}))


FOUND = {test.name: test for test in examples() if test.examples}


def test_those_that_people_reach_for_have_examples() -> None:
    assert set(FOUND) >= MUST


@pytest.mark.parametrize("name", FOUND)
def test_it_gives_what_it_says(name: str) -> None:
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    try:
        failed, _ = runner.run(FOUND[name], out=said.append)
    finally:
        plt.close("all")
    assert not failed, "".join(said)
