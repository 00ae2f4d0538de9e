"""An episode of a log step by step: its breaks, each with its rule, its path, and What if."""

from __future__ import annotations

import re
from functools import partial

import numpy as np
import streamlit as st

from sarl_core.auditing.audit import Audit
from sarl_core.explaining.figures.audit import audit_tracks, step_texts
from sarl_core.explaining.figures.replay import Timeline, intervention_strip
from sarl_core.explaining.html.headings import heading
from sarl_core.explaining.words.audit import stretch_text
from sarl_core.mining.language import counted
from sarl_dashboard.components.log_step import show_step
from sarl_dashboard.components.timeline import clicked_step, show_legend
from sarl_dashboard.state.url import set_url_choice, url_text
from sarl_dashboard.text import escaped
from sarl_dashboard.views.audit.logs import ChosenRules

_ROW = r"(?:[0-9]{1,12})?"
_MOST_STEPS = 2_000  # of an episode that are drawn; a longer one is cut to where it broke rules


def show_timeline(rules: ChosenRules, held: Audit) -> None:
    """The worst stretches, an episode, and one of its steps.

    Args:
        rules: That were chosen.
        held: Against the log.
    """
    st.html(heading("Episodes"))
    if held.worst:
        st.caption(
            "Longest stretches of breaks: "
            + "; ".join(escaped(stretch_text(held, one)) for one in held.worst[:3])
            + "."
        )
    rows = _chosen_episode(held)
    tracks = audit_tracks(held, rows)
    timeline = Timeline.of(tracks, rows.stop - rows.start)
    st.plotly_chart(
        intervention_strip(tracks, step_texts(held, rows), timeline),
        config={"displayModeBar": False},
        key="audit_strip",
        on_select=partial(_pick, rows.start),
        selection_mode="points",
        alt="What was done at each step, what the rule in force says, and the breaks",
    )
    show_legend(held.rule_set.actions, marks="broken")
    _step(rules, held, rows)


def _pick(start: int) -> None:
    """Let the address name the row of the log that was clicked (URL: log_row)."""
    step = clicked_step("audit_strip")
    set_url_choice("log_row", "" if step is None else str(start + step))


def _type_row() -> None:
    """Let the address name the row of the log that was typed, which keys can do as well."""
    row = st.session_state["_log_row"]
    set_url_choice("log_row", "" if row is None else str(row))


def _chosen_episode(held: Audit) -> slice:
    """The widget for the episode, those with the most breaks first; its rows in the log."""
    table = held.episodes.sort_values("broken", ascending=False, kind="stable")
    names = {
        f"{episode} ({counted(broken, 'break')})": place
        for place, episode, broken in zip(
            table.index.tolist(), table["episode"].tolist(), table["broken"].tolist(), strict=True
        )
    }
    if st.session_state.get("log_episode") not in names:
        st.session_state.pop("log_episode", None)
    choice = st.selectbox("Episode", list(names), key="log_episode", bind="query-params", width=320)
    place = names[choice]
    start = int(held.log.episode_starts[place])
    length = int(held.log.episode_lengths[place])
    if length <= _MOST_STEPS:
        return slice(start, start + length)
    broken = np.flatnonzero(held.is_broken[start : start + length])
    first = min(int(broken[0]) if len(broken) else 0, length - _MOST_STEPS)
    st.caption(f"The first {_MOST_STEPS:,} of its {length:,} steps from its first break are drawn.")
    return slice(start + first, start + first + _MOST_STEPS)


def _step(rules: ChosenRules, held: Audit, rows: slice) -> None:
    """One step: the first that broke a rule where none of this episode was chosen."""
    named = url_text("log_row", "", lambda text: re.fullmatch(_ROW, text) is not None)
    row = int(named or -1)
    if row not in range(rows.start, rows.stop):
        broken = np.flatnonzero(held.is_broken[rows])
        if not len(broken):
            st.caption("No rule was broken in this episode. Choose a step to see its rule.")
        row = rows.start + int(broken[0]) if len(broken) else -1
    st.session_state["_log_row"] = row if row >= 0 else None
    st.number_input(
        f"Row of the log ({rows.start:,} to {rows.stop - 1:,})",
        rows.start,
        rows.stop - 1,
        None,
        key="_log_row",
        on_change=_type_row,
        placeholder="or click a step",
        width=320,
    )
    if row >= 0:
        show_step(held, row, rules.choice)
