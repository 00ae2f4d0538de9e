"""Thresholds: how many rules, how long and how good, at every pair of thresholds at once.

A moved slider runs the fragment "controls" and nothing else. The maps are not part of it: they hold
every pair of thresholds already, and only the mark that lies over them moves. The table is drawn by
it in a place of its own, since every further fragment would cost a run of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import streamlit as st
from streamlit.delta_generator import DeltaGenerator

from sarl_core.explaining.figures import thresholds as figures
from sarl_core.explaining.words.cross_fit import elsewhere_text
from sarl_core.mining.landscape import PAPER_CONFIDENCES, PAPER_SUPPORTS, Landscape
from sarl_core.mining.language import share_text, threshold_text
from sarl_core.mining.rules import FILTERED, UNFILTERED, Thresholds
from sarl_core.mining.threshold_steps import (
    CONFIDENCE_STEPS,
    FINE_CONFIDENCES,
    FINE_SUPPORTS,
    SUPPORT_STEPS,
    neat_jumps,
    with_step,
)
from sarl_core.mining.validation.cross_fitting import Judged
from sarl_core.mining.validation.evidence import HeldOut
from sarl_dashboard.jobs import cross_fitting
from sarl_dashboard.state import compact_set
from sarl_dashboard.state.data import held_out_demonstrations, require_demonstrations
from sarl_dashboard.state.mined import grown_trees, mined_landscape
from sarl_dashboard.state.thresholds import (
    MAX_DEPTH,
    MAX_DIVIDER,
    MAX_LIFT,
    MIN_DIVIDER,
    choose_thresholds,
    chosen_divider,
    chosen_thresholds,
)
from sarl_dashboard.views.thresholds.divider import show_divider
from sarl_dashboard.views.thresholds.maps import (
    DIVIDER,
    LARGEST,
    MAPS,
    SURFACES,
    TRADE_OFFS,
    compact_point,
    follow,
    here,
    leave_compact,
    move,
    show_compact,
    show_largest,
    show_maps,
    show_surfaces,
    show_trade_offs,
)

SIZE, QUALITY, HELD_OUT = "Rules and length", "Coverage and fidelity", "Held out"
LAYERS: dict[str, tuple[figures.Layer, figures.Layer]] = {
    SIZE: ("rule_count", "mean_length"),
    QUALITY: ("coverage", "fidelity"),
    HELD_OUT: ("fidelity", "held_out_fidelity"),
}
FINE, PAPER = "Fine grid", "Paper's grid"
WHOLE = "All actions"

st.title("Thresholds")
demonstrations = require_demonstrations()
grown = grown_trees(demonstrations, chosen_divider())
compact = compact_set.chosen_compact(demonstrations)


# --- what widgets do ---------------------------------------------------------------------------


def take_over() -> None:
    """Hand moved thresholds to the sliders, before these are drawn."""
    for name, value in st.session_state.pop("_moved", {}).items():
        st.session_state[name] = value


def jump(name: str, value: float) -> None:
    """Move one threshold."""
    move(**{name: value})


def use(setting: Thresholds) -> None:
    """Put a named setting in force."""
    choose_thresholds(setting)
    compact_set.choose(False)
    st.rerun()  # lift and depth, which it resets, are part of the maps


def use_compact() -> None:
    """Put the compact rules in force."""
    compact_set.choose(True)
    st.rerun()  # the maps lose their ring


# --- parts of the page -------------------------------------------------------------------------


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


@st.fragment(key="controls")
def controls(dimension: int | None, grid: Landscape, table: DeltaGenerator | None) -> None:
    """Sliders, named settings and jumps; the numbers of the rule set; the mark; the table.

    Args:
        dimension: Which action dimension is looked at; None for all.
        grid: The landscape that the maps show.
        table: Where the table of rules goes; None where it is not looked at.
    """
    take_over()
    thresholds = chosen_thresholds()
    # A callback that asks for more than this fragment costs a run; most moves need none.
    alone = table is not None and st.session_state.get("view") != SURFACES
    moved: Callable[[], None] | Literal["rerun"] = (
        leave_compact if compact is not None else "rerun" if alone else follow
    )
    jumps = neat_jumps(grown, thresholds)
    left, middle, right = st.columns([4, 4, 3])
    with left:
        st.select_slider(
            "Minimum support",
            with_step(SUPPORT_STEPS, thresholds.support),
            key="support",
            value=FILTERED.support,
            format_func=threshold_text,
            bind="query-params",
            on_change=moved,
            help="Share of all demonstrated states to which a rule must apply.",
        )
        jump_buttons("support", jumps.support_below, jumps.support_above)
    with middle:
        st.select_slider(
            "Minimum confidence",
            with_step(CONFIDENCE_STEPS, thresholds.confidence),
            key="confidence",
            value=FILTERED.confidence,
            format_func=threshold_text,
            bind="query-params",
            on_change=moved,
            help="Share of those states in which the expert did what the rule says.",
        )
        jump_buttons("confidence", jumps.confidence_below, jumps.confidence_above)
    with right:
        if not demonstrations.is_discrete:
            st.slider(
                "Divider",
                MIN_DIVIDER,
                MAX_DIVIDER,
                key="divider",
                value=MIN_DIVIDER,
                bind="query-params",
                on_change=leave_compact,
                help="Number of equal intervals each continuous action is divided into.",
            )
        named_settings(thresholds)
    point = (
        here(grown, thresholds, dimension) if compact is None else compact_point(compact, dimension)
    )
    other = cross_fitting.judged(thresholds) if dimension is None else None
    metrics(point, other)
    if dimension is None:
        cross_fitting.told(thresholds, float(point.fidelity[0, 0]))
    across, down = figures.mark_place(grid, thresholds.support, thresholds.confidence)
    st.html(f"<style>.st-key-maps {{ --mark-x: {across:.5f}; --mark-y: {down:.5f}; }}</style>")
    if compact is not None:
        st.html("<style>.st-key-maps [class*='st-key-box_']::after { display: none; }</style>")
    if table is not None:
        with table.container():
            if compact is not None:
                show_compact(compact, dimension)
            else:
                show_largest(grown, thresholds, point, dimension)


def named_settings(thresholds: Thresholds) -> None:
    """The paper's two settings and, where there are some, the compact rules; a click each."""
    with st.container(horizontal=True, gap="small", horizontal_alignment="right"):
        for name, setting in (("Filtered", FILTERED), ("Unfiltered", UNFILTERED)):
            st.button(
                name,
                key=name.lower(),
                on_click=use,
                args=(setting,),
                type="primary" if thresholds == setting and compact is None else "secondary",
                help=f"The paper's setting: support {setting.support:g}, "
                f"confidence {setting.confidence:g}",
            )
        if compact_set.offered():
            st.button(
                "Compact",
                key="compact",
                on_click=use_compact,
                type="primary" if compact is not None else "secondary",
                help="A small set that comes with these data: it has a rule for every state, and "
                "was chosen by what a novice achieves with it",
            )


def elsewhere(found: HeldOut | None) -> dict[str, Any]:
    """A number in episodes that the rules were not mined from, to stand under the other."""
    if found is None:
        return {}
    told = f"elsewhere {elsewhere_text(found)}"
    return {"delta": told, "delta_color": "off", "delta_arrow": "off"}


def metrics(point: Landscape, other: Judged | None) -> None:
    """The four numbers of the rule set in force, and what two of them are in other episodes."""
    rules = int(point.rule_count[0, 0])
    with st.container(horizontal=True, key="metrics"):
        st.metric("Rules", f"{rules:,}")
        st.metric(
            "Mean length",
            f"{point.mean_length[0, 0]:.1f}" if rules else "–",
            help="Conditions a rule, on average",
        )
        st.metric(
            "Coverage",
            share_text(float(point.coverage[0, 0]), decimals=1),
            help="Share of the demonstrated states in which some rule applies; elsewhere: of the "
            "states of an episode that the rules were not mined from, on average",
            **elsewhere(None if other is None else other.coverage),
        )
        st.metric(
            "Fidelity",
            share_text(float(point.fidelity[0, 0]), decimals=1),
            help="Share of those in which the expert did what the rule says; elsewhere: in an "
            "episode that the rules were not mined from, on average",
            **elsewhere(None if other is None else other.fidelity),
        )
        if point.held_out_fidelity is not None:
            st.metric(
                "Held-out fidelity",
                share_text(float(point.held_out_fidelity[0, 0]), decimals=1),
                help="The same on the episodes held out, which no rule was mined from; on average, "
                "so that each episode counts once",
            )


def more() -> None:
    """What changes the whole plane, and is rarely needed."""
    with st.popover("More", icon=":material/tune:"):
        st.slider(
            "Minimum lift",
            0.0,
            MAX_LIFT,
            value=0.0,
            step=0.1,
            key="lift",
            bind="query-params",
            on_change=compact_set.choose,
            args=(False,),
            help="How many times more often than over all states the expert must have done what "
            "the rule says. 0: no limit.",
        )
        st.slider(
            "Maximum depth",
            0,
            MAX_DEPTH,
            value=0,
            key="depth",
            bind="query-params",
            on_change=compact_set.choose,
            args=(False,),
            help="Most conditions of a rule. 0: no limit.",
        )


def chosen_dimension() -> int | None:
    """Which action dimension is looked at; None for all together."""
    if len(grown) == 1:
        return None
    names = [tree.dimension.name for tree in grown]
    name = st.segmented_control(
        "Action",
        [WHOLE, *names],
        default=WHOLE,
        key="dimension",
        bind="query-params",
        required=True,
        label_visibility="collapsed",
    )
    return names.index(name) if name in names else None


def switch(label: str, key: str, options: list[str], hint: str) -> str:
    """A choice between a few ways to look."""
    return (
        st.segmented_control(
            label,
            options,
            default=options[0],
            key=key,
            bind="query-params",
            required=True,
            label_visibility="collapsed",
            help=hint,
        )
        or options[0]
    )


# --- the page ----------------------------------------------------------------------------------

take_over()
# Where the sliders share a narrow row, the words between two buttons stand above them.
st.html(
    "<style>@media (min-width: 641px) and (max-width: 1200px) {"
    " [class*='st-key-jumps_'] > :nth-child(2) { order: -1; flex-basis: 100%; } }</style>"
)
st.caption(
    "A rule must apply to at least a certain share of the states (support), and the expert must "
    "have done the same in at least a certain share of those (confidence)."
)
top = st.container()
with st.container(horizontal=True, gap="medium", vertical_alignment="center", key="ways"):
    pairs = [SIZE, QUALITY] if held_out_demonstrations() is None else [SIZE, QUALITY, HELD_OUT]
    shown = switch("Show", "layer", pairs, "What the two figures show")
    view = switch("View", "view", [MAPS, SURFACES], "Maps, or the paper's surfaces")
    axes = switch(
        "Grid",
        "grid",
        [FINE, PAPER],
        "Fine: dense where most happens. The paper's: 0 to 0.5 and 0 to 1 by 0.05.",
    )
    more()
    dimension = chosen_dimension()
in_force = chosen_thresholds()
whole = mined_landscape(
    grown,
    *((PAPER_SUPPORTS, PAPER_CONFIDENCES) if axes == PAPER else (FINE_SUPPORTS, FINE_CONFIDENCES)),
    lift=in_force.lift,
    depth=in_force.max_depth,
)
landscape = whole if dimension is None else whole.dimensions[dimension]
if view == SURFACES:
    show_surfaces(grown, landscape, LAYERS[shown], dimension, marked=compact is None)
else:
    show_maps(grown, landscape, LAYERS[shown], marked=compact is None)
offered = [LARGEST, TRADE_OFFS] if demonstrations.is_discrete else [LARGEST, TRADE_OFFS, DIVIDER]
largest, trade_offs, *divider = st.tabs(
    offered, key="details", on_change="rerun", bind="query-params"
)
table = None
if trade_offs.open:
    with trade_offs:
        show_trade_offs(grown, dimension, compact)
elif divider and divider[0].open:
    with divider[0]:
        show_divider(demonstrations, dimension)
else:
    table = largest.empty()
with top:
    controls(dimension, landscape, table)
st.page_link(
    "rules.py", label="All rules, with the evidence behind each", icon=":material/arrow_forward:"
)
cross_fitting.make_ready()
