"""The command line: ``rtradar run``, ``validate`` and all that ``rtradar --help`` lists.

The table ``commands.toml`` has all commands with their options; the function that does what one
says, and the packages that do the work, are imported on use.

Exit status 0: done. 1: failed. 2: bad input, with one line on stderr that tells what is wrong,
where, what is allowed and how to mend it. 130: stopped by Ctrl-C.
"""

from __future__ import annotations

import argparse
import errno
import io
import logging
import os
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from typing import Any, TextIO

from rtradar.errors import BackendError, CampaignError, ExtensionError, InputError

_WHOLE = "nothing was left half-written"


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status.

    Parameters
    ----------
    arguments : list of str, optional
        Arguments in place of those of the process. If left out, signals that ask the process to
        end are handled too.
    """
    from rtradar.cli.ending import end_well, stay_if_ending

    # This is what the user is told if a signal ends the process; a command may have a text of its
    # own.
    options = argparse.Namespace(stopped=_WHOLE)
    if arguments is None:
        if isinstance(sys.stdout, io.TextIOWrapper):
            # The same as of stderr: names of files may be any bytes.
            sys.stdout.reconfigure(errors="backslashreplace")
        end_well(lambda: options.stopped.format(**vars(options)))
    status = _flushed(_main(arguments, options))
    stay_if_ending()
    return status


def _flushed(status: int) -> int:
    """Flush the standard output; return the exit status, 1 if that fails."""
    from rtradar.cli.values import fail

    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except (OSError, ValueError) as error:
        # Python would try again as it ends, and print a traceback.
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            why = getattr(error, "strerror", None) or error
            fail(1, f"cannot write to the standard output: {why}")
        return status or 1
    return status


def _main(arguments: list[str] | None, options: argparse.Namespace) -> int:
    # After the first moments, in which a signal would still show a traceback.
    from rtradar.cli.ending import INTERRUPTED
    from rtradar.cli.parser import parser
    from rtradar.cli.values import fail
    from rtradar.system.files import DISK_ERRORS

    # Each warning is one line, without the line of source that Python would show.
    warnings.showwarning = _show_warning
    # Without a folder of its own it makes a temporary one, and would log two lines each time.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    try:
        parser().parse_args(arguments, options)
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        status = _done(options)
    except InputError as error:
        return fail(2, error)
    except (BackendError, CampaignError, ExtensionError) as error:
        return fail(1, error)
    except KeyboardInterrupt:
        return fail(INTERRUPTED, f"stopped by the user; {options.stopped.format(**vars(options))}")
    except MemoryError as error:
        return fail(1, f"out of memory ({str(error) or 'no more to be had'}); {_WHOLE}")
    except BrokenPipeError:
        return 1
    except OSError as error:
        if error.filename is not None or error.errno not in DISK_ERRORS | {errno.EBADF}:
            raise
        return fail(1, f"cannot write to the standard output: {error.strerror}")
    return status


def _done(options: argparse.Namespace) -> int:
    """Do what the command says: it gives its exit status, or yields what ``--json`` writes.

    A command yields before it prints, so that the results of long work are kept if nobody reads.
    """
    from rtradar.cli.ending import stay_if_ending
    from rtradar.system.files import check_place, write_json

    try:
        with _only_errors() if getattr(options, "quiet", False) else nullcontext():
            place = getattr(options, "json", None)
            check_place(place)
            found: int | Iterator[Mapping[str, Any]] | None = options.command(options)
            if isinstance(found, Iterator):
                for content in found:
                    if place is not None:
                        write_json(place, content)
    except BaseException:
        stay_if_ending()  # it may have failed because its files are being removed
        raise
    return found if isinstance(found, int) else 0


@contextmanager
def _only_errors() -> Iterator[None]:
    """Show neither warnings nor progress, which needs a terminal, inside."""
    stream = sys.stderr
    with warnings.catch_warnings():
        warnings.showwarning = lambda *_, **__: None
        if stream is None:
            yield
            return
        stream.isatty = lambda: False  # type: ignore[method-assign]
        try:
            yield
        finally:
            del stream.isatty


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    print(f"rtradar: warning: {message}", file=file or sys.stderr)
