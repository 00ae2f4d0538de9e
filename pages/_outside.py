"""The choice of what a rule does outside the data it was mined from, on several pages."""

from __future__ import annotations

from typing import Literal, cast, get_args

import streamlit as st

from sarl_core.mining.rules import RuleSet
from sarl_core.shielding.shield import Outside

OUTSIDE: tuple[Outside, ...] = get_args(Outside)


def outside_choice(width: Literal["stretch"] | int = "stretch") -> Outside:
    """The choice, kept in the URL (outside).

    Args:
        width: Of the widget, in pixels.
    """
    return cast(
        "Outside",
        st.selectbox(
            "Outside the data",
            OUTSIDE,
            key="outside",
            bind="query-params",
            width=width,
            help="What a rule does in a state beyond the least and largest values seen where it "
            "applies. Act: it changes the action all the same, and the step is marked. Abstain: "
            "it leaves the action to the agent.",
        ),
    )


def no_boxes_notice(rule_sets: list[RuleSet], outside: Outside) -> None:
    """Say where abstaining does nothing, because a rule file does not say where its data lay."""
    if outside == "abstain" and any(
        rule_set.rules and all(rule.box is None for rule in rule_set.rules)
        for rule_set in rule_sets
    ):
        st.info(
            "This rule file keeps no data boxes: its rules act everywhere, also with “abstain”. "
            "Mine them again to have the boxes.",
            icon=":material/frame_inspect:",
        )
