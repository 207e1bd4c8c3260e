"""What models say of themselves, and the lists that are derived from it."""

from __future__ import annotations

import inspect

import pytest

from rtradar.cli.parser import parser
from rtradar.scatter import MODELS, takes_backend
from rtradar.scatter.echo_models import affordable_models, models_that


def test_a_model_traces_if_it_takes_a_backend() -> None:
    assert models_that("traces") == [name for name in MODELS.built_in if takes_backend(name)]


def test_models_are_listed_cheapest_first() -> None:
    names = affordable_models(float("inf"))
    assert names == [name for name in MODELS.built_in if name != "auto"]
    costs = [MODELS[name].relative_cost for name in names]  # type: ignore[attr-defined]
    assert costs == sorted(costs)


def test_the_help_of_run_names_every_model(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parser().parse_args(["run", "--help"])
    words = " ".join(capsys.readouterr().out.split()).replace("- ", "-")
    listed = words.partition("--fidelity NAME echo model: ")[2].partition(" (default")[0]
    assert listed.split(", ") == list(MODELS.built_in)
    own = inspect.signature(MODELS["auto"]).parameters["tolerance_db"].default
    assert f"that the level auto accepts [dB] (default: {own:g})" in words
