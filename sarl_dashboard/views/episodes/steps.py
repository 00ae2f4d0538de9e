"""An episode of the demonstrations under the rules in force, and one of its steps."""

from __future__ import annotations

from collections import Counter

import streamlit as st

from sarl_core.auditing.audit import Audit, audit
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.explaining.figures.audit import audit_tracks, feature_lines, step_texts
from sarl_core.explaining.figures.replay import Timeline, intervention_strip
from sarl_core.explaining.html.step_card import state_table
from sarl_core.explaining.words.replay import state_rows
from sarl_core.mining.language import counted, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.cache import cached
from sarl_dashboard.components.log_step import show_step
from sarl_dashboard.components.settings import other_data_notice
from sarl_dashboard.components.timeline import clicked_step, mark_at, mark_room, show_legend
from sarl_dashboard.session import end_page
from sarl_dashboard.state import in_force
from sarl_dashboard.text import refuse
from sarl_dashboard.views.episodes.scene import show_scene

_MOST_STEPS = 2_000  # that are drawn at once; of a longer episode, those around the step
_AT_FIRST, _MOST_FEATURES = 4, 24


def show_episodes(demonstrations: Demonstrations) -> None:
    """An episode over its steps, and everything about the step that is looked at.

    Args:
        demonstrations: All of them.
    """
    episodes = demonstrations.episodes[demonstrations.episode_starts]
    left, right = st.columns(2)
    with left:
        episode = int(episodes[_number("Episode", "episode", len(episodes) - 1)])
    try:
        held = _held(in_force.rules(), demonstrations, episode)
    except InputError as error:
        if not other_data_notice():
            refuse(error)
        end_page()
    with right:
        current = _number("Step", "step", held.steps - 1)
    st.caption(
        f"{counted(held.steps, 'step')}. Some rule applies in {share_text(held.coverage)} of them; "
        f"the expert broke one in {counted(held.broken, 'step')}. Click a step to look at it."
    )
    first = current // _MOST_STEPS * _MOST_STEPS
    rows = slice(first, min(first + _MOST_STEPS, held.steps))
    if held.steps > _MOST_STEPS:
        st.caption(f"Steps {rows.start:,} to {rows.stop - 1:,} are drawn.")
    _figures(held, rows, current)
    left, right = st.columns(2, gap="medium")
    with right:
        show_step(held, current, in_force.kind())
        features, state = held.rule_set.source.features, held.observations[current]
        asking = [held.rule_set[place] for place in held.rules[current].tolist() if place >= 0]
        st.html(state_table(state_rows(state, features, features, asking)))
    with left:  # last, because it may take a while
        show_scene(demonstrations, episode, current)


@cached(show_spinner="Holding the rules against the episode …")
def _held(rule_set: RuleSet, demonstrations: Demonstrations, episode: int) -> Audit:
    return audit(rule_set, demonstrations.select([episode]))


def _number(label: str, key: str, last: int) -> int:
    """A number from 0 that the URL holds, with a button to the one before and the one after."""
    before = st.session_state.get(key)
    if before is not None and not 0 <= before <= last:
        st.session_state[key] = min(max(before, 0), last)
    with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
        number = int(
            st.number_input(
                f"{label} (0 to {last:,})", 0, last, 0, key=key, bind="query-params", width=180
            )
        )
        for name, icon, other in (
            ("Previous", "chevron_left", number - 1),
            ("Next", "chevron_right", number + 1),
        ):
            st.button(
                f"{name} {label.lower()}",
                icon=f":material/{icon}:",
                key=f"{name.lower()}_{key}",
                disabled=not 0 <= other <= last,
                on_click=_go,
                args=(key, other),
            )
    return number


def _go(key: str, number: int) -> None:
    st.session_state[key] = number
    if key == "episode":
        st.session_state["step"] = 0


def _pick(figure: str, first: int) -> None:
    """Go to the step that was clicked in a figure; for a callback."""
    step = clicked_step(figure)
    if step is not None:
        st.session_state["step"] = first + step


def _figures(held: Audit, rows: slice, current: int) -> None:
    """The strip of actions and rules, and the chosen features below it."""
    features = held.rule_set.source.features
    chosen = st.multiselect(
        "Features to draw",
        range(len(features)),
        default=_first_features(held.rule_set),
        format_func=lambda index: features[index].name,
        key="drawn",
        bind="query-params",
        max_selections=_MOST_FEATURES,
    )
    show_legend(held.rule_set.actions, marks="broken")
    tracks = audit_tracks(held, rows)
    timeline = Timeline.of(tracks, rows.stop - rows.start)
    st.html(mark_room(timeline) + mark_at(timeline, current - rows.start))
    with st.container(key="timeline", gap="xxsmall"):
        st.plotly_chart(
            intervention_strip(tracks, step_texts(held, rows), timeline),
            key="episode_strip",
            on_select=lambda: _pick("episode_strip", rows.start),
            selection_mode="points",
            config={"displayModeBar": False},
            alt="What the expert did at each step, what the rule in force says, and the breaks",
        )
        if chosen:
            names = ", ".join(features[index].name for index in chosen)
            st.plotly_chart(
                feature_lines(
                    [features[index] for index in chosen],
                    held.observations[rows][:, chosen],
                    held.is_broken[rows],
                    timeline,
                    first=rows.start,
                ),
                key="episode_features",
                on_select=lambda: _pick("episode_features", rows.start),
                selection_mode="points",
                config={"displayModeBar": False},
                alt=f"Step by step: {names}",
            )


def _first_features(rule_set: RuleSet) -> list[int]:
    """Those that the rules ask about in the most states first."""
    weights: Counter[int] = Counter()
    for rule in rule_set:
        for feature in {bounds.feature for bounds in rule.bounds}:
            weights[feature] += rule.samples
    raw = range(len(rule_set.source.features))
    order = sorted(raw, key=lambda index: -weights[index])
    return order[:_AT_FIRST]
