"""The rules, as a table or as dots, and the one that is chosen among them."""

from __future__ import annotations

import streamlit as st

from sarl_core.mining.language import threshold_text
from sarl_core.mining.rules import Rule, Thresholds
from sarl_dashboard.components.settings import switch
from sarl_dashboard.components.tables import column_config, row_height, table_height
from sarl_dashboard.state import rule_base
from sarl_dashboard.state.url import set_url_choice, url_choice
from sarl_dashboard.views.rules.in_force import InForce
from sarl_dashboard.views.rules.listing import Listed, listed_rules, matching
from sarl_dashboard.views.rules.rule import make_ready, show_rule
from sarl_dashboard.views.rules.scatter import axis_choices, show_scatter

TABLE_ROWS = 8
TABLE, SCATTER = "Table", "Scatter plot"


def nothing_in_force(thresholds: Thresholds) -> None:
    """What to do where no rule is in force."""
    st.info(
        f"No part of the tree has a support of at least {threshold_text(thresholds.support)} and a "
        f"confidence of at least {threshold_text(thresholds.confidence)}, so there is no rule. "
        "Lower one of them on the Thresholds page, whose maps show where there are rules.",
        icon=":material/filter_alt_off:",
    )
    st.page_link("thresholds.py", label="Go to Thresholds", icon=":material/arrow_forward:")


@st.fragment
def search_and_rules(in_force: InForce) -> None:
    """What is searched for, and the rules that match."""
    listed = listed_rules(in_force.rule_set)
    places = matching(listed, in_force)
    if places:
        table_and_rule(listed, places, in_force)
    else:
        url_choice("rule", [rule.id for rule in listed.rules], listed.rules[0].id)
        st.info(
            "No rule matches the search; clear it, and the lower bound, to see all.",
            icon=":material/search_off:",
        )


@st.fragment
def table_and_rule(listed: Listed, places: list[int], in_force: InForce) -> None:
    """The table of rules or their dots, and the chosen one: another choice runs this part alone.

    Args:
        listed: All rules.
        places: Those of them that match, in the order of the table.
        in_force: What they come from.
    """
    rules = [listed.rules[place] for place in places]
    ids = [rule.id for rule in listed.rules]
    chosen_id = url_choice("rule", ids, ids[0])
    row = next((row for row, rule in enumerate(rules) if rule.id == chosen_id), None)
    above, below = st.container(), st.container()
    with below:  # the rule is what was asked for, and a large table takes its time
        show_rule(listed.rules[ids.index(chosen_id)], in_force, lambda: walk(rules, row))
    with above:
        with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
            way = switch(
                "Show", "show", [TABLE, SCATTER], "The rules as rows, or as dots by two numbers"
            )
            axes = axis_choices(in_force.rule_set) if way == SCATTER else None
        if axes is not None:
            count = count_text(len(places), listed, in_force)
            show_scatter(rules, in_force.rule_set, axes, chosen_id, count)
        else:
            rule_rows(listed, places, in_force, row)
    # What the buttons lead to is made while nobody waits for it.
    for neighbour in () if row is None else (row + 1, row - 1):
        if 0 <= neighbour < len(rules):
            make_ready(rules[neighbour], in_force)


def walk(rules: list[Rule], row: int | None) -> None:
    """The buttons from rule to rule, in the order of the table."""
    before = rules[row - 1].id if row else None
    at = -1 if row is None else row  # a rule that is not in the table stands before it
    after = rules[at + 1].id if at + 1 < len(rules) else None
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        for name, icon, rule_id in (
            ("Previous rule", ":material/chevron_left:", before),
            ("Next rule", ":material/chevron_right:", after),
        ):
            st.button(
                name,
                icon=icon,
                key=name.split()[0].lower(),
                on_click=set_url_choice,
                args=("rule", rule_id),
                disabled=rule_id is None,
            )


def rule_rows(listed: Listed, places: list[int], in_force: InForce, row: int | None) -> None:
    """The table of the rules that match, the chosen one selected."""
    select_row(row)
    high = row_height(in_force.rule_set)
    st.dataframe(
        listed.table if len(places) == len(listed.rules) else listed.table.take(places),
        hide_index=True,
        column_config=column_config(in_force.rule_set),
        height=table_height(len(places), TABLE_ROWS, high),
        row_height=high,
        key="rule_table",
        on_select=lambda: pick(listed, places),
        selection_mode="single-row",
        selection_default={"selection": {"rows": [] if row is None else [row]}},
        alt="All rules in force",
    )
    st.caption(
        f"{count_text(len(places), listed, in_force)} The most support first. Click a heading to "
        "sort, the box at the left of a row to see the rule below."
    )


def count_text(matching: int, listed: Listed, in_force: InForce) -> str:
    """How many rules there are, and how many of them match."""
    total = len(listed.rules)
    kind = "" if rule_base.compact_name() is None else "compact "
    count = f"{total:,} {kind}rules" if total > 1 else f"One {kind}rule"
    return f"{matching:,} of {count.lower()} match." if matching < total else f"{count}."


def pick(listed: Listed, places: list[int]) -> None:
    """Choose the rule whose row was selected."""
    rows = st.session_state["rule_table"]["selection"]["rows"]
    if rows and rows[0] < len(places):
        set_url_choice("rule", listed.rules[places[rows[0]]].id)


def select_row(row: int | None) -> None:
    """Select a row of the table, or none, before it is drawn; it keeps a choice of its own."""
    table = st.session_state.get("rule_table")
    rows = [] if row is None else [row]
    if table is not None and list(table["selection"]["rows"]) != rows:
        st.session_state["rule_table"] = {"selection": {"rows": rows}}
