"""Tables of the pages that follow from the code are complete, and the others have its keys."""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
from pathlib import Path

import pytest

import rtradar as rt
from rtradar.campaign.spec_file import read_spec
from rtradar.errors import InputError
from rtradar.scatter import MODELS
from rtradar.scatter.echo_models import models_that

pytest.importorskip("docutils", reason="pages are built by what the extra docs brings")

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "docs"))
import code_tables  # noqa: E402
import level_tables  # noqa: E402

sys.path.remove(str(ROOT / "docs"))
TABLES = code_tables.TABLES
SURFACE = 'material = "wood"\nthickness_m = 0.1\n'
ROOM = f"[room]\nsize_m = [4, 4, 3]\ncorner_m = [0, 0]\n[room.walls]\n{SURFACE}"
TABLES_OF_A_SCENE = "[radar] [person] [room] [[walls]] [[furniture]] [[objects]] [[people]]"
SCENE = {table: f"{table}\n" for table in TABLES_OF_A_SCENE.split()}
SCENE |= {"a side of a room": ROOM, "[materials.NAME]": "[materials.mine]\n"}
DATA_SET = {
    **{table: f"{table}\n" for table in ("[windows]", "[each]", "[[recordings]]")},
    "[others]": "[others]\ncount = 1\n",
    "[[synthetic]]": "[windows]\nduration_s = 1\n[[synthetic]]\n",
}


def page(name: str) -> str:
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


def first_column(table: str) -> list[str]:
    cells = (line.split("|")[1] for line in table.splitlines()[2:])
    return [name for cell in cells for name in re.findall(r"`([^`]+)`", cell)]


def test_every_table_is_on_a_page_and_no_page_asks_for_another() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md"))
    assert sorted(re.findall(r"\{from-code\} (\S+)", text)) == sorted(TABLES | level_tables.TABLES)


def test_names_that_sentences_ask_for_are_there() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md"))
    asked = re.findall(r"\{names\}`([^`]*)`", text)
    assert asked
    assert all(map(level_tables.names, asked))
    assert level_tables.names("levels: not traces") == ["analytic-paper", "analytic"]
    for wrong in ("levels: flies", "levels", "radars"):
        with pytest.raises(ValueError, match="there are no such names"):
            level_tables.names(wrong)


def test_tables_of_levels_have_every_level_and_option() -> None:
    for name, table in level_tables.TABLES.items():
        if name != "level-options":
            assert first_column(table()) == list(MODELS.built_in), name
    options = [
        (level, name)
        for level in MODELS.built_in
        for name in inspect.signature(MODELS[level]).parameters
        if name not in level_tables.GIVEN
    ]
    shown = re.findall(r"^\| `([^`]+)` \| `([^`]+)` \|", level_tables.options(), re.M)
    assert sorted(shown) == sorted(options)


@pytest.mark.parametrize("level", MODELS.built_in)
def test_a_level_says_what_it_computes_and_what_occludes(level: str) -> None:
    said = level_tables.said(level)
    assert len(said.computes) > 20
    assert (inspect.getdoc(MODELS[level]) or "").startswith(f"`{level}`: ")
    assert (said.occlusion != "none") == (level in models_that("traces"))
    assert said.asked.endswith(".")


def test_tables_from_the_code_are_complete() -> None:
    for name, kind in (("radar-keys", rt.Radar), ("antenna-keys", rt.Antenna)):
        keys = [field.name for field in dataclasses.fields(kind)]
        assert sorted(first_column(TABLES[name]())) == sorted(keys)
    meshes = sorted(path.stem for path in (ROOT / "meshes").glob("*.ply"))
    assert first_column(TABLES["meshes"]()) == meshes
    assert {"concrete", "skin", "perfect-conductor"} <= set(first_column(TABLES["materials"]()))
    assert "| `paper-12ghz` |" in TABLES["radar-limits"]()


def allowed(read, text: str, path: Path) -> set[str]:
    """Keys of the last table of a file, as the message about an unknown one lists them."""
    path.write_text(f"{text}no_such_key = 1\n")
    with pytest.raises(InputError, match="unknown key 'no_such_key'; allowed: ") as caught:
        read(path)
    line = next(line for line in str(caught.value).splitlines() if "no_such_key" in line)
    return set(line.rpartition("allowed: ")[2].split(", "))


def rows(name: str) -> dict[str, set[str]]:
    """Keys by table, of the page's table of keys."""
    found: dict[str, set[str]] = {}
    table = ""
    text = TABLES["scene-keys" if name == "scenes.md" else "data-set-keys"]()
    for line in text.splitlines()[2:]:
        cells = line.split(" | ")
        table = cells[0].strip("| `") or table
        found.setdefault(table.replace("`", ""), set()).update(re.findall(r"`([^`]+)`", cells[1]))
    return found


@pytest.mark.parametrize("table", SCENE)
def test_every_key_of_a_scene_file_is_on_its_page(table: str, tmp_path: Path) -> None:
    sides = {"walls", "near", "far", "left", "right", "floor", "ceiling"}  # tables of their own
    keys = allowed(rt.Scene.load, SCENE[table], tmp_path / "scene.toml")
    assert rows("scenes.md")[table] == keys - (sides if table == "[room]" else set())


@pytest.mark.parametrize("table", DATA_SET)
def test_every_key_of_a_data_set_is_on_its_page(table: str, tmp_path: Path) -> None:
    keys = allowed(read_spec, DATA_SET[table], tmp_path / "data.toml")
    assert rows("data-sets.md")[table] == keys


def test_every_key_at_the_top_is_on_its_page(tmp_path: Path) -> None:
    for name, read in (("scenes.md", rt.Scene.load), ("data-sets.md", read_spec)):
        keys = allowed(read, "", tmp_path / "top.toml")
        tables = {re.split(r"[.\]]", table.strip("["))[0] for table in rows(name)}
        assert rows(name)["top"] <= keys <= rows(name)["top"] | tables, name


def test_every_name_that_is_drawn_is_on_its_page(tmp_path: Path) -> None:
    keys = allowed(read_spec, "[drawn]\n", tmp_path / "data.toml")
    assert set(first_column(TABLES["drawn"]())) == keys


def without_code(text: str) -> str:
    """Text of a page without its blocks of code, in which a percent sign is one."""
    return re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)


def test_no_line_of_a_page_is_taken_for_a_comment() -> None:
    """A line that begins with a percent sign is a comment of MyST, so its sentence is lost."""
    lost = [
        f"{path.name}: {line}"
        for path in (ROOT / "docs").glob("*.md")
        for line in without_code(path.read_text(encoding="utf-8")).splitlines()
        if line.lstrip().startswith("%")
    ]
    assert lost == []
