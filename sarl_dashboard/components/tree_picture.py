"""The decision tree with a path lit, as two pages show it; drawn once for each choice."""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True, eq=False)
class PathInTree:
    """A path to be lit.

    Attributes:
        key: Tells the rules from all others.
        tree: One action dimension's.
        thresholds: At which it is cut.
        leaves: Whether every leaf is a rule, whatever the thresholds.
        node: At the end of the path.
        note: Said below.
    """

    key: object
    tree: PolicyTree
    thresholds: Thresholds
    leaves: bool
    node: int
    note: str

    @property
    def cut_key(self) -> str:
        """Tells the tree and its cut from all others."""
        tree = self.tree
        cut_by = (self.thresholds, self.leaves)
        return repr((self.key, tree.source.digest, tree.divider, tree.index, cut_by))


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
        view = st.segmented_control(
            "Tree",
            [around, WHOLE_TREE],
            default=around,
            key=widget,
            bind="query-params",
            required=True,
            label_visibility="collapsed",
        )
    if view == WHOLE_TREE:
        st.plotly_chart(
            _picture(path.cut_key, path.node, dark, path),
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
        st.html(_place(path.cut_key, path.node, path.note, dark, path))


def make_ready(path: PathInTree) -> None:
    """Make what `show_tree` shows first, for when it is asked for."""
    if _is_reached(path):
        _place(path.cut_key, path.node, path.note, is_dark(), path)


def _is_reached(path: PathInTree) -> bool:
    """Whether a state reaches the end of the path."""
    return int(path.tree.samples[path.node]) > 0


@cached()
def _picture(cut_key: str, node: int, dark: bool, _path: PathInTree) -> Any:
    return tree_figure(_path.tree, _cut(cut_key, _path), node, dark=dark)


@cached()
def _place(cut_key: str, node: int, note: str, dark: bool, _path: PathInTree) -> str:
    return place_html(_path.tree, _cut(cut_key, _path), node, note=note, dark=dark)


@cached()
def _cut(cut_key: str, _path: PathInTree) -> NDArray[np.int64]:
    """The nodes that are rules."""
    tree, thresholds = _path.tree, _path.thresholds
    if _path.leaves:
        return np.flatnonzero(tree.feature == LEAF)
    return cut_nodes(
        tree,
        supp_min=thresholds.support,
        conf_min=thresholds.confidence,
        lift_min=thresholds.lift,
        max_depth=thresholds.max_depth,
    )
