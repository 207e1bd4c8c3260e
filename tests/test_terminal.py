"""What commands print: lines of stages, results, the page to open; and what --quiet leaves out."""

from __future__ import annotations

import io
import json
import sys
import webbrowser
from pathlib import Path

import pytest

from rtradar.cli import main
from rtradar.pipeline.timing import Stages, lines_shown, stage_line

Capture = pytest.CaptureFixture[str]
RUN = ["run", "synthetic:walk", "--duration", "0.2", "--fidelity", "analytic"]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def on_terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Make stderr a terminal; not in a fixture, for pytest replaces it after those."""
    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    return shown


def test_a_run_names_its_page_opens_it_and_draws_no_pictures_unless_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda page: not opened.append(page))
    assert main([*RUN, "--out", str(tmp_path / "out"), "--verbose", "--open"]) == 0
    said = capsys.readouterr()
    lines = said.out.splitlines()
    assert lines[-1] == f"open {tmp_path / 'out' / 'report.html'}"
    assert lines[0].startswith("stages [s]: motion 0.")
    assert "numba" in lines[1]
    assert lines[2] == "ray-tracing backend: none"
    assert said.err == ""  # no terminal
    assert opened == [(tmp_path / "out" / "report.html").as_uri()]
    assert not list((tmp_path / "out").glob("*.png"))
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["pictures"] is False
    assert "<img" not in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_a_terminal_shows_a_line_for_each_stage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = on_terminal(monkeypatch)
    assert main([*RUN, "--out", str(tmp_path / "out")]) == 0
    shown = terminal.getvalue()
    stages = "preparing", "link budget", "body and paths to view", "writing the report"
    places = [shown.index(f"\r{stage}: ") for stage in stages]
    assert places == sorted(places)
    assert places[1] < shown.index(", analytic: ") < places[2]


def test_quiet_prints_errors_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    terminal = on_terminal(monkeypatch)
    words = [*RUN, "--out", str(tmp_path / "out"), "--quiet"]
    assert main(words) == 0
    assert capsys.readouterr().out == ""
    assert terminal.getvalue() == ""
    assert terminal.isatty()  # again
    assert main([*words, "--pfa", "3"]) == 2
    assert terminal.getvalue().count("\n") == 1


def test_quiet_and_verbose_exclude_each_other(capsys: Capture) -> None:
    assert main([*RUN, "--out", "out", "--quiet", "--verbose"]) == 2
    assert "not allowed with" in capsys.readouterr().err


def test_lines_are_shown_only_where_asked_and_end_before_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    terminal = on_terminal(monkeypatch)
    stages = Stages()
    with stages.time("report"):
        pass
    assert terminal.getvalue() == ""
    with lines_shown(), pytest.raises(ValueError, match="no"), stage_line("tracing"):
        raise ValueError("no")
    assert terminal.getvalue() == "tracing ...\n"
    assert stages.seconds["report"] >= 0
