"""What a person puts on the first page of a report: a title, who wrote it, a logo, who signs."""

from __future__ import annotations

import base64
import datetime
import io
from dataclasses import dataclass
from pathlib import Path

from sarl_core.errors import InputError, quoted, require
from sarl_core.limits import limited_bytes

MOST_TITLE = 120
MOST_LINE = 120
MOST_NOTES = 400
MOST_PARAGRAPHS = 8
MOST_SIGNERS = 4
_MOST_BYTES = 4 * 2**20
_MOST_PIXELS = 16_000_000
_LOGO_SIZE = (600, 160)  # pixels; twice as many as it is drawn with


@dataclass(frozen=True)
class Logo:
    """A picture at the head of a report.

    Attributes:
        source: A PNG as a data address; written anew, so that nothing else of a file is in it.
        width: In pixels.
        height: In pixels.
    """

    source: str
    width: int
    height: int


def _line(text: str) -> str:
    return " ".join(text.split())


@dataclass(frozen=True)
class Cover:
    """What a person puts on the first page; what is "" is left out.

    Attributes:
        title: Of the report; "" for the task's name.
        author: Who wrote it.
        date: As it is to stand there.
        notes: What the author says, a paragraph a line.
        signers: Who is to sign, a line each.
        logo: At the head, None for none.
    """

    title: str = ""
    author: str = ""
    date: str = ""
    notes: str = ""
    signers: tuple[str, ...] = ()
    logo: Logo | None = None

    def __post_init__(self) -> None:
        """Refuse what does not fit on one page.

        Raises:
            InputError: If a text is too long or no text, has too many lines, or too many sign.
        """
        for name, text, most in (
            ("the title", self.title, MOST_TITLE),
            ("the author", self.author, MOST_LINE),
            ("the date", self.date, MOST_LINE),
            ("the notes", self.notes, MOST_NOTES),
            *(("a signer", signer, MOST_LINE) for signer in self.signers),
        ):
            require(text, str, f"{name} of a report must be text", "give one")
            if not text.isascii() and any("\ud800" <= sign <= "\udfff" for sign in text):
                raise InputError(
                    f"{name} of a report must be text, and {quoted(text)} is none in UTF-8; write "
                    "it anew"
                )
            if len(text) > most:
                raise InputError(
                    f"{name} of a report {'have' if name.endswith('notes') else 'has'} "
                    f"{len(text):,} characters; give at most {most}, so that the first page holds "
                    "it"
                )
        if len(self.paragraphs) > MOST_PARAGRAPHS:
            raise InputError(
                f"the notes of a report have {len(self.paragraphs)} lines; give at most "
                f"{MOST_PARAGRAPHS}, so that the first page holds them"
            )
        if len(self.signers) > MOST_SIGNERS:
            raise InputError(
                f"{len(self.signers)} people are to sign the report; name at most {MOST_SIGNERS}"
            )

    @property
    def byline(self) -> str:
        """Who wrote it and when, in a line."""
        return " · ".join(part for part in map(_line, (self.author, self.date)) if part)

    @property
    def paragraphs(self) -> tuple[str, ...]:
        """The notes, line by line."""
        return tuple(line for line in map(_line, self.notes.splitlines()) if line)


def today_text() -> str:
    """The day, as a date that one gives may be written: "28 November 2026"."""
    day = datetime.date.today()
    return f"{day.day} {day:%B %Y}"


PLAIN = Cover()
"""Nothing but what the report says by itself."""


def read_logo(path: Path) -> Logo:
    """Read a logo from a file.

    Args:
        path: A PNG or JPEG.

    Returns:
        The picture.

    Raises:
        InputError: If it is anything else, or cannot be read.
    """
    try:
        content = limited_bytes(path, _MOST_BYTES)
    except InputError as error:
        raise InputError(f"the logo {path}: {error}") from error
    except OSError as error:
        raise InputError(
            f"the logo {path} cannot be read ({error.strerror}); give a PNG or JPEG file"
        ) from error
    return logo_of(content, path.name)


def logo_of(content: bytes, name: str) -> Logo:
    """The same from a file's content.

    Args:
        content: Of the file.
        name: Of the file, for messages.

    Returns:
        The picture, made smaller where it is large.

    Raises:
        InputError: If it is no PNG or JPEG that can be drawn.
    """
    from PIL import Image

    no_picture = f"the logo {quoted(name)} is no PNG or JPEG picture; give one, and no SVG"
    try:
        # Only these two: no other format can hold script or make a reader fetch something.
        picture = Image.open(io.BytesIO(content), formats=("PNG", "JPEG"))
        if len(content) > _MOST_BYTES or picture.width * picture.height > _MOST_PIXELS:
            raise InputError(
                f"the logo {quoted(name)} is too large ({picture.width} x {picture.height} pixels, "
                f"{len(content) / 1e6:.1f} MB); give one of at most 16 million pixels and 4 MB"
            )
        drawn = picture.convert("RGBA")
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes the decoder complain about
        raise InputError(no_picture) from error
    drawn.thumbnail(_LOGO_SIZE)
    file = io.BytesIO()
    drawn.save(file, format="PNG")
    source = base64.b64encode(file.getvalue()).decode("ascii")
    return Logo(f"data:image/png;base64,{source}", drawn.width, drawn.height)
