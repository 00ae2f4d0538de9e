"""A film with play, pause, speed, loop and steps, all of it in the browser."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable
from pathlib import Path

import streamlit as st

from sarl_core.rendering.replay import Replay

# What the slider of steps says to a film, which may not be there yet.
_TELL = """
export default function ({ data }) {
  window.sarlStep = data;
  document.dispatchEvent(new CustomEvent("sarl-step"));
}
"""


def _part(ending: str) -> str:
    return Path(__file__).with_suffix(ending).read_text(encoding="utf-8")


_PLAYER = st.components.v2.component(
    "film_player", html=_part(".html"), css=_part(".css"), js=_part(".js")
)
_STEP = st.components.v2.component("film_step", js=_TELL)


def _nothing() -> None:
    """For a film that takes nothing along."""


def film_player(
    film: Replay,
    name: str,
    alt: str,
    *,
    key: str,
    begins: bool = True,
    on_step: Callable[[], None] = _nothing,
) -> None:
    """Play a film.

    Args:
        film: What is played.
        name: Tells it from all others.
        alt: What is seen, in words.
        key: Of the widget.
        begins: Whether it begins by itself, where the visitor's system does not ask for stillness.
        on_step: Called where the visitor stopped at a step, which `step_of` gives.
    """
    _PLAYER(
        key=key,
        data={
            "film": name,
            "gif": b64encode(film.gif()).decode("ascii"),
            "fps": film.fps,
            "first": film.first,
            "pictures": film.pictures,
            "steps": len(film.panels[0].steps),
            "panels": film.places,
            "alt": alt,
            "begins": begins,
        },
        on_step_change=on_step,
    )


def step_of(key: str) -> int | None:
    """The step at which the visitor stopped a film; for a callback."""
    step = st.session_state[key].step
    return None if step is None else int(step)


def film_at(name: str, step: int) -> None:
    """Put a film on a step that was chosen elsewhere.

    Args:
        name: Of the film.
        step: To be looked at.
    """
    _STEP(key="film_step", data={"film": name, "step": step}, width="content")
