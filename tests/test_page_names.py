"""What pages name exists, and the checks of that find what does not."""

from __future__ import annotations

import runpy
from collections.abc import Callable
from pathlib import Path

import pytest

CHECKER = runpy.run_path(str(Path(__file__).parents[1] / "docs" / "check_pages.py"))
PAGES: dict[str, str] = CHECKER["PAGES"]
CHECKS: dict[str, Callable[[str], list[str]]] = CHECKER["CHECKS"]
wrong_links, wrong_tables = CHECKER["wrong_links"], CHECKER["wrong_tables"]


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.parametrize("check", CHECKS)
def test_what_a_page_names_exists(check: str, page: str) -> None:
    assert CHECKS[check](PAGES[page]) == []


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_files(page: str) -> None:
    assert wrong_links(page, PAGES[page]) == []


@pytest.mark.parametrize("page", [page for page, text in PAGES.items() if "```toml" in text])
def test_tables_of_a_page_are_read(page: str, tmp_path: Path) -> None:
    assert wrong_tables(PAGES[page], tmp_path) == []


WRONG: dict[str, dict[str, str]] = {
    "commands": {
        "    rtradar run synthetic:walk --fidelity speculum --out out/walk": "--fidelity speculum",
        "    rtradar compare walk.bvh --fidelities analytic,speculum --out out/both": "speculum",
        "    rtradar run walk.bvh --scene \\\n        living-rooms --out out/a": "living-rooms",
        "    rtradar run walk.bvh --radar paper-13ghz --out out/walk": "--radar paper-13ghz",
        "    rtradar run walk.bvh --detector cfar --out out/walk": "--detector cfar",
        "    rtradar run walk.bvh --clutter-removal median --out out/walk": "median",
        "    rtradar train clouds --recipe leaner --out out/lean": "--recipe leaner",
        "    rtradar run walk.bvh --fast --out out/walk": "rtradar run has no option --fast",
        "`rtradar simulate`": "rtradar simulate: no such command",
        "`rtradar dataset make`": "rtradar dataset make: no such command",
        "    .venv/bin/python validation/other_methods/speculum.py --quick": "no such script",
        "`python validation/closed_forms/sphere.py --slow`": "has no option --slow",
        "`people.py OUT --measure-all`": "has no option --measure-all",
    },
    "options": {
        "With `--fast` it is fast.": "no command has such an option",
        "With `--fidelity speculum` it is fast.": "no such name",
    },
    "names": {
        "The walk by `speculum` is fast.": "'speculum'",
        '`fidelity="speculum"`': "'speculum'",
        "| level | cost |\n|---|---|\n| `speculum` | 1 |\n": "'speculum' does not exist",
        '```python\nrt.Radar.preset("paper-13ghz")\n```': "radar 'paper-13ghz'",
        '```python\nrt.Scene.load("living-rooms")\n```': "scene 'living-rooms'",
        "`synthetic:fly` flies.": "activity 'fly'",
        '```toml\n[[furniture]]\nmaterial = "butter"\nmesh = "piano"\n```': "material 'butter'",
    },
    "words": {
        "The level `speculum` is fast.": "`speculum` is unknown",
        "The key `leak_age_dbm` is the leakage.": "`leak_age_dbm` is unknown",
        "The table `[receivers_of]` has it.": "`[receivers_of]` is unknown",
        '`keeping_of = ["spectrograms"]`': "is unknown",
    },
    "files": {
        "See `rtradar/scatter/levels.py`.": "rtradar/scatter/levels.py: no such file",
        "See `docs/levels/`.": "docs/levels/: no such file",
        "See `speculum.py`.": "speculum.py: no such file",
        "`MODELS` of `rtradar/scatter/validity.py`": "does not hold MODELS",
    },
    "python": {
        "`rt.Radars` has them.": "rt.Radars does not exist",
        "`rtradar.scatter.levels` has them.": "rtradar.scatter.levels does not exist",
        "```python\nfrom rtradar.process import cfar_of\n```": "rtradar.process.cfar_of does not",
        '`rt.run(motion, radar, fidelities="specular")`': "rt.run does not take fidelities",
        "    rt.synthetic_motion('walk', seeds=1)": "does not take seeds",
    },
}
"""Texts that each check must refuse, and what it must say of them."""


@pytest.mark.parametrize(
    ("check", "text", "why"),
    [(check, text, why) for check, texts in WRONG.items() for text, why in texts.items()],
)
def test_a_wrong_name_is_found(check: str, text: str, why: str) -> None:
    assert why in " ".join(CHECKS[check](f"A page.\n\n{text}\n"))


def test_a_wrong_link_is_found() -> None:
    assert wrong_links("docs/start.md", "[levels](levels.md#all) and [radars](radar.md)") == [
        "(levels.md): no such file"
    ]


@pytest.mark.parametrize(
    ("content", "key"),
    [
        ("gain_of_all = 3", "gain_of_all"),
        ("[receiver]\nleakage = -45", "leakage"),
        ("[rx_antenna]\nwidth_deg = 45", "width_deg"),
        ("[[walls]]\nhigh_m = 3", "high_m"),
        ("[room]\ntall_m = 3", "tall_m"),
        ("[each]\nlevel = ['specular']", "level"),
        ("[windows]\nlength_s = 1", "length_s"),
    ],
)
def test_a_wrong_key_is_found(content: str, key: str, tmp_path: Path) -> None:
    (said,) = wrong_tables(f"```toml\n{content}\n```\n", tmp_path)
    assert key in said


def test_pages_name_much() -> None:
    """The checks find what there is to check, and do not pass for want of it."""
    everything = "\n\n".join(PAGES.values())
    assert len(list(CHECKER["command_lines"](everything))) > 80
    assert len(CHECKER["inline"](everything)) > 1500
    assert sum(language == "toml" for language, _ in CHECKER["blocks"](everything)) > 8
    assert len(CHECKER["parsers"]()) > 20
