"""Rules: every rule in plain language, with the evidence behind it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import streamlit as st

from sarl_core.explaining.exports.export import rules_to_csv, rules_to_text
from sarl_core.explaining.words.evidence import remedy_text, shortfall_text
from sarl_core.mining.language import action_text, conditions_text, threshold_text
from sarl_core.mining.rule_files import rules_to_json
from sarl_core.mining.rules import Rule, RuleSet
from sarl_core.mining.validation.holding_out import lower_bound, shortfall, with_lower_bound
from sarl_dashboard.cache import cached
from sarl_dashboard.components.edits_notice import notice
from sarl_dashboard.components.tables import column_config, frame, table_height
from sarl_dashboard.jobs import cross_fitting
from sarl_dashboard.state import compact_set
from sarl_dashboard.state.data import data_parts, held_out_digest, require_demonstrations
from sarl_dashboard.state.mined import grown_trees, mined_rules
from sarl_dashboard.state.thresholds import chosen_divider, chosen_thresholds
from sarl_dashboard.state.url import set_url_choice, url_choice
from sarl_dashboard.text import in_full
from sarl_dashboard.views.rules.rule import Behind, make_ready, show_rule

TABLE_ROWS = 8
EVERY = "every action"

st.title("Rules")
notice()
demonstrations = require_demonstrations()
compact = compact_set.chosen_compact(demonstrations)
thresholds = chosen_thresholds()
grown = grown_trees(demonstrations, chosen_divider()) if compact is None else compact.trees


@dataclass(frozen=True, eq=False)
class Listed:
    """The rules of the table.

    Attributes:
        rules: The most support first.
        table: The same as an Arrow table, which takes no time to send.
        does: What each says.
        lower: The lower bound of each.
    """

    rules: tuple[Rule, ...]
    table: Any
    does: tuple[str, ...]
    lower: tuple[float, ...]


@cached(show_spinner="Writing the rules in plain language …")
def listed_of(key: tuple[object, ...], _rule_set: RuleSet) -> Listed:
    """All rules, ready to be filtered."""
    import pyarrow as pa

    rules = tuple(sorted(_rule_set.rules, key=lambda rule: -rule.samples))
    table = frame(rules, _rule_set, list(map(_rule_set.name_of, rules)))
    return Listed(
        rules,
        pa.Table.from_pandas(table, preserve_index=False),
        tuple(action_text(rule.action, _rule_set.actions[rule.dimension]) for rule in rules),
        tuple(map(lower_bound, rules)),
    )


def downloads(count: int, make_set: Callable[[], RuleSet]) -> None:
    """The whole rule set as files, made when asked for."""
    name = f"rules-{demonstrations.env_id.replace('/', '-') or 'unnamed'}"
    for kind, mime, make in (
        ("JSON", "application/json", rules_to_json),
        ("CSV", "text/csv", rules_to_csv),
        ("Text", "text/plain", rules_to_text),
    ):
        suffix = "txt" if kind == "Text" else kind.lower()
        st.download_button(
            kind,
            data=lambda make=make: make(make_set()),  # type: ignore[misc]
            mime=mime,
            file_name=f"{name}.{suffix}",
            on_click="ignore",
            icon=":material/download:",
            key=f"download_{suffix}",
            help=f"All {count:,} rules" if count != 1 else "The one rule",
        )


def nothing_in_force() -> None:
    """What to do where no rule is in force."""
    st.info(
        f"No part of the tree has a support of at least {threshold_text(thresholds.support)} and a "
        f"confidence of at least {threshold_text(thresholds.confidence)}, so there is no rule. "
        "Lower one of them on the Thresholds page, whose maps show where there are rules.",
        icon=":material/filter_alt_off:",
    )
    st.page_link("thresholds.py", label="Go to Thresholds", icon=":material/arrow_forward:")


def pick(shown: list[int], rules: tuple[Rule, ...]) -> None:
    """Choose the rule whose row was selected."""
    rows = st.session_state["rule_table"]["selection"]["rows"]
    if rows and rows[0] < len(shown):
        set_url_choice("rule", rules[shown[rows[0]]].id)


def select_row(place: int | None) -> None:
    """Select a row of the table, or none, before it is drawn; it keeps a choice of its own."""
    kept = st.session_state.get("rule_table")
    rows = [] if place is None else [place]
    if kept is not None and list(kept["selection"]["rows"]) != rows:
        st.session_state["rule_table"] = {"selection": {"rows": rows}}


def walk(shown: list[int], rules: tuple[Rule, ...], place: int | None) -> None:
    """The buttons from rule to rule, in the order of the table."""
    before = None if not place else rules[shown[place - 1]].id
    at = -1 if place is None else place  # a rule that is not in the table stands before it
    after = rules[shown[at + 1]].id if at + 1 < len(shown) else None
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


def matching(listed: Listed, rule_set: RuleSet) -> list[int]:
    """Places of the rules that the search and the choice of action let through."""
    names = list(
        dict.fromkeys(
            action_text(label, dimension)
            for dimension in rule_set.actions
            for label in range(dimension.n_labels)
        )
    )
    with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
        words = st.text_input(
            "Search",
            key="search",
            bind="query-params",
            icon=":material/search:",
            width=300,
            placeholder="a feature, an action, a number",
            label_visibility="collapsed",
        )
        action = st.selectbox(
            "Action",
            [EVERY, *names],
            key="action",
            bind="query-params",
            width=220,
            label_visibility="collapsed",
        )
        least = lower_bound_choice() if compact is None and held_out_digest() else 0.0
        sure = [at for at, low in enumerate(listed.lower) if low >= least]
        if compact is not None:
            downloads(len(compact.shipped), lambda: compact.shipped)
        else:
            downloads(len(sure), lambda: with_lower_bound(rule_set, least) if least else rule_set)
    if len(sure) < len(listed.rules):
        why_left_out(listed, least)
    wanted = (words or "").lower().split()
    places = sure if action == EVERY else [at for at in sure if listed.does[at] == action]
    return [at for at in places if has(listed, at, rule_set, wanted)] if wanted else places


def has(listed: Listed, at: int, rule_set: RuleSet, wanted: list[str]) -> bool:
    """Whether a rule has all words of a search."""
    rule = listed.rules[at]
    text = f"{conditions_text(rule, rule_set)} {listed.does[at]} {rule_set.name_of(rule)}".lower()
    return all(word in text for word in wanted)


def lower_bound_choice() -> float:
    """The least lower bound of a rule; 0 for any."""
    least = st.number_input(
        "Lower bound at least",
        0.0,
        1.0,
        0.0,
        0.05,
        key="lower",
        bind="query-params",
        width=150,
        help="Only rules whose 95 % interval of confidence, over the held-out episodes, lies at or "
        "above this. The downloads hold these rules. 0: all.",
    )
    return float(least or 0.0)


def why_left_out(listed: Listed, least: float) -> None:
    """Why rules do not reach the lower bound, and where none does, what to do."""
    parts = data_parts()
    assert parts is not None
    assert parts.held_out is not None
    found = shortfall(listed.rules, least, parts.held_out.n_episodes)
    told = f"{shortfall_text(found)}."
    remedy = remedy_text(found, parts.remaining.n_episodes)
    st.caption(f"{told} {in_full(remedy)}" if remedy else told)


@st.fragment
def search_and_rules(rule_set: RuleSet) -> None:
    """What is searched for, and the rules that match."""
    key = (
        (rule_set.source.digest, rule_set.divider, thresholds, held_out_digest())
        if compact is None
        else (compact.digest,)
    )
    listed = listed_of(key, rule_set)
    shown = matching(listed, rule_set)
    if shown:
        table_and_rule(listed, shown, rule_set)
    else:
        url_choice("rule", [rule.id for rule in listed.rules], listed.rules[0].id)
        st.info(
            "No rule matches the search; clear it, and the lower bound, to see all.",
            icon=":material/search_off:",
        )


@st.fragment
def table_and_rule(listed: Listed, shown: list[int], rule_set: RuleSet) -> None:
    """The table of rules, and the chosen one: another choice runs this part alone."""
    rules = listed.rules
    chosen_id = url_choice("rule", [rule.id for rule in rules], rules[0].id)
    place = next((row for row, at in enumerate(shown) if rules[at].id == chosen_id), None)
    behind = Behind(demonstrations, grown, thresholds, compact)
    above, below = st.container(), st.container()
    with below:  # the rule is what was asked for, and a large table takes its time
        show_rule(
            next(rule for rule in rules if rule.id == chosen_id),
            rule_set,
            behind,
            lambda: walk(shown, rules, place),
        )
    with above:
        rule_rows(listed, shown, rule_set, place)
    # What the buttons lead to is made while nobody waits for it.
    for other in () if place is None else (place + 1, place - 1):
        if 0 <= other < len(shown):
            make_ready(rules[shown[other]], behind)


def rule_rows(listed: Listed, shown: list[int], rule_set: RuleSet, place: int | None) -> None:
    """The table of the rules that match, the chosen one selected."""
    rules = listed.rules
    select_row(place)
    st.dataframe(
        listed.table if len(shown) == len(rules) else listed.table.take(shown),
        hide_index=True,
        column_config=column_config(rule_set),
        height=table_height(len(shown), TABLE_ROWS),
        key="rule_table",
        on_select=lambda: pick(shown, rules),
        selection_mode="single-row",
        selection_default={"selection": {"rows": [] if place is None else [place]}},
        alt="All rules in force",
    )
    kind = "" if compact is None else "compact "
    count = f"{len(rules):,} {kind}rules" if len(rules) > 1 else f"One {kind}rule"
    st.caption(
        (f"{len(shown):,} of {count.lower()} match. " if len(shown) < len(rules) else f"{count}. ")
        + "The most support first. Click a heading to sort, the box at the left of a row to see "
        "the rule below."
    )


with st.spinner("Mining the rules …"):
    in_force = mined_rules(grown, thresholds) if compact is None else compact.counted
if not in_force.rules:
    nothing_in_force()
else:
    cross_fitting.told(thresholds, in_force.fidelity)
    search_and_rules(in_force)
cross_fitting.make_ready()
