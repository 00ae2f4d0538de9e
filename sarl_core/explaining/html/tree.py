"""The neighbourhood of a rule in its tree, in HTML without script; every name escaped.

It shows what `tree_figure` shows around a rule, and is there at once: a Plotly figure that changes
is made anew by Streamlit and drawn twice. What it cannot do is to be zoomed.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sarl_core.explaining.figures.colours import MARKER_COLOUR, MUTED_COLOUR, faded, label_colour
from sarl_core.explaining.figures.tree import (
    WIDTH,
    below_rules,
    node_lines,
    path_queries,
    window_around,
)
from sarl_core.explaining.html.plot import round_ticks, tick_text
from sarl_core.mining.language import counted, label_text
from sarl_core.mining.tree import PolicyTree

_HIT = 8.0  # pixels: what is narrower is not met by the pointer
_THINNEST = 1.5  # pixels: boxes that are narrower are drawn together
_BOX = 0.92  # of a row's height
_LEVELS = 9  # numbered at most

_STYLE = """<style>
.sarl-place .plot { position: relative; height: 366px; margin: 0.2rem 0.6rem 0 2.9rem; }
.sarl-place .all, .sarl-place .all i { position: absolute; inset: 0; }
.sarl-place .all .row { bottom: auto; }
.sarl-place .all .halo { opacity: 0.85; background: HALO; }
.sarl-place .all .line { background: MARKER; }
.sarl-place .all .dot { inset: auto; width: 7px; height: 7px; margin: -3.5px; border-radius: 50%;
  background: MARKER; box-shadow: 0 0 0 1.5px HALO; }
.sarl-place .all .dot.end { width: 15px; height: 15px; margin: -7.5px; }
.sarl-place .plot b { position: absolute; }
.sarl-place .plot b:hover { box-shadow: inset 0 0 0 1px currentColor; }
.sarl-place em { position: absolute; font-style: normal; font-size: 0.76rem; line-height: 1.35;
  padding: 0 0.2rem; background: GROUND; transform: translateY(-50%); white-space: nowrap;
  overflow: hidden; text-overflow: ellipsis; pointer-events: none; }
.sarl-place small { position: absolute; font-size: 0.8rem; line-height: 1; opacity: 0.65;
  white-space: nowrap; font-variant-numeric: tabular-nums; }
.sarl-place .y { right: 100%; margin-right: 0.45rem; transform: translateY(-50%); }
.sarl-place .x { top: 100%; margin-top: 0.45rem; transform: translateX(-50%); }
.sarl-place .side { right: calc(100% + 1.5rem); top: 50%; writing-mode: vertical-rl;
  transform: translateY(-50%) rotate(180deg); opacity: 0.75; }
.sarl-place .name { font-size: 0.8rem; opacity: 0.75; text-align: center;
  margin: 1.6rem 0.6rem 0 2.9rem; }
.sarl-place .note { font-size: 0.875rem; opacity: 0.7; margin: 1rem 0 0; }
</style>""".replace("MARKER", MARKER_COLOUR)


def place_html(
    tree: PolicyTree,
    cut: NDArray[np.int64],
    node: int,
    *,
    note: str = "",
    dark: bool = False,
) -> str:
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
    rows = [
        f'<i class="row" style="top:{_share(depth - top, bottom - top)};'
        f"height:{_share(_BOX, bottom - top)};"
        f'background:{_gradient(tree, nodes[tree.depth[nodes] == depth], colours, window)}"></i>'
        for depth in range(top, bottom)
    ]
    label = escape(label_text(int(tree.label[node]), tree.dimension))
    told = (
        f"The tree around the rule: {counted(len(path) - 1, 'condition')} lead to "
        f"{counted(int(tree.samples[node]), 'state')}, {label}"
    )
    style = _STYLE.replace("HALO", "#12181d" if dark else "#ffffff").replace(
        "GROUND", "rgba(18,24,29,0.6)" if dark else "rgba(255,255,255,0.7)"
    )
    return (
        f'{style}<div class="sarl-place"><div class="plot"><div class="all" role="img" '
        f'aria-label="{told}">{"".join(rows)}{_way(tree, path, window)}</div>'
        f'<div aria-hidden="true">{_hits(tree, nodes, window)}</div>'
        f"{_queries(tree, path, window)}"
        f'<span aria-hidden="true">{_ticks(tree, window)}'
        '<small class="side">Conditions so far</small></span></div>'
        '<div class="name" aria-hidden="true">Share of the states</div>'
        f'<p class="note">{escape(note)}</p></div>'
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
            _share(min(max(place, left), right) - left, right - left) for place in (begun, ended)
        )
        if first_place != at:
            stops.append(f"#0000 0 {first_place}")
        stops.append(f"{max(mix, key=lambda colour: mix[colour])} 0 {last_place}")
        at = last_place
    stops.append("#0000 0")
    return f"linear-gradient(90deg,{','.join(stops)})"


def _way(tree: PolicyTree, path: Sequence[int], window: tuple[int, int, int, int]) -> str:
    """The path as a line from box to box, with a dot on each."""
    _, _, top, bottom = window
    # One more above the window, where the line comes from.
    points = [_point(tree, node, window) for node in path if top - 1 <= tree.depth[node] < bottom]
    shown = [point for point in points if point[1] >= 0]
    dots = [
        f'<i class="dot{" end" if point is shown[-1] else ""}" '
        f'style="left:{point[0]:.2f}%;top:{point[1]:.2f}%"></i>'
        for point in shown
    ]
    return _line(points, 3.5, "halo") + _line(points, 1.5, "line") + "".join(dots)


def _line(points: Sequence[tuple[float, float]], half: float, css: str) -> str:
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
    if not corners:
        return ""
    return f'<i class="{css}" style="clip-path:polygon({",".join(corners)})"></i>'


def _hits(tree: PolicyTree, nodes: NDArray[np.int64], window: tuple[int, int, int, int]) -> str:
    """What is said of the boxes that are wide enough to point at."""
    left, right, top, bottom = window
    wide = nodes[tree.samples[nodes] >= (right - left) * _HIT / WIDTH]
    parts = []
    for node in wide.tolist():
        start = max(int(tree.sample_start[node]), left)
        end = min(int(tree.sample_start[node] + tree.samples[node]), right)
        told = escape("\n".join(node_lines(tree, node)))
        parts.append(
            f'<b title="{told}" style="left:{_share(start - left, right - left)};'
            f"width:{_share(end - start, right - left)};"
            f"top:{_share(int(tree.depth[node]) - top, bottom - top)};"
            f'height:{_share(_BOX, bottom - top)}"></b>'
        )
    return "".join(parts)


def _queries(tree: PolicyTree, path: Sequence[int], window: tuple[int, int, int, int]) -> str:
    """The conditions of the path, written beside it."""
    _, _, top, bottom = window
    parts = []
    for node, query in zip(path[1:], path_queries(tree, path), strict=True):
        if not top <= tree.depth[node] < bottom:
            continue
        x, y = _point(tree, node, window)
        side, place = ("left", x) if x < 50 else ("right", 100 - x)
        parts.append(
            f'<em style="{side}:calc({place:.2f}% + 12px);top:{y:.2f}%;'
            f'max-width:calc({100 - place:.2f}% - 12px)">{escape(query)}</em>'
        )
    return "".join(parts)


def _ticks(tree: PolicyTree, window: tuple[int, int, int, int]) -> str:
    left, right, top, bottom = window
    total = int(tree.samples[0])
    low, high = 100 * left / total, 100 * right / total
    every = -(-(bottom - top) // _LEVELS)
    return "".join(
        f'<small class="y" style="top:{_share(depth - top + _BOX / 2, bottom - top)}">{depth}'
        "</small>"
        for depth in range(top, bottom, every)
    ) + "".join(
        f'<small class="x" style="left:{_share(tick - low, high - low)}">{tick_text(tick)} %'
        "</small>"
        for tick in round_ticks(low, high, 5)
    )


def _point(tree: PolicyTree, node: int, window: tuple[int, int, int, int]) -> tuple[float, float]:
    """The middle of a node's box, in percent from the left and from above."""
    left, right, top, bottom = window
    middle = int(tree.sample_start[node]) + int(tree.samples[node]) / 2
    down = int(tree.depth[node]) - top + _BOX / 2
    return 100 * (middle - left) / (right - left), 100 * down / (bottom - top)


def _share(part: float, whole: float) -> str:
    return f"{100 * part / whole:.2f}%"


def _signed(pixels: float) -> str:
    return f"{'+' if pixels >= 0 else '-'} {abs(pixels):g}px"
