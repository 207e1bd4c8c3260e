"""`rtradar train` and `rtradar evaluate`, from a folder of clouds to tables and pictures."""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from rtradar.classify import study
from rtradar.classify.baselines import BASELINES
from rtradar.classify.prepare import stack_clouds
from rtradar.classify.recipes import LEAN, PAPER, RECIPES, SMALL
from rtradar.classify.study import load_network, train_study
from rtradar.classify.training import Examples, predict
from rtradar.cli import main
from rtradar.errors import InputError

pytestmark = pytest.mark.drawn

TINY = ["--points", "24", "--epochs", "2", "--folds", "2"]


def rtradar(*words: object) -> int:
    """Run the command of some words, or texts of several."""
    return main([part for word in words for part in str(word).split()])


@pytest.fixture(scope="module")
def trained(collection: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("trained") / "new" / "lean"
    assert rtradar("train", collection, "--out", out, *TINY) == 0
    return out


@pytest.mark.slow
def test_a_study_is_trained_and_evaluated(
    collection: Path, trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paper = tmp_path / "paper"
    words = f"train {collection} --out {paper} --recipe paper --split subject --fold 2"
    assert rtradar(words, *TINY) == 0
    assert "1 of 2 trained" in capsys.readouterr().out
    out = tmp_path / "evaluated"
    words = f"evaluate {trained} {paper} --baselines --out {out} --json {tmp_path / 'numbers.json'}"
    assert rtradar(words) == 0
    said = capsys.readouterr().out
    assert "lean, 24 points" in said
    assert "1 of 2 trained" in said
    assert "random forest, metadata alone" in said
    content = json.loads((out / "evaluation.json").read_text())
    assert content == json.loads((tmp_path / "numbers.json").read_text())
    assert len(content["groups"]) == 2 + len(BASELINES)
    lean = content["groups"][0]
    assert lean["summary"]["test_clouds"] == 36  # each cloud once
    assert sum(map(sum, lean["confusion"])) == 36
    pictures = {f"{kind}-{number}.png" for kind in ("confusion", "learning") for number in (1, 2)}
    pictures |= {"accuracy.png"}
    tables = {"evaluation.json", "table.txt", "trainings.csv", "history.csv"}
    assert {path.name for path in out.iterdir()} == pictures | tables
    assert all((out / name).read_bytes().startswith(b"\x89PNG") for name in pictures)
    assert len((out / "history.csv").read_text().splitlines()) == 1 + 2 * 2 + 2


def test_a_trained_network_can_be_asked_about_other_clouds(
    trained: Path, made_up: Callable[..., Any]
) -> None:
    network, recipe, classes = load_network(trained, 2)
    clouds = made_up(per_class=2, seed=5)
    examples = Examples(stack_clouds(clouds), torch.zeros(6, dtype=torch.int64), classes)
    assert classes == ("kick", "punch", "walk")
    chances = np.exp(predict(network, examples, recipe))
    assert chances.sum(axis=1) == pytest.approx(np.ones(6), abs=1e-5)
    with pytest.raises(InputError, match="training-03"):
        load_network(trained, 3)


def test_every_model_is_asked_by_every_other(
    collection: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert rtradar("train", collection, "--out", tmp_path, *TINY, "--split", "across:fidelity") == 0
    assert rtradar("evaluate", tmp_path) == 0
    assert "trained on" in capsys.readouterr().out
    found = json.loads((tmp_path / "evaluation.json").read_text())["groups"][0]["transfer"]
    assert found["values"] == ["analytic", "specular"]
    assert all(0 <= share <= 1 for row in found["mean"] for share in row)
    assert (tmp_path / "transfer-1.png").exists()


def test_what_is_done_is_not_done_again(
    collection: Path,
    trained: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(
        study.training, "train_network", lambda *given, **also: pytest.fail("it trains again")
    )
    assert rtradar("train", collection, "--out", trained, *TINY) == 0
    assert "2 of 2 trained" in capsys.readouterr().out


def test_trainings_of_one_folder_learn_from_the_same_clouds(
    made_up: Callable[..., Any], tmp_path: Path
) -> None:
    recipe = RECIPES["lean"].changed(points=24, epochs=1)
    clouds, others = made_up(), made_up(seed=1)
    train_study(clouds, tmp_path, recipe, folds=2, only=[1])
    for row in others.rows:
        row["fidelity"] = "specular"
    with pytest.raises(InputError, match="holds other trainings"):
        train_study(others, tmp_path, recipe, folds=2, only=[2])
    plan = json.loads((tmp_path / "plan.json").read_text())
    del plan["made"]  # as older folders are, which shall go on
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    assert len(train_study(clouds, tmp_path, recipe, folds=2).outcomes) == 2


def test_a_folder_that_cannot_be_is_said_in_one_line(
    collection: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert rtradar("train", collection, "--out", tmp_path / ("a" * 300), *TINY) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].endswith("File name too long; give a folder that can be written (--out)")


def test_an_interrupted_command_says_how_to_go_on(
    collection: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def interrupted(*given: Any, **also: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(study.training, "train_network", interrupted)
    assert rtradar("train", collection, "--out", tmp_path, *TINY) == 130
    said = capsys.readouterr().err
    assert said.splitlines()[-1].startswith("rtradar: stopped by the user; the same command goes")


BAD = [
    (["--points", "25"], "holds other trainings (recipe: points 24, not 25)"),
    (["--seed", "1"], "holds other trainings (seed: 0, not 1)"),
    (["--recipe", "fat"], "--recipe fat"),
    (["--split", "people"], "split 'people' is unknown"),
    (["--split", "across:colour"], "no sample has 'colour'"),
    (["--fold", "3"], "--fold 3: there are 2 trainings"),
    (["--fold", "x"], "list of whole numbers"),
    (["--points", "0"], "points = 0"),
    (["--rate", "-1"], "rate = -1"),
    (["--augmentation", "all"], "augmentation = 'all'"),
    (["--precision", "int8"], "precision = 'int8'"),
    (["--folds", "1"], "--folds 1"),
]


@pytest.mark.parametrize(("words", "said"), BAD, ids=[" ".join(words) for words, _ in BAD])
def test_bad_training_is_refused_in_one_line(
    collection: Path, trained: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    before = sorted(trained.rglob("*"))
    assert rtradar("train", collection, "--out", trained, *TINY, *words) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error
    assert sorted(trained.rglob("*")) == before


def test_bad_folders_are_refused_in_one_line(
    collection: Path, trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("mine")
    for words, said in [
        (["train", tmp_path / "none", "--out", tmp_path / "out"], "none"),
        (["train", collection, "--out", tmp_path / "file", *TINY], "--out"),
        (["train", collection, "--out", tmp_path / "out", *TINY, "--points", "49"], "hold 48"),
        (["evaluate", tmp_path / "none"], "there is no"),
        (["evaluate", trained, "--out", tmp_path / "file"], "--out"),
        (["evaluate", trained, "--data", collection], "--data"),
        (["evaluate", trained, "--json", tmp_path / "none" / "file"], "--json"),
        (["evaluate", trained, "--baselines", "--data", tmp_path / "none"], "none"),
    ]:
        assert rtradar(*words) == 2, words
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert said in error
    assert not (tmp_path / "out").exists()
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("name", ["plan.json", "training-01/outcome.json"])
def test_damaged_files_are_named(
    collection: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    words = ["train", collection, "--out", tmp_path, *TINY, "--fold", "1", "--epochs", "1"]
    assert rtradar(*words) == 0
    (tmp_path / name).write_text('{"recipe":')
    capsys.readouterr()
    assert rtradar("evaluate", tmp_path) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert name in error


@pytest.mark.parametrize("package", ["torch", "sklearn"])
def test_a_missing_extra_is_named(
    collection: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    package: str,
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *of: None if name == package else find(name, *of)
    )
    for name in [name for name in sys.modules if name.startswith("rtradar.classify")]:
        monkeypatch.delitem(sys.modules, name)
    for command in (["train", collection, "--out", tmp_path / "out"], ["evaluate", tmp_path]):
        assert rtradar(*command) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert "in a checkout: pip install -e '.[learn]'" in error
    assert not (tmp_path / "out").exists()


def test_the_help_of_train_has_the_defaults_of_the_recipes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert rtradar("train", "--help") == 0
    words = " ".join(capsys.readouterr().out.split())
    for text in (
        f"number of epochs (default: lean {LEAN.epochs}, paper {PAPER.epochs}, "
        f"the others {SMALL.epochs})",
        f"learning rate (default: lean {LEAN.rate:.0e}, paper {PAPER.rate:.0e})",
        f"the paper's (default: lean {LEAN.augmentation}, paper {PAPER.augmentation})",
    ):
        assert text.replace("e-0", "e-") in words
    points = f"lean and paper {LEAN.points}, small and edges {SMALL.points}, spectrogram 0"
    assert f"points of each cloud (default: {points})" in words
    for recipe in RECIPES.values():
        assert f"all by one (default: {recipe.scaling})" in words
