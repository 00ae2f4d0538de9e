"""The sliders of the thresholds, and everything that follows them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Literal

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from sarl_core.explaining.figures.thresholds import mark_place
from sarl_core.mining.language import threshold_text
from sarl_core.mining.never.landscape import NeverLandscape
from sarl_core.mining.never.steps import EPSILON_STEPS, USUAL_EPSILON
from sarl_core.mining.rules import FILTERED, UNFILTERED, Thresholds
from sarl_core.mining.thresholds.landscape import Landscape
from sarl_core.mining.thresholds.steps import (
    CONFIDENCE_STEPS,
    SUPPORT_STEPS,
    neat_jumps,
    with_step,
)
from sarl_dashboard.components.elsewhere import elsewhere_notice
from sarl_dashboard.components.journey.steps_needed import say_of_sample
from sarl_dashboard.components.journey.words import with_words, word_help
from sarl_dashboard.components.places import placed
from sarl_dashboard.jobs import cross_fitting
from sarl_dashboard.state import rule_base
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.rule_files import (
    COMBINED,
    COMPACT,
    COMPACT_ENDINGS,
    FEWEST,
    compact_sets,
)
from sarl_dashboard.state.thresholds import (
    BOTH,
    DEMAND,
    FORBID,
    MAX_DIVIDER,
    MIN_DIVIDER,
    chosen_epsilon,
    chosen_mode,
    chosen_thresholds,
    from_least,
    least_support,
    settled,
    take_over_moved,
)
from sarl_dashboard.state.url import stay_beside
from sarl_dashboard.views.thresholds.display import Display
from sarl_dashboard.views.thresholds.largest_rules import show_largest
from sarl_dashboard.views.thresholds.moves import (
    follow,
    jump,
    leave_compact,
    use,
    use_compact,
    use_mode,
)
from sarl_dashboard.views.thresholds.numbers import show_numbers
from sarl_dashboard.views.thresholds.recommendation import show_recommendation

_A_FRAME = 0.02  # seconds
_SETTLED = "That of these trees was settled when they were mined."
_TOO_LOW = ". The trees of this file do not reach so far down; mine its steps again with less"
_SHORT = {COMPACT: "Compact", COMBINED: "Two features", FEWEST: "Fewest"}


_MODES = {DEMAND: "Rules that demand", FORBID: "Rules that forbid", BOTH: "Both"}


def mode_choice() -> None:
    """Whether rules at the thresholds say what to do, what never to do, or both (URL: mode)."""
    # The widget follows the URL, so a link and the browser's "back" both reach it.
    st.session_state["_mode_choice"] = chosen_mode()
    st.segmented_control(
        "Kind of rules",
        list(_MODES),
        format_func=_MODES.__getitem__,
        key="_mode_choice",
        on_change=lambda: use_mode(st.session_state["_mode_choice"]),
        required=True,
        label_visibility="collapsed",
        help=with_words(
            "Rules that demand say what to do. Rules that forbid, never-rules, say what not to do "
            "and leave the rest to whoever acts. Rarely done is not unsafe: they say what the "
            "expert had no need of. Both: where a rule that demands applies it decides, and "
            "elsewhere those that forbid."
        ),
    )


@st.fragment(key="controls")
def show_controls(
    display: Display, landscape: Landscape | NeverLandscape, table: DeltaGenerator | None
) -> None:
    """Sliders, named settings and jumps; the numbers of the rule set; the mark; the table.

    Args:
        display: What is looked at.
        landscape: That of the maps.
        table: Where the table of rules goes; None where it is not looked at.
    """
    take_over_moved()
    thresholds = chosen_thresholds()
    both = thresholds.never is not None and thresholds.demands
    # What the sliders are moved for is sent first, and drawn before the rest comes: a browser that
    # is sent more meanwhile draws all at once.
    sliders = st.container(key="sliders")
    point = display.point(thresholds)
    everything = display.dimension is None
    judged = cross_fitting.judged(thresholds) if everything else None
    show_numbers(
        point,
        judged,
        display.trees[0] if display.compact is None else None,
    )
    upwards = thresholds.confidence if thresholds.demands else thresholds.never or 0.0
    across, down = mark_place(landscape, thresholds.support, upwards)
    ring = "block" if display.compact is None else "none"
    st.html(placed("maps", across=f"{across:.5f}", down=f"{down:.5f}", ring=ring))
    time.sleep(_A_FRAME)
    with sliders:
        show_sliders(display, thresholds, alone=table is not None and not display.surfaces)
    stay_beside()
    demonstrations = chosen_demonstrations()
    if both and display.compact is None and demonstrations is not None:
        say_of_sample("Coverage, fidelity and freedom", demonstrations)
    if everything:
        elsewhere_notice(thresholds, float(point.fidelity[0, 0]), missed=judged is None)
    if thresholds.never is None:
        show_recommendation(display, thresholds)
    if table is not None:
        with table.container():
            show_largest(display, thresholds, int(point.rule_count[0, 0]))


def show_sliders(display: Display, thresholds: Thresholds, *, alone: bool) -> None:
    """What thresholds are moved by, and named settings.

    Args:
        display: What is looked at.
        thresholds: Those in force, or set aside.
        alone: Whether nothing beside the fragment follows a move.
    """
    # A callback that asks for more than this fragment costs a run; most moves need none.
    moved: Callable[[], None] | Literal["rerun"] = (
        leave_compact if not rule_base.at_thresholds() else "rerun" if alone else follow
    )
    jumps = None if display.forbids else neat_jumps(display.trees, thresholds)
    left, middle, right = st.columns([4, 4, 3])
    with left:
        st.select_slider(
            "Minimum support",
            with_step(from_least(SUPPORT_STEPS), thresholds.support),
            key="support",
            value=max(FILTERED.support, least_support()),
            format_func=threshold_text,
            bind="query-params",
            on_change=moved,
            help=word_help("support", "Here: how much of it a rule must have at least."),
        )
        if jumps is not None:
            below = jumps.support_below
            if below is not None and below < least_support():
                below = None
            jump_buttons("support", below, jumps.support_above)
    with middle:
        if jumps is None:
            epsilon_slider(moved)
        else:
            st.select_slider(
                "Minimum confidence",
                with_step(CONFIDENCE_STEPS, thresholds.confidence),
                key="confidence",
                value=FILTERED.confidence,
                format_func=threshold_text,
                bind="query-params",
                on_change=moved,
                help=word_help("confidence", "Here: how much of it a rule must have at least."),
            )
            jump_buttons("confidence", jumps.confidence_below, jumps.confidence_above)
    with right:
        if display.is_divided and settled() is not None:
            st.metric("Divider", f"{display.trees[0].divider}", help=word_help("divider", _SETTLED))
        elif display.is_divided:
            st.slider(
                "Divider",
                MIN_DIVIDER,
                MAX_DIVIDER,
                key="divider",
                value=MIN_DIVIDER,
                bind="query-params",
                on_change=leave_compact,
                help=word_help("divider"),
            )
        if thresholds.never is not None and thresholds.demands:
            epsilon_slider(moved)
        elif not display.forbids:
            named_settings(thresholds, rule_base.compact_name() if display.compact else None)


def epsilon_slider(moved: Callable[[], None] | Literal["rerun"]) -> None:
    """The threshold of rules that forbid.

    Args:
        moved: What happens when it was moved.
    """
    st.select_slider(
        "Epsilon",
        with_step(EPSILON_STEPS, chosen_epsilon()),
        key="epsilon",
        value=USUAL_EPSILON,
        format_func=threshold_text,
        bind="query-params",
        on_change=moved,
        help=word_help("epsilon", "Keep it small: a large one forbids too early."),
    )


def jump_buttons(name: str, below: float | None, above: float | None) -> None:
    """Two buttons that go to the next value at which the rule set changes."""
    with st.container(
        horizontal=True,
        horizontal_alignment="distribute",
        vertical_alignment="center",
        gap="small",
        key=f"jumps_{name}",
    ):
        for side, value in (("below", below), ("above", above)):
            if side == "above":
                st.caption("next change", width="content")
            st.button(
                "none" if value is None else threshold_text(value),
                key=f"{name}_{side}",
                on_click=jump,
                args=(name, value),
                type="tertiary",
                icon=f":material/{'arrow_back' if side == 'below' else 'arrow_forward'}:",
                icon_position="left" if side == "below" else "right",
                disabled=value is None,
                help=f"Next value {side} at which the rules change",
            )


def named_settings(thresholds: Thresholds, compact: str | None) -> None:
    """The paper's two settings and, where there are some, the compact sets; a click each.

    Args:
        thresholds: Those in force, or set aside.
        compact: Name of the compact set in force; None for the thresholds.
    """
    with st.container(horizontal=True, gap="small", horizontal_alignment="right"):
        for name, setting in (("Filtered", FILTERED), ("Unfiltered", UNFILTERED)):
            st.button(
                name,
                key=name.lower(),
                on_click=use,
                args=(setting,),
                type="primary" if thresholds == setting and not compact else "secondary",
                disabled=setting.support < least_support(),
                help=f"The paper's setting: support {setting.support:g}, "
                f"confidence {setting.confidence:g}"
                + (_TOO_LOW if setting.support < least_support() else ""),
            )
        for name in compact_sets():
            st.button(
                _SHORT[name],
                key=COMPACT_ENDINGS[name],
                on_click=use_compact,
                args=(name,),
                type="primary" if compact == name else "secondary",
                help=f"{rule_base.set_title(name)}: a small set that comes with these data. It "
                "has a rule for every state, and was chosen by what a novice achieves with it",
            )
