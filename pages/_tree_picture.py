"""The decision tree with a path lit, drawn once for each choice; two pages show it."""

from __future__ import annotations

from typing import Any

import numpy as np
import streamlit as st

from sarl_core.explaining.rule_figures import tree_figure
from sarl_core.mining.rules import Thresholds, cut_nodes
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
    told = repr((key, tree.source.digest, tree.divider, tree.index, thresholds))
    return _picture(told, node, around, leaves, dark, tree, thresholds)


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
    cut = (
        np.flatnonzero(_tree.feature == LEAF)
        if leaves
        else cut_nodes(
            _tree,
            supp_min=_thresholds.support,
            conf_min=_thresholds.confidence,
            lift_min=_thresholds.lift,
            max_depth=_thresholds.max_depth,
        )
    )
    return tree_figure(_tree, cut, node, around=around, dark=dark)
