"""Placed rules that overrule others: in words, and with an example state of each."""

from __future__ import annotations

from typing import Any, cast

import streamlit as st

from sarl_core.explaining.words.edits import conflict_text
from sarl_core.explaining.words.states import state_columns
from sarl_core.mining.action_words import says_text
from sarl_core.shielding.effects import Verdicts
from sarl_dashboard.components.tables import table_height
from sarl_dashboard.state import edits
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.text import escaped

MOST_CONFLICTS = 4


def conflicts(of: Base, verdicts: Verdicts) -> None:
    """Placed rules that overrule others, with an example of each."""
    import pandas as pd

    if verdicts.rule_set.forbids:
        return  # they add up, so none takes a state from another
    st.header("Conflicts")
    if not verdicts.conflicts:
        st.caption("No placed rule takes a state from another rule that says something else.")
        return
    rule_set, noun = verdicts.rule_set, edits.basis_of(of).noun
    lines = [conflict_text(one, rule_set, states=noun) for one in verdicts.conflicts]
    st.markdown("\n".join(f"- {escaped(line)}" for line in lines[:MOST_CONFLICTS]))
    if len(lines) > MOST_CONFLICTS:
        st.caption(f"The largest {MOST_CONFLICTS} of {len(lines):,}; the table has them all.")
    st.dataframe(
        pd.DataFrame(_conflict_rows(of, verdicts)),
        hide_index=True,
        height=table_height(len(lines), 6),
        key="conflicts",
        alt="Rules that are overruled, with an example state of each",
        column_config={
            "States": st.column_config.NumberColumn(format="localized", width=70),
            "Rule": st.column_config.TextColumn(width=90, help="The placed rule, which decides"),
            "Takes from": st.column_config.TextColumn(
                width=90, help="The rule that would decide without it"
            ),
        },
    )


def _conflict_rows(of: Base, verdicts: Verdicts) -> dict[str, list[Any]]:
    rule_set, basis = verdicts.rule_set, edits.basis_of(of)
    rows: dict[str, list[Any]] = {"Rule": [], "Says": [], "Takes from": [], "Which says": []}
    rows["States"] = [one.states for one in verdicts.conflicts]
    for one in verdicts.conflicts:
        for who, says, at in (("Rule", "Says", one.rule), ("Takes from", "Which says", one.other)):
            rule = rule_set.rules[at]
            rows[who].append(rule_set.name_of(rule))
            rows[says].append(says_text(rule, rule_set.actions[rule.dimension]))
    if basis.expert is not None:
        rows["Expert as the rule"] = [one.right for one in verdicts.conflicts]
        rows["Expert as the other"] = [one.other_right for one in verdicts.conflicts]
        demonstrations = cast(Any, edits.demonstrations_for(of.rule_set))
        examples = [one.example for one in verdicts.conflicts]
        rows["Example episode"] = demonstrations.episodes[examples].tolist()
        rows["Example step"] = demonstrations.steps[examples].tolist()
    examples = [one.example for one in verdicts.conflicts]
    states = basis.ground.states[examples]
    for column in state_columns(rule_set.source.features):
        rows[column.title] = (
            column.words(states) if column.of_words else states[:, column.places[0]].tolist()
        )
    return rows
