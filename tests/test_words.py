"""Texts and names use the words of the field, and not words that this project once made up."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Each word with what the field says instead.
BANNED = {
    "hiders?": "occluder",
    "mirror[_ -]points?": "specular point",
    "rungs?": "echo model or fidelity level",
    "dials?": "option of a model",
    "taken_in": "inline",
    "let_go": "release",
    "economi[sz]ed": "reduced",
    r"spool\w*": "memory-mapped buffer",
    "not_to_be_parted": "atomic",
    "in_reserve": "fallback",
    "heard": "received",
    "ladders?": "echo models or fidelity levels",
    "all_or_nothing": "atomic",
    "first_?come": "cache",
    "(?:ghost|wall)_echoes": "multipath",
    "path_account": "path summary",
    "(?:kept|swept)_anchors": "cache of keyframes",
    "give_back_memory": "release",
    "zone_shares": "Fresnel fractions",
    "text_book": "reference",
}
# Not yet clean in the whole project, so not yet banned: anchor (keyframe), share (fraction), told
# (given), way (candidate or direction), reach, turn, stands (is), piece (block), judge, crowd
# (group), moment (snapshot), ghost (multipath), survey (link budget), tones (direct sum), cure.
EXEMPT = {"CHANGELOG.md", "docs/glossary.md", "docs/style.md", "tests/test_words.py"}
KEPT = {'"dials"'}  # a key of summary.json, which readers of old runs rely on
PATTERN = re.compile(rf"(?<![A-Za-z])(?:{'|'.join(BANNED)})(?![A-Za-z])", re.IGNORECASE)


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
    for word in KEPT:
        text = text.replace(word, "")
    return [
        f"{number}: {line.strip()}"
        for number, line in enumerate(text.splitlines(), 1)
        if PATTERN.search(line)
    ]


def test_no_text_has_a_banned_word() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in texts()
        for line in found_in(path.read_text(encoding="utf-8"))
    ]
    assert not wrong, "words that the field does not use, see docs/style.md:\n" + "\n".join(wrong)


def test_all_kinds_of_texts_are_read() -> None:
    names = {path.relative_to(ROOT).as_posix() for path in texts()}
    assert {
        "README.md",
        "pyproject.toml",
        "docs/validation.md",
        "rtradar/radar/radar.py",
        "tests/conftest.py",
        "validation/closed_forms/sphere.py",
    } <= names
    assert not EXEMPT & names


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("every rung", True),
        ("MIRROR_POINT = 1", True),
        ("def _hiders(time):", True),
        ("self.spooled", True),
        ("what hides a part", False),
        ("wrung", False),
        ('summary["parameters"]["dials"]', False),
    ],
)
def test_a_banned_word_is_found(text: str, wrong: bool) -> None:
    assert bool(found_in(text)) == wrong
