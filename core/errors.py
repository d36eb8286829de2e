"""Root classes of the errors meant for the user."""


class SlamduelError(Exception):
    """A sentence for the user: it names the file and row, or the option, what was found and what was expected.

    Caught once, at the command line, which prints it and ends with exit status 2.
    """


class InputError(SlamduelError):
    """A file, a log, an option or a combination of them that cannot be used."""


class Absent(InputError):
    """A published log that is not on this machine."""


class Interrupted(SlamduelError):
    """The user stopped a command; the message says how to resume it."""
