"""``rtradar dataset build``: what it says, and how it says no."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from rtradar.campaign import in_words
from rtradar.campaign.samples import Made, SamplePlan
from rtradar.cli import main
from rtradar.clouds import Sample

SPEC = """
[windows]
duration_s = 1.0
[[synthetic]]
label = "walk"
count = 12
subjects = 12
"""


def fake(recipe: SamplePlan) -> Made:
    return Made(Sample(np.zeros((3, 3)), recipe.label, recipe.parameters), np.zeros((0, 3)), 2.0)


def test_a_plan_then_the_whole(
    here: None, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rtradar.campaign.build.make_sample", fake)
    (tmp_path / "set.toml").write_text(SPEC)
    words = ["dataset", "build", str(tmp_path / "set.toml"), "--out", str(tmp_path / "out")]
    words += ["--json", str(tmp_path / "told.json")]
    assert main([*words, "--plan"]) == 0
    said = capsys.readouterr().out
    assert "12 samples\n  by label: walk 12\n" in said
    assert (
        "synthetic-8 1, and 4 more" not in said
    )  # eight are shown, by name: 0, 1, 10, 11, 2, 3, 4, 5
    assert "synthetic-5 1, and 4 more" in said
    assert "10 are missing: about 20 s on 1 worker," in said
    told = json.loads((tmp_path / "told.json").read_text())
    assert (told["samples"], told["made"], told["missing"], told["estimated_s"]) == (
        12,
        2,
        10,
        20.0,
    )
    assert main(words) == 0
    assert "2 were there, 10 made" in capsys.readouterr().out
    assert len(list((tmp_path / "out").glob("*.npz"))) == 12


PLAN = {"samples": 3, "by": {}, "whole": 1, "damaged": 0, "made": 0, "missing": 2, "workers": 1}


def test_what_was_made_is_said_in_units_that_fit() -> None:
    made = {"damaged": 2, "made": 4, "bytes": 4e9, "work_s": 3.0, "wall_s": 600.0, "workers": 2}
    assert in_words(PLAN | made) == (
        "3 samples\n1 were there, 2 were damaged, "
        "4 made in 10 min by 2 workers (3.0 s and 1.0 GB each)"
    )


@pytest.mark.parametrize(
    ("seconds", "size", "said"),
    [
        (119.4, 999_400.0, "about 119 s on 1 worker, and 1.0 MB"),
        (120.0, 999.9e6, "about 2 min on 1 worker, and 999.9 MB"),
        (7199.0, 1e9, "about 120 min on 1 worker, and 1.0 GB"),
        (7200.0, 15e6, "about 2.0 h on 1 worker, and 15.0 MB"),
    ],
)
def test_units_change_where_two_of_the_next_are_full(
    seconds: float, size: float, said: str
) -> None:
    plan = PLAN
    told = in_words({**plan, "estimated_s": seconds, "estimated_bytes": size})
    assert told == f"3 samples\n1 were there\n2 are missing: {said}"
    assert in_words({**plan, "missing": 0, "estimated_s": 0.0, "estimated_bytes": 0.0}).endswith(
        "\nnone is missing"
    )


@pytest.mark.parametrize(
    ("text", "options", "named"),
    [
        ("colour = 1" + SPEC, [], "colour"),
        (SPEC, ["--workers", "0"], "--workers"),
        (SPEC, ["--workers", "2", "--scheduler", "tcp://host:1"], "--scheduler"),
        (SPEC, ["--json", "/none/told.json"], "--json"),
        (SPEC + '[each]\nradar = ["none.toml"]', [], "none.toml"),
    ],
)
def test_bad_input_gets_one_clear_line_and_leaves_nothing(
    text: str, options: list[str], named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "set.toml").write_text(text)
    words = ["dataset", "build", str(tmp_path / "set.toml"), "--out", str(tmp_path / "out")]
    assert main([*words, *options]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert named in said.err
    assert not (tmp_path / "out").exists()


def test_several_complaints_are_a_line_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "set.toml").write_text("colour = 1\nsize = 2" + SPEC.replace("walk", "dance"))
    words = ["dataset", "build", str(tmp_path / "set.toml"), "--out", str(tmp_path / "out")]
    assert main(words) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    for line, named in zip(lines, ("'colour'", "'size'", "'dance'"), strict=True):
        assert line.startswith("rtradar: data set file '")
        assert named in line
    assert not (tmp_path / "out").exists()


def test_without_dask_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "set.toml").write_text(SPEC)
    words = ["dataset", "build", str(tmp_path / "set.toml"), "--out", str(tmp_path / "out")]
    monkeypatch.setitem(sys.modules, "dask", None)
    assert main(words) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "in a checkout: pip install -e '.[campaign]'" in said
