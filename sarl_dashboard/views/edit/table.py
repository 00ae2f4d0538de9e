"""The rules as edited, in a table on the page Edit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.explaining.words.edits import state_text
from sarl_core.mining.action_words import says_text
from sarl_core.mining.editing.edits import Edit, apply
from sarl_core.mining.language import conditions_text, counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.shielding.effects import Verdicts
from sarl_dashboard.cache import cached
from sarl_dashboard.components.lists.pages import follow, number_of_pages, page_choice
from sarl_dashboard.components.lists.rows import row_choice
from sarl_dashboard.components.lists.rule_search import have_word, names_have_word
from sarl_dashboard.components.settings import search_box, switch
from sarl_dashboard.components.tables import (
    action_column,
    row_height,
    rows_selected_anew,
    table_height,
)
from sarl_dashboard.state import edits
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.state.url import set_url_choice, url_text
from sarl_dashboard.text import digest_of

Places = NDArray[np.int64]

TABLE_ROWS = 9
PAGE_ROWS = 2_000  # that a browser is sent at once
PAGE = "edit_page"
_IN_ORDER = (
    "Placed rules (manual or pinned) come first, in their order: the first that applies decides. "
    "Mined rules never overlap."
)
_ADD_UP = (
    "Rules that forbid add up: in a state everything is forbidden that one of them forbids there. "
    "Where a rule demands an action, they have no say."
)
EVERY, TOUCHED = "All rules", "Edited"


def in_order(rule_set: RuleSet) -> Places:
    """Places of the rules, the placed ones in their order, then the largest first."""
    placed = np.array([rule.placed for rule in rule_set.rules], dtype=np.bool_)
    samples = np.array([rule.samples for rule in rule_set.rules], dtype=np.int64)
    return np.lexsort((np.where(placed, 0, -samples), ~placed))


def table(of: Base, verdicts: Verdicts) -> Rule | None:
    """The rules as edited, a page of them; returns the chosen one."""
    rule_set = verdicts.rule_set
    with st.container(horizontal=True, gap="small", vertical_alignment="bottom"):
        words = search_box()
        view = switch("Show", "rules_shown", [EVERY, TOUCHED])
    made = edits.history(of).edits
    rows = _rows(edits.grown(of, made), made, view == TOUCHED, words)
    order = rows.order
    if not len(order):
        st.info(
            "No rule is edited yet; show all rules and choose one."
            if view == TOUCHED and not words
            else "No rule matches; clear the search to see all.",
            icon=":material/search_off:",
        )
        return None
    place = rows.place
    first_of_all = rule_set[int(order[0])].id
    chosen = rule_set[place[url_text("rule", first_of_all, place.__contains__)]]
    row = next(iter(np.flatnonzero(order == place[chosen.id]).tolist()), None)
    pages = number_of_pages(len(order), PAGE_ROWS)
    listing = rows.listing
    follow(PAGE, listing, chosen.id, page=(row or 0) // PAGE_ROWS, pages=pages)
    above = st.container()
    # Which page it is has to be known before the table, which stands above the choice.
    page = page_choice(PAGE, pages)
    first = page * PAGE_ROWS
    part = order[first : first + PAGE_ROWS]
    with above:
        at = row - first if row is not None and 0 <= row - first < len(part) else None
        # What is selected is a row: where the rows change places, it is another table.
        texts = _texts(edits.grown(of, made))
        _page_rows(verdicts, part, texts, at, f"edit_table_{listing}_{page}")
        several = counted(len(rule_set), "rule")
        st.caption(
            (f"{len(order):,} of {several}. " if len(order) < len(rule_set) else f"{several}. ")
            + (f"Rows {first + 1:,} to {first + len(part):,}. " if pages > 1 else "")
            + (_ADD_UP if rule_set.forbids else _IN_ORDER)
            + " Click the box at the left of a row to edit its rule."
        )
    return chosen


def _page_rows(
    verdicts: Verdicts,
    places: Places,
    texts: dict[str, tuple[str, str]],
    row: int | None,
    key: str,
) -> None:
    """Some rows of the table, the chosen one selected."""
    rule_set = verdicts.rule_set

    def pick() -> None:
        selected = rows_selected_anew(key, row)
        if selected and selected[0] < len(places):
            set_url_choice("rule", rule_set[int(places[selected[0]])].id)

    high = row_height(rule_set)
    st.dataframe(
        _with_numbers(verdicts, places, texts),
        hide_index=True,
        column_config=_columns(rule_set),
        height=table_height(len(places), TABLE_ROWS, high),
        row_height=high,
        key=key,
        on_select=pick,
        selection_mode="single-row",
        selection_default={"selection": {"rows": [] if row is None else [row]}},
        alt="The rules with all edits",
    )
    row_choice(key, [rule_set.name_of(rule_set[int(place)]) for place in places], row, pick)


def _touched(rule: Rule) -> bool:
    return rule.placed or rule.regrown or not rule.enabled


@dataclass(frozen=True, eq=False)
class EditRows:
    """The rows of the table, none of which is written in words for it.

    Attributes:
        order: Places of their rules.
        place: Of every rule of the set, by id.
        listing: What tells these rows in this order from others.
    """

    order: Places
    place: Mapping[str, int]
    listing: str


@cached()
def _rows(
    rule_set: RuleSet, edits: tuple[Edit, ...], touched: bool, words: tuple[str, ...]
) -> EditRows:
    """The rules that match."""
    edited_set = apply(rule_set, edits)
    place = {rule.id: at for at, rule in enumerate(edited_set.rules)}
    matches = np.ones(len(edited_set), dtype=np.bool_)
    if touched:
        matches &= np.array(list(map(_touched, edited_set.rules)), dtype=np.bool_)
    for word in words if matches.any() else ():
        matches &= _have_word(edited_set, rule_set, place, word)
    order = in_order(edited_set)
    order = order[matches[order]]
    ids = "\0".join(edited_set.rules[at].id for at in order.tolist())
    return EditRows(order, place, digest_of(ids.encode(errors="surrogatepass")))


def _have_word(
    edited_set: RuleSet, rule_set: RuleSet, place: Mapping[str, int], word: str
) -> NDArray[np.bool_]:
    """Whether the rules as edited have a word; what no edit changes is searched as it was."""
    have = names_have_word(edited_set, word)
    was = have_word(rule_set, word)
    before = {rule.id: at for at, rule in enumerate(rule_set.rules)}
    for rule_id, at in place.items():
        rule = edited_set.rules[at]
        if rule_id in before and rule.origin != "manual":
            have[at] |= was[before[rule_id]]
        else:
            have[at] |= word in " ".join(_text(rule, edited_set)).lower()
    return have


@cached()
def _texts(rule_set: RuleSet) -> dict[str, tuple[str, str]]:
    """What rules that no edit changes say and when, by id; filled as rows are first drawn."""
    return {}


def _text(rule: Rule, rule_set: RuleSet) -> tuple[str, str]:
    does = says_text(rule, rule_set.actions[rule.dimension])
    return does, conditions_text(rule, rule_set)


def _with_numbers(verdicts: Verdicts, places: Places, known: dict[str, tuple[str, str]]) -> Any:
    """The rows of some rules, with what edits change of them."""
    import pyarrow as pa

    rule_set = verdicts.rule_set
    rules = [rule_set.rules[at] for at in places.tolist()]
    decided = verdicts.decided[places]
    texts = []
    for rule in rules:
        text = None if rule.origin == "manual" else known.get(rule.id)
        if text is None:
            text = _text(rule, rule_set)
            if rule.origin != "manual":
                known[rule.id] = text
        texts.append(text)
    columns = {
        "On": [rule.enabled for rule in rules],
        "Kind": [state_text(rule).split(",")[0] if _touched(rule) else "mined" for rule in rules],
        "Rule": list(map(rule_set.name_of, rules)),
        "Action": [[does] for does, _ in texts],
        "When": [when for _, when in texts],
        "Decides": decided,
    }
    table = pa.table(columns)
    if verdicts.right is not None:
        right = verdicts.right[places].astype(float)
        right[decided == 0] = float("nan")
        share = pa.array(100 * right / decided.clip(min=1), from_pandas=True)
        table = table.append_column("Expert agrees", share)
    return table


def _columns(rule_set: RuleSet) -> dict[str, Any]:
    column = st.column_config
    forbidding = [rule for rule in rule_set.rules if rule.forbids]
    action, action_width = action_column(rule_set.actions, "What the rule says", forbidding)
    return {
        "On": column.CheckboxColumn(width=40, help="Whether a shield uses the rule"),
        "Kind": column.TextColumn(
            width=70,
            help="Mined; probed; regrown, with a part of the tree; pinned, so that it keeps its "
            "place; or added by hand",
        ),
        "Rule": column.TextColumn(
            width=80, help="Its name: rules are numbered by their place in the set"
        ),
        "Action": action,
        "When": column.TextColumn(
            width=570 - action_width, help="The conditions under which the rule applies"
        ),
        "Decides": column.NumberColumn(
            width=80,
            format="localized",
            help="States in which it is the rule in force; of one that forbids, in which it has a "
            "say",
        ),
        "Expert agrees": column.ProgressColumn(
            width=112,
            min_value=0.0,
            max_value=100.0,
            format="%.2f %%",
            color="gray",
            help="Share of those in which the expert did as it says",
        ),
    }
