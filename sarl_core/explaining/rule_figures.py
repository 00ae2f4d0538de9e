"""Figures of one rule: its place in the tree, and its intervals."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.colours import MARKER_COLOUR, MUTED_COLOUR, faded, label_colour
from sarl_core.explaining.evidence import FeatureEvidence
from sarl_core.explaining.language import (
    label_text,
    number_text,
    query_text,
    share_text,
    short_condition,
)
from sarl_core.explaining.markup import plain
from sarl_core.mining.rules import Condition
from sarl_core.mining.tree import LEAF, PolicyTree

MAX_BOXES = 2000  # more take a browser the better part of a second
_HOVERS = 400
_NEIGHBOURHOOD = 30  # "around" a rule is what is at most so many times as wide


def tree_figure(
    tree: PolicyTree,
    cut: NDArray[np.int64],
    node: int,
    *,
    around: bool = False,
    dark: bool = False,
    height: int = 420,
) -> go.Figure:
    """The tree from above: a box a node, as wide as its share of the states.

    Every box stands on the boxes it was divided into; rules are full in colour, what lies above
    them is pale, and what was cut off below them is grey.

    Args:
        tree: With n nodes.
        cut: Nodes that are rules, (k,).
        node: The rule whose path is lit.
        around: Whether to show the neighbourhood of the rule only.
        dark: Whether it stands on dark ground.
        height: In pixels.

    Returns:
        Zoom by dragging, back by a double click.
    """
    total = int(tree.samples[0])
    below = _below(tree, cut)
    rules = np.zeros(tree.n_nodes, dtype=np.bool_)
    rules[cut] = True
    path = np.array(tree.path(node), dtype=np.int64)
    window = _window(tree, node) if around else (0, total, 0, int(tree.depth.max()) + 1)
    shown = _shown(tree, window, keep=np.concatenate([cut, path]))
    figure = go.Figure()
    for label in range(tree.dimension.n_labels):
        name = plain(label_text(label, tree.dimension))
        mine = shown[tree.label[shown] == label]
        for part, opacity, what in (
            (mine[~below[mine] & ~rules[mine]], 0.26, "on the way"),
            (mine[rules[mine]], 0.95, "a rule"),
        ):
            _add_boxes(figure, tree, part, faded(label_colour(label), opacity), f"{name}, {what}")
    _add_boxes(
        figure,
        tree,
        shown[below[shown]],
        faded(MUTED_COLOUR, 0.22 if dark else 0.16),
        "cut off below a rule",
    )
    _add_hover(figure, tree, shown, window)
    _add_path(figure, tree, path, dark=dark)
    if around:
        _add_conditions(figure, tree, path, window, dark=dark)
    left, right, top, bottom = window
    figure.update_layout(
        height=height,
        margin={"l": 50, "r": 10, "t": 8, "b": 44},
        showlegend=False,
        hovermode="closest",
        hoverdistance=30,
        dragmode="zoom",
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
    )
    figure.update_xaxes(
        range=[left / total, right / total],
        title={"text": "Share of the states"},
        tickformat="~%" if right - left > total / 50 else ".2~%",
        showgrid=False,
        zeroline=False,
        nticks=6,
    )
    figure.update_yaxes(
        range=[bottom + 0.05, top - 0.05],
        title={"text": "Conditions so far"},
        showgrid=False,
        zeroline=False,
        nticks=min(bottom - top + 1, 9),
        tickformat="d",
    )
    return figure


def feature_figure(
    evidence: FeatureEvidence, feature: Feature, colour: str, *, height: int = 190
) -> go.Figure:
    """A feature over all states and over those of a rule, the rule's interval shaded.

    Args:
        evidence: The two histograms.
        feature: Name and unit.
        colour: Of the rule's label.
        height: In pixels.

    Returns:
        Two histograms over each other, each of its own states.
    """
    edges, bounds = evidence.edges, evidence.bounds
    centres, widths = (edges[:-1] + edges[1:]) / 2, np.diff(edges)
    unit = f" {plain(feature.unit)}" if feature.unit else ""
    ranges = [
        f"{number_text(low)} to {number_text(high)}{unit}"
        for low, high in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    ]
    figure = go.Figure()
    for name, shares, fill in (
        ("all states", evidence.everywhere, faded(MUTED_COLOUR, 0.55)),
        ("states of the rule", evidence.at_rule, faded(colour, 0.75)),
    ):
        figure.add_bar(
            x=centres,
            y=np.round(shares, 6),
            width=widths,
            name=name,
            customdata=ranges,
            marker={"color": fill, "line": {"width": 0}},
            hovertemplate=f"%{{customdata}}<br>%{{y:.1%}} of {name}<extra></extra>",
        )
    low = bounds.low if np.isfinite(bounds.low) else float(edges[0])
    high = bounds.high if np.isfinite(bounds.high) else float(edges[-1])
    whole = {"xref": "x", "yref": "y domain", "y0": 0, "y1": 1}
    shapes: list[dict[str, Any]] = [
        {**whole, "type": "rect", "x0": low, "x1": high, "fillcolor": MARKER_COLOUR}
        | {"opacity": 0.13, "line": {"width": 0}, "layer": "below"}
    ]
    shapes += [
        {**whole, "type": "line", "x0": edge, "x1": edge}
        | {"line": {"color": MARKER_COLOUR, "width": 2}}
        for edge in (bounds.low, bounds.high)
        if np.isfinite(edge)
    ]
    figure.update_layout(
        height=height,
        shapes=shapes,  # at once: one by one, Plotly copies them all each time
        margin={"l": 44, "r": 10, "t": 6, "b": 40},
        barmode="overlay",
        bargap=0,
        showlegend=False,
        hovermode="closest",
        dragmode=False,
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
    )
    figure.update_xaxes(
        range=[float(edges[0]), float(edges[-1])],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        nticks=6,
        title={"text": plain(feature.unit or feature.name), "standoff": 4},
    )
    figure.update_yaxes(tickformat=".0%", fixedrange=True, nticks=4, zeroline=False)
    return figure


def interval_text(evidence: FeatureEvidence, feature: Feature) -> str:
    """What stands above a feature's figure.

    Args:
        evidence: Knows the interval.
        feature: Name and unit.

    Returns:
        As "pole angle > 0.02 rad".
    """
    return short_condition(evidence.bounds, feature)


def _below(tree: PolicyTree, cut: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether each node lies below a rule. Rules of a tree share no state."""
    if not len(cut):
        return np.zeros(tree.n_nodes, dtype=np.bool_)
    by_start = cut[np.argsort(tree.sample_start[cut])]
    starts = tree.sample_start[by_start]
    at = np.searchsorted(starts, tree.sample_start, side="right") - 1
    owner = by_start[np.maximum(at, 0)]
    inside = tree.sample_start < tree.sample_start[owner] + tree.samples[owner]
    return (at >= 0) & inside & (tree.depth > tree.depth[owner])


def _window(tree: PolicyTree, node: int) -> tuple[int, int, int, int]:
    """Left, right (in states), top and bottom (in queries) of a rule's neighbourhood."""
    path = tree.path(node)
    top = node
    for above in reversed(path):
        if tree.samples[above] > _NEIGHBOURHOOD * tree.samples[node]:
            break
        top = above
    left, width = int(tree.sample_start[top]), int(tree.samples[top])
    depth = int(tree.depth[node])
    return left, left + width, int(tree.depth[top]), min(depth + 4, int(tree.depth.max()) + 1)


def _shown(
    tree: PolicyTree, window: tuple[int, int, int, int], keep: NDArray[np.int64]
) -> NDArray[np.int64]:
    left, right, top, bottom = window
    start, end = tree.sample_start, tree.sample_start + tree.samples
    inside = (end > left) & (start < right) & (tree.depth >= top) & (tree.depth < bottom)
    nodes = np.flatnonzero(inside)
    if len(nodes) > MAX_BOXES:
        # The narrowest are less than a hair wide; those that matter stay.
        by_size = nodes[np.argsort(-tree.samples[nodes], kind="stable")]
        nodes = np.union1d(by_size[:MAX_BOXES], keep[inside[keep]])
    return nodes


def _add_boxes(
    figure: go.Figure, tree: PolicyTree, nodes: NDArray[np.int64], colour: str, name: str
) -> None:
    """Boxes as one outline with gaps: a browser draws thousands of them at once."""
    if not len(nodes):
        return
    total = float(tree.samples[0])
    left = tree.sample_start[nodes] / total
    right = (tree.sample_start[nodes] + tree.samples[nodes]) / total
    top = tree.depth[nodes].astype(np.float64)
    gap = np.full(len(nodes), np.nan)
    x = np.column_stack([left, right, right, left, gap]).ravel()
    y = np.column_stack([top, top, top + 0.92, top + 0.92, gap]).ravel()
    figure.add_scatter(
        x=np.round(x, 7),
        y=y,
        mode="lines",
        fill="toself",
        fillcolor=colour,
        line={"width": 0},
        name=name,
        hoverinfo="skip",
    )


def _add_hover(
    figure: go.Figure,
    tree: PolicyTree,
    nodes: NDArray[np.int64],
    window: tuple[int, int, int, int],
) -> None:
    """Invisible points that say what a box is; the widest boxes are enough."""
    left, right, _, _ = window
    some = nodes[np.argsort(-tree.samples[nodes], kind="stable")][:_HOVERS]
    total = float(tree.samples[0])
    start = np.maximum(tree.sample_start[some], left)
    end = np.minimum(tree.sample_start[some] + tree.samples[some], right)
    texts = []
    for node in some.tolist():
        feature, asked = int(tree.feature[node]), ""
        if feature != LEAF:
            name = tree.source.features[feature].name
            asked = f"<br>asks: {plain(name)} ≤ {number_text(float(tree.threshold[node]))}?"
        texts.append(
            f"{int(tree.samples[node]):,} states ({share_text(float(tree.support[node]))})<br>"
            f"{share_text(float(tree.confidence[node]))} "
            f"{plain(label_text(int(tree.label[node]), tree.dimension))}{asked}"
        )
    figure.add_scatter(
        x=(start + end) / 2 / total,
        y=tree.depth[some] + 0.46,
        mode="markers",
        marker={"size": 1, "color": "rgba(0,0,0,0)"},
        text=texts,
        hovertemplate="%{text}<extra></extra>",
    )


def _add_path(figure: go.Figure, tree: PolicyTree, path: NDArray[np.int64], *, dark: bool) -> None:
    halo = "#12181d" if dark else "#ffffff"
    total = float(tree.samples[0])
    middle = (tree.sample_start[path] + tree.samples[path] / 2) / total
    depth = tree.depth[path] + 0.46
    figure.add_scatter(
        x=middle,
        y=depth,
        mode="lines",
        line={"color": halo, "width": 7},
        hoverinfo="skip",
        opacity=0.85,
    )
    sizes = [7] * (len(path) - 1) + [15]
    figure.add_scatter(
        x=middle,
        y=depth,
        mode="lines+markers",
        hoverinfo="skip",
        name="path",
        line={"color": MARKER_COLOUR, "width": 3},
        marker={"color": MARKER_COLOUR, "size": sizes, "line": {"color": halo, "width": 1.5}},
    )


def _add_conditions(
    figure: go.Figure,
    tree: PolicyTree,
    path: NDArray[np.int64],
    window: tuple[int, int, int, int],
    *,
    dark: bool,
) -> None:
    """The conditions of the path, written beside it."""
    total = float(tree.samples[0])
    left, right, top, bottom = window
    ink = "#f1f5f7" if dark else "#1d2730"
    notes: list[dict[str, Any]] = []
    for above, here in zip(path[:-1].tolist(), path[1:].tolist(), strict=True):
        if not top <= tree.depth[here] < bottom:
            continue
        middle = (tree.sample_start[here] + tree.samples[here] / 2) / total
        query = Condition(
            int(tree.feature[above]),
            "<=" if int(tree.children_left[above]) == here else ">",
            float(tree.threshold[above]),
        )
        rightwards = middle * total < (left + right) / 2
        note: dict[str, Any] = {
            "x": middle,
            "y": float(tree.depth[here]) + 0.46,
            "showarrow": False,
            "text": plain(query_text(query, tree.source.features)),
            "xanchor": "left" if rightwards else "right",
            "xshift": 12 if rightwards else -12,
            "font": {"size": 11, "color": ink},
            "bgcolor": "rgba(18,24,29,0.6)" if dark else "rgba(255,255,255,0.7)",
        }
        notes.append(note)
    figure.layout.annotations = notes  # at once: one by one, Plotly copies them all each time
