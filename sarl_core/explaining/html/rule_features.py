"""What a rule asks, feature by feature: histograms in HTML."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.colours import MARKER_COLOUR, MUTED_COLOUR, faded
from sarl_core.explaining.html.plot import Axis, Part, Scale, area, plot
from sarl_core.explaining.tables.rule_evidence import FeatureEvidence
from sarl_core.explaining.templates import render
from sarl_core.explaining.ticks import round_ticks, tick_text
from sarl_core.mining.language import condition_text, number_text, share_text, short_condition

MOST = 12  # features
_X_TICKS, _Y_TICKS = 5, 4  # at most, beside zero

_EVERYWHERE = faded(MUTED_COLOUR, 0.55)


def features_html(
    evidence: Sequence[FeatureEvidence], features: Sequence[Feature], colour: str
) -> Markup:
    """A figure for each feature that a rule asks about, as many side by side as there is room for.

    Args:
        evidence: The evidence, see `feature_evidence`; the first `MOST` are drawn.
        features: All features of the demonstrations.
        colour: Of the rule's label.

    Returns:
        Two histograms over each other in each figure, each of its own states, the rule's interval
        shaded.
    """
    reached = any(one.at_rule.any() for one in evidence)
    key = [("all states", _EVERYWHERE)]
    if reached:
        key.append(("states of the rule", faded(colour, 0.75)))
    key.append(("the interval asked for", faded(MARKER_COLOUR, 0.25)))
    if len(evidence) > MOST:
        key.append((f"the first {MOST} of {len(evidence)} features", ""))
    figures = [_figure(one, features[one.feature], colour) for one in evidence[:MOST]]
    return render("rules/features", key=key, figures=figures)


def _figure(one: FeatureEvidence, feature: Feature, colour: str) -> tuple[str, Markup]:
    """What stands above a figure, and the figure."""
    low, high = float(one.edges[0]), float(one.edges[-1])
    highest = float(max(one.everywhere.max(), one.at_rule.max()))
    across, upwards = Scale(low, high), Scale(0.0, 1.04 * highest)
    least, most = max(one.bounds.low, low), min(one.bounds.high, high)
    parts = [
        Part("asked", f"left:{across.place(least)};width:{across.length(least, most)}"),
        _bars(one, one.everywhere, across, upwards, _EVERYWHERE),
    ]
    if one.at_rule.any():
        parts.append(_bars(one, one.at_rule, across, upwards, faded(colour, 0.75)))
    parts += [
        Part("bound", f"left:{across.place(bound)}")
        for bound in (one.bounds.low, one.bounds.high)
        if math.isfinite(bound)
    ]
    values, shares = round_ticks(low, high, _X_TICKS), round_ticks(0.0, highest, _Y_TICKS)
    said = list(map(tick_text, values))
    if feature.indicator is not None:
        values, said = [0.0, 1.0], ["no", "yes"]
    # A combination is called by a phrase, which stands above the figure.
    own_name = feature.name if feature.derived is None else ""
    drawn = plot(
        parts,
        Axis(across, values, said, feature.unit or own_name),
        Axis(upwards, shares, [f"{100 * share:g} %" for share in shares]),
        label=_in_words(one, feature),
        height=132,
        tips=_tips(one, feature),
    )
    above = short_condition(one.bounds, feature)
    if one.infinite:
        above += f" (infinite in {share_text(one.infinite)} of all states, drawn at the ends)"
    return above, drawn


def _bars(
    one: FeatureEvidence,
    shares: NDArray[np.float64],
    across: Scale,
    upwards: Scale,
    colour: str,
) -> Part:
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
    tips = []
    for index, (everywhere, at_rule) in enumerate(
        zip(one.everywhere.tolist(), one.at_rule.tolist(), strict=True)
    ):
        low, high = edges[index : index + 2]
        words = f"{number_text(low, apart_from=high)} to {number_text(high, apart_from=low)}{unit}"
        words += f": {share_text(everywhere)} of all states"
        if reached:
            words += f", {share_text(at_rule)} of those of the rule"
        tips.append(words if everywhere or at_rule else "")
    return tips


def _in_words(one: FeatureEvidence, feature: Feature) -> str:
    unit = f" {feature.unit}" if feature.unit else ""
    first, last = float(one.edges[0]), float(one.edges[-1])
    low, high = number_text(first, apart_from=last), number_text(last, apart_from=first)
    groups = "all states and those of the rule" if one.at_rule.any() else "all states"
    return (
        f"{feature.name} of {groups}, from {low} to {high}{unit}; the rule asks that "
        f"{condition_text(one.bounds, feature)}"
    )
