"""The output folder: all the files of a command or none, and nothing of anybody else's."""

from __future__ import annotations

import errno
import json
import os
import shutil
import socket
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rtradar.errors import InputError
from rtradar.system.directory import Directory
from rtradar.system.output_folder import OutputFiles, atomic_folder, check_whole, new_folder

KIND = OutputFiles(
    "list.json",
    r"list\.json|maps|clouds|plan\.png|learning-\d+\.png|store\.zarr/(zarr\.json|c/\d+)",
    r"store\.zarr(/c)?",
)

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="links, locks and permissions of POSIX")


def fill(folder: Path, text: str, *more: str) -> None:
    """What a command would make: two files, a store of two, the list, and more."""
    (folder / "maps").write_text(text)
    (folder / "store.zarr" / "c").mkdir(parents=True)
    (folder / "store.zarr" / "zarr.json").write_text(text)
    (folder / "store.zarr" / "c" / ("1" if text == "first" else "2")).write_text(text)
    for name in more:
        (folder / name).write_text(text)
    finish(folder)


def finish(folder: Path) -> None:
    (folder / "list.json").write_text(json.dumps({"files": KIND.list_of(folder)}))


def make(out: Path, text: str, *more: str, **options: Any) -> None:
    with atomic_folder(out, KIND, **options) as folder:
        fill(folder, text, *more)


def contents(folder: Path) -> dict[str, str]:
    """Every file, link and special file below, and what is in it."""
    found = {}
    for path in folder.rglob("*"):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = f"-> {os.readlink(path)}"
        elif not path.is_dir():
            found[name] = path.read_text() if path.is_file() else "special"
    return found


def made(text: str, *more: str) -> dict[str, str]:
    """What `contents` finds where `make` went well, but for the list."""
    names = ["maps", "store.zarr/zarr.json", f"store.zarr/c/{1 if text == 'first' else 2}", *more]
    return dict.fromkeys(names, text)


def unlisted(folder: Path) -> dict[str, str]:
    return {name: text for name, text in contents(folder).items() if name != "list.json"}


def test_files_of_an_earlier_run_are_replaced_or_removed_and_others_left(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    make(out, "first", "plan.png", "learning-12.png")
    (out / "mine").write_text("mine")
    (out / "store.zarr" / "notes").write_text("mine")
    with atomic_folder(out, KIND) as folder:
        fill(folder, "second", "learning-1.png")
        assert (out / "maps").read_text() == "first"  # nothing moves before the end
    assert unlisted(out) == made("second", "learning-1.png") | {
        "mine": "mine",
        "store.zarr/notes": "mine",
    }
    files = json.loads((out / "list.json").read_text())["files"]
    assert files == ["learning-1.png", "list.json", "maps", "store.zarr/"]


def test_a_store_that_the_new_run_has_not_goes_with_its_folders(tmp_path: Path) -> None:
    make(tmp_path, "first")
    with atomic_folder(tmp_path, KIND) as folder:
        (folder / "maps").write_text("second")
        finish(folder)
    assert unlisted(tmp_path) == {"maps": "second"}
    assert not (tmp_path / "store.zarr").exists()


# -- what is somebody else's -----------------------------------------------------------------------


def link_to_folder(path: Path) -> None:
    elsewhere = path.parent.parent / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "mine").write_text("mine")
    path.symlink_to(elsewhere)


def link_to_file(path: Path) -> None:
    (path.parent.parent / "mine").write_text("mine")
    path.symlink_to("../mine")


def bind(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        here = Path.cwd()
        os.chdir(path.parent)  # such a path has at most 107 bytes
        try:
            one.bind(path.name)
        finally:
            os.chdir(here)


def device(path: Path) -> None:
    try:
        os.mknod(path, 0o600 | stat.S_IFCHR, os.makedev(1, 5))  # /dev/zero, which never ends
    except PermissionError:
        pytest.skip("only root makes devices")


FOREIGN: dict[str, Callable[[Path], object]] = {
    "file": lambda path: path.write_text("mine"),
    "folder": lambda path: path.mkdir() or (path / "mine").write_text("mine"),  # type: ignore[func-returns-value]
    "link to a file": link_to_file,
    "link to a folder": link_to_folder,
    "dangling link": lambda path: path.symlink_to("nowhere"),
    "pipe": os.mkfifo,
    "socket": bind,
    "device": device,
}


@POSIX
@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("kind", FOREIGN)
@pytest.mark.parametrize("name", ["maps", "plan.png", "list.json", "store.zarr/c/0"])
def test_what_no_list_names_is_refused_before_any_work(
    tmp_path: Path, name: str, kind: str, overwrite: bool
) -> None:
    out = tmp_path / "out"
    (out / name).parent.mkdir(parents=True)
    FOREIGN[kind](out / name)
    before = contents(tmp_path)
    if overwrite and kind in ("file", "link to a file", "link to a folder", "dangling link"):
        make(out, "first", overwrite=True)
        after = contents(tmp_path)
        new = {f"out/{own}": text for own, text in made("first").items()}
        # Replaced, or left where the new files have no such name.
        assert after.items() >= new.items()
        replaced = {f"out/{name}"} & {*new, "out/list.json"}
        kept = {own: text for own, text in before.items() if own not in replaced}
        assert after.items() >= kept.items()
        return
    with pytest.raises(InputError) as caught, atomic_folder(out, KIND, overwrite=overwrite):
        pytest.fail("the work has begun")
    assert name in str(caught.value)
    assert ("is no file; move it away" if overwrite else "--overwrite") in str(caught.value)
    assert contents(tmp_path) == before


@POSIX
@pytest.mark.parametrize(
    "told",
    [
        '{"files": ["../mine", "/etc/passwd", "*", "mine", "elsewhere/", "../", "list.json"]}',
        '{"files": ["maps"]}',  # a list that does not name itself is none
        '{"files": {"maps": 1, "list.json": 2}}',
        '{"files": "maps list.json"}',
        '{"files": [["maps"], 3, null, "list.json"]}',
        '{"unfinished": "../elsewhere", "files": ["list.json", "elsewhere/mine"]}',
        "[" * 200_000,
        '"maps"',
        "not JSON",
    ],
)
def test_a_list_of_anybody_gives_nothing_away(tmp_path: Path, told: str) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    for folder in (out, elsewhere, out / "elsewhere"):
        folder.mkdir()
        (folder / "mine").write_text("mine")
    (out / "maps").write_text("mine")
    (out / "list.json").write_text(told)
    before = contents(tmp_path)
    with pytest.raises(InputError, match=r"'list\.json'|'maps'"):
        make(out, "first")
    assert contents(tmp_path) == before


@POSIX
@pytest.mark.parametrize(
    "how",
    ["unmarked", "marked for another", "link", "of notes", "marker is a link", "marker is a pipe"],
)
def test_a_work_folder_that_is_none_stays(tmp_path: Path, how: str) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    for folder in (out, elsewhere):
        folder.mkdir()
    (elsewhere / "mine").write_text("mine")
    looks = out / (".rtradar-notes" if how == "of notes" else ".rtradar-0123456789abcdef")
    if how == "link":
        (elsewhere / ".made-by-rtradar").write_text(str(elsewhere.stat().st_ino))
        looks.symlink_to(elsewhere)
    else:
        looks.mkdir()
        (looks / "mine").write_text("mine")
        number = str(looks.stat().st_ino)
        marker = looks / ".made-by-rtradar"
        if how == "marked for another":
            marker.write_text(str(elsewhere.stat().st_ino))
        elif how == "of notes":
            marker.write_text(number)
        elif how == "marker is a link":
            (tmp_path / "number").write_text(number)
            marker.symlink_to(tmp_path / "number")
        elif how == "marker is a pipe":
            os.mkfifo(marker)
    before = contents(tmp_path)
    make(out, "first")
    assert contents(tmp_path).items() >= before.items()


@POSIX
def test_hard_links_keep_what_they_hold(tmp_path: Path) -> None:
    out = tmp_path / "out"
    make(out, "first")
    for name in ("maps", "list.json", "store.zarr/zarr.json"):
        os.link(out / name, tmp_path / name.replace("/", "-"))
    make(out, "second")
    links = ("maps", "store.zarr-zarr.json")
    assert [(tmp_path / name).read_text() for name in links] == ["first", "first"]
    assert "store.zarr/" in (tmp_path / "list.json").read_text()


def test_a_twin_is_refused_where_capitals_do_not_tell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on macOS and Windows: there ``maps`` leads to a file that is listed as ``Maps``."""
    (tmp_path / "Maps").write_text("mine")
    real = Directory.mode

    def mode(self: Directory, name: str) -> int:
        return real(self, next((own for own in self.names() if own.lower() == name.lower()), name))

    monkeypatch.setattr(Directory, "mode", mode)
    with pytest.raises(InputError, match="Maps"):
        make(tmp_path, "first")
    assert contents(tmp_path) == {"Maps": "mine"}


# -- races -----------------------------------------------------------------------------------------


@POSIX
@pytest.mark.parametrize("when", ["before the moves", "while a file moves"])
def test_a_folder_that_becomes_a_link_is_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    """Somebody puts a link in place of the store between two looks at it."""
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    make(out, "first")
    (elsewhere / "c").mkdir(parents=True)
    for name in ("zarr.json", "c/1", "c/2"):
        (elsewhere / name).write_text("mine")
    real = Directory.move

    def move(self: Directory, name: str, target: Directory, new: str) -> None:
        if (
            new == ("list.json" if when == "before the moves" else "maps")
            and not (out / "store.zarr").is_symlink()
        ):
            os.rename(out / "store.zarr", tmp_path / "was")
            (out / "store.zarr").symlink_to(elsewhere)
        real(self, name, target, new)

    monkeypatch.setattr(Directory, "move", move)
    with pytest.raises(InputError, match="cannot move the files"):
        make(out, "second")
    assert contents(elsewhere) == dict.fromkeys(("zarr.json", "c/1", "c/2"), "mine")


@POSIX
@pytest.mark.parametrize("left", [["moved", "out"], []])
def test_an_output_folder_that_is_renamed_or_vanishes_is_told(
    tmp_path: Path, left: list[str]
) -> None:
    def disturbed(out: Path) -> None:
        with atomic_folder(out, KIND) as folder:
            if left:
                (tmp_path / "decoy").mkdir()
                out.rename(tmp_path / "moved")
                (tmp_path / "decoy").rename(out)
            else:
                shutil.rmtree(out)
            fill(folder, "first")

    with pytest.raises(InputError, match="was renamed, moved or removed while"):
        disturbed(tmp_path / "out")
    # No work folder is left in it.
    assert sorted(path.name for path in tmp_path.rglob("*")) == left


# -- disks and permissions -------------------------------------------------------------------------


def test_a_full_disk_is_said_in_one_line(tmp_path: Path) -> None:
    said = r"cannot write to '.*out': No space left on device; .*--out"
    with pytest.raises(InputError, match=said):
        raise_in(tmp_path / "out", OSError(errno.ENOSPC, "No space left on device"))
    assert contents(tmp_path) == {}
    assert not (tmp_path / "out").exists()


def raise_in(out: Path, error: BaseException | type[BaseException]) -> None:
    with atomic_folder(out, KIND) as folder:
        fill(folder, "second")
        raise error


def test_other_errors_are_not_taken_for_a_full_disk(tmp_path: Path) -> None:
    missing = FileNotFoundError(errno.ENOENT, "No such file", "x")
    for error in (missing, OSError("what"), RuntimeError("errno = 2")):
        with pytest.raises(type(error)) as caught:
            raise_in(tmp_path / "out", error)
        assert caught.value is error


def test_folders_that_were_made_go_again_and_others_stay(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    with pytest.raises(MemoryError):
        raise_in(tmp_path / "there" / "new" / "out", MemoryError)
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


@pytest.mark.parametrize(("name", "says"), [("file/out", "file"), ("x" * 300, "too long")])
def test_a_place_where_no_folder_can_be_is_refused(tmp_path: Path, name: str, says: str) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match=rf"cannot write to .*{says}.*--out"):
        make(tmp_path / name, "first")
    assert contents(tmp_path) == {"file": "mine"}


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere"
)
def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match="cannot write to"):
            make(tmp_path / "out", "first")
    finally:
        tmp_path.chmod(0o700)


@pytest.mark.parametrize("forgotten", ["list.json", "unforeseen"])
def test_a_command_whose_files_are_not_foreseen_is_a_mistake_of_ours(
    tmp_path: Path, forgotten: str
) -> None:
    def forget() -> None:
        with atomic_folder(tmp_path, KIND) as folder:
            fill(folder, "first")
            change = Path.unlink if forgotten == "list.json" else Path.touch
            change(folder / forgotten)

    with pytest.raises(AssertionError, match=forgotten):
        forget()
    assert contents(tmp_path) == {}


# -- other processes -------------------------------------------------------------------------------

SLOW = """
import json, pathlib, sys, time
from rtradar.system.directory import Directory
from rtradar.system.output_folder import atomic_folder
from tests_kind import KIND
out = pathlib.Path(sys.argv[1])
real = Directory.move
def slowly(*places):
    real(*places)
    print("moved", flush=True)
    time.sleep(0.3)
Directory.move = slowly
with atomic_folder(out, KIND) as folder:
    for name in ("clouds", "maps", "plan.png"):
        (folder / name).write_text("first")
    (folder / "list.json").write_text(json.dumps({"files": KIND.list_of(folder)}))
"""
KIND_FILE = f"from rtradar.system.output_folder import OutputFiles\nKIND = {KIND!r}\n"


def command(tmp_path: Path, text: str, *words: str) -> tuple[list[str], dict[str, str]]:
    (tmp_path / "code").mkdir(exist_ok=True)
    (tmp_path / "code" / "tests_kind.py").write_text(KIND_FILE)
    return [sys.executable, "-c", text, *words], os.environ | {
        "PYTHONPATH": str(tmp_path / "code"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }


@pytest.mark.slow
@POSIX
def test_two_processes_that_end_at_once_leave_what_is_of_one(tmp_path: Path) -> None:
    out = tmp_path / "out"
    words, environment = command(tmp_path, SLOW, str(out))
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment) as other:
        assert other.stdout is not None
        while not out.exists():
            assert other.poll() is None
        with atomic_folder(out, KIND) as folder:
            for name in ("clouds", "maps"):
                (folder / name).write_text("second")
            finish(folder)
            assert other.stdout.readline() == "moved\n"
    assert other.returncode == 0
    assert unlisted(out) == {"clouds": "second", "maps": "second"}


KILLED = """
import json, os, pathlib, sys
from rtradar.system.output_folder import atomic_folder
from tests_kind import KIND
def killed_at(last, real):
    def call(*places, **named):
        global calls
        if calls == last:
            os._exit(9)
        calls += 1
        return real(*places, **named)
    return call
for last in range(int(sys.argv[2])):
    if (child := os.fork()):
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
        continue
    calls = 0
    for name in ("rename", "replace", "rmdir", "unlink", "mkdir"):
        setattr(os, name, killed_at(last, getattr(os, name)))
    with atomic_folder(pathlib.Path(sys.argv[1]) / str(last), KIND) as folder:
        for name in ("clouds", "maps"):
            (folder / name).write_text("second")
        (folder / "store.zarr" / "c").mkdir(parents=True)
        (folder / "store.zarr" / "c" / "2").write_text("second")
        (folder / "list.json").write_text(json.dumps({"files": KIND.list_of(folder)}))
    os._exit(0)
"""


@POSIX
def test_a_process_killed_anywhere_leaves_all_of_the_old_or_all_of_the_new_or_a_folder_that_says_so(
    tmp_path: Path,
) -> None:
    count, ends = 30, []
    for last in range(count):
        make(tmp_path / str(last), "first", "plan.png")
        (tmp_path / str(last) / "mine").write_text("mine")
    words, environment = command(tmp_path, KILLED, str(tmp_path), str(count))
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True, env=environment)
    status = [int(word) for word in done.stdout.split()]
    for last in range(status.index(0) + 1):
        out = tmp_path / str(last)
        killed = contents(out)
        if "unfinished" in json.loads((out / "list.json").read_text()):
            ends.append("says so")
            with pytest.raises(InputError, match="holds files of two runs"):
                check_whole(out, "list.json")
        else:
            check_whole(out, "list.json")
            shown = {name: text for name, text in unlisted(out).items() if not name.startswith(".")}
            ends.append("old" if shown == made("first", "plan.png") | {"mine": "mine"} else "new")
            if ends[-1] == "new":
                new = dict.fromkeys(("clouds", "maps", "store.zarr/c/2"), "second")
                assert shown == new | {"mine": "mine"}
        assert contents(out) == killed  # who reads it changes nothing
        with atomic_folder(out, KIND) as folder:
            (folder / "maps").write_text("third")
            finish(folder)
        # What the killed one had still to move is gone, too.
        assert unlisted(out) == {"maps": "third", "mine": "mine"}
        make(out, "second")
        assert unlisted(out) == made("second") | {"mine": "mine"}
    assert set(status) == {0, 9}
    assert ends == sorted(ends, key=["old", "says so", "new"].index)
    assert min(ends.count("old"), ends.count("new")) >= 2
    assert ends.count("says so") >= 7  # seven files move or go


@POSIX
def test_a_folder_in_use_is_let_be(tmp_path: Path) -> None:
    with atomic_folder(tmp_path, KIND) as folder:
        fill(folder, "first")
        make(tmp_path, "second")
        assert (folder / "maps").read_text() == "first"
    assert unlisted(tmp_path) == made("first")


def test_a_new_folder_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    def fail(folder: Path) -> None:
        (folder / "half").write_text("half")
        raise ZeroDivisionError

    out = tmp_path / "out"
    with pytest.raises(ZeroDivisionError), new_folder(out) as folder:
        fail(folder)
    assert not list(tmp_path.iterdir())
    with new_folder(out) as folder:
        (folder / "maps").write_text("first")
        assert not out.exists()
    assert contents(tmp_path) == {"out/maps": "first"}
    with pytest.raises(InputError, match="was made meanwhile"), new_folder(out) as folder:
        (folder / "maps").write_text("second")
    assert contents(tmp_path) == {"out/maps": "first"}


@POSIX
def test_what_a_killed_maker_of_a_new_folder_left_goes_and_a_living_one_s_stays(
    tmp_path: Path,
) -> None:
    code = """
import os, sys
from pathlib import Path
from rtradar.system.output_folder import new_folder
with new_folder(Path(sys.argv[1])) as folder:
    (folder / "half").write_text("half")
    os.kill(os.getpid(), 9)
"""
    killed = subprocess.run([sys.executable, "-c", code, tmp_path / "killed"], check=False)
    assert killed.returncode == -9
    (left,) = tmp_path.iterdir()
    with new_folder(tmp_path / "one") as one:
        assert not left.exists()
        with new_folder(tmp_path / "two"):
            assert one.exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one", "two"]
