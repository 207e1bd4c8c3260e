"""Cards: well-formed, escaped, and short as texts."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

import pytest

from rtradar.cards import html_card, quantity, text_card

HOSTILE = "</td><script>alert(1)</script>&\"'\n\x00"


def test_a_card_is_well_formed_and_escapes_what_it_is_given() -> None:
    tables = {HOSTILE: {HOSTILE: HOSTILE}, "": {"a": "b"}}
    page = html_card("Radar", HOSTILE, tables, picture=b"png", note=HOSTILE)
    root = ET.fromstring(page)
    assert root.get("class") == "rtradar-card"
    assert {element.tag for element in root.iter()}.isdisjoint({"script", "link", "object"})
    (cell,) = [cell for cell in root.iter("td") if cell.text != "b"]
    assert cell.text == HOSTILE.replace("\n", "?").replace("\x00", "?")
    assert len(list(root.iter("caption"))) == 1  # an empty heading has none
    (picture,) = root.iter("img")
    assert picture.get("src") == "data:image/png;base64,cG5n"
    assert not re.search(r"https?:|url\(|@import", page)


def test_a_card_follows_the_theme_of_notebook_and_system() -> None:
    page = html_card("Radar", "x", {})
    assert "prefers-color-scheme: dark" in page
    assert "--jp-content-font-color1" in page


def test_a_text_has_ten_lines_and_100_columns_at_most() -> None:
    rows = {f"label {number}": 300 * "x" for number in range(20)}
    lines = text_card("Radar", "one\ntwo", rows).splitlines()
    assert len(lines) == 10
    assert lines[0] == "Radar one?two"
    assert lines[-1] == "  ..."
    assert {len(line) for line in lines[1:-1]} == {100}
    assert text_card("Scene", "s", {"a": "1", "long": "2"}) == "Scene s\n  a     1\n  long  2"


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (62.5e-6, "s", "62.5 µs"),
        (4e9, "Hz", "4 GHz"),
        (0.0, "s", "0 s"),
        (9.999e11, "Hz", "999.9 GHz"),
        (-0.012, "m", "-12 mm"),
        (1e-15, "s", "0.001 ps"),
        (999.99e-6, "s", "1 ms"),
    ],
)
def test_quantities_have_prefixes(value: float, unit: str, text: str) -> None:
    assert quantity(value, unit) == text
