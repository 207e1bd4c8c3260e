"""Whatever is in an output folder, and wherever a command is killed, only our files change."""

from __future__ import annotations

import json
import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtradar.errors import InputError
from rtradar.system.output_folder import OutputFiles, atomic_folder

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="links and pipes of POSIX")

KIND = OutputFiles(
    "list.json", r"list\.json|maps|plan\.png|store\.zarr/(zarr\.json|c/\d+)", r"store\.zarr(/c)?"
)
OWN = ["maps", "plan.png", "list.json", "store.zarr"]
OWN += ["store.zarr/zarr.json", "store.zarr/c", "store.zarr/c/0", "store.zarr/c/1"]
NEAR = ["Maps", "maps\n", " maps", "PLAN.PNG", "maps.h5", "store.zarr/mine", "store.zarr/c/x"]
NEAR += [".rtradar-0123456789abcdef", ".rtradar-notes"]
LINKS = ["link to a file", "link to a folder", "link within", "dangling", "hard link"]
KINDS = ["file", "folder", *LINKS, "pipe"]

letters = st.characters(exclude_characters="/\0", exclude_categories=["Cs"])
any_name = st.text(letters, min_size=1, max_size=12).filter(lambda name: name not in (".", ".."))
names = st.one_of(st.sampled_from(OWN), st.sampled_from(NEAR), any_name)
trees = st.dictionaries(names, st.sampled_from(KINDS), max_size=8)
listed_names = st.sampled_from([*OWN, *NEAR, "../outside/thesis", "store.zarr/", "../", "/"])
lists = st.one_of(
    st.none(),
    st.lists(listed_names, max_size=8).map(
        lambda files: json.dumps({"files": [*files, "list.json"]})
    ),
    st.sampled_from(["[]", "{", '{"files": 3}']),
    st.just('{"unfinished": ".rtradar-0123456789abcdef", "files": ["list.json", "maps"]}'),
)

Status = tuple[int, int, object]


def snapshot(folder: Path) -> dict[str, Status]:
    """What is below a folder: type and permissions, number in the file system, content."""
    found: dict[str, Status] = {}
    for parent, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(parent, name)
            status = path.lstat()
            content: object = None
            if path.is_symlink():
                content = os.readlink(path)
            elif stat.S_ISREG(status.st_mode):
                content = path.read_bytes()
            found[str(path.relative_to(folder))] = (status.st_mode, status.st_ino, content)
    return found


def plant(out: Path, outside: Path, tree: dict[str, str]) -> None:
    """Make the entries that can be made: not below a file, nor twice."""
    for number, (name, kind) in enumerate(sorted(tree.items())):
        path = out / name
        try:
            path.parent.mkdir(exist_ok=True)
            if kind == "file":
                path.touch(exist_ok=False)
                path.write_text("mine")
            elif kind == "folder":
                path.mkdir()
                (path / "mine").write_text("mine")
            elif kind == "hard link":
                os.link(outside / "thesis", path)
            elif kind == "pipe":
                os.mkfifo(path)
            else:
                targets = {
                    "link to a file": "../outside/thesis",
                    "link to a folder": "../outside",
                    "link within": "maps",
                }
                path.symlink_to(targets.get(kind, f"nowhere-{number}"))
        except OSError:
            continue


class Killed(BaseException):
    """Stands for SIGKILL: nothing is done after it, no clearing up either."""


CALLS = ("replace", "rename", "unlink", "mkdir", "rmdir")


@contextmanager
def killed_at(last: int | None) -> Iterator[None]:
    """Let so many calls change the file system, and none after them."""
    real = {name: getattr(os, name) for name in CALLS}
    count = 0

    def counted(name: str):  # type: ignore[no-untyped-def]
        def call(*places, **named):  # type: ignore[no-untyped-def]
            nonlocal count
            count += 1
            if last is not None and count > last:
                raise Killed
            return real[name](*places, **named)

        return call

    for name in CALLS:
        setattr(os, name, counted(name))
    try:
        yield
    finally:
        for name in CALLS:
            setattr(os, name, real[name])


def command(out: Path, *, overwrite: bool, fails: bool) -> None:
    with atomic_folder(out, KIND, overwrite=overwrite) as folder:
        (folder / "maps").write_text("new")
        (folder / "store.zarr").mkdir()
        (folder / "store.zarr" / "zarr.json").write_text("new")
        (folder / "list.json").write_text(json.dumps({"files": KIND.list_of(folder)}))
        if fails:
            raise ValueError("the command itself fails")


@settings(max_examples=150)
@given(
    tree=trees,
    told=lists,
    earlier=st.booleans(),
    overwrite=st.booleans(),
    fails=st.booleans(),
    last=st.one_of(st.none(), st.integers(0, 25)),
)
def test_only_files_that_rtradar_made_change(
    tree: dict[str, str],
    told: str | None,
    earlier: bool,
    overwrite: bool,
    fails: bool,
    last: int | None,
) -> None:
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        out, outside = root / "out", root / "outside"
        outside.mkdir()
        out.mkdir()
        (outside / "thesis").write_text("years of work")
        (outside / "thesis").chmod(0o640)
        if earlier:
            command(out, overwrite=False, fails=False)
        plant(out, outside, tree)
        if told is not None and not os.path.lexists(out / "list.json"):
            (out / "list.json").write_text(told)
        listed = _listed(out)
        before, beyond = snapshot(out), snapshot(outside)
        try:
            with killed_at(last):
                command(out, overwrite=overwrite, fails=fails)
        except (InputError, ValueError, Killed) as error:
            ended = type(error)
        else:
            ended = type(None)
        after = snapshot(out)

        assert snapshot(outside) == beyond
        new = {"maps", "store.zarr/zarr.json", "list.json"}
        for path, what in before.items():
            regular = stat.S_ISREG(what[0])
            ours = KIND.is_file(path) and regular and path in listed
            ours |= overwrite and path in new and (regular or stat.S_ISLNK(what[0]))
            ours |= KIND.is_folder(path) and stat.S_ISDIR(
                what[0]
            )  # which goes when its last file has gone
            if not ours or ended in (InputError, ValueError):
                assert after.get(path) == what, path
            elif path not in after:
                assert path not in new or ended is Killed
        if ended is type(None):
            assert {
                path
                for path, what in after.items()
                if path.startswith(".rtradar") and path not in before
            } == set()
            assert all(after[path][2] == b"new" for path in new - {"list.json"})
        elif ended is not Killed:
            assert after == before


def _listed(out: Path) -> set[str]:
    """Files that the folder's own list names, where it is one."""
    path = out / "list.json"
    try:
        told = json.loads(path.read_text()) if stat.S_ISREG(path.lstat().st_mode) else None
    except (OSError, ValueError):
        return set()
    files = told.get("files") if isinstance(told, dict) else None
    if not isinstance(files, list) or "list.json" not in files:
        return set()
    inside = {str(found.relative_to(out)) for found in out.rglob("*")}
    return {
        path
        for path in inside
        if path in files or ("store.zarr/" in files and path.startswith("store.zarr/"))
    }
