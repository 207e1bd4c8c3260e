"""The two ways rtradar says no: bad input, and a machine that cannot do what was asked."""


class InputError(ValueError):
    """What the user gave cannot be used.

    The message is one line: what is wrong, where, what is allowed, how to mend it. The command line prints it and
    exits with status 2.
    """


class BackendError(RuntimeError):
    """No ray-tracing backend of the kind asked for works on this machine.

    The message is one line that names the cure. The command line prints it and exits with status 1.
    """


class ValidityWarning(UserWarning):
    """An approximation is used near or past the end of its validity."""
