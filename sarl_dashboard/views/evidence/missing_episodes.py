"""How many more episodes each rule would take, on the page Evidence."""

from __future__ import annotations

from typing import Any

import streamlit as st

from sarl_core.explaining.html.evidence import enough_plot
from sarl_core.explaining.html.headings import note
from sarl_core.explaining.tables.evidence import enough_columns
from sarl_core.explaining.words.evidence import least_text, never_text
from sarl_dashboard.cache import cached
from sarl_dashboard.components.tables import action_column, table_height
from sarl_dashboard.views.evidence.evidence import RuleSetEvidence


@cached()
def _enough(evidence: RuleSetEvidence) -> Any:
    import pandas as pd

    findings = evidence.findings
    columns = enough_columns(
        findings.rules,
        evidence.rule_set,
        findings.missing,
        findings.influences,
    )
    # A list of one, which the table shows in the action's colour.
    columns["Action"] = [[action] for action in columns["Action"]]
    return pd.DataFrame(columns)


def show_enough(evidence: RuleSetEvidence) -> None:
    """How many more episodes each rule would take."""
    findings = evidence.findings
    if findings.judged is None:
        st.info(
            "Whether the demonstrations are enough, only episodes can say that the rules were not "
            "mined from. "
            + (
                "Hold some out above."
                if evidence.mined is None
                else "Hold some out where these steps are mined."
            ),
            icon=":material/info:",
        )
        return
    least = least_text(evidence.thresholds)
    st.html(
        note(
            f"How many more episodes until the lower end of a rule's interval would reach {least}, "
            "if the same share of them was held out, and the rule applied as often and was right "
            "as often, and as unevenly, as so far. Where the confidence itself does not lie above "
            "that, no number is enough."
        )
    )
    none = never_text(findings.missing)
    if none:
        st.html(note(none))
        table = st.container()
    else:
        left, table = st.columns([1, 2], gap="medium")
        with left, st.container(key="enough"):
            st.html(enough_plot(findings.missing, least))
    with table:
        column = st.column_config
        forbidding = [rule for rule in findings.rules if rule.forbids]
        st.dataframe(
            _enough(evidence),
            hide_index=True,
            height=table_height(len(findings.rules), 6),
            key="enough_table",
            column_config={
                "Rule": column.TextColumn(width=60),
                "Action": action_column(
                    evidence.rule_set.actions, "What the rule says", forbidding
                )[0],
                "Still missing": column.TextColumn(width=155),
                "Held out": column.TextColumn(
                    width=170,
                    help="How often it was right in an episode held out, on average over those",
                ),
                "Interval": column.TextColumn(
                    width=130, help="What so few or so many episodes can tell (95 %)"
                ),
                "Verdict": None,
                "Mined from": column.TextColumn(
                    width=160, help="How often it was right in the states it was mined from"
                ),
                "Moved most by": column.TextColumn(
                    width=195, help="The one episode without which the share would differ most"
                ),
                "When": column.TextColumn(width=420),
            },
            alt="What each rule still misses",
        )
