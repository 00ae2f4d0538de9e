"""Text for the screen."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.words.markdown import markdown_text
from sarl_core.mining.language import counted

escaped = markdown_text
LabelVisibility = Literal["visible", "collapsed"]
# What sentences say to those who type commands: the forms on the pages do the same.
_OPTIONS = re.compile(r"with --column .* \(on the page \w+: in the form\)")
_IN_BRACKETS = re.compile(r" \((--missing drop, in Python [^)]*|--column [^)]*=[a-z]+)\)")

# Commands and options as our own sentences name them; what a file calls something may hold signs
# that mean more.
_TYPED = re.compile(r"(?<![^\s(])`([a-z][\w .=-]*)`(?![^\s.,;)])")


def on_page(text: str) -> str:
    """A message without the options of the command line that the page has a form for."""
    return _IN_BRACKETS.sub("", _OPTIONS.sub("in the form for the columns", text))


def in_full(text: str) -> str:
    """A message as a sentence; what begins with a name, as of a file, keeps its first letter."""
    text = on_page(text)
    first = text.split(" ", 1)[0]
    end = "" if text.endswith("?") else "."
    return _with_code(text[:1].upper() + text[1:] if first.isalpha() else text) + end


def _with_code(text: str) -> str:
    """A sentence in Markdown, in which what is to be typed stands between backticks."""
    parts = _TYPED.split(text)
    return "".join(
        f"`{part}`" if place % 2 else escaped(part) for place, part in enumerate(parts) if part
    )


def refuse(problem: Exception | str) -> None:
    """Say what is wrong, in its one sentence."""
    st.error(in_full(str(problem)), icon=":material/error:")


@contextmanager
def labelled(
    name: str, width: int | Literal["stretch", "content"] = "stretch"
) -> Iterator[LabelVisibility]:
    """Label a widget by a name that may hold signs of Markdown.

    A label is read aloud as it was written, escapes and all. So where a name needs them it stands
    above its widget, whose label is the name itself and is not seen.

    Args:
        name: What the widget within is labelled by, as it is.
        width: Of the widget.

    Yields:
        Whether the widget's own label is seen.
    """
    if escaped(name) == name:
        yield "visible"
        return
    with st.container(gap=None, width=width):
        st.markdown(f":small[{escaped(name)}]")
        yield "collapsed"


def together(text: str) -> str:
    """A sentence in which no line ends between a number and its percent sign."""
    return re.sub(r"(?<=\d) (?=%)", "\N{NO-BREAK SPACE}", text)


def size_text(demonstrations: Demonstrations) -> str:
    """How many steps and episodes there are, wherever they are; as "900 steps in 3 episodes"."""
    whole = demonstrations.whole
    return f"{counted(whole.steps, 'step')} in {counted(whole.episodes, 'episode')}"


def file_name(env_id: str) -> str:
    """An environment's id as the beginning of a file's name."""
    return re.sub(r"[^\w.-]+", "-", env_id).strip("-.") or "unnamed"


def digest_of(content: bytes) -> str:
    """Fingerprint of a file."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()
