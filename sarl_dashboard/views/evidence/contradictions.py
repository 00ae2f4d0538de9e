"""States on which demonstrations disagree, on the page Evidence."""

from __future__ import annotations

from functools import partial

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.figures.evidence import EPISODES_DRAWN, contradictions_figure
from sarl_core.explaining.tables.evidence import episode_columns, pair_columns
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.validation.contradictions import (
    NEAR,
    Contradictions,
    by_episode,
    find_contradictions,
)
from sarl_dashboard.cache import cached
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.journey.steps_needed import say_steps_needed
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.tables import table_height
from sarl_dashboard.components.worked_out import worked_out
from sarl_dashboard.state import hold_out
from sarl_dashboard.text import escaped

AT_ONCE = 50_000  # pairs up to which contradictions are looked for without being asked


@cached(show_spinner="Comparing every state with those near it …")
def _contradictions(demonstrations: Demonstrations, divider: int, reach: float) -> Contradictions:
    return find_contradictions(demonstrations, divider=divider, reach=reach)


def show_contradictions(remaining: Demonstrations, rule_set: RuleSet) -> None:
    """States on which demonstrations disagree, and which episode does so most.

    Args:
        remaining: Those that are not left out.
        rule_set: Knows the actions and their intervals.
    """
    if say_steps_needed("looking for contradictions", remaining):
        return
    divider = rule_set.divider
    reach = float(
        st.select_slider(
            "How near is near",
            [0.0, 0.02, 0.05, NEAR, 0.2, 0.3],
            value=NEAR,
            key="reach",
            bind="query-params",
            width=340,
            help=with_words(
                "No feature of the two states differs by more than this share of its standard "
                "deviation over all states."
            ),
        )
    )
    st.caption(
        "A state contradicts another one if it is the very same and was shown with another "
        "action, or if its nearest state of another episode is near and was shown with another "
        "one. Where the expert changes its mind within a short way, near states may differ "
        "rightly; an episode far above the others is what to look at."
    )
    if len(remaining) > AT_ONCE:
        worked_out(
            "contradictions",
            (remaining, divider, reach),
            lambda executor, progress: executor.submit(
                find_contradictions, remaining, divider=divider, reach=reach
            ).result(),
            f"Compares {len(remaining):,} states, which takes a while.",
            partial(_show, remaining, rule_set),
        )
        return
    _show(remaining, rule_set, _contradictions(remaining, divider, reach))


def _show(remaining: Demonstrations, rule_set: RuleSet, contradictions: Contradictions) -> None:
    dimension = None
    actions = rule_set.actions
    if len(actions) > 1:
        names = ["any action", *(action.name for action in actions)]
        name = st.selectbox("Action", names, key="contradiction", bind="query-params", width=260)
        dimension = names.index(name) - 1 if name in names[1:] else None
    flags = contradictions.contradicting(dimension)
    which = slice(None) if dimension is None else [dimension]
    identical = int(contradictions.identical[:, which].any(axis=1).sum())
    near = int(contradictions.near[:, which].any(axis=1).sum())
    compared = int((contradictions.neighbour >= 0).sum())
    st.markdown(
        f"**{int(flags.sum()):,} of {counted(len(remaining), 'state')}** contradict another: "
        f"{identical:,} are identical to one with another action, {near:,} of {compared:,} that "
        "have a near one in another episode differ from it."
    )
    episodes = by_episode(remaining, contradictions, dimension)
    if not flags.any():
        st.info(
            "No demonstrations disagree at this distance. Widen it to look further.",
            icon=":material/check_circle:",
        )
        return
    left, right = st.columns(2, gap="medium")
    with left:
        chart(
            contradictions_figure(episodes),
            "contradictions",
            "Share of contradicting steps of each episode",
        )
        if len(episodes) > EPISODES_DRAWN:
            st.caption(f"The first {EPISODES_DRAWN} of {len(episodes):,} episodes.")
    with right:
        selected = st.dataframe(
            episode_columns(episodes),
            hide_index=True,
            height=table_height(len(episodes), 6),
            key="episode_table",
            on_select="rerun",
            selection_mode="multi-row",
            column_config={
                "Episode": st.column_config.NumberColumn(width=68, format="%d"),
                "Share": st.column_config.NumberColumn(
                    width=66, format="%.1f %%", help="Of its steps, those that contradict another"
                ),
                "Contradicting": st.column_config.NumberColumn(width=100),
                "Identical": st.column_config.NumberColumn(
                    width=72, help="The very same state was also shown with another action"
                ),
                "Near": st.column_config.NumberColumn(
                    width=56, help="The nearest state of another episode has another action"
                ),
                "Steps": st.column_config.NumberColumn(width=58),
            },
            alt="Episodes by how much they contradict others",
        )
        rows = [row for row in selected.selection.rows if row < len(episodes)]
        chosen = tuple(episodes[row].episode for row in rows)
        st.button(
            f"Leave out {counted(len(chosen), 'episode')}" if chosen else "Leave out",
            icon=":material/playlist_remove:",
            key="leave_out_selected",
            disabled=not chosen,
            on_click=_leave_out,
            args=(chosen,),
            help="Tick episodes in the table. Every page follows, and nothing is deleted.",
        )
        st.caption(
            "Click the boxes at the left of rows, or go to a row by the arrow keys and press Shift "
            "and Space; Tab at the end of a row leaves the table."
        )
    for place, action in enumerate(actions):
        if dimension in (None, place) and contradictions.near[:, place].any():
            st.markdown(f"**The nearest pairs: {escaped(action.name)}**")
            st.dataframe(
                pair_columns(remaining, contradictions, divider=rule_set.divider, dimension=place),
                hide_index=True,
                height=table_height(int(contradictions.near[:, place].sum()), 6),
                key=f"pairs_{place}",
                column_config={"Distance": st.column_config.NumberColumn(format="%.3g")},
                alt="States and their nearest ones with another action",
            )


def _leave_out(episodes: tuple[int, ...]) -> None:
    hold_out.leave_out((*hold_out.chosen().left_out, *episodes))
