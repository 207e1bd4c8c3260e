"""The texts of the paper's items: nothing of the paper is missing, no figure is typed twice."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from rtradar.paper.items import TEXTS, Sources, find_recordings, load_items
from rtradar.paper.learning import SIZES, learning_figures, stored_result

NUMBERED = {"figure": 16, "table": 4, "equation": 19}


def test_every_figure_table_and_equation_of_the_paper_is_an_item() -> None:
    wanted = {f"{kind}-{n}" for kind, last in NUMBERED.items() for n in range(1, last + 1)}
    ids = [item.id for item in load_items()]
    assert wanted <= set(ids)
    assert len(set(ids)) == len(ids)
    for kind in NUMBERED:
        numbers = [int(name.split("-")[1]) for name in ids if name.startswith(kind)]
        assert numbers == sorted(numbers), "not in the order of the paper"


@pytest.mark.parametrize("item", load_items(), ids=lambda item: item.id)
def test_every_item_says_all_four_things(item: object) -> None:
    for name in TEXTS:
        text = getattr(item, name)
        assert text.strip()
        assert "  " not in text
        assert text[-1] in ".%"


def test_the_page_of_the_paper_has_the_figures_of_the_stored_result() -> None:
    page = (Path(__file__).parents[2] / "docs" / "classification.md").read_text(encoding="utf-8")
    row = next(line for line in page.splitlines() if line.startswith("| the paper's settings |"))
    shown = [float(re.findall(r"\d+\.\d", cell)[0]) for cell in row.split("|")[2:-1]]
    assert shown == [stored_result()["ours"][size]["mean"] for size in SIZES]


def test_table_4_is_that_of_the_evaluation(tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="the classifier needs the extra learn")
    from rtradar.classify.outcomes import TABLE_4

    assert {int(size): tuple(each) for size, each in stored_result()["paper"].items()} == TABLE_4


def test_table_4_beside_ours_has_its_mean_and_where_it_is_from(tmp_path: Path) -> None:
    found = learning_figures(Sources(tmp_path, quick=True, full=False, recordings={}))
    assert "1000: 90.0 ± 4.7" in found["table4_paper"]
    assert "1000: 69.0 ± 9.3" in found["table4_ours"]
    assert stored_result()["commit"] in found["origin"]
    assert (tmp_path / "table-4.png").is_file()
    json.dumps(found, allow_nan=False)


def test_recordings_of_the_paper_come_before_others(tmp_path: Path) -> None:
    for name in ("HDM_bd_kickLFront1Reps_001_120", "HDM_dg_kickLSide2Reps_001_120"):
        (tmp_path / f"{name}.amc").touch()
    found = find_recordings(tmp_path)
    assert {key: path.stem for key, path in found.items()} == {
        "kick": "HDM_dg_kickLSide2Reps_001_120"
    }
