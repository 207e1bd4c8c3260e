"""Cloud files: they read back, say what they hold, and are whole or not there."""

import numpy as np
import pytest

from rtradar.clouds import save_cloud_npz, save_ply
from rtradar.errors import InputError
from rtradar.system.files import atomic_file

POINTS = np.random.default_rng(0).normal(size=(40, 3))


@pytest.mark.parametrize("points", [POINTS, POINTS[:0]])
def test_npz_reads_back(tmp_path, points) -> None:
    path = tmp_path / "cloud.npz"
    save_cloud_npz(path, points)
    with np.load(path) as archive:
        np.testing.assert_array_equal(archive["points"], points)
        assert archive["points"].dtype == np.float64
        assert archive["axes"].tolist() == ["time", "range", "velocity"]
        assert archive["units"].tolist() == ["s", "m", "m/s"]


def test_npz_of_the_same_cloud_is_the_same_file(tmp_path) -> None:
    for name in ("a.npz", "b.npz"):
        save_cloud_npz(tmp_path / name, POINTS)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_failure_leaves_the_old_file_and_nothing_else(tmp_path) -> None:
    path = tmp_path / "cloud.npz"
    save_cloud_npz(path, POINTS)
    before = path.read_bytes()

    def fail_half_way() -> None:
        with atomic_file(path) as file:
            file.write(b"half")
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError):
        fail_half_way()
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["cloud.npz"]


def test_readable_as_other_files_are(tmp_path) -> None:
    (tmp_path / "plain").touch()
    save_ply(tmp_path / "cloud.ply", POINTS)
    assert (tmp_path / "cloud.ply").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize("save", [save_cloud_npz, save_ply])
def test_bad_input_is_refused(tmp_path, save) -> None:
    with pytest.raises(InputError, match="exists"):
        save(tmp_path / "missing" / "cloud", POINTS)
    with pytest.raises(InputError, match="cannot write"):
        save(tmp_path, POINTS)
    with pytest.raises(InputError, match="shape"):
        save(tmp_path / "cloud", POINTS[:, :2])
    with pytest.raises(InputError, match="NaN"):
        save(tmp_path / "cloud", np.full((1, 3), np.nan))
    assert list(tmp_path.iterdir()) == []
