"""Cards: well-formed, escaped, and short as texts."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import rtradar as rt
from rtradar.cards import html_card, quantity, text_card
from rtradar.clouds import Collection, Sample
from rtradar.clouds.sample_files import write_index, write_sample
from rtradar.scene import Furniture, material

ONE_LINE = "</td><script>alert(1)</script>&\"'"
HOSTILE = ONE_LINE + "\n\x00"


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


def _collection(folder: Path) -> Collection:
    for number, label in enumerate(("walk", "walk", HOSTILE)):
        provenance = {"subject": HOSTILE, "radar": "paper-12ghz", "snr_db": number}
        write_sample(folder, f"s{number}", Sample(np.zeros((2, 3)), label, provenance), np.zeros(3))
    write_index(folder, [f"s{number}" for number in range(3)])
    return Collection(folder)


def _things(folder: Path) -> dict[str, object]:
    wood = material("wood")
    chairs = [
        Furniture(name=f"<b>{number}", mesh="chair", material=wood, position_m=(2.0, number, 0))
        for number in range(30)
    ]
    motion = rt.synthetic_motion("walk", seed=0)
    antenna = rt.Antenna(pattern="cosine", exponent=4)
    return {
        "radar": rt.Radar(name="<b>", transmit_power_dbm=12, tx_antenna=antenna),
        "one channel": rt.Radar(name="x", tx_y=1, tx_z=0, rx_y=1, rx_z=0, multiplexing="ddm"),
        "motion": dataclasses.replace(motion, name=HOSTILE),
        "scene": rt.Scene(name=ONE_LINE, description=ONE_LINE, furniture=chairs),
        "room": rt.Scene.load("living-room"),
        "free space": rt.Scene(),
        "collection": _collection(folder),
    }


def test_things_have_short_texts_and_cards(tmp_path: Path) -> None:
    for name, thing in _things(tmp_path).items():
        lines = repr(thing).splitlines()
        assert 2 <= len(lines) <= 10, name
        assert max(map(len, lines)) <= 100, name
        root = ET.fromstring(thing._repr_html_())
        assert {element.tag for element in root.iter()}.isdisjoint({"script", "b/"}), name
        assert 3 <= len(list(root.iter("tr"))) <= 30, name  # one screenful
        for row in root.iter("tr"):
            assert row.findtext("td"), f"{name}: {row.findtext('th')} has no value"


def test_texts_have_figures_with_units(tmp_path: Path) -> None:
    things = {name: repr(thing) for name, thing in _things(tmp_path).items()}
    assert "9.593 m, resolution 3.747 cm" in things["radar"]
    assert "±7.138 m/s, resolution 0.107 m/s" in things["radar"]
    assert "12 Tx × 8 Rx = 96" in things["radar"]
    assert "angle     not measured" in things["one channel"]
    assert "361 at 120 Hz" in things["motion"]
    assert "height    1.7 m from the lowest to the highest joint" in things["motion"]
    assert "6.8 × 5 × 2.5 m" in things["room"]
    assert "walk (2)" in things["collection"]


def test_the_text_of_a_long_motion_is_quick() -> None:
    walk = rt.synthetic_motion("walk", seed=0)
    frames = 50_000
    long = dataclasses.replace(
        walk,
        root_positions=np.resize(walk.root_positions, (frames, 3)),
        rotations=np.broadcast_to(walk.rotations[0], (frames, *walk.rotations.shape[1:])),
    )
    assert "50,000 at" in repr(long)
    assert "positions" not in vars(long)  # a cached array of 50,000 poses
