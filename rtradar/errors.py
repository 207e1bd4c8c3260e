"""The ways rtradar says no: bad input, and machines that cannot do what was asked."""


class InputError(ValueError):
    """What the user gave cannot be used.

    The message is one line: what is wrong, where, what is allowed, how to mend it. The command line prints it and
    exits with status 2.
    """


class BackendError(RuntimeError):
    """No ray-tracing backend of the kind asked for works on this machine.

    The message is one line that names the cure. The command line prints it and exits with status 1.
    """


class CampaignError(RuntimeError):
    """Workers or their scheduler were lost.

    The message is one line that says how to go on. The command line prints it and exits with status 1.
    """


class ExtensionError(RuntimeError):
    """Something that another package adds to rtradar cannot be loaded, fails, or gives what it must not.

    The message is one line that names it and its package. The command line prints it and exits with status 1.
    """


class ValidityWarning(UserWarning):
    """An approximation is used near or past the end of its validity."""
