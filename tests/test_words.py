"""Texts and names use the words of the field, and not words that this project once made up."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "glossary.md"


def banned() -> list[str]:
    """Words of the last column of the page's table; a hyphen may stand for a space."""
    table = PAGE.read_text(encoding="utf-8").partition("| word | meaning | not |\n")[2]
    lines = table.partition("\n\n")[0].splitlines()[1:]
    return [word for line in lines for word in line.rstrip(" |").rpartition("| ")[2].split(", ")]


EXEMPT = {"CHANGELOG.md", "docs/glossary.md", "tests/test_words.py"}
WORDS = "|".join(word.replace(" ", "[_ -]") for word in banned())
PATTERN = re.compile(rf"(?<![A-Za-z])(?:{WORDS})(?:s|es)?(?![A-Za-z])", re.IGNORECASE)


def texts() -> list[Path]:
    """Sources and pages of the project that must keep to the words."""
    folders = ("rtradar", "tests", "validation", "docs", "radars", "scenes")
    found = [path for folder in folders for path in (ROOT / folder).rglob("*")]
    pages = [*ROOT.glob("*.md"), *ROOT.glob("*.toml"), *found]
    kinds = {".py", ".md", ".rst", ".toml", ".sh"}
    named = {path.relative_to(ROOT).as_posix(): path for path in pages if path.suffix in kinds}
    return [path for name, path in sorted(named.items()) if name not in EXEMPT]


def found_in(text: str) -> list[str]:
    """Lines of a text that have a banned word, with their numbers."""
    return [
        f"{number}: {line.strip()}"
        for number, line in enumerate(text.splitlines(), 1)
        if PATTERN.search(line)
    ]


def test_no_text_has_a_banned_word() -> None:
    found = {path: found_in(path.read_text(encoding="utf-8")) for path in texts()}
    wrong = [f"{path.relative_to(ROOT)}:{line}" for path in found for line in found[path]]
    assert not wrong, "\n".join(
        ["words that the field does not use, see docs/glossary.md:", *wrong]
    )


def test_the_page_bans_words() -> None:
    assert {"mirror point", "glint", "rung", "zone_shares", "economized"} <= set(banned())


def test_all_kinds_of_texts_are_read() -> None:
    names = {path.relative_to(ROOT).as_posix() for path in texts()}
    assert {"README.md", "pyproject.toml", "docs/validation.md", "tests/conftest.py"} <= names
    assert {"rtradar/radar/radar.py", "validation/closed_forms/sphere.py"} <= names
    assert not EXEMPT & names


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("every rung", True),
        ("MIRROR_POINT = 1", True),
        ("def _hiders(time):", True),
        ("self.spooled", True),
        ("knobs of a model", True),
        ("what hides a part", False),
        ("wrung", False),
    ],
)
def test_a_banned_word_is_found(text: str, wrong: bool) -> None:
    assert bool(found_in(text)) == wrong
