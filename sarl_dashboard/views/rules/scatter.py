"""All rules as dots, in the place of the table."""

from __future__ import annotations

from collections.abc import Sequence

import streamlit as st
from markupsafe import Markup

from sarl_core.explaining.figures.rules.measures import MEASURES, RuleMeasure, measures_of
from sarl_core.explaining.figures.rules.scatter import (
    SYMBOLS,
    RuleDot,
    colour_entries,
    largest_dots,
    rule_dots,
    rule_scatter,
)
from sarl_core.explaining.html.step_card import legend
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_dashboard.cache import cached
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.state.url import set_url_choice

_BARE = {"displayModeBar": False, "scrollZoom": False}
_WIDTH = 150  # pixels of a choice: two of them on a phone
_MEANING = (
    "Support: share of all states to which the rule applies. Confidence: share of those in which "
    "the expert did what the rule says. Lift: confidence over the action's share of all states. "
    "Joint support: share of all states to which the rule applies and in which it is right. "
    "Length: number of conditions; merged: after several on one feature are made one. Held out: "
    "how often it was right in an episode held out, and the lower end of its 95 % interval."
)


@cached(show_spinner="Measuring the rules …")
def measured(rule_set: RuleSet, title: str) -> dict[str, float]:
    """One measure of all rules by their ids; of very many rules some take their time."""
    measure = next(one for one in MEASURES if one.title == title)
    return {rule.id: measure.read(rule, rule_set.source.features) for rule in rule_set.rules}


def axis_choices(rule_set: RuleSet) -> tuple[RuleMeasure, RuleMeasure]:
    """The measures to the right and upwards (URL: across, upwards)."""
    measures = {one.title: one for one in measures_of(rule_set.rules, rule_set.source.features)}
    titles = list(measures)
    with st.container(horizontal=True, gap="small", width=2 * _WIDTH + 16):
        chosen = [
            st.selectbox(
                label,
                titles,
                index=index,
                key=key,
                bind="query-params",
                width=_WIDTH,
                help=with_words(_MEANING),
            )
            for label, key, index in (("To the right", "across", 0), ("Upwards", "upwards", 1))
        ]
    return measures[chosen[0]], measures[chosen[1]]


def show_scatter(
    rules: Sequence[Rule],
    rule_set: RuleSet,
    axes: tuple[RuleMeasure, RuleMeasure],
    chosen_id: str,
    count: str,
) -> None:
    """The rules that match as dots, the chosen one marked; a click chooses another one.

    Args:
        rules: Those that match.
        rule_set: All of them.
        axes: The measures to the right and upwards.
        chosen_id: Of the rule below.
        count: How many rules there are, and match, in words.
    """
    x, y = axes
    across, upwards = (measured(rule_set, measure.title) for measure in axes)
    placed = rule_dots(
        rules, [across[rule.id] for rule in rules], [upwards[rule.id] for rule in rules]
    )
    dots = largest_dots(placed)
    if not dots:
        st.info(
            f"No rule that matches has both numbers, {x.title.lower()} and {y.title.lower()}; "
            "choose another one.",
            icon=":material/scatter_plot:",
        )
        return
    st.html(colour_legend(dots, rule_set))
    st.plotly_chart(
        rule_scatter(dots, rule_set, x, y, chosen=chosen_id),
        key="rule_scatter",
        config=_BARE,
        selection_mode="points",
        on_select=lambda: pick_dot(dots, chosen_id),
        alt=f"The rules: {x.title} to the right, {y.title} upwards, the action as colour",
    )
    st.caption(" ".join([count, *sentences(rules, placed, dots, chosen_id)]))


def colour_legend(dots: Sequence[RuleDot], rule_set: RuleSet) -> Markup:
    """What the colours mean, and where there are several action dimensions, what the forms do."""
    entries = colour_entries(dots, rule_set)
    several = len(entries) > 1
    return Markup().join(
        legend(some, before=f"{SYMBOLS[number % len(SYMBOLS)][1]}:" if several else "")
        for number, some in enumerate(entries)
        if some
    )


def sentences(
    rules: Sequence[Rule], placed: Sequence[RuleDot], dots: Sequence[RuleDot], chosen_id: str
) -> list[str]:
    """What cannot be seen of the dots: how many rules they are, and which are not among them."""
    there = sum(len(dot.rules) for dot in placed)
    most = max(len(dot.rules) for dot in dots)
    texts = ["Click a dot to see the rule below, or go from rule to rule by the buttons."]
    if most > 1:
        texts.append(
            f"A larger dot is several rules with the same two numbers, here up to {most:,}: "
            "another click on it opens the next of them, another axis parts them."
        )
    if there < len(rules):
        missing = counted(len(rules) - there, "rule")
        texts.append(f"Not drawn: {missing} of which one of the two numbers is not known.")
    if len(dots) < len(placed):
        texts.append(
            f"Drawn are the {len(dots):,} dots of the rules with the most states, of "
            f"{len(placed):,}."
        )
    for dot in dots:
        ids = [rule.id for rule in dot.rules]
        if chosen_id in ids and len(ids) > 1:
            texts.append(
                f"The rule below is {ids.index(chosen_id) + 1:,} of {len(ids):,} at its dot."
            )
    return texts


def pick_dot(dots: Sequence[RuleDot], chosen_id: str) -> None:
    """Choose the first rule of the clicked dot, or the next one where one of its was chosen.

    A second click on a dot takes its selection back, and means the dot all the same.
    """
    points = st.session_state["rule_scatter"].selection.points
    if points and "customdata" in points[0]:
        data = points[0]["customdata"]
        # Which of the two arrives depends on how the numbers were packed for the browser.
        st.session_state["_dot"] = str(
            next(iter(data.values())) if isinstance(data, dict) else data[0]
        )
    first = st.session_state.get("_dot")
    dot = next((dot for dot in dots if dot.rules[0].id == first), None)
    if dot is not None:
        set_url_choice("rule", dot.after(chosen_id).id)
