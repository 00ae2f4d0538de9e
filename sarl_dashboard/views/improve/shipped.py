"""Before a run: what the page does, and what the shipped rules have achieved with it."""

from __future__ import annotations

from typing import Any

import streamlit as st
from msgspec import Struct

from sarl_core.documents import Count, MisfitError, Number, Share, conformed, read_object
from sarl_core.errors import InputError, SarlError
from sarl_core.explaining.figures.aggregation import card_points
from sarl_core.explaining.figures.rule_budgets import budget_figure, budget_points
from sarl_core.explaining.words.comparison import POLICY_TEXT
from sarl_core.improving.aggregation_files import card_path
from sarl_core.mining.language import counted, share_text
from sarl_core.rollouts.failures import rate_text
from sarl_core.rollouts.statistics import Rate
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.settings import switch
from sarl_dashboard.state.data import SHIPPED_SETS, uncombined_demonstrations
from sarl_dashboard.state.rule_files import RULES_FOLDER, compact_file, compact_sets
from sarl_dashboard.text import escaped, refuse
from sarl_dashboard.views.improve.outcome import show_rounds, size_text

BUDGETS = "budgets.json"
ADVICE = "write it again"
FIGURE_WIDTH = 560  # pixels

ROUNDS = (
    "Choose how many rules there may be, then press Run. Each round the rules act in a novice's "
    "place, and the expert says what it would have done in the states they lead to; the best round "
    "is reported on fresh episodes."
)
GAPS = (
    "Choose how many episodes, then press Find the gaps. The rules act in a novice's place, and "
    "the states in which no rule applies are listed: those that need a demonstration."
)


def show_shipped(*, gaps: bool) -> None:
    """What the page does, and what has been achieved with it.

    Args:
        gaps: Whether there is nobody to ask, so that states without a rule are looked for.
    """
    st.info(
        f"{GAPS if gaps else ROUNDS} The work goes on while you look at other pages, and what is "
        "finished stays when you cancel.",
        icon=":material/play_circle:",
    )
    if gaps:
        return
    try:
        there = [_show_cards(), show_budgets()]
    except SarlError as error:
        refuse(error)
        return
    if not any(there):
        st.caption(
            f"No results are shipped for {escaped(_task() or 'these data')}; a run shows what few "
            "rules achieve there."
        )


def _task() -> str:
    """The environment of the chosen data, "" where they name none."""
    demonstrations = uncombined_demonstrations()
    return "" if demonstrations is None else demonstrations.env_id


def _show_cards() -> bool:
    """What the compact sets of the chosen data have achieved, one at a time; whether there are."""
    names = [name for name in compact_sets() if card_path(compact_file(name)).is_file()]
    if not names:
        return False
    st.header("The compact rules that are shipped")
    name = names[0] if len(names) == 1 else switch("Compact rules", "shipped_set", names)
    show_card(read_object(card_path(compact_file(name)), ADVICE))
    return True


class Reported(Struct):
    """What a card says of the episodes that it reports."""

    episodes: Count
    mean: Number
    std: Number
    min: Number
    failures: Count | None = None
    failure_low: Share = 0.0
    failure_high: Share = 1.0
    cut: Count = 0
    freedom: Share | None = None
    intervention_rate: Share = 0.0


class ShippedCard(Struct):
    """What a card says, but for its rounds."""

    command: str
    rules_per_dimension: list[Count]
    chosen_round: Count
    refined: bool
    reported: Reported | None
    turns: Count = 0
    generations: Count = 0  # of a search of thresholds alone, before there were turns


def show_card(document: dict[str, Any]) -> None:
    """How the shipped compact rules came about."""
    try:
        card = conformed(document, ShippedCard)
    except MisfitError as error:
        raise InputError(
            f"the card of the compact rules lacks a part ({error}); make the rules again with "
            "aggregate"
        ) from error
    points = card_points(document)
    st.markdown(card_sentence(card))
    with st.popover("The command that made them", icon=":material/terminal:"):
        st.code(card.command, language="sh", wrap_lines=True)
    show_rounds(
        points,
        chosen=card.chosen_round,
        reported=None if card.reported is None else card.reported.mean,
        key="card",
    )


def card_sentence(card: ShippedCard) -> str:
    """What the rules of a card achieve, for Markdown."""
    size = size_text(card.rules_per_dimension)
    effort = counted(card.turns, "turn") if card.turns else counted(card.generations, "step")
    afterwards = f", refined in {effort} afterwards" * card.refined
    origin = f"They are those of round {card.chosen_round}{afterwards}."
    reported = card.reported
    if reported is None:
        return f"These are {size}. {origin}"
    return (
        f"A novice that acts at random, kept to these {size}, reached a mean return of "
        f"**{reported.mean:,.1f}** over {reported.episodes:,} fresh episodes "
        f"(deviation {reported.std:,.1f}, least {reported.min:,.1f})"
        f"{_failures_of_card(reported)}. {origin}{_policy_of_card(reported)}"
    )


def _failures_of_card(reported: Reported) -> str:
    """How many of a card's episodes failed; nothing where it does not say."""
    if reported.failures is None:
        return ""
    rate = Rate(
        reported.failures,
        reported.episodes,
        reported.failures / max(reported.episodes, 1),
        reported.failure_low,
        reported.failure_high,
        reported.cut,
    )
    return f"; failures: {rate_text(rate)}"


def _policy_of_card(reported: Reported) -> str:
    """That a card's rules are a policy, where they leave nothing to choose from."""
    if reported.freedom != 0:
        return ""
    changed = share_text(reported.intervention_rate)
    return f" {POLICY_TEXT}: they changed {changed} of the novice's steps."


def show_budgets() -> bool:
    """Return against number of rules in the environment of the chosen data; whether it is known.

    What was found in another task says nothing of them.
    """
    file, env_id = RULES_FOLDER / BUDGETS, _task()
    if not env_id or not file.is_file():
        return False
    points = budget_points(read_object(file, ADVICE), env_id)
    if not points:
        return False
    label = {shipped: label for label, shipped in SHIPPED_SETS.values()}.get(env_id, env_id)
    st.header("How many rules it takes")
    st.caption(
        f"What the best rules of each number achieve on fresh episodes of {escaped(label)}, with a "
        "novice that acts at random. A number of rules is the most of any one action."
    )
    with st.container(width=FIGURE_WIDTH):
        chart(budget_figure(points), "budget", f"{label}: return against the number of rules")
    return True
