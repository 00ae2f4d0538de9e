"""How sure a rule is, in words: counts, intervals, and what is still missing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from sarl_core.explaining.colours import INTERVENTION_COLOUR, MARKER_COLOUR, MUTED_COLOUR
from sarl_core.explaining.language import counted, number_text
from sarl_core.mining.evidence import Interval
from sarl_core.mining.holding_out import (
    Verdict,
    held_out_interval,
    mined_interval,
    verdict,
)
from sarl_core.mining.rules import Rule
from sarl_core.mining.stability import Band, RuleStability

VERDICTS: dict[Verdict, str] = {"below": "too low", "open": "open", "reached": "reached"}
"""What each verdict is called on screen."""
VERDICT_COLOURS: dict[Verdict, str] = {
    "below": INTERVENTION_COLOUR,
    "open": "#4A6FA5",
    "reached": "#2E8B6F",
}
_DIGITS = 4


def decimal_text(share: float) -> str:
    """A share as a decimal that never rounds up to one or down to nought.

    Args:
        share: 0 to 1.

    Returns:
        As "0.97" or "0.996"; "1" and "0" only where it is that.
    """
    if share in (0.0, 1.0):
        return f"{share:.0f}"
    for digits in range(2, _DIGITS + 1):
        text = f"{share:.{digits}f}"
        if float(text) not in (0.0, 1.0):
            return text
    return f"< {10**-_DIGITS:.{_DIGITS}f}" if share < 0.5 else f"> {1 - 10**-_DIGITS:.{_DIGITS}f}"


def interval_text(interval: Interval) -> str:
    """An interval of a share.

    Args:
        interval: Its ends.

    Returns:
        As "0.84 to 0.95".
    """
    return f"{decimal_text(interval.low)} to {decimal_text(interval.high)}"


def mined_text(rule: Rule) -> str:
    """A rule's confidence on what it was mined from, as "0.97 of 412"."""
    return f"{decimal_text(rule.confidence)} of {rule.samples:,}" if rule.samples else "no states"


def held_out_text(rule: Rule) -> str:
    """A rule's confidence on what was held out, as "0.91 of 96"; "" where nothing was."""
    if rule.held_out is None:
        return ""
    if not rule.held_out.samples:
        return "no states"
    return f"{decimal_text(rule.held_out.confidence)} of {rule.held_out.samples:,}"


def evidence_text(rule: Rule) -> str:
    """A rule's confidence with its counts.

    Args:
        rule: With what was held out, if anything was.

    Returns:
        As "0.97 of 412, held out 0.91 of 96".
    """
    held = held_out_text(rule)
    return f"{mined_text(rule)}, held out {held}" if held else mined_text(rule)


def intervals_text(rule: Rule) -> str:
    """The 95 % intervals behind `evidence_text`.

    Args:
        rule: With what was held out, if anything was.

    Returns:
        As "95 % interval 0.95 to 0.98, held out 0.84 to 0.95"; "" without a pair.
    """
    if not rule.samples:
        return ""
    text = f"95 % interval {interval_text(mined_interval(rule))}"
    held = held_out_interval(rule)
    return f"{text}, held out {interval_text(held)}" if held is not None else text


def more_text(more: float) -> str:
    """How many episodes are still missing.

    Args:
        more: What `more_episodes` gives.

    Returns:
        As "12 more episodes".
    """
    if more == 0:
        return "enough"
    if math.isinf(more):
        return "never at this rate"
    return f"{int(more):,} more {'episode' if more == 1 else 'episodes'}"


def verdict_counts(rules: Sequence[Rule], threshold: float) -> dict[Verdict, int]:
    """How many rules have each verdict.

    Args:
        rules: With what was held out, if anything was.
        threshold: The minimum confidence.

    Returns:
        One count a verdict.
    """
    counts: dict[Verdict, int] = {"below": 0, "open": 0, "reached": 0}
    for rule in rules:
        counts[verdict(rule, threshold)] += 1
    return counts


def band_text(band: Band, name: str, unit: str = "") -> str:
    """How far one threshold of a rule moves.

    Args:
        band: What was found.
        name: Of the feature.
        unit: Of the feature.

    Returns:
        As "pole angle > 0.0213 rad (0.018 to 0.025)".
    """
    sign = "≤" if band.op == "<=" else ">"
    own = f"{name} {sign} {number_text(band.threshold)}{f' {unit}' if unit else ''}"
    if not band.found:
        return f"{own} (not asked again)"
    low = number_text(band.low, apart_from=band.high)
    high = number_text(band.high, apart_from=band.low)
    return f"{own} ({low})" if band.low == band.high else f"{own} ({low} to {high})"


def stability_text(one: RuleStability, rounds: int) -> str:
    """How often a rule came back.

    Args:
        one: What was found of it.
        rounds: How often episodes were drawn.

    Returns:
        As "came back in 27 of 30 rounds".
    """
    return f"came back in {round(one.returns * rounds)} of {counted(rounds, 'round')}"


_STYLE = """<style>
.sarl-sure { width: 100%; max-width: 640px; font-size: 0.82rem; margin: 0.1rem 0 0.2rem; }
.sarl-sure div { display: flex; align-items: center; gap: 0.6rem; line-height: 1.5; }
.sarl-sure b { flex: 0 0 5.6rem; font-weight: 400; opacity: 0.75; }
.sarl-sure span.t { position: relative; flex: 1 1 auto; height: 14px; min-width: 90px; }
.sarl-sure span.t::before { content: ''; position: absolute; left: 0; right: 0; top: 6.5px;
  height: 1px; background: rgba(128,140,150,0.4); }
.sarl-sure i { position: absolute; }
.sarl-sure i.w { top: 4px; height: 6px; border-radius: 3px; min-width: 2px; }
.sarl-sure i.p { top: 1px; width: 12px; height: 12px; margin-left: -6px; border-radius: 50%; }
.sarl-sure i.m { top: -1px; bottom: -1px; width: 2px; margin-left: -1px; background: MARKER; }
.sarl-sure em { flex: 0 0 10.5rem; font-style: normal; font-variant-numeric: tabular-nums; }
</style>""".replace("MARKER", MARKER_COLOUR)


def evidence_bar(rule: Rule, threshold: float) -> str:
    """The intervals of a rule as whiskers over one scale, with the minimum confidence marked.

    Args:
        rule: With what was held out, if anything was.
        threshold: The minimum confidence.

    Returns:
        HTML without script, styled in place; "" where no pair is the rule's.
    """
    if not rule.samples:
        return ""
    own, held = mined_interval(rule), held_out_interval(rule)
    colour = VERDICT_COLOURS[verdict(rule, threshold)]
    lowest = min(threshold, own.low, *(held[:1] if held is not None else ()))
    # To the next tenth below, so that whiskers can be told apart where all is near to one.
    floor = max(math.floor(lowest * 10 - 0.5) / 10, 0.0)

    def place(value: float) -> float:
        return 100 * (value - floor) / (1 - floor)

    def line(name: str, interval: Interval, share: float, ink: str, text: str) -> str:
        low, high = place(interval.low), place(interval.high)
        return (
            f"<div><b>{escape(name)}</b>"
            f'<span class="t" title="{escape(interval_text(interval))}">'
            f'<i class="m" style="left:{place(threshold):.2f}%"></i>'
            f'<i class="w" style="left:{low:.2f}%;width:{high - low:.2f}%;background:{ink}"></i>'
            f'<i class="p" style="left:{place(share):.2f}%;background:{ink}"></i></span>'
            f"<em>{escape(text)}</em></div>"
        )

    mined_ink = MUTED_COLOUR if held is not None else colour
    lines = [line("mined from", own, rule.confidence, mined_ink, interval_text(own))]
    if held is not None and rule.held_out is not None:
        lines.append(line("held out", held, rule.held_out.confidence, colour, interval_text(held)))
    scale = (
        f'<div style="opacity:0.6"><b></b><span class="t" style="display:flex;justify-content:'
        f'space-between;height:auto"><small>{floor:g}</small><small>1</small></span><em></em></div>'
    )
    return f'{_STYLE}<div class="sarl-sure">{"".join(lines)}{scale}</div>'
