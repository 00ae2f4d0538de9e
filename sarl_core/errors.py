"""What a user can cause, as one family of exceptions, each a sentence: what, where, what to do."""

from __future__ import annotations

from codecs import getincrementaldecoder
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from numbers import Integral, Number
from os import PathLike

_LONGEST = 480  # characters of a message; nobody reads more
_QUOTED = 40  # of what a message repeats from a file
_NO_TEXT = "bytes that are no text"
_EXTRAS = {
    "streamlit": "dashboard",
    "stable_baselines3": "learning",
    "torch": "learning",
    "distributed": "cluster",
    "imageio": "video",
    "imageio_ffmpeg": "video",
}
"""What a package that is not there belongs to."""


class SarlError(Exception):
    """Anything that the user of the library can cause and mend.

    The message is one sentence on one line. It may repeat what stands in a file, so signs that
    are not for people are taken out of it, and where it is too long its middle is left out: it
    begins with what is wrong and ends with what to do.
    """

    def __init__(self, message: object = "") -> None:
        text = _seen(str(message))
        if len(text) > _LONGEST:
            head = 2 * _LONGEST // 3
            text = f"{text[:head]} … {text[head + 3 - _LONGEST :]}"
        super().__init__(text)


class InputError(SarlError):
    """What was given cannot be used: a file, a value, a name. The command line exits with 2."""


class WorkError(SarlError):
    """The input was fine and the work failed all the same. The command line exits with 1."""


@contextmanager
def needing_extras() -> Iterator[None]:
    """Say of a package that is not there to which extra it belongs.

    Raises:
        WorkError: In place of the `ModuleNotFoundError`.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        extra = _EXTRAS.get(package)
        if extra is None:
            raise
        raise WorkError(
            f"this needs {package}, which is not installed; run pip install "
            f"'sarl-explorer[{extra}]'"
        ) from error


def quoted(value: object, longest: int = _QUOTED) -> str:
    """A value from a file as a sentence quotes it.

    Args:
        value: Whatever was read.
        longest: Characters of it.

    Returns:
        A text in quotation marks, a number as Python writes it, anything else in words; short, on
        one line, and without signs that are not for people.
    """
    if isinstance(value, bytes):
        start = value[: 4 * longest]
        try:  # a sign may be cut off at the end
            value = getincrementaldecoder("utf-8")().decode(start, final=start == value)
        except UnicodeDecodeError:
            return _NO_TEXT
        if "\0" in value:
            return _NO_TEXT
    if isinstance(value, str):
        return repr(_short(_seen(value[: 2 * longest]), longest))
    if isinstance(value, (list, tuple)):
        return "a list"
    if isinstance(value, Mapping):
        return "an object"
    if isinstance(value, int) and abs(value) > 10**longest:  # Python may refuse to write it
        return "far too large"
    return _short(_seen(repr(value)), longest)


def require(value: object, kind: type | tuple[type, ...], must: str, advice: str) -> None:
    """Refuse an argument of another type, where a public name takes it in.

    Args:
        value: As it was given.
        kind: What it has to be an instance of.
        must: What has to be what, as "the shield must be a Shield".
        advice: What to do, as "wrap the rules: Shield(rules)".

    Raises:
        InputError: If it is something else.
    """
    if not isinstance(value, kind):
        raise InputError(f"{must} and is {_kind_of(value)}; {advice}")


def require_whole(name: str, value: int, least: int, most: int | None = None) -> None:
    """Refuse what is no whole number, too small, or too large.

    Args:
        name: Of the argument.
        value: As it was given.
        least: The smallest that is allowed.
        most: The largest; None for any.

    Raises:
        InputError: If it is something else.
    """
    require(value, Integral, f"{name} must be a whole number", "give one")
    if value < least:
        raise InputError(
            f"{name} is {quoted(value)} and must be at least {least}; give a larger one"
        )
    if most is not None and value > most:
        raise InputError(
            f"{name} is {quoted(value)} and must be at most {most}; give a smaller one"
        )


def _kind_of(value: object) -> str:
    """What was given, in a few words."""
    if isinstance(value, PathLike):
        return quoted(str(value))
    if value is None or isinstance(value, (str, bytes, Number)):
        return quoted(value)
    if isinstance(value, (list, tuple)) and value:
        return f"a {type(value).__name__} of {type(value[0]).__name__}"
    return f"of type {type(value).__name__}"


def _seen(text: str) -> str:
    """A text without signs that are not for people, nor for Python, which would escape them.

    They move a terminal's cursor, turn the direction of text, are not to be seen at all, or cannot
    be written as UTF-8.
    """
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() else " " if sign.isspace() else "\N{REPLACEMENT CHARACTER}"
        for sign in text
    )


def _short(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[:longest]}..."
