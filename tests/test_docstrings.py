"""Everything public says what it takes, of what shape and unit, and what it returns; and the pages of it can be built."""

from __future__ import annotations

import inspect
import re
import runpy
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
LOADED = re.compile(
    r'src="((?:https?:)?//[^"]*)|<link(?=[^>]*stylesheet)[^>]*href="((?:https?:)?//[^"]*)'
)
PAGES = runpy.run_path(str(ROOT / "docs" / "api_pages.py"))


def public() -> Iterator[tuple[str, Any]]:
    """Public classes and functions, and the public members of those classes, by their names."""
    for package in PAGES["PACKAGES"]:
        for name, thing in PAGES["public"](package).items():
            if inspect.isclass(thing) or inspect.isroutine(thing):
                yield f"{package}.{name}", thing
            for member, value in members(thing).items() if inspect.isclass(thing) else ():
                if not member.startswith("_") and (callable(value) or hasattr(value, "__get__")):
                    yield (
                        f"{package}.{name}.{member}",
                        inspect.unwrap(getattr(value, "__func__", value)),
                    )


def members(thing: type) -> dict[str, Any]:
    """Of a class, those that it has from others of the package among them."""
    owners = [owner for owner in reversed(thing.__mro__) if owner.__module__.startswith("rtradar")]
    return {name: value for owner in owners for name, value in vars(owner).items()}


THINGS = dict(public())


def section(text: str, title: str) -> str:
    """The lines under a numpydoc title."""
    found = re.search(rf"^{title}\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", text, re.MULTILINE | re.DOTALL)
    return found.group(1) if found else ""


def told(text: str, title: str) -> set[str]:
    """Names that a section tells of."""
    lines = [
        line for line in section(text, title).splitlines() if line and not line.startswith(" ")
    ]
    return {name.strip().lstrip("*") for line in lines for name in line.split(" : ")[0].split(",")}


def takes(thing: Any) -> set[str]:
    """Names of what a function takes, or a class that is not told what by its kind: protocols, exceptions, tuples."""
    if isinstance(thing, type) and (
        getattr(thing, "_is_protocol", False) or issubclass(thing, Exception | tuple)
    ):
        return set()
    return set(inspect.signature(thing).parameters) - {"self", "cls"} if callable(thing) else set()


def test_there_is_something_to_look_at() -> None:
    assert len(THINGS) > 150
    assert {
        "rtradar.run",
        "rtradar.Radar.load",
        "rtradar.Radar.window_starts",
        "rtradar.process.os_cfar",
    } <= set(THINGS)


@pytest.mark.parametrize("name", THINGS)
def test_it_has_a_docstring_that_says_all(name: str) -> None:
    thing = THINGS[name]
    text = inspect.getdoc(thing) or ""
    assert text.strip(), "no docstring"
    names = takes(thing)
    assert names <= told(text, "Parameters"), f"not told of: {names - told(text, 'Parameters')}"
    if inspect.isfunction(thing) and names and thing.__annotations__.get("return") != "None":
        assert (section(text, "Returns") + section(text, "Yields")).strip(), (
            "it does not say what it returns"
        )


def test_a_gap_is_found() -> None:
    text = inspect.getdoc(THINGS["rtradar.run"]) or ""
    assert takes(THINGS["rtradar.run"]) == told(text, "Parameters")
    assert "pfa" not in told(text.replace("pfa : float", "false alarms : float"), "Parameters")
    assert not section(text.replace("Returns\n---", "Gives\n---"), "Returns").strip()


@pytest.mark.slow
@pytest.mark.skipif(
    find_spec("sphinx_gallery") is None, reason="pages are built by what the extra docs brings"
)
def test_the_pages_can_be_built(tmp_path: Path) -> None:
    """All but the gallery's pictures, which `test_gallery` asks for; a warning is an error."""
    words = [
        "-q",
        "--fail-on-warning",
        "--keep-going",
        "-D",
        "sphinx_gallery_conf.filename_pattern=^$",
    ]
    command = [
        sys.executable,
        "-m",
        "sphinx",
        *words,
        "--doctree-dir",
        tmp_path / "trees",
        ROOT / "docs",
        tmp_path / "pages",
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "pages" / "theory.html").read_text(encoding="utf-8")
    assert page.count("<math") > 100
    outside = [
        found
        for path in (tmp_path / "pages").rglob("*.html")
        for found in LOADED.findall(path.read_text(encoding="utf-8"))
    ] + [
        found
        for path in (tmp_path / "pages").rglob("*.css")
        for found in re.findall(r"(?:@import|url\()\W*(?:https?:)?//[^)]*", path.read_text())
    ]
    assert outside == []  # the pages open without the internet
    assert (tmp_path / "pages" / "searchindex.js").is_file()
