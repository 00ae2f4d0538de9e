"""The rules that a search, an action and a lower bound let through, and all of them as files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import streamlit as st

from sarl_core.explaining.exports.export import rules_to_csv
from sarl_core.explaining.words.evidence import remedy_text, shortfall_text
from sarl_core.mining.language import action_text, conditions_text
from sarl_core.mining.rule_set import RuleSet, rules_to_json
from sarl_core.mining.rules import Rule
from sarl_core.mining.validation.holding_out import lower_bound, shortfall, with_lower_bound
from sarl_dashboard.cache import cached
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.settings import search_box
from sarl_dashboard.components.tables import frame
from sarl_dashboard.state.data import data_parts, held_out_demonstrations
from sarl_dashboard.text import in_full
from sarl_dashboard.views.rules.in_force import InForce

EVERY = "every action"


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
def listed_rules(rule_set: RuleSet) -> Listed:
    """All rules, ready to be filtered."""
    import pyarrow as pa

    rules = tuple(sorted(rule_set.rules, key=lambda rule: -rule.samples))
    names = [f"{rule_set.name_of(rule)}{'' if rule.enabled else ', off'}" for rule in rules]
    table = frame(rules, rule_set, names)
    return Listed(
        rules,
        pa.Table.from_pandas(table, preserve_index=False),
        tuple(action_text(rule.action, rule_set.actions[rule.dimension]) for rule in rules),
        tuple(map(lower_bound, rules)),
    )


def matching(listed: Listed, in_force: InForce) -> list[int]:
    """Places of the rules that the search and the choice of action let through."""
    rule_set, compact = in_force.rule_set, in_force.compact
    names = list(
        dict.fromkeys(
            action_text(label, dimension)
            for dimension in rule_set.actions
            for label in range(dimension.n_labels)
        )
    )
    with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
        words = search_box()
        action = st.selectbox(
            "Action",
            [EVERY, *names],
            key="action",
            bind="query-params",
            width=220,
            label_visibility="collapsed",
        )
        tried = compact is None and held_out_demonstrations() is not None
        least = lower_bound_choice() if tried else 0.0
        sure = [place for place, bound in enumerate(listed.lower) if bound >= least]
        stem = f"rules-{in_force.demonstrations.env_id.replace('/', '-') or 'unnamed'}"
        if compact is not None and not in_force.edits:
            downloads(stem, len(compact.shipped), lambda: compact.shipped)
        else:
            downloads(
                stem, len(sure), lambda: with_lower_bound(rule_set, least) if least else rule_set
            )
    if len(sure) < len(listed.rules):
        why_left_out(listed, least)
    places = sure if action == EVERY else [place for place in sure if listed.does[place] == action]
    if not words:
        return places
    return [place for place in places if has_words(listed, place, rule_set, words)]


def has_words(listed: Listed, place: int, rule_set: RuleSet, words: tuple[str, ...]) -> bool:
    """Whether a rule has all words of a search."""
    rule, does = listed.rules[place], listed.does[place]
    text = f"{conditions_text(rule, rule_set)} {does} {rule_set.name_of(rule)}".lower()
    return all(word in text for word in words)


def downloads(stem: str, count: int, make_set: Callable[[], RuleSet]) -> None:
    """The whole rule set as files, made when asked for."""
    for kind, ending, write in (
        ("JSON", "json", rules_to_json),
        ("CSV", "csv", rules_to_csv),
        ("Text", "txt", RuleSet.to_text),
    ):
        download(
            kind,
            partial(lambda write: write(make_set()), write),
            f"{stem}.{ending}",
            key=f"download_{ending}",
            meaning=f"All {count:,} rules" if count != 1 else "The one rule",
        )


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
    missing = shortfall(listed.rules, least, parts.held_out.n_episodes)
    remedy = remedy_text(missing, parts.remaining.n_episodes)
    st.caption(f"{shortfall_text(missing)}." + (f" {in_full(remedy)}" if remedy else ""))
