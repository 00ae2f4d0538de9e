"""What a rule asks, feature by feature: histograms in HTML without script; every name escaped."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.figures.colours import MARKER_COLOUR, MUTED_COLOUR, faded
from sarl_core.explaining.html.plot import (
    PLOT_STYLE,
    Axis,
    Scale,
    area,
    plot,
    round_ticks,
    tick_text,
)
from sarl_core.explaining.rule_evidence import FeatureEvidence
from sarl_core.mining.language import condition_text, number_text, share_text, short_condition

MOST = 12  # features
_X_TICKS, _Y_TICKS = 5, 4  # at most, beside zero

_EVERYWHERE = faded(MUTED_COLOUR, 0.55)
_STYLE = (
    """<style>
.sarl-features { display: grid; gap: 1.1rem 1.6rem;
  grid-template-columns: repeat(auto-fill, minmax(min(100%, max(15rem, 30%)), 1fr)); }
.sarl-features-note { font-size: 0.875rem; margin: 0 0 0.8rem; display: flex; flex-wrap: wrap;
  gap: 0.1rem 1rem; }
.sarl-features-note span { opacity: 0.75; }
.sarl-features-note i { display: inline-block; width: 11px; height: 11px; border-radius: 2px;
  margin-right: 0.35rem; vertical-align: -1px; }
.sarl-features figure { margin: 0; min-width: 0; }
.sarl-features figcaption { font-weight: 600; font-size: 1rem; margin-bottom: 0.5rem;
  overflow-wrap: anywhere; color: inherit; }
.sarl-features .asked { top: 0; bottom: 0; background: ASKED; }
.sarl-features .bound { top: 0; bottom: 0; width: 2px; margin-left: -1px; background: MARKER; }
</style>""".replace("MARKER", MARKER_COLOUR).replace("ASKED", faded(MARKER_COLOUR, 0.13))
    + PLOT_STYLE
)


def features_html(
    found: Sequence[FeatureEvidence], features: Sequence[Feature], colour: str
) -> str:
    """A figure for each feature that a rule asks about, as many side by side as there is room for.

    Args:
        found: The evidence, see `feature_evidence`; the first `MOST` are drawn.
        features: All features of the demonstrations.
        colour: Of the rule's label.

    Returns:
        Two histograms over each other in each figure, each of its own states, the rule's interval
        shaded.
    """
    reached = any(one.at_rule.any() for one in found)
    key = [(_EVERYWHERE, "all states")]
    if reached:
        key.append((faded(colour, 0.75), "states of the rule"))
    key.append((faded(MARKER_COLOUR, 0.25), "the interval asked for"))
    parts = [f'<span><i style="background:{fill}"></i>{name}</span>' for fill, name in key]
    if len(found) > MOST:
        parts.append(f"<span>the first {MOST} of {len(found)} features</span>")
    figures = "".join(_figure(one, features[one.feature], colour) for one in found[:MOST])
    return (
        f'{_STYLE}<div class="sarl-features-note">{"".join(parts)}</div>'
        f'<div class="sarl-features">{figures}</div>'
    )


def _figure(one: FeatureEvidence, feature: Feature, colour: str) -> str:
    low, high = float(one.edges[0]), float(one.edges[-1])
    highest = float(max(one.everywhere.max(), one.at_rule.max()))
    across, upwards = Scale(low, high), Scale(0.0, 1.04 * highest)
    least, most = max(one.bounds.low, low), min(one.bounds.high, high)
    parts = [
        f'<i class="asked" style="left:{across.place(least)};'
        f'width:{across.length(least, most)}"></i>',
        _bars(one, one.everywhere, across, upwards, _EVERYWHERE),
    ]
    if one.at_rule.any():
        parts.append(_bars(one, one.at_rule, across, upwards, faded(colour, 0.75)))
    parts += [
        f'<i class="bound" style="left:{across.place(bound)}"></i>'
        for bound in (one.bounds.low, one.bounds.high)
        if math.isfinite(bound)
    ]
    values, shares = round_ticks(low, high, _X_TICKS), round_ticks(0.0, highest, _Y_TICKS)
    drawn = plot(
        "".join(parts),
        Axis(across, values, list(map(tick_text, values)), feature.unit or feature.name),
        Axis(upwards, shares, [f"{100 * share:g} %" for share in shares]),
        label=_in_words(one, feature),
        height=132,
        tips=_tips(one, feature),
    )
    caption = escape(short_condition(one.bounds, feature))
    return f"<figure><figcaption>{caption}</figcaption>{drawn}</figure>"


def _bars(
    one: FeatureEvidence,
    shares: NDArray[np.float64],
    across: Scale,
    upwards: Scale,
    colour: str,
) -> str:
    """All bars of a histogram, as one area within their outline."""
    corners = [
        (edge, share)
        for left, right, share in zip(
            one.edges[:-1].tolist(), one.edges[1:].tolist(), shares.tolist(), strict=True
        )
        for edge in (left, right)
    ]
    return area(corners, across, upwards, colour)


def _tips(one: FeatureEvidence, feature: Feature) -> list[str]:
    """What is said of each bin: over the whole height, since many bars are low."""
    unit = f" {feature.unit}" if feature.unit else ""
    edges = one.edges.tolist()
    reached = one.at_rule.any()
    told = []
    for index, (everywhere, at_rule) in enumerate(
        zip(one.everywhere.tolist(), one.at_rule.tolist(), strict=True)
    ):
        low, high = edges[index : index + 2]
        words = f"{number_text(low, apart_from=high)} to {number_text(high, apart_from=low)}{unit}"
        words += f": {share_text(everywhere)} of all states"
        if reached:
            words += f", {share_text(at_rule)} of those of the rule"
        told.append(words if everywhere or at_rule else "")
    return told


def _in_words(one: FeatureEvidence, feature: Feature) -> str:
    unit = f" {feature.unit}" if feature.unit else ""
    first, last = float(one.edges[0]), float(one.edges[-1])
    low, high = number_text(first, apart_from=last), number_text(last, apart_from=first)
    whose = "all states and those of the rule" if one.at_rule.any() else "all states"
    return (
        f"{feature.name} of {whose}, from {low} to {high}{unit}; the rule asks that "
        f"{condition_text(one.bounds, feature)}"
    )
