"""How often each rule comes back, on the page Evidence."""

from __future__ import annotations

from concurrent.futures import Executor
from functools import partial
from typing import Any

import streamlit as st

from sarl_core.explaining.tables.evidence import stability_columns
from sarl_core.mining.language import counted, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.validation.stability import SAME_RULE, Stability, rule_stability
from sarl_core.progress import Progress
from sarl_dashboard.components.journey.steps_needed import say_steps_needed
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.tables import table_height
from sarl_dashboard.components.worked_out import worked_out
from sarl_dashboard.views.evidence.evidence import RuleSetEvidence

TABLE_ROWS = 12


def show_stability(evidence: RuleSetEvidence) -> None:
    """How often each rule comes back."""
    mined = evidence.parts.mined
    if say_steps_needed("how often a rule comes back", mined):
        return
    if not evidence.rule_set.rules or mined.n_episodes < 2:
        st.info(
            "There is no rule to look for; lower a threshold."
            if mined.n_episodes > 1
            else "There is one episode only, so none can be drawn again.",
            icon=":material/info:",
        )
        return
    with st.container(horizontal=True, vertical_alignment="bottom"):
        rounds = int(
            st.number_input(
                "Rounds",
                5,
                500,
                30,
                key="rounds",
                bind="query-params",
                width=130,
                help=with_words(
                    "In each, as many episodes as there are are drawn, some of them several "
                    "times and others not at all, and the rules are mined again."
                ),
            )
        )
        st.caption(
            "A rule has come back if a new one that says the same covers mostly the same "
            f"states: those that both cover are at least {share_text(SAME_RULE)} of those that "
            "either covers. In brackets: where nine in ten of the new thresholds lay."
        )
    rule_set = evidence.rule_set

    def work(executor: Executor, progress: Progress) -> Stability:
        return rule_stability(rule_set, mined, rounds=rounds, executor=executor, progress=progress)

    worked_out(
        "stability",
        (evidence, rounds),
        work,
        f"Mines {rounds} rule sets.",
        partial(_show_stability, rule_set),
    )


def _show_stability(rule_set: RuleSet, stability: Stability) -> None:
    import pandas as pd

    table = pd.DataFrame(stability_columns(rule_set.rules, rule_set, stability))
    table = table.sort_values(["Comes back", "States"], ascending=False)
    often = sum(one.returns >= 0.5 for one in stability.rules)
    st.markdown(
        f"**{often:,} of {counted(len(stability.rules), 'rule')}** came back in at least half of "
        f"{counted(stability.rounds, 'round')}."
    )
    share: dict[str, Any] = {
        "min_value": 0.0,
        "max_value": 100.0,
        "format": "%.1f %%",
        "color": "gray",
    }
    column = st.column_config
    st.dataframe(
        table,
        hide_index=True,
        height=table_height(len(table), TABLE_ROWS),
        key="stability_table",
        column_config={
            "Action": column.TextColumn(width=150),
            "Comes back": column.ProgressColumn(
                width=120, help="Share of the rounds in which it came back", **share
            ),
            "Overlap": column.ProgressColumn(
                width=120,
                help="With the most similar new rule, in the middle of all rounds: states that "
                "both cover over states that either covers",
                **share,
            ),
            "States": column.NumberColumn(width=75, format="localized"),
            "Thresholds and their bands": column.TextColumn(width=540),
            "Rule": column.TextColumn(width=75),
        },
        alt="How often each rule came back, and how far its thresholds moved",
    )
