"""How sure one rule is, as a bar in HTML."""

from __future__ import annotations

import math
from typing import NamedTuple

from markupsafe import Markup

from sarl_core.explaining.colours import MUTED_COLOUR
from sarl_core.explaining.html.plot import Scale
from sarl_core.explaining.templates import render
from sarl_core.explaining.words.evidence import VERDICT_COLOURS, held_out_interval_text
from sarl_core.mining.language import share_text
from sarl_core.mining.rules import Rule
from sarl_core.mining.validation.holding_out import verdict


class _Line(NamedTuple):
    """A dot on the scale, and for what was held out its interval."""

    name: str
    place: str
    whisker: tuple[str, str] | None
    colour: str
    text: str


def evidence_bar(rule: Rule, threshold: float) -> Markup:
    """What is known of a rule over one scale, with the minimum confidence marked.

    Args:
        rule: With what was held out, if anything was.
        threshold: The minimum confidence.

    Returns:
        HTML: a dot for each share, and for what was held out a whisker, its interval; "" where no
        pair is the rule's.
    """
    if not rule.samples:
        return Markup()
    held = rule.held_out
    share = None if held is None else held.share
    interval = None if held is None else held.interval
    lowest = min(
        value
        for value in (threshold, rule.confidence, share, *(interval or ()))
        if value is not None
    )
    # To the next tenth below, so that dots can be told apart where all is near to one.
    floor = float(max(math.floor(lowest * 10 - 0.5) / 10, 0.0))
    scale = Scale(floor, 1.0)
    confidence = share_text(rule.confidence)
    lines = [_Line("mined from", scale.place(rule.confidence), None, MUTED_COLOUR, confidence)]
    if share is not None:
        whisker = interval and (scale.place(interval.low), scale.length(*interval))
        colour = VERDICT_COLOURS[verdict(rule, threshold)]
        lines.append(
            _Line("held out", scale.place(share), whisker, colour, held_out_interval_text(held))
        )
    return render(
        "rules/evidence_bar", lines=lines, threshold=scale.place(threshold), floor=share_text(floor)
    )
