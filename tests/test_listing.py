"""``rtradar list``, and the help that is shown where no command is named."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rtradar.cli import main
from rtradar.errors import ExtensionError
from rtradar.motion import ACTIVITIES
from rtradar.scene import MATERIALS
from rtradar.system.registries import DETECTORS, MODELS, RADARS, scene_files

Capture = pytest.CaptureFixture[str]
NAMES = {"scenes": scene_files(), "radars": RADARS, "materials": MATERIALS}
NAMES |= {"fidelities": MODELS, "detectors": DETECTORS, "activities": ACTIVITIES}


@pytest.mark.parametrize("kind", NAMES)
def test_all_names_of_a_kind_are_listed_each_with_its_description(
    kind: str, tmp_path: Path, capsys: Capture
) -> None:
    assert main(["list", kind, "--json", str(tmp_path / "names.json")]) == 0
    rows = json.loads((tmp_path / "names.json").read_text())[kind]
    assert [row["name"] for row in rows] == list(NAMES[kind])
    assert all(len(row["description"]) > 10 for row in rows)
    if kind == "activities":
        assert len({row["description"].partition(".")[0] for row in rows}) == len(rows)
    shown = [line.split()[0] for line in capsys.readouterr().out.splitlines() if line[0] != " "]
    assert shown == list(NAMES[kind])


def test_what_a_package_adds_is_listed_also_where_it_is_broken(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def steep(power: object, *, pfa: float, looks: int) -> object:
        """Detector of steep slopes.

        More of it.
        """

    def broken() -> None:
        raise ExtensionError("radar 'broken' failed")

    monkeypatch.setitem(DETECTORS._registered, "steep", steep)
    monkeypatch.setitem(RADARS._registered, "broken", broken)
    assert main(["list", "detectors"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.split(maxsplit=1) == ["steep", "Detector of steep slopes."]
    assert main(["list", "radars"]) == 0
    assert "radar 'broken' failed" in capsys.readouterr().out


@pytest.mark.parametrize("words", [[], ["list"], ["dataset"]])
def test_without_a_command_the_help_is_shown(words: list[str], capsys: Capture) -> None:
    assert main(words) == 0
    bare = capsys.readouterr().out
    assert main([*words, "--help"]) == 0
    assert capsys.readouterr().out == bare
    assert "\nexamples:\n  rtradar" in bare


COMMANDS = ["run", "compare", "list scenes", "view", "export", "dataset", "train", "evaluate"]


@pytest.mark.parametrize("command", [*COMMANDS, "doctor", "validate", "bench", "paper"])
def test_every_help_ends_with_examples_of_the_command(command: str, capsys: Capture) -> None:
    assert main([*command.split(), "--help"]) == 0
    examples = capsys.readouterr().out.partition("\nexamples:\n")[2].splitlines()
    assert examples
    assert all(line.startswith(f"  rtradar {command}") for line in examples)
