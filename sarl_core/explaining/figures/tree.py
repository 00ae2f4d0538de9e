"""The place of one rule in the tree, as a figure."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from sarl_core.explaining.colours import MARKER_COLOUR, MUTED_COLOUR, faded, label_colour
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.mining.action_words import label_text
from sarl_core.mining.digits import limit_text
from sarl_core.mining.language import query_text, share_text
from sarl_core.mining.rules import Condition
from sarl_core.mining.tree import LEAF, PolicyTree

MAX_BOXES = 2000  # more take a browser the better part of a second
_HOVERS = 400
WIDTH = 620  # pixels that the boxes have on a wide screen
HIT = 4.0  # pixels: what is narrower is not met by the pointer
_NEIGHBOURHOOD = 30  # "around" a rule is what is at most so many times as wide


def tree_figure(
    tree: PolicyTree,
    cut: NDArray[np.int64],
    node: int,
    *,
    dark: bool = False,
) -> go.Figure:
    """The tree from above: a box a node, as wide as its share of the states.

    Every box stands on the boxes it was divided into; rules are full in colour, what lies above
    them is pale, and what was cut off below them is grey.

    Args:
        tree: With n nodes.
        cut: Nodes that are rules, (k,).
        node: The rule whose path is lit.
        dark: Whether it stands on dark ground.

    Returns:
        Zoom by dragging, back by a double click.
    """
    below = below_rules(tree, cut)
    rules = np.zeros(tree.n_nodes, dtype=np.bool_)
    rules[cut] = True
    path = np.array(tree.path(node), dtype=np.int64)
    drawn = _drawn_nodes(tree, keep=np.concatenate([cut, path]))
    kinds = []
    for label in range(tree.dimension.n_labels):
        name = plain(label_text(label, tree.dimension))
        mine = drawn[tree.label[drawn] == label]
        for part, opacity, what in (
            (mine[~below[mine] & ~rules[mine]], 0.26, "on the way"),
            (mine[rules[mine]], 0.95, "a rule"),
        ):
            kinds.append((part, faded(label_colour(label), opacity), f"{name}, {what}"))
    grey = faded(MUTED_COLOUR, 0.22 if dark else 0.16)
    kinds.append((drawn[below[drawn]], grey, "cut off below a rule"))
    figure = go.Figure()
    _add_hover(figure, tree, drawn)
    _add_path(figure, tree, path, dark=dark)
    bottom = int(tree.depth.max()) + 1
    figure.update_layout(
        **figure_layout(
            420,
            shapes=[_boxes(tree, nodes, *look) for nodes, *look in kinds if len(nodes)],
            margin={"l": 50, "r": 10, "b": 44},
            showlegend=False,
            hoverdistance=30,
        )
    )
    figure.update_layout(dragmode="zoom")
    figure.update_xaxes(
        range=[0, 1],
        title={"text": "Share of the states"},
        tickformat="~%",
        showgrid=False,
        zeroline=False,
        nticks=6,
    )
    figure.update_yaxes(
        range=[bottom + 0.05, -0.05],
        title={"text": "Conditions so far"},
        showgrid=False,
        zeroline=False,
        nticks=min(bottom + 1, 9),
        tickformat="d",
    )
    return figure


def below_rules(tree: PolicyTree, cut: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether each node lies below a rule. Rules of a tree share no state.

    Args:
        tree: With n nodes.
        cut: Nodes that are rules, (k,).

    Returns:
        Shape (n,).
    """
    if not len(cut):
        return np.zeros(tree.n_nodes, dtype=np.bool_)
    by_start = cut[np.argsort(tree.sample_start[cut])]
    starts = tree.sample_start[by_start]
    at = np.searchsorted(starts, tree.sample_start, side="right") - 1
    owner = by_start[np.maximum(at, 0)]
    inside = tree.sample_start < tree.sample_start[owner] + tree.samples[owner]
    return (at >= 0) & inside & (tree.depth > tree.depth[owner])


def node_lines(tree: PolicyTree, node: int) -> list[str]:
    """What is said of a node where the pointer is.

    Args:
        tree: With the node.
        node: Node number.

    Returns:
        Lines, with names as they are in the file.
    """
    lines = [
        f"{int(tree.samples[node]):,} states ({share_text(float(tree.support[node]))})",
        f"{share_text(float(tree.confidence[node]))} "
        f"{label_text(int(tree.label[node]), tree.dimension)}",
    ]
    feature = int(tree.feature[node])
    if feature != LEAF:
        queried = tree.source.features[feature]
        limit = limit_text(float(tree.threshold[node]), queried)
        plain = queried.indicator is None
        lines.append(f"asks: {f'{queried.name} ≤ {limit}' if plain else queried.statement(True)}?")
    return lines


def path_queries(tree: PolicyTree, path: Sequence[int]) -> list[str]:
    """The conditions on a path, in signs.

    Args:
        tree: With the path.
        path: Nodes, the root first.

    Returns:
        One text for each node but the first.
    """
    return [
        query_text(
            Condition(
                int(tree.feature[above]),
                "<=" if int(tree.children_left[above]) == here else ">",
                float(tree.threshold[above]),
            ),
            tree.source.features,
        )
        for above, here in pairwise(path)
    ]


def window_around(tree: PolicyTree, node: int) -> tuple[int, int, int, int]:
    """The neighbourhood of a rule.

    Args:
        tree: With the rule.
        node: The rule's.

    Returns:
        Left and right in states, top and bottom in conditions.
    """
    path = tree.path(node)
    top = node
    for above in reversed(path):
        if tree.samples[above] > _NEIGHBOURHOOD * tree.samples[node]:
            break
        top = above
    left, width = int(tree.sample_start[top]), int(tree.samples[top])
    depth = int(tree.depth[node])
    return left, left + width, int(tree.depth[top]), min(depth + 4, int(tree.depth.max()) + 1)


def _drawn_nodes(tree: PolicyTree, keep: NDArray[np.int64]) -> NDArray[np.int64]:
    """The nodes that are drawn, and those to keep."""
    nodes = np.flatnonzero(tree.samples > 0)
    if len(nodes) > MAX_BOXES:
        # The narrowest are less than a hair wide; those that matter stay.
        by_size = nodes[np.argsort(-tree.samples[nodes], kind="stable")]
        nodes = by_size[:MAX_BOXES]
    return np.union1d(nodes, keep[tree.samples[keep] > 0])


def _boxes(
    tree: PolicyTree,
    nodes: NDArray[np.int64],
    colour: str,
    name: str,
) -> dict[str, Any]:
    """Boxes as one shape, those that touch each other as one box: a browser draws them at once."""
    total = float(tree.samples[0])
    order = nodes[np.lexsort((tree.sample_start[nodes], tree.depth[nodes]))]
    start, depth = tree.sample_start[order], tree.depth[order]
    end = start + tree.samples[order]
    apart = (start[1:] != end[:-1]) | (depth[1:] != depth[:-1])
    first = np.flatnonzero(np.concatenate([[True], apart]))
    last = np.flatnonzero(np.concatenate([apart, [True]]))
    path = "".join(
        f"M{left:.6g},{top}H{right:.6g}V{top + 0.92:.2f}H{left:.6g}Z"
        for left, right, top in zip(
            (start[first] / total).tolist(),
            (end[last] / total).tolist(),
            depth[first].tolist(),
            strict=True,
        )
    )
    return {"type": "path", "path": path, "fillcolor": colour, "name": name} | {
        "line": {"width": 0},
        "layer": "below",
    }


def _add_hover(figure: go.Figure, tree: PolicyTree, nodes: NDArray[np.int64]) -> None:
    """Invisible points that say what a box is; the widest boxes are enough."""
    total = float(tree.samples[0])
    wide = nodes[tree.samples[nodes] >= total * HIT / WIDTH]
    some = wide[np.argsort(-tree.samples[wide], kind="stable")][:_HOVERS]
    texts = ["<br>".join(map(plain, node_lines(tree, node))) for node in some.tolist()]
    figure.add_scatter(
        x=(tree.sample_start[some] + tree.samples[some] / 2) / total,
        y=tree.depth[some] + 0.46,
        mode="none",  # a marker would be an element of the page for each
        name="boxes",
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
