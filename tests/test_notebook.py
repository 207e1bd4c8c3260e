"""The notebook of the pages: it is stored without outputs, and every cell runs."""

from __future__ import annotations

import base64
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

nbformat = pytest.importorskip("nbformat")

NOTEBOOK = Path(__file__).parents[1] / "docs" / "notebook.ipynb"


@pytest.fixture(scope="module")
def stored() -> Any:
    return nbformat.read(NOTEBOOK, as_version=4)


@pytest.fixture(scope="module")
def outputs(stored: Any, tmp_path_factory: pytest.TempPathFactory) -> list[list[dict[str, Any]]]:
    """What each cell of code shows."""
    from nbclient import NotebookClient

    notebook = nbformat.from_dict(stored)
    folder = {"metadata": {"path": str(tmp_path_factory.mktemp("notebook"))}}
    NotebookClient(notebook, timeout=600, resources=folder).execute()
    return [cell.outputs for cell in notebook.cells if cell.cell_type == "code"]


def pictures(shown: list[dict[str, Any]]) -> list[Image.Image]:
    drawn = [
        data["image/png"] for output in shown if "image/png" in (data := output.get("data", {}))
    ]
    return [Image.open(BytesIO(base64.b64decode(one))).convert("RGB") for one in drawn]


def test_it_has_ten_cells_and_no_outputs(stored: Any) -> None:
    code = [cell for cell in stored.cells if cell.cell_type == "code"]
    assert len(code) == 10
    assert not any(cell.outputs for cell in code)


@pytest.mark.slow
def test_nothing_is_printed_to_stderr(outputs: list[list[dict[str, Any]]]) -> None:
    told = [one["text"] for shown in outputs for one in shown if one.get("name") == "stderr"]
    assert not told


@pytest.mark.slow
@pytest.mark.parametrize("cell", [0, 1, 2, 3, 5, 6, 8])
def test_a_cell_shows_a_card(outputs: list[list[dict[str, Any]]], cell: int) -> None:
    assert any("text/html" in output.get("data", {}) for output in outputs[cell])


@pytest.mark.slow
@pytest.mark.parametrize(("cell", "count"), [(1, 1), (2, 1), (7, 3)])
def test_a_cell_draws(outputs: list[list[dict[str, Any]]], cell: int, count: int) -> None:
    drawn = pictures(outputs[cell])
    assert len(drawn) == count
    for picture in drawn:
        assert (np.ptp(np.asarray(picture, dtype=int), axis=-1) > 40).mean() > 1 / 500


@pytest.mark.slow
def test_the_network_learns(outputs: list[list[dict[str, Any]]]) -> None:
    lines = "".join(one["text"] for one in outputs[9]).splitlines()
    losses = [float(line.split()[-1]) for line in lines]
    assert losses[-1] < 0.7 * losses[0]
