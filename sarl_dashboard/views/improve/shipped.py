"""Before a run: what the page does, and what the shipped rules have achieved with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import streamlit as st

from sarl_core.documents import parse_json
from sarl_core.errors import InputError, SarlError
from sarl_core.explaining.figures.aggregation import budget_figure, budget_points, card_points
from sarl_core.explaining.words.comparison import POLICY_TEXT
from sarl_core.improving.aggregation_files import card_path
from sarl_core.limits import limited_bytes
from sarl_core.mining.language import counted, share_text
from sarl_dashboard.components.chart import chart
from sarl_dashboard.state.data import SHIPPED_SETS
from sarl_dashboard.state.rule_files import RULES_FOLDER, compact_file
from sarl_dashboard.text import refuse
from sarl_dashboard.views.improve.outcome import show_rounds, size_text

BUDGETS = "budgets.json"


def show_shipped() -> None:
    """What the page does, and what has been achieved with it."""
    st.info(
        "Choose how many rules there may be, then press Run. Each round the rules act in a "
        "novice's place, and the expert says what it would have done in the states they lead to; "
        "the best round is reported on fresh episodes. The work goes on while you look at other "
        "pages, and what is finished stays when you cancel.",
        icon=":material/play_circle:",
    )
    file = card_path(compact_file())
    try:
        card = read_document(file)
        if card is not None:
            show_card(card)
        show_budgets()
    except SarlError as error:
        refuse(error)


def read_document(path: Path) -> dict[str, Any] | None:
    """A JSON file; None if there is none.

    Raises:
        InputError: If it cannot be read.
    """
    if not path.is_file():
        return None
    try:
        document = parse_json(limited_bytes(path))
    except (OSError, ValueError, InputError) as error:
        raise InputError(f"{path.name} cannot be read ({error}); write it again") from error
    if not isinstance(document, dict):
        raise InputError(f"{path.name} holds no JSON object; write it again")
    return document


def show_card(card: dict[str, Any]) -> None:
    """How the shipped compact rules came about."""
    points = card_points(card)
    try:
        sentence, chosen = card_sentence(card), int(card["chosen_round"])
        command = str(card["command"])
        reported = card["reported"]
        mean = float(reported["mean"]) if reported else None
        if not points:
            raise KeyError("rounds")
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the card of the compact rules lacks {error}; make the rules again with aggregate"
        ) from error
    st.subheader("The compact rules that are shipped")
    st.markdown(sentence)
    with st.popover("The command that made them", icon=":material/terminal:"):
        st.code(command, language="sh", wrap_lines=True)
    show_rounds(points, chosen=chosen, reported=mean, key="card")


def card_sentence(card: dict[str, Any]) -> str:
    """What the rules of a card achieve, for Markdown."""
    size = size_text([int(count) for count in card["rules_per_dimension"]])
    afterwards = ""
    if card["refined"]:
        afterwards = f", refined in {counted(int(card['generations']), 'step')} afterwards"
    origin = f"They are those of round {int(card['chosen_round'])}{afterwards}."
    reported = card["reported"]
    if not reported:
        return f"These are {size}. {origin}"
    return (
        f"A novice that acts at random, kept to these {size}, reached a mean return of "
        f"**{float(reported['mean']):,.1f}** over {int(reported['episodes']):,} fresh episodes "
        f"(deviation {float(reported['std']):,.1f}, least {float(reported['min']):,.1f})"
        f"{_failures_of_card(reported)}. {origin}{_policy_of_card(reported)}"
    )


def _failures_of_card(reported: dict[str, Any]) -> str:
    """How many of a card's episodes failed; nothing where it does not say."""
    if "failures" not in reported:
        return ""
    low, high = (share_text(float(reported[f"failure_{end}"])) for end in ("low", "high"))
    cut = int(reported.get("cut", 0))
    also = f", and {cut:,} were cut off before they could" if cut else ""
    return f"; {int(reported['failures']):,} of them failed{also} (95 % interval {low} to {high})"


def _policy_of_card(reported: dict[str, Any]) -> str:
    """That a card's rules are a policy, where they leave nothing to choose from."""
    if reported.get("freedom") != 0:
        return ""
    changed = share_text(float(reported["intervention_rate"]))
    return f" {POLICY_TEXT}: they changed {changed} of the novice's steps."


def show_budgets() -> None:
    """Return against number of rules, an environment each."""
    document = read_document(RULES_FOLDER / BUDGETS)
    if document is None:
        return
    budgets = [
        (label, points)
        for label, env_id in SHIPPED_SETS.values()
        if (points := budget_points(document, env_id))
    ]
    if not budgets:
        return
    st.subheader("How many rules it takes")
    st.caption(
        "What the best rules of each number achieve on fresh episodes, with a novice that acts at "
        "random. A number of rules is the most of any one action."
    )
    with st.grid(min(len(budgets), 3), min_column_width=300) as grid:
        for index, (label, points) in enumerate(budgets):
            with grid.cell():
                st.markdown(f"**{label}**")
                chart(
                    budget_figure(points),
                    f"budget_{index}",
                    f"{label}: return against the number of rules",
                )
