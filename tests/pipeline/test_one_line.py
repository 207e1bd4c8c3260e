"""A radar with antennas on one line reports no coordinate that it cannot measure, anywhere."""

from __future__ import annotations

import base64
import json
import pickle
import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure

import rtradar as rt
from rtradar.exchange import read_cloud
from rtradar.pipeline.output.view import load_run_view, view
from rtradar.system import figure_style

pytestmark = pytest.mark.drawn

LINES = {
    "y": {"tx_y": 2, "tx_z": 0, "rx_y": 4, "rx_z": 0},
    "z": {"tx_y": 0, "tx_z": 2, "rx_y": 0, "rx_z": 4},
}


@pytest.fixture(scope="module", params=LINES)
def made(
    request: pytest.FixtureRequest, small: rt.Radar, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Path, dict[str, Figure]]:
    """The line, the folder of a run, and the figures drawn for it by the names of their files."""
    figures: dict[str, Figure] = {}

    def save(figure: Figure, file: Path) -> None:
        # As it is now, for afterwards it is emptied.
        figures[file.name] = pickle.loads(pickle.dumps(figure))
        original(figure, file)

    out, original = tmp_path_factory.mktemp("made"), figure_style.write_png
    radar = replace(small, **LINES[request.param])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figure_style, "write_png", save)
        walk = rt.synthetic_motion("walk", seed=0, duration_s=0.2)
        rt.run(walk, radar, out=out, fidelity="analytic", pictures=True)
    return request.param, out, figures


def test_the_coordinate_across_the_line_is_nan(made: tuple[str, Path, dict[str, Figure]]) -> None:
    line, out, _ = made
    points = np.load(out / "cloud_xyz.npz")["points"]
    assert len(points) > 50
    across, along = (2, 1) if line == "y" else (1, 2)
    assert np.isnan(points[:, across]).all()
    assert np.isfinite(points[:, [0, along]]).all()
    # From the radar at (-4, 1, 1), the distance from the line and the place along it make the range
    # of a person 3 to 5 m away.
    ranges = np.hypot(points[:, 0] + 4, points[:, along] - 1)
    assert 3 < ranges.min() < ranges.max() < 6
    np.testing.assert_array_equal(read_cloud(out / "cloud_xyz.npz").values[:, :3], points)


def test_the_cloud_is_drawn_in_two_coordinates_and_says_what_is_missing(
    made: tuple[str, Path, dict[str, Figure]],
) -> None:
    line, _, figures = made
    view_, *others = figures["cloud_xyz.png"].axes
    assert [axes.get_label() for axes in others] == ["<colorbar>"]
    missing = {"y": "elevation", "z": "azimuth"}[line]
    assert (view_.get_xlabel(), view_.get_ylabel()) == (
        f"x [m], from the distance to the array's line\n({missing} is not measured)",
        f"{line} [m]",
    )
    assert np.isfinite(view_.collections[0].get_offsets()).all()


def test_azimuth_of_a_line_is_a_cone_angle(made: tuple[str, Path, dict[str, Figure]]) -> None:
    line, out, figures = made
    said = {"y": "Azimuth [°] (cone angle; elevation is not measured)", "z": "Elevation [°]"}[line]
    assert figures["range_angle.png"].axes[0].get_xlabel() == said
    with h5py.File(out / "maps.h5") as maps:
        assert ("azimuth" in maps, "elevation" in maps) == (line == "y", line == "z")
        if line == "y":
            assert "cone angle" in maps["azimuth"].attrs["long_name"]


def test_pages_show_what_is_measured(
    made: tuple[str, Path, dict[str, Figure]], tmp_path: Path
) -> None:
    line, out, _ = made
    view(out, page=tmp_path / "view.html", still=tmp_path / "still.png")
    assert load_run_view(out).spatial.measured.tolist() == [True, line == "y", line == "z"]
    for page in (out / "report.html", tmp_path / "view.html"):
        text = page.read_text(encoding="utf-8")
        found = re.search(r'id="report-data">(.*?)</script>', text)
        assert found
        spatial = json.loads(found[1])["spatial"]
        assert spatial["measured"] == [True, line == "y", line == "z"]
        shown = np.frombuffer(base64.b64decode(spatial["points"]), "<f4").reshape(-1, 3)
        np.testing.assert_array_equal(
            np.isnan(shown).all(axis=0), [False, line == "z", line == "y"]
        )
    angle = {"y": "elevation", "z": "azimuth"}[line]
    assert f"does not measure {angle}" in (out / "report.html").read_text(encoding="utf-8")
