"""An episode of a log step by step: its breaks, each with its rule, its path, and What if."""

from __future__ import annotations

from typing import Any

import numpy as np
import streamlit as st

from sarl_core.auditing.audit import Audit
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.figures.audit import audit_tracks, step_texts
from sarl_core.explaining.figures.replay import Timeline, intervention_strip
from sarl_core.explaining.html.headings import heading
from sarl_core.explaining.html.lit_path import lit_paths_html
from sarl_core.explaining.html.step_card import legend
from sarl_core.explaining.state_path import PathFinder
from sarl_core.explaining.words.audit import stretch_text
from sarl_core.mining.language import counted, label_text, sentence
from sarl_core.mining.rule_order import fits
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.sampling import feature_spans, within
from sarl_dashboard.cache import cached
from sarl_dashboard.state.compact_set import SET_ON_RULES_PAGE
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.text import escaped
from sarl_dashboard.views.audit.logs import ChosenRules

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
    picked: Any = st.plotly_chart(
        intervention_strip(tracks, step_texts(held, rows), timeline),
        config={"displayModeBar": False},
        key="audit_strip",
        on_select="rerun",
        selection_mode="points",
        alt="What was done at each step, what the rule in force says, and the breaks",
    )
    _key(held)
    points = picked["selection"]["points"]
    _step(rules, held, rows, int(points[0]["customdata"][0]) if points else None)


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
    choice = st.selectbox("Episode", list(names), key="log_episode", width=320)
    place = names[choice]
    start = int(held.log.episode_starts[place])
    length = int(held.log.episode_lengths[place])
    if length <= _MOST_STEPS:
        return slice(start, start + length)
    broken = np.flatnonzero(held.is_broken[start : start + length])
    first = min(int(broken[0]) if len(broken) else 0, length - _MOST_STEPS)
    st.caption(f"The first {_MOST_STEPS:,} of its {length:,} steps from its first break are drawn.")
    return slice(start + first, start + first + _MOST_STEPS)


def _key(held: Audit) -> None:
    """Which colour is which label."""
    dimension = held.rule_set.actions[0]
    if dimension.n_labels <= 12 and len(held.rule_set.actions) == 1:
        labels = range(dimension.n_labels)
        st.html(legend([(label_text(one, dimension), label_colour(one)) for one in labels]))


def _step(rules: ChosenRules, held: Audit, rows: slice, clicked: int | None) -> None:
    """One step: the first that broke a rule where none was clicked."""
    broken = np.flatnonzero(held.is_broken[rows])
    if clicked is None:
        if not len(broken):
            st.caption("No rule was broken in this episode. Click a step to see its rule.")
            return
        clicked = int(broken[0])
    row = rows.start + min(clicked, rows.stop - rows.start - 1)
    assert held.log.steps is not None
    state = held.observations[row]
    with st.container(border=True):
        st.markdown(
            f"**Step {held.log.steps[row]} of episode {held.log.episodes[row]}.** "
            + escaped(step_texts(held, slice(row, row + 1))[0].split(": ", 1)[1])
            + (" – **broken**" if held.is_broken[row] else "")
            + (", outside the data of the rule" if held.outside[row] else "")
        )
        for place in dict.fromkeys(held.rules[row].tolist()):
            if place < 0:
                continue
            rule = held.rule_set[place]
            st.markdown(
                f"**{held.rule_set.name_of(rule)}.** {escaped(sentence(rule, held.rule_set))}"
            )
            if rules.choice in SET_ON_RULES_PAGE:
                st.page_link(
                    "rules.py",
                    label=f"Open {held.rule_set.name_of(rule)}",
                    icon=":material/rule:",
                    query_params={"set": SET_ON_RULES_PAGE[rules.choice], "rule": rule.id},
                )
        for table in lit_paths_html(_finder(held.rule_set), state, held.rules[row]):
            st.html(table)
        _link_what_if(rules, held, row)


def _link_what_if(rules: ChosenRules, held: Audit, row: int) -> None:
    """A way to this state on the page What if, where that page asks about the same features."""
    demonstrations = chosen_demonstrations()
    if demonstrations is None or not fits(rules.rule_set, demonstrations):
        return
    names = [feature.name for feature in rules.rule_set.source.features]
    if names != [feature.name for feature in demonstrations.features]:
        return
    # Its sliders reach as far as what was demonstrated.
    state = within(held.observations[row], feature_spans(demonstrations.observations))
    values = {f"x{index}": repr(float(value)) for index, value in enumerate(state.tolist())}
    chosen = {"set": SET_ON_RULES_PAGE[rules.choice]} if rules.choice in SET_ON_RULES_PAGE else {}
    st.page_link(
        "what_if.py",
        label="What if, with this state",
        icon=":material/help_center:",
        query_params={**st.query_params.to_dict(), **chosen, **values},
    )


@cached()
def _finder(rule_set: RuleSet) -> PathFinder:
    return PathFinder(rule_set)
