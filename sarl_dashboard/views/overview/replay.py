"""A replay that plays: what rules are for, in a picture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import streamlit as st

from sarl_core.shipped import DATA
from sarl_dashboard.cache import cached

_REPLAY = DATA / "replays" / "lunar_lander.gif"


@cached()
def _card(path: Path) -> dict[str, Any]:
    return cast("dict[str, Any]", json.loads(path.read_text(encoding="utf-8")))


def show_replay() -> None:
    """The shipped film, with what is in it and how far it can be trusted."""
    film = _card(_REPLAY.with_suffix(".json"))
    rules = _card(DATA / "rules" / f"{film['rules']}.card.json")
    shielded, reported = film["shielded"], rules["reported"]
    st.image(
        str(_REPLAY),
        width="content",
        alt="A spacecraft that acts at random: with the rules it lands, without them it crashes",
    )
    st.caption(
        f"Both fire their engines at random. On the left {rules['rules']} rules, learned from an "
        f"expert's flights, correct {shielded['interventions']} of {shielded['length']} actions, "
        f"and it lands; on the right nobody does, and it crashes. Of {reported['episodes']:,} "
        f"other flights with these rules {reported['failures']} failed: the rules help, and "
        "guarantee nothing."
    )
