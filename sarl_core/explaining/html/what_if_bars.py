"""What the shield would do along each feature of a state, as bars in HTML without script."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from sarl_core.decimals import decimal_on_scale, decimal_text
from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.figures.colours import faded, label_colour
from sarl_core.explaining.html.path import label_key
from sarl_core.explaining.words.what_if import with_unit
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import label_text, number_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.near import FeatureLine

_PALE = 0.32
# The mark is dark with a white edge, so that it is seen on every colour and on both grounds.
_STYLE = """<style>
.sarl-lines { font-size: 0.82rem; line-height: 1.25; }
.sarl-lines p { margin: 0 0 0.4rem 0; font-size: 1rem; font-weight: 600; }
.sarl-lines p.note { margin: 0.3rem 0 0 0; font-size: 0.875rem; font-weight: 400; opacity: 0.65; }
.sarl-lines .row { display: flex; align-items: flex-start; gap: 0.6rem; padding: 0.2rem 0; }
.sarl-lines .name { flex: none; width: 28%; max-width: 11rem; text-align: right;
  overflow-wrap: anywhere; }
.sarl-lines .track { flex: 1; min-width: 0; padding-right: 4px; }
.sarl-lines .bar { position: relative; height: 17px; }
.sarl-lines .bar span { position: absolute; top: 0; bottom: 0; min-width: 2px; }
.sarl-lines .bar b { position: absolute; top: -3px; bottom: -3px; width: 3px; margin-left: -1.5px;
  background: #1d2730; box-shadow: 0 0 0 1.5px #ffffff; border-radius: 1px; }
.sarl-lines .ends { display: flex; justify-content: space-between; font-size: 0.7rem;
  opacity: 0.65; padding-top: 3px; }
</style>"""


def lines_html(
    lines: Sequence[FeatureLine],
    ranges: Sequence[tuple[float, float]],
    values: Sequence[float],
    features: Sequence[Feature],
    dimension: int,
    rule_set: RuleSet,
) -> str:
    """A bar for each feature, coloured by what would be executed along it.

    Full colour where a rule decides, pale where the agent's action is passed on because no rule
    applies or the rule abstains.

    Args:
        lines: Of the features to show, from top to bottom.
        ranges: Ends of each bar, in the feature's unit.
        values: The present values, each within its bar.
        features: Names and units, likewise.
        dimension: Action dimension that gives the colours.
        rule_set: The shield's.

    Returns:
        HTML without script, every name escaped. Every bar is as wide as there is room; the
        present value is marked on it.
    """
    labels = rule_set.actions[dimension]
    rows = "".join(
        _row(stretches(line, ends, dimension, rule_set), ends, value, feature, labels)
        for line, ends, value, feature in zip(lines, ranges, values, features, strict=True)
    )
    return (
        f'{_STYLE}<div class="sarl-lines">'
        "<p>If one feature were different, and all others as they are</p>"
        f"{label_key(labels)}{rows}"
        '<p class="note">Each bar is a feature from its least to its largest demonstrated value, '
        "the mark is the state. Full colour: a rule decides. Pale: the agent's action is passed "
        "on.</p></div>"
    )


def stretches(
    line: FeatureLine, ends: tuple[float, float], dimension: int, rule_set: RuleSet
) -> list[tuple[float, float, int, bool]]:
    """The parts of a bar, neighbours that look the same made one.

    Args:
        line: What the shield does along the feature.
        ends: Of the bar.
        dimension: Action dimension.
        rule_set: The shield's.

    Returns:
        Start, end, label of what is executed, and whether a rule decides it; from left to right,
        without gaps.
    """
    low, high = ends
    executed = line.decisions.executed[:, dimension]
    shown = rule_set.actions[dimension].labels_of(executed).tolist()
    # A rule that abstains is in force, and something else is executed.
    ruled = [
        rule >= 0 and rule_set.rules[rule].action == label
        for rule, label in zip(line.decisions.rules[:, dimension].tolist(), shown, strict=True)
    ]
    starts = [-np.inf, *line.starts[1:].astype(np.float64).tolist()]
    found: list[tuple[float, float, int, bool]] = []
    for place, start in enumerate(starts):
        end = starts[place + 1] if place + 1 < len(starts) else np.inf
        left, right = max(start, low), min(end, high)
        if left >= right:
            continue
        looks = (shown[place], ruled[place])
        if found and found[-1][2:] == looks:
            found[-1] = (found[-1][0], right, *looks)
        else:
            found.append((left, right, *looks))
    return found


def _row(
    parts: Sequence[tuple[float, float, int, bool]],
    ends: tuple[float, float],
    value: float,
    feature: Feature,
    labels: LabelledDimension,
) -> str:
    low, high = ends
    # The narrowest last: they are drawn wider than they are, and stay on top of their neighbours.
    bar = "".join(
        _part(part, ends, feature, labels)
        for part in sorted(parts, key=lambda part: part[0] - part[1])
    )
    near = decimal_text(decimal_on_scale(value, low, high))
    now = escape(f"{feature.name} is {with_unit(near, feature)}")
    told = f"{now}: {_told(parts, value, feature, labels)}"
    place = 100 * (value - low) / (high - low)
    under = "".join(
        f"<span>{escape(with_unit(number_text(end, apart_from=other), feature))}</span>"
        for end, other in ((low, high), (high, low))
    )
    return (
        f'<div class="row" role="img" aria-label="{told}">'
        f'<div class="name">{escape(feature.name)}</div><div class="track"><div class="bar">{bar}'
        f'<b style="left:{place:.2f}%" title="{now}"></b></div>'
        f'<div class="ends">{under}</div></div></div>'
    )


def _part(
    part: tuple[float, float, int, bool],
    ends: tuple[float, float],
    feature: Feature,
    labels: LabelledDimension,
) -> str:
    start, end, label, ruled = part
    low, high = ends
    # What ends with the bar hangs at its right, so that it stays within it however narrow it is.
    side = (
        f"left:{100 * (start - low) / (high - low):.2f}%"
        if end < high or start == low
        else "right:0"
    )
    colour = label_colour(label) if ruled else faded(label_colour(label), _PALE)
    between = f"{feature.name} {_between(start, end, feature)}"
    return (
        f'<span style="{side};width:{100 * (end - start) / (high - low):.2f}%;'
        f'background:{colour}" title="{escape(between)}: {_done(part, labels)}"></span>'
    )


def _told(
    parts: Sequence[tuple[float, float, int, bool]],
    value: float,
    feature: Feature,
    labels: LabelledDimension,
) -> str:
    """What a bar shows, for those who do not see it, escaped."""
    place = max((at for at, part in enumerate(parts) if part[0] <= value), default=0)
    here = parts[place]
    stays = f"{_done(here, labels)}, from {escape(_between(here[0], here[1], feature))}"
    if len(parts) == 1:
        return f"{stays}, which is all of the bar"
    below, above = (
        _done(parts[side], labels) if 0 <= side < len(parts) else "the bar ends"
        for side in (place - 1, place + 1)
    )
    return f"{stays}; below that: {below}; above that: {above}"


def _between(start: float, end: float, feature: Feature) -> str:
    return (
        f"{number_text(start, apart_from=end)} to "
        f"{with_unit(number_text(end, apart_from=start), feature)}"
    )


def _done(part: tuple[float, float, int, bool], labels: LabelledDimension) -> str:
    """What is executed in a stretch, escaped."""
    _, _, label, ruled = part
    does = label_text(label, labels) if 0 <= label < labels.n_labels else f"action {label}"
    return escape(does) + (", by a rule" if ruled else ", as the agent wants")
