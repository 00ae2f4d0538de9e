"""What stands beside every page: the choice of data, and the thresholds in force."""

from __future__ import annotations

from collections.abc import Callable

import streamlit as st

from sarl_core.environments.formulas import Formula
from sarl_core.errors import SarlError
from sarl_core.mining.language import counted, limit_text, threshold_text
from sarl_dashboard.components.hold_out import parting_lines
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.session import end_page
from sarl_dashboard.state import combining, data_words, in_force, rule_base
from sarl_dashboard.state.data import (
    all_demonstrations,
    choose_dataset,
    chosen_dataset,
    data_problem,
    dataset_labels,
    uncombined_demonstrations,
)
from sarl_dashboard.state.rule_files import CHOSEN
from sarl_dashboard.state.thresholds import (
    MIN_DIVIDER,
    choose_divider,
    chosen_divider,
    chosen_thresholds,
    keep_thresholds,
    threshold_values,
)
from sarl_dashboard.state.url import say_in_url
from sarl_dashboard.text import escaped, refuse, size_text


def threshold_parameters() -> dict[str, str | None]:
    """What the URL says of the thresholds in force, also on pages that have no widgets for them."""
    values = threshold_values() | {"divider": (chosen_divider(), MIN_DIVIDER)}
    return {
        name: None if value == default else threshold_text(value)
        for name, (value, default) in values.items()
    }


def require_data(title: str) -> None:
    """Where a link names what is not here, say so and stop: nothing takes its place.

    Args:
        title: Of the page.
    """
    if problem := data_problem():
        st.title(title)
        refuse(problem)
        st.page_link("library.py", label="Go to Library", icon=":material/arrow_forward:")
        end_page()
    if problem := data_words.problem():
        st.title(title)
        refuse(problem)
        _go_on_without(data_words.go_on_without)
        end_page()


def require_rules(title: str) -> None:
    """Where a link names rules or edits that are not here, say so and stop.

    Args:
        title: Of the page.
    """
    if problem := in_force.problem():
        st.title(title)
        refuse(problem)
        _go_on_without(in_force.go_on_without)
        end_page()
    if in_force.kind() != CHOSEN:  # on a narrow screen, whose sidebar is folded
        with st.container(key="rules_in_force"):
            st.caption(f"Rules: {escaped(in_force.title())}")


def _go_on_without(leave: Callable[[], None]) -> None:
    st.button(
        "Go on without them",
        key="go_on_without",
        icon=":material/arrow_forward:",
        on_click=leave,
    )


_FILE = "a rule file …"


def _rules_choice() -> None:
    """Which rules are in force, on every page."""
    labels = in_force.options()
    chosen = in_force.chosen()
    if st.session_state.get("_rules_choice") != _FILE:
        st.session_state["_rules_choice"] = chosen
    st.selectbox(
        "Rules",
        [*labels, _FILE],
        format_func=lambda option: labels.get(option, "A rule file …"),
        key="_rules_choice",
        on_change=_choose_rules,
        help=with_words(
            "In force on every page, and in every link to one. What was edited is among them, "
            "and what you keep in the Library."
        ),
    )
    if st.session_state["_rules_choice"] == _FILE:
        st.file_uploader("Rule file (.json)", key="rule_file", on_change=_take_file)
        if problem := st.session_state.pop("_rule_file_problem", ""):
            refuse(problem)


def _choose_rules() -> None:
    option = st.session_state["_rules_choice"]
    if option != _FILE:
        in_force.choose(option)


def _take_file() -> None:
    """Keep what was uploaded; the rules that were in force stay where it cannot be read."""
    file = st.session_state.get("rule_file")
    if file is None:
        return
    try:
        rule_base.take_file(file.getvalue(), file.name)
    except SarlError as error:
        st.session_state["_rule_file_problem"] = str(error)
    else:
        in_force.name_edits()
        st.session_state["_rules_choice"] = in_force.chosen()


def sidebar(*, with_thresholds: bool = True) -> None:
    """The choice of data, and which rules are in force.

    Args:
        with_thresholds: Whether to say which thresholds are in force; a page with their sliders
            says so itself.
    """
    name = chosen_dataset()
    thresholds, divider = chosen_thresholds(), chosen_divider()
    # A page without sliders keeps what a link says, for the page that has them.
    keep_thresholds()
    choose_divider(divider)
    st.session_state["_went_back"] = False  # what the address says is chosen by now
    for parameter, value in threshold_parameters().items():
        say_in_url(parameter, value)
    # The widget follows the URL, so a link and the browser's "back" both reach it.
    st.session_state["_data_choice"] = name
    labels = dataset_labels()
    with st.sidebar:
        st.selectbox(
            "Data",
            list(labels),
            format_func=labels.__getitem__,
            key="_data_choice",
            on_change=lambda: choose_dataset(st.session_state["_data_choice"]),
        )
        problem = data_problem()
        demonstrations = None if problem else uncombined_demonstrations()
        if problem:
            st.caption("What the address names is not here.")
            return
        if demonstrations is None:
            st.caption("Nothing uploaded yet: see the Demonstrations page.")
            return
        lines = [size_text(demonstrations)]
        if len(demonstrations) < demonstrations.whole.steps:
            lines[0] += f"; a sample of {len(demonstrations):,} of them is here"
        whole = all_demonstrations()
        lines += parting_lines(whole) if whole is not None else []
        formulas = sum(isinstance(one.definition, Formula) for one in demonstrations.derived)
        if formulas:
            lines.append(f"**{counted(formulas, 'formula')}** among the features")
        # On pages that do not ask for it the choice keeps its place in the URL by this.
        if combining.chosen().on and demonstrations.sample_of is None:
            lines.append("**Combinations** of two features on")
        st.caption("  \n".join(lines))
        _rules_choice()
        if not with_thresholds or not rule_base.at_thresholds():
            return
        lines = [
            f"Support at least **{limit_text(thresholds.support)}**",
        ]
        if thresholds.demands:
            lines.append(f"Confidence at least **{limit_text(thresholds.confidence)}**")
        if thresholds.never is not None:
            behind = " behind" * thresholds.demands
            lines.append(
                f"Rules that **forbid**{behind}, epsilon **{threshold_text(thresholds.never)}**"
            )
        if not demonstrations.is_discrete:
            lines.append(f"Divider **{divider}**")
        if thresholds.lift:
            lines.append(f"Lift at least **{threshold_text(thresholds.lift)}**")
        if thresholds.max_depth:
            lines.append(f"Depth at most **{thresholds.max_depth}**")
        st.caption("  \n".join(lines))
