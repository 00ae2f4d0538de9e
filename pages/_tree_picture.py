"""The decision tree with a path lit, drawn once for each choice; two pages show it."""

from __future__ import annotations

from typing import Any

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.explaining.rule_figures import tree_figure
from sarl_core.explaining.rule_place import place_html
from sarl_core.mining.algorithm_1 import cut_nodes
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.tree import LEAF, PolicyTree


def tree_picture(
    key: object,
    tree: PolicyTree,
    thresholds: Thresholds,
    node: int,
    *,
    around: bool,
    leaves: bool,
    dark: bool,
) -> Any:
    """The tree with the path to a node.

    Args:
        key: Tells the rules from all others.
        tree: One action dimension's.
        thresholds: At which it is cut.
        node: At the end of the path.
        around: Whether to show the neighbourhood of the node only.
        leaves: Whether every leaf is a rule, whatever the thresholds.
        dark: Whether the theme is.

    Returns:
        The figure; shared between sessions.
    """
    return _picture(_told(key, tree, thresholds), node, around, leaves, dark, tree, thresholds)


def tree_place(
    key: object,
    tree: PolicyTree,
    thresholds: Thresholds,
    node: int,
    *,
    note: str,
    leaves: bool,
    dark: bool,
) -> str:
    """The neighbourhood of a node in the tree, in HTML without script.

    Args:
        key: As those that follow, see `tree_picture`.
        tree: One action dimension's.
        thresholds: At which it is cut.
        node: At the end of the path.
        note: Said below it.
        leaves: Whether every leaf is a rule, whatever the thresholds.
        dark: Whether the theme is.

    Returns:
        Made once for each choice.
    """
    return _place(_told(key, tree, thresholds), node, note, leaves, dark, tree, thresholds)


def _told(key: object, tree: PolicyTree, thresholds: Thresholds) -> str:
    return repr((key, tree.source.digest, tree.divider, tree.index, thresholds))


@st.cache_resource(max_entries=48, show_spinner=False)
def _picture(
    told: str,
    node: int,
    around: bool,
    leaves: bool,
    dark: bool,
    _tree: PolicyTree,
    _thresholds: Thresholds,
) -> Any:
    cut = _cut(told, leaves, _tree, _thresholds)
    return tree_figure(_tree, cut, node, around=around, dark=dark)


@st.cache_resource(max_entries=96, show_spinner=False)
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


@st.cache_resource(max_entries=12, show_spinner=False)
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
