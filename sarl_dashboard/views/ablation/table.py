"""What the page Worth of each rule shows: its result, a figure, a table, and the chosen rule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import streamlit as st

from sarl_core.environments.failures import no_failures_text
from sarl_core.explaining.colours import chip_colour
from sarl_core.explaining.figures.ablation import (
    FIGURE_ROWS,
    METHOD,
    VERDICT_COLOURS,
    ablation_columns,
    ablation_figure,
    ablation_text,
    left_out_text,
)
from sarl_core.explaining.tables.spreadsheet_cells import safe_cells
from sarl_core.mining.language import sentence
from sarl_core.studies.ablation import Ablation
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.keeping import keep_result_button
from sarl_dashboard.components.lists.rows import row_choice, selected_row
from sarl_dashboard.components.safety import safety_tiles
from sarl_dashboard.components.settings import notes_notice
from sarl_dashboard.components.tables import action_column
from sarl_dashboard.text import escaped
from sarl_dashboard.views.ablation.settings import AblationChoice

TABLE_ROWS = 14
ROW_HEIGHT = 33  # pixels


def show(ablation: Ablation, choice: AblationChoice, *, at_work: bool) -> None:
    """An ablation, as far as it is finished.

    Args:
        ablation: To show.
        choice: What was asked for.
        at_work: Whether more is on its way.
    """
    notes_notice(note for note in ablation.remarks if note not in ablation.base.notes)
    with st.grid(6, min_column_width=150):
        st.metric(
            "Return, all rules",
            f"{ablation.base.returns.mean():,.1f}",
            border=True,
            height="stretch",
        )
        failures, (first, *others) = (
            ablation.base.failures,
            safety_tiles(ablation.base, shielded=True),
        )
        count = "–" if failures is None else f"{failures.count:,} of {failures.of:,}"
        replace(first, value=count).show("Failures, all rules")
        for tile in others:
            tile.show()
        st.metric("Rules taken out", f"{len(ablation.rules):,}", border=True, height="stretch")
        st.metric(
            "Episodes run for it",
            f"{ablation.played:,}",
            border=True,
            height="stretch",
            help=with_words(
                f"Of {len(ablation.rules) * len(ablation.base):,}: in the others the rule that is "
                "taken out changed nothing, so they are the same without it."
            ),
        )
    if not at_work:
        st.markdown("\n\n".join(map(escaped, ablation_text(ablation))))
        if left := left_out_text(ablation):
            st.info(left, icon=":material/filter_list:")
    if not ablation.rules:
        if not at_work:
            st.info(
                "No rule changed an action in these episodes, so none can be told from the others. "
                "Choose another agent, as the novice, or rules that apply more often.",
                icon=":material/rule:",
            )
        return
    figure(ablation)
    table(ablation, choice)
    st.caption(METHOD)


def figure(ablation: Ablation) -> None:
    """The rules with the largest differences."""
    ranked = sorted(ablation.effects, key=lambda effect: effect.difference.mean)
    if len(ranked) > FIGURE_ROWS:
        largest = sorted(ranked, key=lambda effect: -abs(effect.difference.mean))[:FIGURE_ROWS]
        ranked = [effect for effect in ranked if effect in largest]
        st.caption(f"The {FIGURE_ROWS} rules whose removal moves the return most.")
    chart(
        ablation_figure(ablation, ranked),
        "ablation_figure",
        "For each rule, the change of the return without it, with its 95 % interval",
    )


def table(ablation: Ablation, choice: AblationChoice) -> None:
    """All rules that were taken out; one can be chosen."""
    import pandas as pd

    rule_set = ablation.shield.rule_set
    columns = ablation_columns(ablation)
    columns["Verdict"] = [[verdict] for verdict in columns["Verdict"]]
    columns["Action"] = [[action] for action in columns["Action"]]
    rows = len(ablation.rules)
    names = [rule_set.name_of(rule_set.rules[index]) for index in ablation.rules]
    chosen = st.dataframe(
        pd.DataFrame(columns),
        hide_index=True,
        height="content" if rows <= TABLE_ROWS else (TABLE_ROWS + 1) * ROW_HEIGHT,
        column_config=column_config(ablation),
        key="ablation_table",
        on_select="rerun",
        selection_mode="single-row",
        alt="What became of the episodes without each rule",
    )
    row_choice("ablation_table", names, selected_row("ablation_table", rows))
    with st.container(horizontal=True, vertical_alignment="center"):
        st.caption(
            "Click a heading to sort, the box at the left of a row to read the rule.",
            width="content",
        )
        name = str(choice.wanted.row.env_id).rsplit("/", 1)[-1].rsplit(":", 1)[-1]
        file = f"ablation-{name}-{choice.wanted.row.seed}.csv"
        download("Download CSV", lambda: csv(ablation), file, key="ablation_csv")
        keep_result_button(lambda: csv(ablation), file, key="keep_ablation")
    picked = chosen["selection"]["rows"]
    if picked and picked[0] < rows:
        rule = rule_set.rules[ablation.rules[picked[0]]]
        with st.container(border=True):
            st.markdown(f"**{rule_set.name_of(rule)}.** {escaped(sentence(rule, rule_set))}")
            if choice.linked is not None:
                st.page_link(
                    "rules.py",
                    label="Open this rule",
                    icon=":material/rule:",
                    query_params={**query(), **choice.linked, "rule": rule.id},
                )


def query() -> Mapping[str, str]:
    """What the URL says now."""
    parameters: dict[str, str] = st.query_params.to_dict()
    return parameters


def column_config(ablation: Ablation) -> dict[str, Any]:
    """What the columns look like, and what they mean."""
    column = st.column_config
    rule_set = ablation.shield.rule_set
    forbidding = [rule for rule in rule_set.rules if rule.forbids]
    action, action_width = action_column(rule_set.actions, "What the rule says", forbidding)
    failures = (
        f"Of {len(ablation.base):,} episodes; with all rules it is {ablation.base_failures:,}"
        if ablation.failures_known
        else no_failures_text(ablation.base.env_id)
    )
    return {
        "Rule": column.TextColumn(pinned=True, width=76),
        "Verdict": column.MultiselectColumn(
            options=[verdict.capitalize() for verdict in VERDICT_COLOURS],
            color=list(map(chip_colour, VERDICT_COLOURS.values())),
            width=160,
            help="Load-bearing: without it the return is lower, or more episodes fail. Harmful: "
            "the other way round.",
        ),
        "Return without it": column.NumberColumn(
            format="%+.1f",
            width=136,
            help="Return without the rule less the return with it, mean over all episodes",
        ),
        "95 % interval": column.TextColumn(
            alignment="right", width=136, help="Of that mean difference, of this rule alone"
        ),
        "Failures without it": column.NumberColumn(format="%d", width=140, help=failures),
        "Changed": column.NumberColumn(
            format="localized", width=86, help="Steps at which it changed the action"
        ),
        "In force": column.NumberColumn(
            format="localized", width=80, help="Steps at which it applied"
        ),
        "Episodes": column.NumberColumn(
            format="localized", width=86, help="In which it made a difference to an action"
        ),
        "Action": action,
        "When": column.TextColumn(
            width=450 - action_width, help="The conditions under which the rule applies"
        ),
    }


def csv(ablation: Ablation) -> bytes:
    """The table as a file, every number in full."""
    frame = ablation.to_frame()
    frame.insert(0, "seed", int(ablation.base.seeds[0]))
    frame.insert(0, "agent", ablation.base.agent)
    frame.insert(0, "environment", ablation.base.env_id)
    return str(safe_cells(frame).to_csv(index=False)).encode()
