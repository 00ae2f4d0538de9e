"""The neighbourhood of a rule in its tree, in HTML.

It shows what `tree_figure` shows around a rule, and is there at once: a Plotly figure that changes
is made anew by Streamlit and drawn twice. What it cannot do is to be zoomed.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from sarl_core.explaining.colours import MUTED_COLOUR, faded, label_colour
from sarl_core.explaining.figures.tree import (
    WIDTH,
    below_rules,
    node_lines,
    path_queries,
    window_around,
)
from sarl_core.explaining.markup import percent
from sarl_core.explaining.templates import render
from sarl_core.explaining.ticks import round_ticks, tick_text
from sarl_core.mining.action_words import label_text
from sarl_core.mining.language import counted
from sarl_core.mining.tree import PolicyTree

_HIT = 8.0  # pixels: what is narrower is not met by the pointer
_THINNEST = 1.5  # pixels: boxes that are narrower are drawn together
_BOX = 0.92  # of a row's height
_LEVELS = 9  # numbered at most
_LINES = 22  # of text that have room above each other


def place_html(
    tree: PolicyTree,
    cut: NDArray[np.int64],
    node: int,
    *,
    note: str = "",
    dark: bool = False,
) -> Markup:
    """What lies around a rule: a box a node, as wide as its share of the states.

    Args:
        tree: With n nodes.
        cut: Nodes that are rules, (k,).
        node: The rule whose path is lit.
        note: Said below it.
        dark: Whether it stands on dark ground.

    Returns:
        HTML, as wide as there is room.
    """
    left, right, top, bottom = window = window_around(tree, node)
    path = tree.path(node)
    start, end = tree.sample_start, tree.sample_start + tree.samples
    inside = (end > left) & (start < right) & (tree.depth >= top) & (tree.depth < bottom)
    nodes = np.flatnonzero(inside & (tree.samples > 0))
    nodes = nodes[np.lexsort((start[nodes], tree.depth[nodes]))]
    colours = _colours(tree, cut, dark=dark)
    height = bottom - top
    low, high = (100 * end / int(tree.samples[0]) for end in (left, right))
    points = _points(tree, path, window)
    label = label_text(int(tree.label[node]), tree.dimension)
    return render(
        "rules/tree",
        dark=dark,
        description=f"The tree around the rule: {counted(len(path) - 1, 'condition')} lead to "
        f"{counted(int(tree.samples[node]), 'state')}, {label}",
        rows=[
            f"top:{percent((depth - top) / height)};height:{percent(_BOX / height)};"
            f"background:{_gradient(tree, nodes[tree.depth[nodes] == depth], colours, window)}"
            for depth in range(top, bottom)
        ],
        way=[("halo", _outline(points, 3.5)), ("line", _outline(points, 1.5))]
        if len(points) > 1
        else [],
        dots=[f"left:{x:.2f}%;top:{y:.2f}%" for x, y in points if y >= 0],
        boxes=_boxes(tree, nodes, window),
        queries=_queries(tree, path, window),
        lines=max(1, int(_LINES * _BOX / height)),
        levels=[
            (percent((depth - top + _BOX / 2) / height), depth)
            for depth in range(top, bottom, -(-height // _LEVELS))
        ],
        shares=[
            (percent((tick - low) / (high - low)), tick_text(tick))
            for tick in round_ticks(low, high, 5)
        ],
        note=note,
    )


def _colours(tree: PolicyTree, cut: NDArray[np.int64], *, dark: bool) -> list[str]:
    """The colour of each node's box: full for a rule, pale above it, grey below."""
    grey = faded(MUTED_COLOUR, 0.22 if dark else 0.16)
    rules = set(cut.tolist())
    hues = [label_colour(label) for label in range(tree.dimension.n_labels)]
    pale, full = [faded(hue, 0.26) for hue in hues], [faded(hue, 0.95) for hue in hues]
    return [
        grey if below else full[label] if node in rules else pale[label]
        for node, (below, label) in enumerate(
            zip(below_rules(tree, cut).tolist(), tree.label.tolist(), strict=True)
        )
    ]


def _gradient(
    tree: PolicyTree,
    nodes: NDArray[np.int64],
    colours: Sequence[str],
    window: tuple[int, int, int, int],
) -> str:
    """The boxes of a row, from left to right, as hard stops: one element draws them all."""
    left, right, _, _ = window
    thinnest = (right - left) * _THINNEST / WIDTH
    boxes: list[tuple[int, int, dict[str, int]]] = []  # from, to, and how many states of a colour
    for node in nodes.tolist():
        first, states = int(tree.sample_start[node]), int(tree.samples[node])
        if boxes and boxes[-1][1] == first:
            begun, ended, mix = boxes[-1]
            if list(mix) == [colours[node]] or (ended - begun < thinnest and states < thinnest):
                mix[colours[node]] = mix.get(colours[node], 0) + states
                boxes[-1] = begun, first + states, mix
                continue
        boxes.append((first, first + states, {colours[node]: states}))
    if not boxes:
        return "none"
    # A stop at 0 begins where the one before it ended.
    stops, at = [], "0.00%"
    for begun, ended, mix in boxes:
        first_place, last_place = (
            percent((min(max(place, left), right) - left) / (right - left))
            for place in (begun, ended)
        )
        if first_place != at:
            stops.append(f"#0000 0 {first_place}")
        stops.append(f"{max(mix, key=lambda colour: mix[colour])} 0 {last_place}")
        at = last_place
    stops.append("#0000 0")
    return f"linear-gradient(90deg,{','.join(stops)})"


def _points(
    tree: PolicyTree, path: Sequence[int], window: tuple[int, int, int, int]
) -> list[tuple[float, float]]:
    """The path from box to box, and one more above the window, where its line comes from."""
    _, _, top, bottom = window
    return [_point(tree, node, window) for node in path if top - 1 <= tree.depth[node] < bottom]


def _outline(points: Sequence[tuple[float, float]], half: float) -> str:
    """Straight lines downwards, drawn with a square brush: places in percent, width in pixels."""
    corners: list[str] = []
    for (x, y), (to_x, to_y) in pairwise(points):
        rightwards = 1 if to_x >= x else -1
        outline = (
            (x, y, -rightwards, -1),
            (x, y, rightwards, -1),
            (to_x, to_y, rightwards, -1),
            (to_x, to_y, rightwards, 1),
            (to_x, to_y, -rightwards, 1),
            (x, y, -rightwards, 1),
        )
        turns = outline if rightwards > 0 else outline[::-1]  # overlaps stay filled
        around = [
            f"calc({across:.2f}% {_signed(half * right)}) calc({down:.2f}% {_signed(half * low)})"
            for across, down, right, low in turns
        ]
        # There and back from one corner, so that all lines are one outline.
        corners += ["0 0", *around, around[0]]
    return ",".join(corners)


def _boxes(
    tree: PolicyTree, nodes: NDArray[np.int64], window: tuple[int, int, int, int]
) -> list[tuple[str, str]]:
    """What is said of the boxes that are wide enough to point at, and where each stands."""
    left, right, top, bottom = window
    wide = nodes[tree.samples[nodes] >= (right - left) * _HIT / WIDTH]
    boxes = []
    for node in wide.tolist():
        start = max(int(tree.sample_start[node]), left)
        end = min(int(tree.sample_start[node] + tree.samples[node]), right)
        boxes.append(
            (
                "\n".join(node_lines(tree, node)),
                f"left:{percent((start - left) / (right - left))};"
                f"width:{percent((end - start) / (right - left))};"
                f"top:{percent((int(tree.depth[node]) - top) / (bottom - top))};"
                f"height:{percent(_BOX / (bottom - top))}",
            )
        )
    return boxes


def _queries(
    tree: PolicyTree, path: Sequence[int], window: tuple[int, int, int, int]
) -> list[tuple[str, str]]:
    """The conditions of the path, and where beside it they are written."""
    _, _, top, bottom = window
    queries = []
    for node, query in zip(path[1:], path_queries(tree, path), strict=True):
        if not top <= tree.depth[node] < bottom:
            continue
        x, y = _point(tree, node, window)
        side, place = ("left", x) if x < 50 else ("right", 100 - x)
        style = (
            f"{side}:calc({place:.2f}% + 12px);top:{y:.2f}%;"
            f"max-width:calc({100 - place:.2f}% - 12px)"
        )
        queries.append((query, style))
    return queries


def _point(tree: PolicyTree, node: int, window: tuple[int, int, int, int]) -> tuple[float, float]:
    """The middle of a node's box, in percent from the left and from above."""
    left, right, top, bottom = window
    middle = int(tree.sample_start[node]) + int(tree.samples[node]) / 2
    down = int(tree.depth[node]) - top + _BOX / 2
    return 100 * (middle - left) / (right - left), 100 * down / (bottom - top)


def _signed(pixels: float) -> str:
    return f"{'+' if pixels >= 0 else '-'} {abs(pixels):g}px"
