"""Which rules are exported, as what, and how they are made ready."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.projection import Projection
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import projection_choice, rule_set_choice
from sarl_dashboard.session import end_page
from sarl_dashboard.state.agents import PROJECTIONS
from sarl_dashboard.state.rule_choice import rules_for
from sarl_dashboard.state.rule_files import PAPERS
from sarl_dashboard.text import file_name, refuse


class Format(NamedTuple):
    """What a file may be: its ending, its language on screen, what is said of it."""

    suffix: str
    language: str | None
    meaning: str
    decides: bool = False  # it has an action for every state, and not the rules alone


FORMATS = {
    "JSON": Format(
        ".json",
        "json",
        "The rule file: every number in full, as it stands; all of this project reads it.",
    ),
    "CSV": Format(".csv", None, "A line a rule, for a spreadsheet."),
    "Markdown": Format(".md", "markdown", "A table for a wiki or a repository."),
    "Python": Format(".py", "python", "One function that needs nothing but Python 3.", True),
    "C": Format(".c", "c", "One function in C99 that needs nothing but the language.", True),
    "ONNX": Format(
        ".onnx", None, "A model for ONNX runtimes; writing it needs the package onnx.", True
    ),
}


@dataclass(frozen=True, eq=False)
class ExportSettings:
    """What is exported, and how.

    Attributes:
        rules: What they are called.
        rule_set: As it was chosen.
        form: Of the file.
        projection: What a continuous action becomes.
        rounded: Whether thresholds are rounded.
        merged: Whether conditions on one feature become one interval.
    """

    rules: str
    rule_set: RuleSet
    form: Format
    projection: Projection
    rounded: bool
    merged: bool

    @property
    def stem(self) -> str:
        """Name of the file, without its ending."""
        return f"rules-{file_name(self.rule_set.source.env_id)}"


def chosen_rules() -> tuple[str, RuleSet]:
    """The rules to carry away; where there are none to be had, say why and stop.

    Returns:
        What they are called, and the rules.
    """
    choice = rule_set_choice("carry", without=tuple(PAPERS))
    try:
        rule_set = rules_for(choice)
    except SarlError as error:
        refuse(error)
        end_page()
    assert rule_set is not None
    return choice, rule_set


def settings() -> ExportSettings:
    """The box of settings."""
    with st.container(border=True):
        left, middle, right = st.columns([4, 5, 3], gap="medium")
        with left:
            choice, rule_set = chosen_rules()
        with middle:
            name = st.pills(
                "Format",
                list(FORMATS),
                default="JSON",
                key="format",
                bind="query-params",
                required=True,
                wrap=True,  # else the last ones are cut off on a telephone
            )
            form = FORMATS[name or "JSON"]  # a link may end in "format="
            projection: Projection = PROJECTIONS[0]
            if rule_set.actions[0].is_interval and form.decides:
                projection = projection_choice()
        with right:
            rounded = st.toggle(
                "Round thresholds",
                value=True,
                key="rounded",
                bind="query-params",
                help=with_words(
                    "To the fewest digits that change no decision on the demonstrations"
                ),
            )
            merged = st.toggle(
                "Merge conditions",
                key="merged",
                bind="query-params",
                help=with_words(
                    "Several conditions on one feature become one interval, and each rule stands "
                    "by itself: easier to read, slower to execute"
                ),
            )
    return ExportSettings(choice, rule_set, form, projection, rounded, merged)
