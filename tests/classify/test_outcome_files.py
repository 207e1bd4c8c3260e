"""What came of a training, in a file that may be damaged, or a stranger's."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rtradar.classify.outcomes import HISTORY, Outcome, load_outcome, save_outcome
from rtradar.errors import InputError

EPOCH = dict.fromkeys(HISTORY, 0.5)
CLOUDS = 20_000


def example() -> Outcome:
    names = np.array(["a", "b"])
    return Outcome(
        "fold 1", "", np.array([3, 5]), np.array([0, 1]), np.array([0, 0]), names, names, [EPOCH],
        names, np.array([[0.75, 0.25], [1.0, 0.0]]),
    )  # fmt: skip


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    save_outcome(tmp_path / "outcome.json", example())
    assert load_outcome(tmp_path / "outcome.json").as_dict() == example().as_dict()


@pytest.mark.parametrize(
    "changes",
    [
        {"truth": [0.5, 1.0]},
        {"truth": [None, 1]},
        {"truth": [True, False]},
        {"truth": [0, 10**30]},
        {"truth": [[0], [1]]},
        {"truth": "01"},
        {"truth": []},
        {"predicted": [0]},
        {"predicted": [0, -1]},
        {"indices": [-1, 1]},
        {"recordings": [1, 2]},
        {"recordings": {"a": 1, "b": 2}},
        {"subjects": []},
        {"subjects": {}, "probabilities": {}},
        {"probabilities": []},
        {"probabilities": [[float("nan"), 0.5], [0.5, 0.5]]},
        {"probabilities": [[1.5, 0.5], [0.5, 0.5]]},
        {"name": 3},
        {"more": 1},
        {"history": {}},
        {"history": [[]]},
        {"history": [{"rate": 1.0}]},
        {"history": [{**EPOCH, "more": 1.0}]},
        {"history": [{**EPOCH, "seconds": "1"}]},
        {"history": [{**EPOCH, "seconds": 10**400}]},
        {"history": [{**EPOCH, "seconds": None}]},
    ],
    ids=repr,
)
def test_what_is_no_outcome_is_damaged(tmp_path: Path, changes: dict[str, Any]) -> None:
    (tmp_path / "outcome.json").write_text(json.dumps(example().as_dict() | changes))
    with pytest.raises(InputError, match="is damaged; remove it"):
        load_outcome(tmp_path / "outcome.json")


@pytest.mark.parametrize(
    "text", ["", "[]", "null", '{"name": "fold 1"', "[" * 10**5, "\xff", '{"truth": [0]}']
)
def test_what_is_no_json_of_ours_is_damaged(tmp_path: Path, text: str) -> None:
    (tmp_path / "outcome.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match="is damaged; remove it"):
        load_outcome(tmp_path / "outcome.json")


def test_one_long_name_takes_no_memory_for_all(tmp_path: Path) -> None:
    """NumPy would give each name the room of the longest: 8 GB here, for a file of 0.3 MB."""
    many = {name: [0] * CLOUDS for name in ("indices", "truth", "predicted")} | {
        "recordings": [""] * CLOUDS
    }
    changes = many | {"tested_on": ["x" * 100_000] + [""] * (CLOUDS - 1)}
    (tmp_path / "outcome.json").write_text(json.dumps(example().as_dict() | changes))
    with pytest.raises(InputError, match="is damaged; remove it"):
        load_outcome(tmp_path / "outcome.json")
