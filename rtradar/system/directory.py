"""An open directory, whose entries are opened relative to it."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO

_BY_DESCRIPTOR = {
    os.open,
    os.stat,
    os.mkdir,
    os.rename,
    os.unlink,
    os.rmdir,
} <= os.supports_dir_fd and hasattr(os, "O_DIRECTORY")


class Directory:
    """An open directory; its entries are opened relative to it, so that no link is followed.

    Where the system cannot do that (Windows), entries are opened by their paths.
    """

    def __init__(self, path: Path, descriptor: int | None) -> None:
        self.path, self._descriptor = path, descriptor

    @classmethod
    def at(cls, path: Path) -> Directory:
        """Open the directory of a path, which may be a link to one."""
        if not _BY_DESCRIPTOR:
            os.listdir(path)  # raises as opening it would
            return cls(path, None)
        return cls(path, os.open(path, os.O_RDONLY | os.O_DIRECTORY))

    def __enter__(self) -> Directory:
        return self

    def __exit__(self, *_: object) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)

    def names(self) -> list[str]:
        """Return the names of the entries."""
        return os.listdir(self.path if self._descriptor is None else self._descriptor)

    def mode(self, name: str) -> int:
        """Return type and permissions of an entry, not following a link; 0 if there is none."""
        try:
            return os.stat(self._name(name), dir_fd=self._descriptor, follow_symlinks=False).st_mode
        except FileNotFoundError:
            return 0

    def open(self, name: str) -> Directory:
        """Open a directory in this one; OSError if the entry is no directory, or a link."""
        if self._descriptor is None:
            if not stat.S_ISDIR(self.mode(name)):
                raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), name)
            return Directory(self.path / name, None)
        flags = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW
        return Directory(self.path / name, os.open(name, flags, dir_fd=self._descriptor))

    @contextmanager
    def parent_of(self, name: str, *, make: bool = False) -> Iterator[Directory]:
        """Open the directory that holds a file of a relative name; make it if asked."""
        with ExitStack() as stack:
            here = self
            # Folder by folder, each relative to the one before: a link on the way is refused.
            for part in name.split("/")[:-1]:
                if make and not here.mode(part):
                    os.mkdir(here._name(part), dir_fd=here._descriptor)
                here = stack.enter_context(here.open(part))
            yield here

    def open_file(self, name: str, *, write: bool = False) -> IO[bytes]:
        """Open a regular file to read, or a new one to write; OSError for anything else."""
        flags = (os.O_WRONLY | os.O_CREAT | os.O_EXCL if write else os.O_RDONLY) | getattr(
            os, "O_BINARY", 0
        )
        # No link is followed, and a pipe is not waited for; what is no regular file is closed
        # again.
        flags |= getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
        descriptor = os.open(self._name(name), flags, 0o666, dir_fd=self._descriptor)
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            os.close(descriptor)
            raise OSError(errno.EINVAL, "not a regular file", name)
        return os.fdopen(descriptor, "wb" if write else "rb")

    def make(self, name: str) -> None:
        """Make a directory that nobody else may enter."""
        os.mkdir(self._name(name), 0o700, dir_fd=self._descriptor)

    def move(self, name: str, target: Directory, new: str) -> None:
        """Move an entry to another directory, under another name, in one step."""
        places = self._name(name), target._name(new)
        os.replace(*places, src_dir_fd=self._descriptor, dst_dir_fd=target._descriptor)

    def remove(self, name: str) -> None:
        """Remove a file."""
        os.unlink(self._name(name), dir_fd=self._descriptor)

    def remove_folder(self, name: str) -> None:
        """Remove an empty directory."""
        os.rmdir(self._name(name), dir_fd=self._descriptor)

    def remove_tree(self, name: str) -> None:
        """Remove a directory with all in it, as far as that goes; no link is followed."""
        shutil.rmtree(self._name(name), ignore_errors=True, dir_fd=self._descriptor)

    def status(self) -> os.stat_result:
        """Return its owner, its inode number and so on."""
        return os.stat(self.path if self._descriptor is None else self._descriptor)

    def is_in_place(self) -> bool:
        """Tell whether its path still leads to it."""
        try:
            return os.path.samestat(os.stat(self.path), self.status())
        except OSError:
            return False

    def lock(self, *, wait: bool = False) -> bool:
        """Lock it until it is closed; False if another process has it. Windows has no such lock."""
        if sys.platform == "win32" or self._descriptor is None:
            return True
        import fcntl

        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            return False
        return True

    def _name(self, name: str) -> str:
        return str(self.path / name) if self._descriptor is None else name
