"""The rule sets of the page Compare: two to five of them."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import FILTERED
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import RULE_SETS, offered_rule_sets, rule_sets_help
from sarl_dashboard.jobs import growing
from sarl_dashboard.state import in_force, rule_base
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.rule_choice import BETWEEN, rules_for
from sarl_dashboard.state.rule_files import EDITED, IN_FORCE, UNEDITED
from sarl_dashboard.state.thresholds import chosen_thresholds, least_support
from sarl_dashboard.state.url import set_url_choice, url_name
from sarl_dashboard.text import in_full

MOST = 5


@dataclass(frozen=True, eq=False)
class Side:
    """One of the sets.

    Attributes:
        rule_set: Its rules.
        name: On screen; no two are called alike.
    """

    rule_set: RuleSet
    name: str


def chosen_sides() -> list[Side]:
    """The widget, and what was chosen (URL: sets).

    Returns:
        The sets, the one that the others are held against first; without those that cannot be had,
        which is said on the page.
    """
    chosen = _named()
    offered = offered_rule_sets(RULE_SETS)
    stored = {
        name: label for name, label in rule_base.labels().items() if rule_base.is_in_library(name)
    }
    for name in chosen:
        if rule_base.is_in_library(name) and name not in stored:
            stored[name] = rule_base.library_label(name)
    st.session_state["_sets_choice"] = chosen
    st.multiselect(
        "Rule sets",
        [*offered, *stored, *(name for name in chosen if name not in (*offered, *stored))],
        format_func=lambda name: stored.get(name, name),
        key="_sets_choice",
        max_selections=MOST,
        on_change=_choose,
        help=with_words(
            f"Two to five; the others are held against the first. {rule_sets_help(offered)}"
        ),
    )
    sides: list[Side] = []
    for name in chosen:
        try:
            rule_set = rules_for(name)
        except SarlError as error:
            st.info(in_full(str(error)), icon=":material/link_off:")
            continue
        if rule_set is None:
            st.info(f"“{name}” is no rule set; choose others.", icon=":material/link_off:")
            continue
        sides.append(Side(rule_set, stored.get(name, name)))
    return sides


def _named() -> list[str]:
    usual: tuple[str, ...] = (UNEDITED, EDITED) if in_force.is_edited() else (IN_FORCE, _usual())
    before = [st.query_params.get(name, "") for name in ("first", "second")]
    if all(before) and "sets" not in st.query_params:  # an address of when there were two
        usual = (before[0], before[1])
    text = url_name("sets") or BETWEEN.join(usual)
    return list(dict.fromkeys(filter(None, text.split(BETWEEN))))[:MOST]


def _usual() -> str:
    """What the rules in force are held against first; of many states there are too many rules."""
    demonstrations = chosen_demonstrations()
    many = demonstrations is not None and growing.are_many(demonstrations)
    if not many and not least_support():
        return "unfiltered"
    return "" if chosen_thresholds() == FILTERED else "filtered"


def _choose() -> None:
    # Nothing chosen is a choice too, and not the usual one.
    set_url_choice("sets", BETWEEN.join(st.session_state["_sets_choice"]) or BETWEEN)
