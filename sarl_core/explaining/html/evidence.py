"""Plots of how sure rules are that follow the controls: all intervals, and what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np
from markupsafe import Markup

from sarl_core.explaining.colours import LABEL_COLOURS, MUTED_COLOUR, faded
from sarl_core.explaining.html.plot import Axis, Part, Scale, area, plot
from sarl_core.explaining.ticks import round_ticks, tick_text
from sarl_core.explaining.words.evidence import (
    VERDICT_COLOURS,
    evidence_text,
    held_out_interval_text,
    limits_text,
    verdicts_text,
)
from sarl_core.mining.action_words import says_text
from sarl_core.mining.evidence import Interval
from sarl_core.mining.language import counted, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.mining.validation.holding_out import least_confidence, verdict

_ASIDE = 0.17  # of a rule's place: what it was mined from to the left, held out to the right
_FEW = 60  # rules up to which whiskers are drawn wide
_NAMED = 30  # rules up to which each has its name written
_CLOSE = 10  # names that stand side by side in a narrow window
_TIPS = 60
_BOTH = "those that demand and then those that forbid, of each kind "
_MINED = faded(MUTED_COLOUR, 0.7)


def overview_plot(rules: Sequence[Rule], rule_set: RuleSet) -> Markup:
    """What is known of many rules, side by side.

    Args:
        rules: In the order in which they stand from left to right, those that demand before those
            that forbid; at least one.
        rule_set: Knows the names and the thresholds: what rules have to reach is drawn as a line.

    Returns:
        HTML. Grey: the confidence on what each was mined from, a dot. In colour:
        held out, with the interval where there is one.
    """
    few, forbidding = len(rules) <= _FEW, sum(bool(rule.forbids) for rule in rules)
    least = [least_confidence(rule, rule_set.thresholds) for rule in rules]
    drawn: list[tuple[float, Interval | None, float, str]] = []
    for place, (rule, needed) in enumerate(zip(rules, least, strict=True), 1):
        held = rule.held_out
        aside = _ASIDE * few if held is not None else 0.0
        if rule.samples:
            drawn.append((place - aside, None, rule.confidence, _MINED))
        if held is not None and held.share is not None:
            colour = VERDICT_COLOURS[verdict(rule, needed)]
            drawn.append((place + aside, held.interval, held.share, colour))
    ends = [interval.low if interval is not None else share for _, interval, share, _ in drawn]
    floor = max(min([*least, *ends]) - 0.03, 0.0)
    across, upwards = Scale(0.5, len(rules) + 0.5), Scale(floor, 1.01)
    parts = []
    for at, held_out_interval, share, colour in drawn:
        interval = held_out_interval or Interval(share, share)
        parts.append(
            Part(
                "whisker",
                f"left:{across.place(at)};bottom:{upwards.place(interval.low)};"
                f"height:{upwards.length(interval.low, interval.high)};background:{colour};"
                f"--at:{_within(share, interval)}",
            )
        )
    begin = 0.5
    for needed, same in groupby(least):
        end = begin + len(list(same))
        parts.append(
            Part(
                "least",
                f"left:{across.place(begin)};width:{across.length(begin, end)};"
                f"bottom:{upwards.place(needed)}",
            )
        )
        begin = end
    named = (
        [float(place) for place in range(1, len(rules) + 1)]
        if len(rules) <= _NAMED
        else [tick for tick in round_ticks(1, len(rules), 8, whole=True) if tick >= 1]
    )
    heights = round_ticks(100 * floor, 100.0, 5)
    return plot(
        parts,
        Axis(
            across,
            named,
            [rule_set.name_of(rules[round(place) - 1]) for place in named],
            f"Rules, {_BOTH if 0 < forbidding < len(rules) else ''}the most support first",
        ),
        Axis(
            upwards,
            [height / 100 for height in heights],
            [f"{tick_text(height)} %" for height in heights],
            "Confidence",
        ),
        label=f"The confidence of {counted(len(rules), 'rule')} against "
        f"{limits_text(rule_set.thresholds)}, with the 95 % intervals of what was held out: "
        f"{verdicts_text(rules, rule_set.thresholds)}",
        height=262,
        tips=[_tip(rule, rule_set) for rule in rules],
        css=f"sarl-overview{' sarl-few' * few}{' sarl-close' * (len(named) > _CLOSE)}",
    )


def _within(share: float, interval: Interval) -> str:
    """Where a share stands in its interval, from the lower end up."""
    width = interval.high - interval.low
    return f"{100 * (share - interval.low) / width if width else 0:.1f}%"


def _tip(rule: Rule, rule_set: RuleSet) -> str:
    does = says_text(rule, rule_set.actions[rule.dimension])
    lines = (
        f"{rule_set.name_of(rule)}: {does}",
        evidence_text(rule),
        held_out_interval_text(rule.held_out),
    )
    return "\n".join(line for line in lines if line)


def enough_plot(missing: Sequence[float], least: str = "the minimum confidence") -> Markup:
    """How many rules would reach what they have to after so many more episodes.

    Args:
        missing: What `more_episodes` gives of each rule; at least one.
        least: What is to be reached, as `least_text` says it.

    Returns:
        HTML: episodes to the right, rules upwards, in steps.
    """
    some = np.sort([value for value in missing if np.isfinite(value)])
    turns = [0.0, *np.unique(some[some > 0]).tolist()]
    reached = np.searchsorted(some, turns, side="right").tolist()
    far, most = max(turns[-1] * 1.1, 1.0), len(missing)
    # As high as it comes, since of many rules few may ever reach it.
    top = max(reached[-1], 1)
    across, upwards = Scale(0.0, far), Scale(0.0, top * 1.04)
    corners = []
    for turn, end, count in zip(turns, [*turns[1:], far], reached, strict=True):
        corners += [(turn, float(count)), (end, float(count))]
    colour = LABEL_COLOURS[0]
    middles = (np.arange(_TIPS) + 0.5) * far / _TIPS
    by_then = np.searchsorted(some, middles, side="right").tolist()
    widths, heights = round_ticks(0.0, far, 5), round_ticks(0.0, top, 4, whole=True)
    return plot(
        [area(corners, across, upwards, faded(colour, 0.55))],
        Axis(across, widths, list(map(tick_text, widths)), "More episodes"),
        Axis(upwards, heights, list(map(tick_text, heights)), f"Rules that reach it, of {most:,}"),
        label=f"Of {counted(most, 'rule')} {reached[0]:,} "
        f"{'reaches' if reached[0] == 1 else 'reach'} {least} now, and "
        f"{reached[-1]:,} ({share_text(reached[-1] / most)}) after enough more episodes",
        height=200,
        tips=[
            f"{counted(count, 'rule')} after {episodes:,.0f} more episodes"
            for episodes, count in zip(middles.tolist(), by_then, strict=True)
        ],
    )
