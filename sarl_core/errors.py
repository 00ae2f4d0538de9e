"""What a user can cause, as one family of exceptions, each a sentence: what, where, what to do."""

from __future__ import annotations


class SarlError(Exception):
    """Anything that the user of the library can cause and mend; the message is one sentence."""


class InputError(SarlError):
    """What was given cannot be used: a file, a value, a name. The command line exits with 2."""


class WorkError(SarlError):
    """The input was fine and the work failed all the same. The command line exits with 1."""
