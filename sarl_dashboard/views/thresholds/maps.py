"""What the Thresholds page shows of a landscape: maps, surfaces, the largest rules, trade-offs.

What is clicked in them puts thresholds in force, so the moves are here too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import streamlit as st

from sarl_core.explaining.figures import thresholds as figures
from sarl_core.explaining.figures.colours import MARKER_COLOUR
from sarl_core.explaining.figures.pareto_front import front_figure, thin_front
from sarl_core.mining.landscape import Landscape
from sarl_core.mining.language import counted
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.threshold_steps import neat_point
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.components.tables import column_config, frame, table_height
from sarl_dashboard.session import is_dark
from sarl_dashboard.state import compact_set
from sarl_dashboard.state.compact_set import Compact
from sarl_dashboard.state.mined import largest_rules, mined_front, mined_landscape
from sarl_dashboard.state.thresholds import chosen_limits, chosen_thresholds

Grown = tuple[PolicyTree, ...]
MAPS, SURFACES = "Maps", "3-D"
LARGEST, TRADE_OFFS, DIVIDER = "Largest rules", "Best trade-offs", "Divider"
TABLE_ROWS = 50
BARE = {"displayModeBar": False, "scrollZoom": False}
MARK_RADIUS = 9


# --- moving the thresholds -----------------------------------------------------------------------


def follow() -> None:
    """Show what the thresholds of the moment give; for callbacks, and the last thing they do."""
    if st.session_state.get("view") == SURFACES:
        st.rerun()  # the chosen point is part of the surface
    st.rerun(
        ["controls", "front"] if st.session_state.get("details") == TRADE_OFFS else ["controls"]
    )


def move(**thresholds: float) -> None:
    """Put thresholds in force, by their names in the URL.

    `take_over` writes them where the sliders find them: what a callback in a fragment writes to a
    slider does not reach the browser when it asks for another run.
    """
    st.session_state["_moved"] = thresholds
    if compact_set.in_force():
        leave_compact()
    follow()


def leave_compact() -> None:
    """Go back to the thresholds; for callbacks, and the last thing they do."""
    compact_set.choose(False)
    st.rerun()  # the ring comes back to the maps, and the sidebar says what is in force


def take_click(key: str, grown: Grown) -> None:
    """Set both thresholds to those of the clicked cell or point.

    A second click on one cell takes its selection back, and means the cell all the same.
    """
    points = st.session_state[key].selection.points
    if points and "customdata" in points[0]:
        data = points[0]["customdata"]
        # Which of the two arrives depends on how the numbers were packed for the browser.
        values = list(data.values()) if isinstance(data, dict) else list(data)
        clicked = Thresholds(float(values[0]), float(values[1]), *chosen_limits())
        if key == "pareto":
            clicked = neat_point(grown, clicked)
        st.session_state["_clicked"] = (clicked.support, clicked.confidence)
    support, confidence = st.session_state.get("_clicked", (None, None))
    if support is not None:
        move(support=support, confidence=confidence)


# --- what is shown -----------------------------------------------------------------------------


def here(grown: Grown, thresholds: Thresholds, dimension: int | None) -> Landscape:
    """The landscape of the one point that is in force."""
    point = mined_landscape(
        grown,
        [thresholds.support],
        [thresholds.confidence],
        lift=thresholds.lift,
        depth=thresholds.max_depth,
    )
    return point if dimension is None else point.dimensions[dimension]


def compact_point(compact: Compact, dimension: int | None) -> Landscape:
    """The numbers of the compact rules, in the shape of those of one point of the landscape."""
    rules = compact.counted
    if dimension is not None:
        own = rules.of_dimension(dimension)
        rules = replace(rules, rules=own, actions=(rules.actions[dimension],))
    nowhere = np.zeros(1)
    return Landscape(
        nowhere,
        nowhere,
        np.array([[len(rules)]]),
        np.array([[rules.mean_length]]),
        np.array([[rules.coverage]]),
        np.array([[rules.fidelity]]),
    )


def show_maps(
    grown: Grown,
    landscape: Landscape,
    layers: tuple[figures.Layer, figures.Layer],
    *,
    marked: bool,
) -> None:
    """Two maps side by side, with the mark that `controls` moves, or hides."""
    margin = figures.MARGIN
    st.html(
        "<style>"
        ".st-key-maps [class*='st-key-box_'] { position: relative; }"
        ".st-key-maps [class*='st-key-box_']::after { content: ''; position: absolute; z-index: 2;"
        f" pointer-events: none; width: {2 * MARK_RADIUS}px; height: {2 * MARK_RADIUS}px;"
        f" left: calc({margin['l'] - MARK_RADIUS}px"
        f" + (100% - {margin['l'] + margin['r']}px) * var(--mark-x));"
        f" top: calc({margin['t'] - MARK_RADIUS}px"
        f" + {figures.HEIGHT - margin['t'] - margin['b']}px * var(--mark-y));"
        # In a layer of its own, so that the map beneath is not painted again when it moves.
        f" will-change: transform; border: 3px solid {MARKER_COLOUR};"
        " box-sizing: border-box; border-radius: 50%;"
        " box-shadow: 0 0 0 1.5px #ffffff; }"
        "</style>"
    )
    with st.container(key="maps"):
        for column, layer in zip(st.columns(2), layers, strict=True):
            with column:
                st.markdown(f"**{figures.STYLES[layer].title}**")
                with st.container(key=f"box_{layer}"):
                    st.plotly_chart(
                        figures.heatmap(landscape, layer, dark=is_dark()),
                        key=f"map_{layer}",
                        config=BARE,
                        selection_mode="points",
                        on_select=lambda key=f"map_{layer}": take_click(key, grown),
                        alt=f"{figures.STYLES[layer].title}, for every minimum support and "
                        "minimum confidence",
                    )
    st.caption(
        "Click a cell to set both thresholds to it. "
        + (
            "The ring marks the present ones."
            if marked
            else "The compact rules are not cut at thresholds, so no cell is marked."
        )
    )


def show_surfaces(
    grown: Grown,
    landscape: Landscape,
    layers: tuple[figures.Layer, figures.Layer],
    dimension: int | None,
    *,
    marked: bool,
) -> None:
    """The same two layers as the paper draws them."""
    thresholds = chosen_thresholds()
    point = here(grown, thresholds, dimension)
    for column, layer in zip(st.columns(2), layers, strict=True):
        with column:
            st.markdown(f"**{figures.STYLES[layer].title}**")
            figure = figures.surface(
                landscape,
                layer,
                dark=is_dark(),
                chosen=(
                    thresholds.support,
                    thresholds.confidence,
                    float(getattr(point, layer)[0, 0]),
                )
                if marked
                else None,
            )
            st.plotly_chart(
                figure,
                key=f"surface_{layer}",
                config={"displaylogo": False},
                alt=f"{figures.STYLES[layer].title} as a surface",
            )
    st.caption("Drag to turn." + (" The dot marks the present thresholds." if marked else ""))


def show_largest(
    grown: Grown, thresholds: Thresholds, point: Landscape, dimension: int | None
) -> None:
    """The rules with the most support."""
    rules = int(point.rule_count[0, 0])
    if not rules:
        st.info(
            "No part of the tree is as frequent and as certain as these thresholds ask. Lower "
            "the minimum support or the minimum confidence: the maps show where there are rules.",
            icon=":material/filter_alt_off:",
        )
        return
    part, names = largest_rules(grown, thresholds, TABLE_ROWS)
    shown = [
        (rule, name)
        for rule, name in zip(part.rules, names, strict=True)
        if dimension in (None, rule.dimension)
    ][:TABLE_ROWS]
    st.dataframe(
        frame([rule for rule, _ in shown], part, [name for _, name in shown]),
        hide_index=True,
        column_config=column_config(part),
        height=table_height(len(shown), 10),
        key="largest_table",
        alt="The rules with the most support",
    )
    if rules > len(shown):
        st.caption(f"The {len(shown)} rules with the most support, of {rules:,}.")


def show_compact(compact: Compact, dimension: int | None) -> None:
    """The compact rules with the most support."""
    rules = [rule for rule in compact.counted.rules if dimension in (None, rule.dimension)]
    rules.sort(key=lambda rule: -rule.samples)
    shown = rules[:TABLE_ROWS]
    st.dataframe(
        frame(shown, compact.counted, list(map(compact.counted.name_of, shown))),
        hide_index=True,
        column_config=column_config(compact.counted),
        height=table_height(len(shown), 10),
        key="compact_table",
        alt="The compact rules with the most support",
    )
    told = []
    if len(rules) > len(shown):
        told.append(f"The {len(shown)} rules with the most support, of {len(rules):,}.")
    unreached = sum(not rule.samples for rule in rules)
    if unreached:
        are = "is" if unreached == 1 else "are"
        told.append(f"{counted(unreached, 'rule')} {are} reached by no demonstrated state.")
    if told:
        st.caption(" ".join(told))


@st.fragment(key="front")
def show_trade_offs(grown: Grown, dimension: int | None, compact: Compact | None) -> None:
    """The rule sets that no other one beats, and where the one in force is among them."""
    thresholds = chosen_thresholds()
    point = (
        here(grown, thresholds, dimension) if compact is None else compact_point(compact, dimension)
    )
    trees = grown if dimension is None else (grown[dimension],)
    with st.spinner("Looking for the best trade-offs …"):
        front = mined_front(trees, lift=thresholds.lift, depth=thresholds.max_depth)
    if not front:
        st.info(
            "There is no rule at any thresholds; lower the minimum lift under More.",
            icon=":material/filter_alt_off:",
        )
        return
    st.caption(
        "No other thresholds give fewer rules, more coverage and more fidelity than these. "
        "Click a point to use its thresholds."
    )
    points = thin_front(front)
    figure = front_figure(
        points,
        dark=is_dark(),
        chosen=(
            int(point.rule_count[0, 0]),
            float(point.coverage[0, 0]),
            float(point.fidelity[0, 0]),
        ),
    )
    st.plotly_chart(
        figure,
        key="pareto",
        config=BARE,
        selection_mode="points",
        on_select=lambda: take_click("pareto", grown),
        alt="Number of rules against coverage, coloured by fidelity",
    )
    if len(points) < len(front):
        st.caption(f"{len(points):,} of {len(front):,} such rule sets are drawn.")
