"""The one root of every error that is the user's to read."""


class SlamduelError(Exception):
    """A sentence for the user: it names the file and row, or the option, what was found and what was expected.

    Caught once, at the command line, which prints it and ends with exit status 2.
    """


class InputError(SlamduelError):
    """A file, a log, a command-line option or a combination of them that cannot be used as it stands."""


class Interrupted(SlamduelError):
    """The user stopped a command; the sentence says how to go on with it."""
