"""The page of recipes: its commands run, with the files that it shows."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from rtradar.cli import main

PAGE = (Path(__file__).parents[1] / "docs" / "recipes.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    rtradar (run .*)$", PAGE, re.MULTILINE)
FILES = {
    block.split()[1].rstrip(":"): block
    for block in re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::rtradar.ValidityWarning")  # nobody in the room alone
def test_every_recipe_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, content in FILES.items():
        Path(name).write_text(content, encoding="utf-8")
    assert len(COMMANDS) >= 6
    for command in COMMANDS:
        words = shlex.split(command)
        # A tenth of the time; all else is what the page says.
        words[words.index("--duration") + 1] = "7" if "capture" in words else "0.2"
        assert main([*words, "--quiet"]) == 0, command
        out = Path(words[words.index("--out") + 1])
        if (out / "sweep.json").exists():
            assert len(json.loads((out / "sweep.json").read_text())["runs"]) == 2
        else:
            assert json.loads((out / "summary.json").read_text())["detections"] > 0
