"""Public things document their parameters, shapes, units and results, and their pages build."""

from __future__ import annotations

import inspect
import re
import runpy
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest

import rtradar as rt

ROOT = Path(__file__).parents[1]
LOADED = {
    "html": r'src="((?:https?:)?//[^"]*)|<link(?=[^>]*stylesheet)[^>]*href="((?:https?:)?//[^"]*)',
    "css": r"(?:@import|url\()\W*(?:https?:)?//[^)]*",
}
"""What a page or a style sheet loads from elsewhere."""
KNOWN_FILLERS = {"rtradar.compare: motion", "rtradar.compare: radar"}
"""Parameters whose text is a filler all the same."""
PAGES = runpy.run_path(str(ROOT / "docs" / "api_pages.py"))


def public() -> Iterator[tuple[str, Any]]:
    """Public classes and functions, and the public members of those classes, by their names."""
    for package in PAGES["PACKAGES"]:
        for name, thing in PAGES["public"](package).items():
            if inspect.isclass(thing) or inspect.isroutine(thing):
                yield f"{package}.{name}", thing
            for member, value in members(thing).items() if inspect.isclass(thing) else ():
                if not member.startswith("_") and (callable(value) or hasattr(value, "__get__")):
                    own = inspect.unwrap(getattr(value, "__func__", value))
                    yield f"{package}.{name}.{member}", own


def members(thing: type) -> dict[str, Any]:
    """Public members of a class, with those inherited from classes of the package."""
    owners = [owner for owner in reversed(thing.__mro__) if owner.__module__.startswith("rtradar")]
    return {name: value for owner in owners for name, value in vars(owner).items()}


THINGS = dict(public())


def test_every_public_constant_has_a_text_on_its_page() -> None:
    for package in PAGES["PACKAGES"]:
        for name, thing in PAGES["public"](package).items():
            if not (inspect.isclass(thing) or inspect.isroutine(thing)):
                assert PAGES["text_of"](package, name), f"{package}.{name}"


def section(text: str, title: str) -> str:
    """Lines below a title of numpydoc."""
    found = re.search(rf"^{title}\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", text, re.MULTILINE | re.DOTALL)
    return found.group(1) if found else ""


def named(text: str, title: str) -> set[str]:
    """Names that a section documents."""
    lines = [line for line in section(text, title).splitlines() if re.match(r"\S", line)]
    return {name.strip().lstrip("*") for line in lines for name in line.split(" : ")[0].split(",")}


def fillers(text: str) -> set[str]:
    """Names of parameters whose text says nothing: none, a unit, the name, or half a phrase."""
    found = set()
    entries = re.split(r"^(?=\S)", section(text, "Parameters"), flags=re.MULTILINE)
    for entry in filter(str.strip, entries):
        first, *rest = entry.strip().splitlines()
        meaning = re.sub(r"\[[^]]*\]", "", " ".join(rest)).strip(" .,;")
        for name in (part.strip().lstrip("*") for part in first.split(" : ")[0].split(",")):
            said = re.sub(r"\W|_|^(the|a|an) ", "", meaning.lower())
            again = said == name.replace("_", "").lower()
            if not meaning or again or re.match(r"(Of|As|By|In)\b", meaning):
                found.add(name)
    return found


def own_fillers() -> set[str]:
    """Fillers of everything public, as ``name: parameter``; inherited ones count once."""
    found, seen = set(), set()
    for name, thing in THINGS.items():
        owner, _, member = name.rpartition(".")
        inherited = inspect.isclass(THINGS.get(owner)) and member not in vars(THINGS[owner])
        if not inherited and id(thing) not in seen:
            seen.add(id(thing))
            found |= {f"{name}: {parameter}" for parameter in fillers(inspect.getdoc(thing) or "")}
    return found


def options_of(thing: Any) -> set[str]:
    """Names of options that a function takes by ``**options: Unpack[...]``."""
    if not inspect.isfunction(thing) or "Unpack" not in str(thing.__annotations__.get("options")):
        return set()
    # The other annotations may name types that are only imported for checkers of types.
    (options,) = get_args(eval(thing.__annotations__["options"], thing.__globals__))
    return set(get_type_hints(options))


def takes(thing: Any) -> set[str]:
    """Public parameters of a function or class; none for protocols, exceptions and tuples."""
    if isinstance(thing, type) and (
        getattr(thing, "_is_protocol", False) or issubclass(thing, Exception | tuple)
    ):
        return set()
    names = inspect.signature(thing).parameters if callable(thing) else ()
    return {name for name in names if not name.startswith("_")} - {"self", "cls"}


def test_there_is_something_to_look_at() -> None:
    assert len(THINGS) > 150
    members = {"rtradar.Radar.load", "rtradar.Radar.window_starts"}
    assert members | {"rtradar.run", "rtradar.process.os_cfar"} <= set(THINGS)


@pytest.mark.parametrize("name", THINGS)
def test_it_has_a_docstring_that_says_all(name: str) -> None:
    thing = THINGS[name]
    text = inspect.getdoc(thing) or ""
    assert text.strip(), "no docstring"
    titles = re.findall(r"^(\w[\w ]*)\n-{3,}$", text, re.MULTILINE)
    assert len(titles) == len(set(titles)), "a section appears twice"
    names = takes(thing)
    assert names - named(text, "Parameters") == set(), "not documented"
    if options := options_of(thing):
        documented = named(inspect.getdoc(rt.RunSettings) or "", "Parameters")
        assert options == documented if name == "rtradar.run" else options <= documented
    if inspect.isfunction(thing) and names and thing.__annotations__.get("return") != "None":
        told = section(text, "Returns") + section(text, "Yields")
        assert told.strip(), "it does not say what it returns"


def test_a_gap_is_found() -> None:
    text = inspect.getdoc(THINGS["rtradar.run"]) or ""
    assert takes(THINGS["rtradar.run"]) == named(text, "Parameters")
    assert "pfa" in options_of(THINGS["rtradar.run"])
    assert "motion" not in named(text.replace("motion : Motion", "film : Motion"), "Parameters")
    assert not section(text.replace("Returns\n---", "Gives\n---"), "Returns").strip()


def test_texts_of_parameters_are_no_fillers() -> None:
    new = sorted(own_fillers() - KNOWN_FILLERS)
    assert not new, f"say what it means, in words that do not begin with Of, As, By or In: {new}"


def test_a_filler_is_found() -> None:
    texts = {
        "time": "Of the motion.",
        "power_w": "[W]",
        "radar": "The radar.",
        "pose": "As in `run`.",
        "seed": "",
        "range_m": "Distance from the radar [m].",
        "index": "Index of the frame; in Hz.",
    }
    text = "Title.\n\nParameters\n----------\n" + "".join(
        f"{name} : int\n    {meaning}\n" for name, meaning in texts.items()
    )
    assert fillers(text) == {"time", "power_w", "radar", "pose", "seed"}


@pytest.mark.slow
@pytest.mark.skipif(
    find_spec("sphinx_gallery") is None, reason="pages are built by what the extra docs brings"
)
def test_the_pages_can_be_built(tmp_path: Path) -> None:
    """All pages without what the gallery and the notebook draw; a warning is an error.

    `test_gallery` and `test_notebook` run those.
    """
    words = ["-q", "--fail-on-warning", "--keep-going", "-D", "nb_execution_mode=off"]
    words += ["-D", "sphinx_gallery_conf.filename_pattern=^$", "--doctree-dir", tmp_path / "trees"]
    command = [sys.executable, "-m", "sphinx", *words, ROOT / "docs", tmp_path / "pages"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "pages" / "theory.html").read_text(encoding="utf-8")
    assert page.count("<math") > 100
    assert re.search(
        r"<mi>h</mi>\s*<mspace[^>]*></mspace>\s*<mi>cos</mi>\s*<mo>[^<]*</mo>\s*<mspace", page
    )
    assert '<mo stretchy="false">|' not in page  # bars have no space within
    outside = [
        found
        for ending, expression in LOADED.items()
        for path in (tmp_path / "pages").rglob(f"*.{ending}")
        for found in re.findall(expression, path.read_text(encoding="utf-8"))
    ]
    assert outside == []  # the pages open without the internet
    assert (tmp_path / "pages" / "searchindex.js").is_file()
