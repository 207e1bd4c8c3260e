"""Pages repeat figures and lists of each other and of the code; they are the same everywhere."""

from __future__ import annotations

import ast
import re
from argparse import ArgumentParser
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

import rtradar as rt
from rtradar.classify.recipes import RECIPES
from rtradar.classify.splits import SCHEMES
from rtradar.cli.parser import parser
from rtradar.cli.showing import KINDS as LISTED
from rtradar.clouds.sample_files import KINDS
from rtradar.scatter import MODELS
from rtradar.scatter.echo_models import models_that
from rtradar.scene.moving import _KINDS as MOTIONS
from rtradar.settings import RunSettings
from rtradar.system.registries import BOARDS, DETECTORS, READERS, scene_files
from rtradar.validate import claims

ROOT = Path(__file__).parents[1]
MULTIPLEXING = get_args(get_type_hints(rt.Radar)["multiplexing"])


def rows(page: str, heading: str) -> list[list[str]]:
    """Cells of the table that has this heading; empty cells at its end are left out."""
    lines = iter((ROOT / page).read_text(encoding="utf-8").splitlines())
    found = []
    for line in lines:
        if line.startswith(heading):
            next(lines)
            for row in lines:
                if not row.startswith("|"):
                    break
                found.append([cell.strip() for cell in row.strip().strip("|").split(" | ")])
    assert found, f"{page} has no table {heading}"
    return found


CLAIMS = rows("README.md", "| claim | worst")


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim[0])
def test_claims_of_the_readme_are_those_of_the_validation(claim: list[str]) -> None:
    figures = [row[2:4] + row[5:] for row in rows("docs/validation.md", "| key | claim")]
    assert claim[1:] in figures


def test_defaults_of_the_page_for_beginners_are_those_of_the_settings() -> None:
    compared = 0
    for options, _, shown in rows("docs/start.md", "| option | meaning | default"):
        for name, flag in flags().items():
            default, text = getattr(RunSettings(), name), shown.strip("`")
            if not re.search(rf"`{flag}[ `]", options) or name in ("start_s", "duration_s"):
                continue
            compared += 1
            if isinstance(default, bool):
                assert text == ("on" if default else "off"), flag
            elif default is None:
                assert not text, flag
            else:
                assert type(default)(text) == default, flag
    assert compared > 10


# -- lists that name all of a kind -----------------------------------------------------------------


def options_of_run() -> ArgumentParser:
    """Parser of ``rtradar run``, with its options."""
    (commands,) = (action for action in parser()._actions if action.dest == "==SUPPRESS==")
    run: ArgumentParser = commands.choices["run"]  # type: ignore[index]
    run.format_help()
    return run


def limit_names() -> set[str]:
    """Names that the code gives to limits of a run."""
    sources = [
        path.read_text(encoding="utf-8")
        for folder in ("scatter", "pipeline")
        for path in (ROOT / "rtradar" / folder).rglob("*.py")
    ]
    given = r'Limit\(\s*"(\w+)"|\("(inside_\w+)"|"name": "(\w+)",\s*"share"'
    found = set(re.findall(given, "".join(sources)))
    budget = (ROOT / "rtradar/scatter/link_budget.py").read_text(encoding="utf-8")
    concerned = re.search(r"concerned = dict\.fromkeys\((\(.*?\)), 0\.0\)", budget, re.S)
    assert concerned
    return {name for names in found for name in names if name} | {*ast.literal_eval(concerned[1])}


def flags() -> dict[str, str]:
    """Option of each setting of a run."""
    actions = options_of_run()._option_string_actions.items()
    return {
        action.dest.removeprefix("settings."): flag
        for flag, action in actions
        if re.fullmatch(r"settings\.\w+", action.dest) and not flag.startswith("--no-")
    }


def choices(option: str) -> tuple[str, ...]:
    return tuple(options_of_run()._option_string_actions[option].choices or ())


TABLES: dict[tuple[str, str], Callable[[], Iterable[str]]] = {
    ("README.md", "| level | what it"): lambda: MODELS.built_in,
    ("docs/choosing-a-level.md", "| level | 12 GHz: complex error"): lambda: MODELS.built_in,
    ("docs/limits.md", "| name in `limits`"): limit_names,
    ("docs/radar.md", "| `pattern` |"): lambda: get_args(get_type_hints(rt.Antenna)["pattern"]),
    ("docs/radar.md", "| `multiplexing` |"): lambda: MULTIPLEXING,
    ("docs/scenes.md", "| kind | keys"): lambda: MOTIONS,
    ("docs/scenes.md", "| name | what is taken out"): lambda: choices("--clutter-removal"),
    ("docs/start.md", "| file | what is needed"): lambda: [f".{one}" for one in READERS.built_in],
    ("docs/classification.md", "| `--split` |"): lambda: SCHEMES,
    ("docs/data-sets.md", "| kind | shape"): lambda: KINDS,
    ("docs/data-sets.md", "| file in `validation/`"): lambda: (
        {path.name for path in (ROOT / "validation").glob("*.toml")} - {"few_channels.toml"}
    ),  # a radar
}
"""Tables whose first column has all of a kind, and the names of that kind."""

SENTENCES: dict[tuple[str, str], Callable[[], Iterable[str]]] = {
    ("README.md", r"`--scene` takes a name \((.*?)\)"): lambda: {*scene_files()} - {"free-space"},
    ("ARCHITECTURE.md", r"For ([^.]*?)\s+one kernel\s+does so for all paths"): lambda: models_that(
        "fast_over_walls"
    ),
    ("docs/radar.md", r"\n(`iwr1443`.*?)\s+are\s+evaluation boards"): lambda: BOARDS,
    ("docs/start.md", r"`rtradar list` shows[^:]*:\s(.*?)\."): lambda: LISTED,
    ("docs/start.md", r"`--detector NAME` \|(.*?) \[the chain"): lambda: DETECTORS.built_in,
    ("docs/start.md", r"`--variant NAME` \|(.*?);"): lambda: choices("--variant"),
    ("docs/start.md", r"`--body-material NAME` \|(.*?) \|"): lambda: choices("--body-material"),
    ("docs/start.md", r"`--clutter-removal NAME` \|(.*?);"): lambda: choices("--clutter-removal"),
}
"""Sentences that list all of a kind, and the names of that kind."""


def in_backticks(text: str) -> set[str]:
    """Names in backticks, of which those that are options of another one are left out."""
    return {name for name in re.findall(r"`\"?([^`\"]+)\"?`", text) if "=" not in name}


def in_sentence(text: str, expression: str) -> set[str]:
    found = re.search(expression, text, re.S)
    assert found, f"there is no sentence {expression}"
    return in_backticks(found[1])


@pytest.mark.parametrize(("page", "heading"), TABLES)
def test_a_table_is_whole(page: str, heading: str) -> None:
    first = " ".join(row[0] for row in rows(page, heading))
    assert in_backticks(first) == set(TABLES[page, heading]())


@pytest.mark.parametrize(("page", "expression"), SENTENCES)
def test_a_sentence_is_whole(page: str, expression: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert in_sentence(text, expression) == set(SENTENCES[page, expression]())


def test_a_list_that_is_not_whole_is_found() -> None:
    page, expression = "docs/radar.md", r"\n(`iwr1443`.*?)\s+are\s+evaluation boards"
    text = (ROOT / page).read_text(encoding="utf-8")
    assert set(BOARDS) - in_sentence(text.replace("`awr1843`, ", ""), expression) == {"awr1843"}
    assert in_backticks("| `turning` | `spinning`, `loud=True` |") == {"turning", "spinning"}
    with pytest.raises(AssertionError, match="there is no sentence"):
        in_sentence("Nothing.", expression)
    with pytest.raises(AssertionError, match="has no table"):
        rows(page, "| nothing")


def test_every_option_of_a_run_is_on_the_page_for_beginners() -> None:
    text = (ROOT / "docs/start.md").read_text(encoding="utf-8")
    cells = [line.split(" | ")[0] for line in text.splitlines() if line.startswith("| `--")]
    shown = set(re.findall(r"`(--[\w-]+)", " ".join(cells)))
    taken = {name for name in options_of_run()._option_string_actions if name.startswith("--")}
    # It is needed, and each example has it; recordings of Acclaim have it on their own line.
    assert shown == taken - {"--help", "--out", "--skeleton"}


def test_every_recipe_is_on_its_page() -> None:
    text = (ROOT / "docs/classification.md").read_text(encoding="utf-8")
    assert set(re.findall(r"--recipe (\w+)", text)) == set(RECIPES)


def test_words_of_the_levels_in_the_readme_are_their_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("docutils", reason="pages are built by what the extra docs brings")
    monkeypatch.syspath_prepend(ROOT / "docs")
    write = import_module("level_tables").readme
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert write(text) == text, "write them anew: python docs/level_tables.py"
    assert "with bounces" in text
    assert write(text.replace("with bounces", "with jumps")) == text


def test_a_receiver_of_which_nothing_is_said_is_ideal() -> None:
    """As the page of limits says."""
    values = {name: getattr(rt.Receiver(), name) for name in rt.Receiver.__dataclass_fields__}
    assert not any(values.values()), values


# Keys of claims whose rows came after the table of the page was made, which takes hours.
NOT_YET_IN_THE_TABLE = {
    *("double-reflections", "full-wave", "joints", "levels-against-full-wave", "levels_in_rooms"),
    "shadow",
    # These report, and judge nothing.
    *("cloud_sampling", "interpolation", "measured_radar", "measured_rcs", "radhar_activities"),
    *("receiver-cost", "spatial_cloud", "threads"),
}


def keys_not_on(text: str) -> set[str]:
    """Keys of claims that a page does not name, nor their script."""
    named = set(re.findall(r"`([^`\s]+)`", text))
    every = {key: claim.script.name for claim in claims(ROOT / "validation") for key in claim.keys}
    return {key for key, script in every.items() if not named & {key, script}}


def test_the_readme_has_the_number_of_figures_of_the_table() -> None:
    page = (ROOT / "docs/validation.md").read_text(encoding="utf-8")
    kept, judged = re.findall(r"^(\d+) of (\d+) judged figures", page, re.MULTILINE)[0]
    assert f"all {judged} judged figures were within" in (ROOT / "README.md").read_text("utf-8")
    assert kept == judged


def test_every_claim_is_on_the_page_of_the_validation() -> None:
    text = (ROOT / "docs/validation.md").read_text(encoding="utf-8")
    assert keys_not_on(text) <= NOT_YET_IN_THE_TABLE
    assert keys_not_on(text.replace("`if-sum`", "").replace("`if_sum.py`", "")) - {
        *NOT_YET_IN_THE_TABLE
    } == {"if-sum"}
