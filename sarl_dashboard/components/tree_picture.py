"""The decision tree with a path lit, as two pages show it; drawn once for each choice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import streamlit as st
from markupsafe import Markup
from numpy.typing import NDArray

from sarl_core.explaining.figures.tree import tree_figure
from sarl_core.explaining.html.tree import place_html
from sarl_core.mining.algorithm_1 import cut_nodes
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.tree import LEAF, PolicyTree
from sarl_dashboard.cache import cached
from sarl_dashboard.components.settings import switch
from sarl_dashboard.session import is_dark

WHOLE_TREE = "Whole tree"


@dataclass(frozen=True)
class PathInTree:
    """A path to be lit.

    Attributes:
        tree: One action dimension's.
        cut_at: Thresholds at which it is cut; None where every leaf is a rule. Where some rules
            forbid, no node is marked as one.
        node: At the end of the path.
        note: Said below.
    """

    tree: PolicyTree
    cut_at: Thresholds | None
    node: int
    note: str


def show_tree(path: PathInTree, *, around: str, widget: str) -> None:
    """The tree with a path lit: what lies around its end, or all of it.

    What lies around is HTML and there at once; the whole is a chart that can be zoomed.

    Args:
        path: To light.
        around: What the first view is called.
        widget: Name of the choice between them, in the URL.
    """
    view, reached, dark = WHOLE_TREE, _is_reached(path), is_dark()
    if reached:
        view = switch("Tree", widget, [around, WHOLE_TREE])
    if view == WHOLE_TREE:
        st.plotly_chart(
            _picture(path, dark),
            key="tree_figure",
            config={"displaylogo": False, "scrollZoom": True},
            alt="The decision tree with the path lit",
        )
        st.caption(
            path.note
            + ("" if reached else " No state reaches its end, so the box has no width.")
            + " Drag or scroll to zoom, double-click to go back."
        )
    else:
        st.html(_place(path, dark))


def make_ready(path: PathInTree) -> None:
    """Make what `show_tree` shows first, for when it is asked for."""
    if _is_reached(path):
        _place(path, is_dark())


def _is_reached(path: PathInTree) -> bool:
    """Whether a state reaches the end of the path."""
    return int(path.tree.samples[path.node]) > 0


@cached()
def _picture(path: PathInTree, dark: bool) -> Any:
    return tree_figure(path.tree, _cut(path.tree, path.cut_at), path.node, dark=dark)


@cached()
def _place(path: PathInTree, dark: bool) -> Markup:
    cut = _cut(path.tree, path.cut_at)
    return place_html(path.tree, cut, path.node, note=path.note, dark=dark)


@cached()
def _cut(tree: PolicyTree, thresholds: Thresholds | None) -> NDArray[np.int64]:
    """The nodes that are rules."""
    if thresholds is None:
        return np.flatnonzero(tree.feature == LEAF)
    if thresholds.never is not None:  # what forbids one action lies above what forbids another
        return np.array([], dtype=np.int64)
    return cut_nodes(
        tree,
        supp_min=thresholds.support,
        conf_min=thresholds.confidence,
        lift_min=thresholds.lift,
        max_depth=thresholds.max_depth,
    )
