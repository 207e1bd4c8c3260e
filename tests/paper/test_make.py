"""`rtradar paper`: its page, its numbers, and that a killed command goes on."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rtradar import paper
from rtradar.cli import main
from rtradar.errors import InputError
from rtradar.paper import AS_PAPER, make_paper, paper_warnings
from rtradar.paper.formulas import radar_figures
from rtradar.paper.items import TEXTS, Sources, load_items
from rtradar.paper.learning import learning_figures

Parts = dict[str, Callable[[Sources], dict[str, Any]]]


class Asked(dict[str, Any]):
    """Figures of which every name is known, as a number; it keeps the names."""

    def __init__(self) -> None:
        self.names: set[str] = set()

    def __missing__(self, name: str) -> float:
        self.names.add(name)
        return 1.0


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Let the parts without a simulation be all; return the names of those that have run."""
    ran: list[str] = []

    def part(name: str, measure: Callable[[Sources], dict[str, Any]]) -> Any:
        def run(sources: Sources) -> dict[str, Any]:
            ran.append(name)
            return measure(sources)

        return run

    parts = {"radar": radar_figures, "learning": learning_figures}
    monkeypatch.setattr(
        "rtradar.paper._parts", lambda: {name: part(name, one) for name, one in parts.items()}
    )
    return ran


def test_page_and_numbers_have_the_items_that_are_measured(
    counted: list[str], tmp_path: Path
) -> None:
    out = tmp_path / "paper"
    make_paper(out, quick=True)
    content = json.loads((out / "paper.json").read_text())
    items = {item["id"]: item for item in content["items"]}
    for name in ("table-1", "table-2", "table-4", "figure-1", "equation-6", "number-cfar"):
        assert set(items[name]) == {"id", "title", *TEXTS, "picture"}
        assert "{" not in items[name]["ours"]
    assert items["table-4"]["picture"] == "table-4.png"
    assert items["figure-14"]["picture"] == "figure-14.png"
    assert items["equation-3"]["ours"] == "7.14 m/s."
    page = (out / "paper.html").read_text()
    assert all(f'id="{name}"' in page and f'href="#{name}"' in page for name in items)
    assert {path.name for path in out.iterdir()} <= set(content["files"])


def test_every_brace_of_the_texts_is_a_figure_that_some_part_measures(tmp_path: Path) -> None:
    folder = Path(paper.__file__).parent
    code = "".join(path.read_text(encoding="utf-8") for path in folder.glob("*.py"))
    asked = Asked()
    assert all(item.filled(asked) is not None for item in load_items())
    words = re.findall(r'"([^"\s]+)"', code)
    keys = {re.sub(r"\\{[^}]*\\}", ".+", re.escape(key)) for key in words}
    known = re.compile("|".join(key for key in keys if re.search("[a-z]", key)))
    learnt = learning_figures(Sources(tmp_path, quick=True, full=False, recordings={}))
    assert [name for name in asked.names - learnt.keys() if not known.fullmatch(name)] == []


def test_a_command_that_was_stopped_goes_on(
    counted: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts: Parts = paper._parts()

    def stop(sources: Sources) -> dict[str, Any]:
        (sources.out / "table-4.png").touch()  # a picture that nobody has listed yet
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("rtradar.paper._parts", lambda: {**parts, "learning": stop})
        with pytest.raises(KeyboardInterrupt):
            make_paper(tmp_path, quick=True)
    assert counted == ["radar"]
    make_paper(tmp_path, quick=True)
    assert counted == ["radar", "learning"]
    make_paper(tmp_path)  # which measures more than quick does
    assert counted == ["radar", "learning", "radar", "learning"]


@pytest.mark.parametrize("name", ["paper.html", "figure-4.png"])
def test_a_folder_that_holds_files_of_others_is_refused(
    counted: list[str], tmp_path: Path, name: str
) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(InputError, match=name):
        make_paper(tmp_path, quick=True)
    assert not counted
    assert (tmp_path / name).read_text() == "mine"
    make_paper(tmp_path, quick=True, overwrite=True)
    assert len(counted) == 2


def test_the_command_says_where_the_page_is(
    counted: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["paper", "--quick", "--out", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.endswith(f"open {tmp_path / 'out' / 'paper.html'}\n")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["paper", "--out", "OUT", "--mocap", "nowhere"], "no folder"),
        (["paper", "--out", "OUT", "--mocap", "."], "no HDM_"),
        (["run", "synthetic:walk", "--as-paper", "--fidelity", "rays", "--out", "OUT"], "fidelity"),
    ],
)
def test_bad_input_is_one_line(
    words: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([str(tmp_path / "out") if word == "OUT" else word for word in words]) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.count("\n") == 1


def test_a_run_as_the_paper_warns_of_each_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["run", "synthetic:walk", "--as-paper", "--duration", "0.15"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().err
    assert all(text in said for text in paper_warnings())
    parameters = json.loads((tmp_path / "summary.json").read_text())["parameters"]
    assert {name: parameters[name] for name in AS_PAPER} == AS_PAPER
