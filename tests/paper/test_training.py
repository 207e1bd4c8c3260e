"""`rtradar paper --full`, whose trainings take a day: the same steps, of a few clouds."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from rtradar.classify import study
from rtradar.classify.recipes import LEAN, PAPER
from rtradar.paper import learning, training
from rtradar.paper.items import Sources
from rtradar.paper.learning import learning_figures

pytest.importorskip("dask")

SIZES = ("500", "1000")
RADAR = 'name = "two by two"\ntx_y = 1\ntx_z = 1\nrx_y = 2\nrx_z = 2\nidle_s = 312.5e-6\n'
SPEC = 'seed = 0\n[windows]\nduration_s = 0.4\n[each]\nradar = ["radar.toml"]\n'
SPEC += 'scene = ["free-space"]\nfidelity = ["analytic"]\n'
ACTIVITIES = ("walk", "kick", "punch", "jumping_jack")


@pytest.mark.slow
def test_all_trainings_are_done_once_and_fill_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "paper_400.toml").write_text(
        SPEC + "".join(f'[[synthetic]]\nlabel = "{one}"\ncount = 4\n' for one in ACTIVITIES)
    )
    (tmp_path / "radar.toml").write_text(RADAR)
    monkeypatch.setattr(training, "validation_folder", lambda: tmp_path)
    monkeypatch.setattr(training, "train_study", partial(study.train_study, folds=2))
    # The rate is halved after every epoch, so that the trainings of the table end after two.
    short = PAPER.changed(epochs=70, rate=2e-6, step_epochs=1, batch=8, points=16)
    monkeypatch.setattr(training, "PAPER", short)
    monkeypatch.setattr(training, "LEAN", LEAN.changed(epochs=2))
    trial = short.changed(rate=1e-6, epochs=2, stop_below=0.0)
    monkeypatch.setattr(training, "_FIRST_TRIAL", trial)
    for module in (learning, training):
        monkeypatch.setattr(module, "SIZES", SIZES)
    sources = Sources(tmp_path, quick=True, full=True, recordings={})
    found = learning_figures(sources)
    stored = learning_figures(Sources(tmp_path, quick=True, full=False, recordings={}))
    assert found.keys() == stored.keys()
    assert "this run" in found["origin"]
    assert found["first_trial_epochs"] == 2
    assert 0 <= found["all_epochs_test_last"] <= 100
    assert found["best_clouds"] == 8  # one of two folds of 16
    assert "in 16 answers each (this run)" in found["spatial"]
    # A second command finds all trainings done.
    monkeypatch.setattr(study.training, "train_network", None)
    assert learning_figures(sources) == found
