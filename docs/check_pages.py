"""What pages name exists: commands, options, keys, levels and other names, files and functions.

Each check takes the text of a page and returns what it finds wrong with it. The tests run them all;
``python docs/check_pages.py`` prints what is wrong with which page.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import re
import shlex
import textwrap
import tomllib
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import rtradar as rt
from rtradar.campaign.spec_file import read_spec
from rtradar.classify.recipes import RECIPES
from rtradar.cli.parser import parser as whole_parser
from rtradar.errors import InputError
from rtradar.scene import MATERIALS
from rtradar.scene.tables import KEYS
from rtradar.settings import RunSettings
from rtradar.system.registries import ACTIVITY_NAMES, DETECTORS, MODELS, RADARS, scene_files
from rtradar.validate import claims

ROOT = Path(__file__).parents[1]
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("docs/*.rst")])
    if path.name != "CHANGELOG.md"  # it tells of the past
}
FOLDERS = ("rtradar", "docs", "validation", "tests", "scenes", "radars", "meshes")
BUILT = {"__pycache__", "api", "auto_gallery", "drawn"}  # by Python and by Sphinx
FILES = [
    path
    for folder in (ROOT / name for name in FOLDERS)
    for path in folder.rglob("*")
    if not BUILT & {*path.relative_to(folder).parts}
] + list(ROOT.iterdir())
PATHS = {f"/{path.relative_to(ROOT).as_posix()}{'/' * path.is_dir()}" for path in FILES}
SCRIPT_OPTIONS = {"--json", "--quick", "--figure"}  # of each script that measures a claim
FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```", re.M | re.S)
BLOCK = re.compile(r"(?<=\n\n)(?: {4}.*\n+)+")
COMMANDS = re.compile(r"(?:\.venv/bin/)?(rtradar|python) +(?=[a-z.-])")

NAMES: dict[str, set[str]] = {
    "level": {*MODELS.built_in},
    "level of a target": {*MODELS.built_in, "full-wave"},
    "radar": {*RADARS.built_in},
    "scene": {*scene_files()},
    "detector": {*DETECTORS.built_in},
    "activity": {*ACTIVITY_NAMES},
    "material": {*MATERIALS},
    "mesh": {path.stem for path in (ROOT / "meshes").glob("*.ply")},
    "recipe": {*RECIPES},
}
SAYS = {
    r"(?<!split )by `([a-z]+(?:-[a-z]+)*)`": "level of a target",
    r"\bfidelity ?= ?\[?\"([^\"]+)\"": "level of a target",
    r"Radar\.preset\(\"([^\"]+)\"": "radar",
    r"Scene\.load\(\"([\w-]+)\"": "scene",
    r"synthetic_motion\(\"([^\"]+)\"": "activity",
    r"synthetic:([a-z]\w*)": "activity",
    r"^material = \"([^\"]+)\"": "material",
    r"^mesh = \"([\w-]+)\"": "mesh",
}
"""Where a page names something of a kind: an expression, and the kind."""

VALUES = {
    "--fidelity": "level",
    "--fidelities": "level",
    "--radar": "radar",
    "--scene": "scene",
    "--detector": "detector",
    "--recipe": "recipe",
}
"""Options whose values are names; with a dot they are files, and in capitals they stand for any."""


def blocks(text: str) -> Iterator[tuple[str, str]]:
    """Language and content of each block of code; one that is indented has no language."""
    for info, content in FENCE.findall(text):
        yield info.split()[-1] if info else "", content
    for found in BLOCK.findall(FENCE.sub("", text)):
        yield "", textwrap.dedent(found)


def inline(text: str) -> list[str]:
    """Code within the sentences of a page, without that of roles such as :math:."""
    text = re.sub(r"(?:\{[\w-]+\}|:[\w:-]+:)`[^`]*`", "", BLOCK.sub("", FENCE.sub("", text)))
    return [" ".join(code.split()).replace(r"\|", "|") for code in re.findall(r"`+([^`]+)`", text)]


def command_lines(text: str) -> Iterator[list[str]]:
    """Words of each command of a page that begins with rtradar or python."""
    lines = [
        line
        for language, content in blocks(text)
        if language not in ("python", "toml")
        for line in content.replace("\\\n", " ").splitlines()
    ]
    for line in [*lines, *inline(text)]:
        if found := COMMANDS.match(re.sub(r"^(\w+=\S+ )+", "", line.strip())):
            yield shlex.split(found.string[found.start(1) :], comments=True)
        elif re.match(r"\w+\.py ", line):
            yield ["python", *shlex.split(line)]


# -- commands and options --------------------------------------------------------------------------


@cache
def parsers() -> dict[tuple[str, ...], argparse.ArgumentParser]:
    """Parser of each command by its words, with its options filled in."""
    found: dict[tuple[str, ...], argparse.ArgumentParser] = {(): whole_parser()}
    waiting = [()]
    while waiting:
        words: tuple[str, ...] = waiting.pop()
        found[words].format_help()
        for action in found[words]._actions:
            if isinstance(action, argparse._SubParsersAction):
                for name, parser in action.choices.items():
                    found[*words, name] = parser
                    waiting.append((*words, name))
    return found


def option_of(word: str, parser: argparse.ArgumentParser) -> argparse.Action | None:
    found: argparse.Action | None = parser._option_string_actions.get(word.partition("=")[0])
    return found


def wrong_value(option: str, value: str, action: argparse.Action) -> bool:
    """Whether an option is given a name that does not exist."""
    values = value.split(",") if option == "--fidelities" else value.split("|")
    if option in VALUES:
        # Of extending.md, and a room that is drawn.
        known = NAMES[VALUES[option]] | {"lane-60ghz", "points", "threshold", "random:7"}
        return not all("." in one or one.isupper() or one in known for one in values)
    known = {str(choice) for choice in action.choices or ()}
    return bool(known) and not all(one.isupper() or one in known for one in values)


def wrong_commands(text: str) -> list[str]:
    """Commands, their options, and names given to these that do not exist."""
    wrong = []
    for program, *words in command_lines(text):
        if program == "python":
            wrong += wrong_script(words)
            continue
        path: tuple[str, ...] = ()
        while words and (*path, words[0]) in parsers():
            path, words = (*path, words[0]), words[1:]
        parser = parsers()[path]
        if words and parser._subparsers and not words[0].startswith("-"):
            wrong.append(f"rtradar {' '.join((*path, words[0]))}: no such command")
        for word, value in zip(words, [*words[1:], ""][: len(words)], strict=True):
            if word.startswith("--"):
                action = option_of(word, parser)
                if action is None:
                    wrong.append(f"rtradar {' '.join(path)} has no option {word}")
                elif action.nargs != 0 and value and wrong_value(word, value, action):
                    wrong.append(f"{word} {value}: no such name")
    return wrong


def wrong_script(words: list[str]) -> list[str]:
    """A script that does not exist, or an option that it does not take."""
    if words[0].startswith("-"):
        return []  # a module, such as pytest
    paths = [path for path in PATHS if path.endswith(f"/{words[0]}")]
    if not paths:
        return [f"{words[0]}: no such script"]
    # A name without its folder is that of a script of the validation.
    path = max(paths, key=lambda path: path.startswith("/validation/"))
    source = (ROOT / path[1:]).read_text(encoding="utf-8")
    taken = SCRIPT_OPTIONS if "rtradar.validate.rows import" in source else set()
    options = {word for word in words[1:] if word.startswith("--")}
    return [
        f"{words[0]} has no option {one}" for one in options - taken if f'"{one}"' not in source
    ]


def wrong_options(text: str) -> list[str]:
    """Options in sentences that no command has, and names given to them that do not exist."""
    wrong = []
    for code in inline(text):
        words = re.split("[ =]", code)
        if re.match("--[a-z]", code):
            actions = [a for parser in parsers().values() if (a := option_of(words[0], parser))]
            if not actions and not any(f'"{words[0]}"' in source for source in scripts()):
                wrong.append(f"{code}: no command has such an option")
            elif actions and len(words) > 1 and all(wrong_value(*words[:2], a) for a in actions):
                wrong.append(f"{code}: no such name")
    return wrong


@cache
def scripts() -> list[str]:
    """Sources of the scripts of the validation."""
    return [path.read_text(encoding="utf-8") for path in (ROOT / "validation").rglob("*.py")]


# -- names -----------------------------------------------------------------------------------------


def wrong_names(text: str) -> list[str]:
    """Levels, radars, scenes and other names of the registries that do not exist."""
    found = {(kind, name) for how, kind in SAYS.items() for name in re.findall(how, text, re.M)}
    for table in re.findall(r"^\| level .*\n\|.*\n((?:\|.*\n)+)", text, re.M):
        first = re.findall(r"^\| `([\w-]+)`", table, re.M)
        found |= {("level of a target", name) for name in first}
    return [f"{kind} '{name}' does not exist" for kind, name in found if name not in NAMES[kind]]


# Names of other programs and of people's files; those of keys and functions of ours are found in
# the sources.
OF_OTHERS = {
    *("anny", "h5py", "numpy.load", "scipy.io.loadmat", "scipy.signal", "trimesh.Trimesh"),
    *("torch.utils.data.Dataset", "DataLoader", "xarray.open_zarr", "zarr.open_group"),
    *("SampleSwap", "cmplx16ImRe_t", "adcbufCfg", "channelCfg", "cfarCfg", "peakGrouping"),
    *("clutterRemoval", "DRJIT_LIBLLVM_PATH", "make", "awr12", "awr22", "iwr14", "count2"),
    *("HipLeft_x", "left_hip", "left_up_leg", "venv"),
    "time_of_sample",  # composed of a name and _of_sample
}


@cache
def words_of_the_code() -> set[str]:
    """Words of the package and the scripts, without comments and docstrings, and names of files."""
    found = set().union(*NAMES.values(), OF_OTHERS)
    for path in FILES:
        found |= {path.name, path.stem}
        if path.is_relative_to(ROOT / "rtradar") or path.is_relative_to(ROOT / "validation"):
            if path.suffix == ".py":
                source = path.read_text(encoding="utf-8")
                found |= words_in(re.sub(r'""".*?"""|#[^\n]*', "", source, flags=re.S))
            elif path.suffix in (".toml", ".js"):
                found |= words_in(path.read_text(encoding="utf-8"))
    found |= {key for claim in claims(ROOT / "validation") for key in claim.keys}
    return {plain(word) for word in found}


def words_in(source: str) -> set[str]:
    return set(re.findall(r"\w+(?:[-.]\w+)*", source)) | set(re.findall(r"\w+", source))


def plain(word: str) -> str:
    """A word as readers of joint names compare it, without case and underscores."""
    return word.lower().replace("_", "")


def unknown_words(text: str) -> list[str]:
    """Single words, tables and keys in backticks that stand nowhere in the code."""
    wrong = []
    for code in set(inline(text)) - own_files(text):
        found = re.fullmatch(r"\[*([A-Za-z_][\w-]*(?:\.[A-Za-z_]\w*)*)\]*", code)
        found = found or re.match(r"(\w\w+) ?= ?\S", code)
        if found and plain(found[1]) not in words_of_the_code():
            parts = found[1].split(".")
            if len(parts) == 1 or not {plain(part) for part in parts} <= words_of_the_code():
                wrong.append(f"`{code}` is unknown: neither in the code, nor the name of a file")
    return wrong


# -- files, functions, keys ------------------------------------------------------------------------


def own_files(text: str) -> set[str]:
    """Files that a page shows as the reader's own, with the name on a line above."""
    return set(re.findall(r"^`([\w.]+)`$", text, re.M))


def wrong_files(text: str) -> list[str]:
    """Files of the repository in backticks that do not exist, or do not hold what they should."""
    wrong = []
    for code in set(inline(text)) - own_files(text):
        named = re.fullmatch(r"[\w.*/-]+?(?:/|\.(?:py|md|rst|toml|sh|svg|js))", code)
        if not named or code.startswith((".", "out/", "/")):
            continue
        inside = code.split("/")[0] in FOLDERS
        if (inside or code.endswith((".py", ".rst", ".sh", "/"))) and not any(
            Path(path).match(f"*/{code.rstrip('/')}") or path.endswith(f"/{code}") for path in PATHS
        ):
            wrong.append(f"{code}: no such file")
    for symbol, path in re.findall(r"`(\w+)` (?:of|in)\s+`([\w/]+\.py)`", text):
        if (ROOT / path).is_file() and not re.search(
            rf"^(?:class |def |    def )?{symbol}\b", (ROOT / path).read_text("utf-8"), re.M
        ):
            wrong.append(f"{path} does not hold {symbol}")
    return wrong


def wrong_links(page: str, text: str) -> list[str]:
    """Links of a page to files that do not exist."""
    links = re.findall(r"\]\(([^)#\s]+)(?:#[\w-]+)?\)", text)
    drawn = ("http", "drawn/")  # pictures that Sphinx draws
    return [
        f"({link}): no such file"
        for link in links
        if not link.startswith(drawn) and not (ROOT / page).parent.joinpath(link).exists()
    ]


def found_by(dotted: str) -> Any:
    """What a dotted name is, such as rt.Radar.preset; raises AttributeError if there is none."""
    names = dotted.split(".")[1:]
    thing: Any = rt
    for number, name in enumerate(names):
        if not hasattr(thing, name) and inspect.ismodule(thing):
            try:
                import_module(".".join(["rtradar", *names[: number + 1]]))
            except ModuleNotFoundError:
                raise AttributeError(dotted) from None
        thing = getattr(thing, name)
    return thing


def wrong_python(text: str) -> list[str]:
    """Functions and classes of the package that do not exist, and options they do not take."""
    text = re.sub(r"\[[^]]*\]\([^)]*\)", "", text)
    wrong = []
    dotted = set(re.findall(r"(?<![\w./'\"-])((?:rt|rtradar)(?:\.[A-Za-z]\w*)+)(?![\w./])", text))
    for module, names in re.findall(r"from (rtradar[\w.]*) import ([\w, ]+)", text):
        dotted |= {f"{module}.{name.strip()}" for name in names.split(",")}
    for name in sorted(dotted):
        try:
            found_by(name)
        except AttributeError:
            wrong.append(f"{name} does not exist")
    sources = [content for language, content in blocks(text) if language in ("python", "")]
    for source in [*sources, *(code for code in inline(text) if code.startswith("rt."))]:
        try:
            tree = ast.parse(source)
        except SyntaxError:
            continue  # of a shell
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and re.match(r"rt\.[\w.]+$", ast.unparse(call.func)):
                wrong += wrong_keywords(ast.unparse(call.func), call)
    return wrong


def wrong_keywords(name: str, call: ast.Call) -> list[str]:
    try:
        taken = inspect.signature(found_by(name)).parameters
    except (AttributeError, ValueError):
        return []  # it is reported already, or takes anything
    known = set(taken)
    if any(one.kind is one.VAR_KEYWORD for one in taken.values()):
        known |= set(RunSettings.__dataclass_fields__) | {"material", "polarization"}
    given = {keyword.arg for keyword in call.keywords if keyword.arg}
    return [f"{name} does not take {one}" for one in sorted(given - known)]


def wrong_tables(text: str, folder: Path) -> list[str]:
    """Blocks of TOML that the reader of such files refuses, and keys in sentences that none has."""
    wrong = []
    for language, content in blocks(text):
        if language != "toml":
            continue
        content = content.replace("walk.bvh", "synthetic:walk")
        tables = set(tomllib.loads(content))
        path = folder / "block.toml"
        path.write_text(content, encoding="utf-8")
        for file in re.findall(r'= "(\w+\.a[sm][cf])"', content):
            (folder / file).touch()
        try:
            if tables & {"each", "windows", "synthetic", "recordings"}:
                read_spec(path)
            elif tables & {"scene", "settings"}:
                _ = rt.Experiment.load(path).parts
            elif tables & {"materials", *(key.strip("[]") for key in KEYS)}:
                rt.Scene.load(path)
            elif "project" not in tables:  # which is of a package of the reader's own
                rt.Radar.load(path)
        except InputError as error:
            wrong.append(str(error))
    return wrong


CHECKS: dict[str, Callable[[str], list[str]]] = {
    "commands": wrong_commands,
    "options": wrong_options,
    "names": wrong_names,
    "words": unknown_words,
    "files": wrong_files,
    "python": wrong_python,
}


if __name__ == "__main__":
    for name, content in PAGES.items():
        for check in CHECKS.values():
            for line in check(content):
                print(f"{name}: {line}")
