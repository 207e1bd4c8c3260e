"""The output folder: all the files of a run, or none."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from rtradar import output_folder
from rtradar.errors import InputError
from rtradar.output_folder import all_or_nothing, settle


def fill(folder: Path, text: str) -> None:
    (folder / "maps").write_text(text)
    (folder / "store").mkdir()
    (folder / "store" / text).write_text(text)


def fill_and_fail(out: Path, error: BaseException | type[BaseException]) -> None:
    with all_or_nothing(out) as folder:
        fill(folder, "second")
        raise error


def contents(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_files_and_folders_of_the_same_name_are_replaced_and_others_left(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    with all_or_nothing(out) as folder:
        fill(folder, "first")
    (out / "mine").write_text("mine")
    with all_or_nothing(out) as folder:
        fill(folder, "second")
        assert (out / "maps").read_text() == "first"  # nothing moves before the end
    assert contents(out) == {"maps", "store", "store/second", "mine"}
    assert (out / "maps").read_text() == "second"


def test_pictures_that_the_new_run_does_not_make_go(tmp_path: Path) -> None:
    for name in ("plan.png", "learning-1.png", "learning-12.png", "learning-mine.png", "other.png"):
        (tmp_path / name).write_text("old")
    with all_or_nothing(tmp_path, ("plan.png", "learning-[0-9]*.png", "never.png")) as folder:
        (folder / "learning-1.png").write_text("new")
    assert contents(tmp_path) == {"learning-1.png", "learning-mine.png", "other.png"}
    assert (tmp_path / "learning-1.png").read_text() == "new"


def test_after_an_error_pictures_stay(tmp_path: Path) -> None:
    (tmp_path / "plan.png").touch()
    with pytest.raises(ValueError, match="no"), all_or_nothing(tmp_path, ("plan.png",)):
        raise ValueError("no")
    assert contents(tmp_path) == {"plan.png"}


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, MemoryError])
def test_after_an_error_all_is_as_before(tmp_path: Path, error: type[BaseException]) -> None:
    out = tmp_path / "out"
    with all_or_nothing(out) as folder:
        fill(folder, "first")
    with pytest.raises(error):
        fill_and_fail(out, error)
    assert contents(out) == {"maps", "store", "store/first"}


FULL = "Can't decrement id ref count (file write failed: time = now, errno = 28, error message = 'No space left on device')"


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), RuntimeError(FULL)])  # as of HDF5
def test_a_full_disk_is_said_in_one_line(tmp_path: Path, error: Exception) -> None:
    with pytest.raises(InputError, match=r"cannot write to '.*out': No space left on device; .*--out"):
        fill_and_fail(tmp_path / "out", error)
    assert contents(tmp_path) == set()


def test_other_errors_are_not_taken_for_a_full_disk(tmp_path: Path) -> None:
    for error in (FileNotFoundError(errno.ENOENT, "No such file", "x"), OSError("what"), RuntimeError("errno = 2")):
        with pytest.raises(type(error)) as caught, all_or_nothing(tmp_path / "out"):
            raise error
        assert caught.value is error


def test_folders_that_were_made_go_again_and_others_stay(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    with pytest.raises(MemoryError):
        fill_and_fail(tmp_path / "there" / "new" / "out", MemoryError)
    assert contents(tmp_path) == {"there"}


def test_a_file_in_the_way_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match=r"cannot write to .*file.*--out"), all_or_nothing(tmp_path / "file" / "out"):
        pass
    assert contents(tmp_path) == {"file"}


def test_a_name_that_cannot_be_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot write to .*too long.*--out"), all_or_nothing(tmp_path / ("x" * 300)):
        pass


@pytest.mark.parametrize("kind", ["file", "link"])
def test_a_folder_takes_the_place_of_whatever_has_its_name(tmp_path: Path, kind: str) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    for folder in (out, elsewhere):
        folder.mkdir()
    if kind == "file":
        (out / "store").write_text("mine")
    else:
        (out / "store").symlink_to(elsewhere)
        (elsewhere / "mine").write_text("mine")
    with all_or_nothing(out) as folder:
        fill(folder, "second")
    assert contents(out) == {"maps", "store", "store/second"}
    assert contents(elsewhere) == (set() if kind == "file" else {"mine"})  # what a link names is not ours to take away


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX locks")
@pytest.mark.parametrize("swept", ["before", "while"])
def test_a_folder_that_another_command_sweeps_as_it_is_made_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, swept: str
) -> None:
    real = tempfile.mkdtemp
    others: list[int | None] = []

    def made(**named: str) -> str:
        name = real(**named)
        if not others:
            others.append(output_folder._lock(Path(name)))
            if swept == "before":
                os.rmdir(name)
        return name

    monkeypatch.setattr(tempfile, "mkdtemp", made)
    with all_or_nothing(tmp_path) as folder:
        (folder / "maps").write_text("new")
    output_folder._let_go(others[0])
    settle(tmp_path)
    assert contents(tmp_path) == {"maps"}


SLOW = """
import os, pathlib, sys, time
from rtradar.output_folder import all_or_nothing
out = pathlib.Path(sys.argv[1])
real = os.replace
def slowly(*places):
    real(*places)
    print("moved", flush=True)
    time.sleep(0.5)
os.replace = slowly
with all_or_nothing(out) as folder:
    for name in ("clouds", "maps", "plan.png"):
        (folder / name).write_text("first")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX locks")
def test_two_processes_that_end_at_once_leave_what_is_of_one(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", SLOW, str(tmp_path)], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        with all_or_nothing(tmp_path, ("plan*.png",)) as folder:
            for name in ("clouds", "maps"):
                (folder / name).write_text("second")
            assert other.stdout.readline() == "moved\n"
    assert other.returncode == 0
    assert [(tmp_path / name).read_text() for name in ("clouds", "maps")] == ["second", "second"]
    assert contents(tmp_path) == {"clouds", "maps"}


KILLED = """
import os, pathlib, sys
out, last = pathlib.Path(sys.argv[1]), int(sys.argv[2])
from rtradar.output_folder import all_or_nothing
calls = 0
def killed_at(real):
    def move(*places, **named):
        global calls
        if calls == last:
            os._exit(9)
        calls += 1
        return real(*places, **named)
    return move
os.rename, os.replace, os.rmdir = killed_at(os.rename), killed_at(os.replace), killed_at(os.rmdir)
with all_or_nothing(out, ("plan*.png",)) as folder:
    for name in ("clouds", "maps"):
        (folder / name).write_text("second")
    for name in ("new", "store"):
        (folder / name).mkdir()
        (folder / name / "second").write_text("second")
print("whole")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX locks")
def test_a_process_killed_at_any_move_leaves_all_of_the_old_or_all_of_the_new_to_whoever_comes_next(tmp_path: Path) -> None:
    ends = []
    for last in range(20):
        out = tmp_path / str(last)
        with all_or_nothing(out) as folder:
            fill(folder, "first")
            (folder / "plan.png").touch()
        done = subprocess.run([sys.executable, "-c", KILLED, str(out), str(last)], stdout=subprocess.PIPE, text=True, check=False)
        settle(out)
        ends.append((out / "maps").read_text())
        if ends[-1] == "first":
            assert contents(out) == {"maps", "plan.png", "store", "store/first"}
        else:
            assert contents(out) == {"clouds", "maps", "new", "new/second", "store", "store/second"}
            assert (out / "clouds").read_text() == "second"
        if done.stdout:
            break
    assert done.returncode == 0
    # The folder takes its new name; a picture goes, and four things move, one over an old folder; it takes its name back; its
    # folders are removed.
    assert ends[0] == "first"
    assert ends.count("second") > 7


def test_a_folder_in_use_is_let_be(tmp_path: Path) -> None:
    with all_or_nothing(tmp_path) as folder:
        (folder / "maps").write_text("new")
        settle(tmp_path)
        assert (folder / "maps").exists()
    assert contents(tmp_path) == {"maps"}


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match="cannot write to"), all_or_nothing(tmp_path / "out"):
            pass
    finally:
        tmp_path.chmod(0o700)
