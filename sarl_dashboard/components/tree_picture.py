"""The decision tree with a path lit, as two pages show it; drawn once for each choice."""

from __future__ import annotations

from typing import Any

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.explaining.figures.tree import tree_figure
from sarl_core.explaining.html.tree import place_html
from sarl_core.mining.algorithm_1 import cut_nodes
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.tree import LEAF, PolicyTree
from sarl_dashboard.cache import cached
from sarl_dashboard.session import is_dark

WHOLE_TREE = "Whole tree"


def show_tree(
    key: object,
    tree: PolicyTree,
    thresholds: Thresholds,
    node: int,
    *,
    around: str,
    widget: str,
    note: str,
    leaves: bool,
) -> None:
    """The tree with the path to a node lit: what lies around the node, or all of it.

    What lies around is HTML and there at once; the whole is a chart that can be zoomed.

    Args:
        key: Tells the rules from all others.
        tree: One action dimension's.
        thresholds: At which it is cut.
        node: At the end of the path.
        around: What the first view is called.
        widget: Name of the choice between them, in the URL.
        note: Said below.
        leaves: Whether every leaf is a rule, whatever the thresholds.
    """
    view, reached, dark = WHOLE_TREE, int(tree.samples[node]) > 0, is_dark()
    if reached:
        view = st.segmented_control(
            "Tree",
            [around, WHOLE_TREE],
            default=around,
            key=widget,
            bind="query-params",
            required=True,
            label_visibility="collapsed",
        )
    told = _told(key, tree, thresholds)
    if view == WHOLE_TREE:
        st.plotly_chart(
            _picture(told, node, leaves, dark, tree, thresholds),
            key="tree_figure",
            config={"displaylogo": False, "scrollZoom": True},
            alt="The decision tree with the path lit",
        )
        st.caption(
            note
            + ("" if reached else " No state reaches its end, so the box has no width.")
            + " Drag or scroll to zoom, double-click to go back."
        )
    else:
        st.html(_place(told, node, note, leaves, dark, tree, thresholds))


def make_ready(
    key: object,
    tree: PolicyTree,
    thresholds: Thresholds,
    node: int,
    *,
    note: str,
    leaves: bool,
) -> None:
    """Make what `show_tree` shows first, for when it is asked for; its arguments are the same."""
    if tree.samples[node]:
        told = _told(key, tree, thresholds)
        _place(told, node, note, leaves, is_dark(), tree, thresholds)


def _told(key: object, tree: PolicyTree, thresholds: Thresholds) -> str:
    return repr((key, tree.source.digest, tree.divider, tree.index, thresholds))


@cached()
def _picture(
    told: str,
    node: int,
    leaves: bool,
    dark: bool,
    _tree: PolicyTree,
    _thresholds: Thresholds,
) -> Any:
    cut = _cut(told, leaves, _tree, _thresholds)
    return tree_figure(_tree, cut, node, dark=dark)


@cached()
def _place(
    told: str,
    node: int,
    note: str,
    leaves: bool,
    dark: bool,
    _tree: PolicyTree,
    _thresholds: Thresholds,
) -> str:
    cut = _cut(told, leaves, _tree, _thresholds)
    return place_html(_tree, cut, node, note=note, dark=dark)


@cached()
def _cut(told: str, leaves: bool, _tree: PolicyTree, _thresholds: Thresholds) -> NDArray[np.int64]:
    """The nodes that are rules."""
    if leaves:
        return np.flatnonzero(_tree.feature == LEAF)
    return cut_nodes(
        _tree,
        supp_min=_thresholds.support,
        conf_min=_thresholds.confidence,
        lift_min=_thresholds.lift,
        max_depth=_thresholds.max_depth,
    )
