"""Errors and warnings: bad input, and machines that cannot do what was asked.

The message of each error is one line, which the command line prints; only `InputErrors` has more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager


class InputError(ValueError):
    """What the user gave cannot be used.

    The message says what is wrong, where, what is allowed, and how to mend it. The command line
    exits with status 2.
    """


class InputErrors(InputError):  # noqa: N818 - several of them
    """Several things that the user gave cannot be used.

    Parameters
    ----------
    lines : sequence of str
        Message about each of them, one line each as that of `InputError`.
    """

    def __init__(self, lines: Sequence[str]) -> None:
        super().__init__("\n".join(lines))
        self.lines = tuple(lines)

    def __reduce__(self) -> tuple[type[InputErrors], tuple[tuple[str, ...]]]:
        return InputErrors, (self.lines,)


@contextmanager
def prefixed(where: str) -> Iterator[None]:
    """Put ``where`` before each message of an `InputError` that is raised inside."""
    try:
        yield
    except InputErrors as errors:
        raise InputErrors([f"{where}{line}" for line in errors.lines]) from None
    except InputError as error:
        raise InputError(f"{where}{error}") from None


class BackendError(RuntimeError):
    """No ray-tracing backend of the kind asked for works on this machine.

    The message names the remedy. The command line exits with status 1.
    """


class CampaignError(RuntimeError):
    """Workers or their scheduler were lost.

    The message says how to go on. The command line exits with status 1.
    """


class ExtensionError(RuntimeError):
    """What another package adds to rtradar cannot be loaded, fails, or gives what it must not.

    The message names it and its package. The command line exits with status 1.
    """


class ValidityWarning(UserWarning):
    """An approximation is used near or past the end of its validity."""
