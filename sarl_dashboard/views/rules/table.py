"""The rules, as a table or as dots, and the one that is chosen among them."""

from __future__ import annotations

import numpy as np
import streamlit as st

from sarl_core.mining.language import limit_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_dashboard.components.lists.pages import follow, number_of_pages, page_choice
from sarl_dashboard.components.settings import switch
from sarl_dashboard.components.tables import (
    column_config,
    row_height,
    rows_selected_anew,
    select_row,
    table_height,
)
from sarl_dashboard.state import rule_base
from sarl_dashboard.state.url import set_url_choice, url_text
from sarl_dashboard.text import digest_of
from sarl_dashboard.views.rules.in_force import InForce
from sarl_dashboard.views.rules.listing import (
    Listed,
    Places,
    listed_rules,
    matching,
    table_of,
)
from sarl_dashboard.views.rules.rule import make_ready, show_rule
from sarl_dashboard.views.rules.scatter import axis_choices, show_scatter

TABLE_ROWS = 8
PAGE_ROWS = 2_000  # that a browser is sent at once
PAGE = "rules_page"
TABLE, SCATTER = "Table", "Scatter plot"
# What the rows of several pages may be ordered by, and whether the least comes first.
AS_LISTED = "most support first"
ORDERS = {
    AS_LISTED: ("", 1),
    "highest confidence first": ("confidence", -1),
    "highest lift first": ("lift", -1),
    "shortest first": ("length", 1),
    "longest first": ("length", -1),
}


def nothing_in_force(thresholds: Thresholds) -> None:
    """What to do where no rule is in force."""
    if thresholds.never is not None and not thresholds.demands:
        st.info(
            f"No part of the tree has a support of at least {limit_text(thresholds.support)} and "
            "an action whose share there is shown to be at most "
            f"{limit_text(thresholds.never)}, so nothing is forbidden. Lower the minimum support "
            "or raise epsilon on the Thresholds page, whose maps show where there are rules.",
            icon=":material/filter_alt_off:",
        )
        st.page_link("thresholds.py", label="Go to Thresholds", icon=":material/arrow_forward:")
        return
    st.info(
        f"No part of the tree has a support of at least {limit_text(thresholds.support)} and a "
        f"confidence of at least {limit_text(thresholds.confidence)}, so there is no rule. "
        "Lower one of them on the Thresholds page, whose maps show where there are rules.",
        icon=":material/filter_alt_off:",
    )
    st.page_link("thresholds.py", label="Go to Thresholds", icon=":material/arrow_forward:")


@st.fragment
def search_and_rules(in_force: InForce) -> None:
    """What is searched for, and the rules that match."""
    listed = listed_rules(in_force.rule_set)
    places = matching(listed, in_force)
    if len(places):
        table_and_rule(listed, places, in_force)
    else:
        chosen_rule(listed, in_force.rule_set, AS_LISTED)
        st.info(
            "No rule matches the search; clear it, and the lower bound, to see all.",
            icon=":material/search_off:",
        )


@st.fragment
def table_and_rule(listed: Listed, places: Places, in_force: InForce) -> None:
    """The table of rules or their dots, and the chosen one: another choice runs this part alone.

    Args:
        listed: All rules.
        places: Those of them that match, in the order of the table.
        in_force: What they come from.
    """
    rule_set, order = in_force.rule_set, AS_LISTED
    above, below = st.container(), st.container()
    with above, st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
        way = switch(
            "Show", "show", [TABLE, SCATTER], "The rules as rows, or as dots by two numbers"
        )
        axes = axis_choices(rule_set) if way == SCATTER else None
        if axes is None and len(places) > PAGE_ROWS:
            order = order_choice()
    places = in_order(listed, places, order)
    chosen = chosen_rule(listed, rule_set, order)
    row = next(iter(np.flatnonzero(places == listed.place[chosen.id]).tolist()), None)
    with below:  # the rule is what was asked for, and a large table takes its time
        show_rule(chosen, in_force, lambda: walk(rule_set, places, row))
    with above:
        if axes is not None:
            count = count_text(len(places), in_force)
            matching_rules = [rule_set[place] for place in places.tolist()]
            show_scatter(matching_rules, rule_set, axes, chosen.id, count)
        else:
            rule_rows(places, in_force, chosen, row)
    # What the buttons lead to is made while nobody waits for it.
    for neighbour in () if row is None else (row + 1, row - 1):
        if 0 <= neighbour < len(places):
            make_ready(rule_set[int(places[neighbour])], in_force)


def chosen_rule(listed: Listed, rule_set: RuleSet, order: str) -> Rule:
    """The rule that is looked at: that of the URL, else the first of all."""
    first = rule_set[int(in_order(listed, listed.places, order)[0])].id
    return rule_set[listed.place[url_text("rule", first, listed.place.__contains__)]]


def order_choice() -> str:
    """The order of several pages (URL: order): a click on a heading sorts one of them alone."""
    return st.selectbox(
        "Order",
        list(ORDERS),
        key="order",
        bind="query-params",
        width=220,
        label_visibility="collapsed",
    )


def in_order(listed: Listed, places: Places, order: str) -> Places:
    """Rules in one of the `ORDERS`, where two are equal as they were listed."""
    measure, sign = ORDERS[order]
    if not measure:
        return places
    return places[np.argsort(sign * listed.measures[measure][places], kind="stable")]


def walk(rule_set: RuleSet, places: Places, row: int | None) -> None:
    """The buttons from rule to rule, in the order of the table."""
    at = -1 if row is None else row  # a rule that is not in the table stands before it
    before = rule_set[int(places[row - 1])].id if row else None
    after = rule_set[int(places[at + 1])].id if at + 1 < len(places) else None
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


def rule_rows(places: Places, in_force: InForce, chosen: Rule, row: int | None) -> None:
    """The table of the rules that match, a page of it, the chosen one selected."""
    pages = number_of_pages(len(places), PAGE_ROWS)
    at_row = (row or 0) // PAGE_ROWS
    follow(PAGE, digest_of(places.tobytes()), chosen.id, page=at_row, pages=pages)
    table = st.container()
    # Which page it is has to be known before the table, which stands above the choice.
    page = page_choice(PAGE, pages)
    first = page * PAGE_ROWS
    part = places[first : first + PAGE_ROWS]
    at = row - first if row is not None and 0 <= row - first < len(part) else None
    with table:
        # A table a page: what is chosen in one is not taken for a row of another.
        page_rows(part, in_force, at, f"rule_table_{page}" if page else "rule_table")
        where, sort = "", "sort"
        if pages > 1:
            where = f"Rows {first + 1:,} to {first + len(part):,}. "
            sort = "sort the page"
        order = "" if pages > 1 else "The most support first. "
        st.caption(
            f"{count_text(len(places), in_force)} {where}{order}Click a heading to {sort}, the box "
            "at the left of a row to see the rule below."
        )


def page_rows(places: Places, in_force: InForce, row: int | None, key: str) -> None:
    """Some rows of the table, the chosen one selected."""
    select_row(row, key)
    rule_set = in_force.rule_set
    high = row_height(rule_set)
    st.dataframe(
        table_of(rule_set, places.tobytes()),
        hide_index=True,
        column_config=column_config(rule_set),
        height=table_height(len(places), TABLE_ROWS, high),
        row_height=high,
        key=key,
        on_select=lambda: pick(rule_set, places, key, row),
        selection_mode="single-row",
        selection_default={"selection": {"rows": [] if row is None else [row]}},
        alt="All rules in force",
    )


def count_text(matching: int, in_force: InForce) -> str:
    """How many rules there are, and how many of them match."""
    total = len(in_force.rule_set)
    kind = "" if rule_base.compact_name() is None else "compact "
    count = f"{total:,} {kind}rules" if total > 1 else f"One {kind}rule"
    return f"{matching:,} of {count.lower()} match." if matching < total else f"{count}."


def pick(rule_set: RuleSet, places: Places, key: str, drawn: int | None) -> None:
    """Choose the rule whose row was selected, which was drawn with another."""
    rows = rows_selected_anew(key, drawn)
    if rows and rows[0] < len(places):
        set_url_choice("rule", rule_set[int(places[rows[0]])].id)
