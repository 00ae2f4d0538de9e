"""The table of rules, as two pages show it."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic
from typing import Any, Literal

import streamlit as st

from sarl_core.demonstrations.derived import Combination
from sarl_core.explaining.colours import chip_colour, label_colour
from sarl_core.explaining.tables.evidence import held_out_columns
from sarl_core.explaining.tables.rules import rule_columns
from sarl_core.explaining.words.evidence import VERDICT_COLOURS, VERDICTS
from sarl_core.mining.action_words import action_text, says_text
from sarl_core.mining.evidence import FEWEST_EPISODES
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_dashboard.components.journey.words import word_help

ROW_HEIGHT = 33  # pixels, at the theme's font size
_LATE = 2.0  # seconds in which a table may still say what was selected in it before
_TALL_ROW = 76  # four lines
_PHRASE = 260  # pixels: what a combination is called, on one line or two
_NAME = 62  # pixels: four digits


def action_column(
    actions: Sequence[LabelledDimension], meaning: str, forbidding: Sequence[Rule] = ()
) -> tuple[Any, int]:
    """The column of what rules say, each action in its colour, and how many pixels wide it is.

    Args:
        actions: Action dimensions and their labels.
        meaning: Help.
        forbidding: Never-rules among the rules, each in the colour of what it forbids.
    """
    labels = {
        action_text(label, dimension): label
        for dimension in actions
        for label in range(dimension.n_labels)
    } | {says_text(rule, actions[rule.dimension]): rule.label for rule in forbidding}
    # About seven pixels a letter; what a long action takes, the conditions give.
    width = min(max(150, 30 + 7 * max(map(len, labels), default=0)), 250)
    column = st.column_config.MultiselectColumn(
        width=width,
        help=meaning,
        options=list(labels),
        color=[chip_colour(label_colour(label)) for label in labels.values()],
    )
    return column, width


def column_config(rule_set: RuleSet) -> dict[str, Any]:
    """What the columns look like; all have help that says what they mean.

    The widths sum to what is left of a window 1440 pixels wide; on a phone the name, the action
    and the beginning of the conditions are seen.
    """
    column = st.column_config
    forbidding = [rule for rule in rule_set.rules if rule.forbids]
    does = "What the expert does there" + ", or at most rarely" * bool(forbidding)
    action, action_width = action_column(rule_set.actions, does, forbidding)
    return {
        "Rule": column.TextColumn(
            width=_NAME, help="Its name: rules are numbered by their place in the set"
        ),
        "Action": action,
        "When": column.TextColumn(
            width=max(472 - _NAME - action_width, _PHRASE if _combines(rule_set) else 0),
            help="The conditions under which the rule applies",
        ),
        "Support": column.NumberColumn(width=80, format="%.2f %%", help=word_help("support")),
        "Confidence": column.ProgressColumn(
            width=112,
            min_value=0.0,
            max_value=100.0,
            format="%.2f %%",
            color="gray",
            help=word_help("confidence"),
        ),
        "Lift": column.NumberColumn(width=58, format="%.2f", help=word_help("lift")),
        "Joint support": column.NumberColumn(
            width=100,
            format="%.2f %%",
            help="Share of all states to which the rule applies and in which it is right",
        ),
        "States": column.NumberColumn(
            width=72, format="localized", help="Demonstrated states to which the rule applies"
        ),
        "Length": column.NumberColumn(width=68, help="Number of conditions on the way to the rule"),
        "Held out": column.TextColumn(
            width=130, help="How often it was right in an episode held out, on average over those"
        ),
        "Verdict": column.MultiselectColumn(
            width=90,
            help="Where the 95 % interval of the held-out confidence lies: at or above the minimum "
            "confidence (reached), below it (too low), or on both sides (open); none with fewer "
            f"than {FEWEST_EPISODES} episodes",
            options=list(VERDICTS.values()),
            color=[chip_colour(VERDICT_COLOURS[name]) for name in VERDICTS],
        ),
        "Lower bound": column.NumberColumn(
            width=95,
            format="%.1f %%",
            help="Lower end of the 95 % interval of the held-out confidence",
        ),
    }


def frame(rules: Sequence[Rule], rule_set: RuleSet, names: Sequence[str]) -> Any:
    """Rules as a data frame, in the order given, with what each is called."""
    import pandas as pd

    columns = rule_columns(rules, rule_set)
    # A list of one, which the table shows in the action's colour.
    columns["Action"] = [[action] for action in columns["Action"]]
    columns["Rule"] = list(names)
    order: tuple[str, ...] = ("Rule", "Action", "When")
    tried = held_out_columns(rules, rule_set.thresholds)
    if tried:
        tried["Verdict"] = [[word] for word in tried["Verdict"]]
        # Next to what they compare with; the rarer measures go to the end.
        order = (*order, "Support", "Confidence", "Held out", "Verdict", "States")
        columns |= tried
    others = [name for name in columns if name not in order]
    return pd.DataFrame({name: columns[name] for name in (*order, *others)})


def row_height(*rule_sets: RuleSet) -> int:
    """How high a row is: what combinations are called takes a phrase, which wraps."""
    return _TALL_ROW if any(map(_combines, rule_sets)) else ROW_HEIGHT


def _combines(rule_set: RuleSet) -> bool:
    return any(isinstance(one.derived, Combination) for one in rule_set.source.features)


def table_height(rows: int, most: int, row: int = ROW_HEIGHT) -> int | Literal["content"]:
    """As high as its rows, or as so many of them; where rows are high, as fewer."""
    high = (most + 1) * ROW_HEIGHT + ROW_HEIGHT // 2
    return "content" if ROW_HEIGHT + rows * row <= high else high


def select_row(row: int | None, key: str) -> None:
    """Select a row of a table, or none, before it is drawn; it keeps a choice of its own.

    Args:
        row: From 0.
        key: Of the table.
    """
    table = st.session_state.get(key)
    rows = _rows(row)
    if table is None or (before := list(table["selection"]["rows"])) == rows:
        return
    st.session_state[key] = {"selection": {"rows": rows}}
    # Said once more it is meant, so its time does not begin anew.
    if _left(key)[0] != before:
        st.session_state[f"_{key}_left"] = before, monotonic()


def rows_selected_anew(key: str, drawn: int | None) -> list[int] | None:
    """The rows that somebody has just selected in a table; None where nobody has.

    A table says what is selected in it a moment after it was drawn, and so maybe after something
    else was chosen beside it, which that would take back.

    Args:
        key: Of the table.
        drawn: The row that it was drawn with, from 0.
    """
    rows = list(st.session_state[key]["selection"]["rows"])
    left, when = _left(key)
    if rows == left:
        if monotonic() - when < _LATE:
            st.session_state[f"_{key}_left"] = left, -_LATE
            return None
        del st.session_state[f"_{key}_left"]
    return None if rows == _rows(drawn) else rows


def _left(key: str) -> tuple[list[int] | None, float]:
    """What was selected in a table before something else was chosen, and when that was."""
    left: tuple[list[int] | None, float] = st.session_state.get(f"_{key}_left", (None, 0.0))
    return left


def _rows(row: int | None) -> list[int]:
    return [] if row is None else [row]
