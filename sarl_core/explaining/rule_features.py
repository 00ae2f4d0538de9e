"""What a rule asks, feature by feature: histograms in HTML without script; every name escaped.

Places are percentages and text is text, so that all of it fits a wide window and a phone alike.
A histogram is one element that is cut along its outline: Streamlit takes SVG out of HTML.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.colours import MARKER_COLOUR, MUTED_COLOUR, faded
from sarl_core.explaining.evidence import FeatureEvidence
from sarl_core.explaining.language import condition_text, number_text, share_text, short_condition

MOST = 12  # features
_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)  # of round numbers
_X_TICKS, _Y_TICKS = 5, 4  # at most, beside zero

_EVERYWHERE = faded(MUTED_COLOUR, 0.55)
_STYLE = """<style>
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
.sarl-features .plot { position: relative; height: 132px; margin: 0 0.6rem 0 2.9rem; }
.sarl-features .plot i { position: absolute; top: 0; bottom: 0; }
.sarl-features .plot .grid { left: 0; right: 0; top: auto; height: 1px; background: currentColor;
  opacity: 0.13; }
.sarl-features .plot .asked { background: ASKED; }
.sarl-features .plot .bars { left: 0; right: 0; }
.sarl-features .plot .bound { width: 2px; margin-left: -1px; background: MARKER; }
.sarl-features small { position: absolute; font-size: 0.8rem; line-height: 1; opacity: 0.65;
  white-space: nowrap; font-variant-numeric: tabular-nums; }
.sarl-features .y { right: 100%; margin-right: 0.45rem; transform: translateY(50%); }
.sarl-features .x { top: 100%; margin-top: 0.4rem; transform: translateX(-50%); }
.sarl-features .bins { position: absolute; inset: 0; display: flex; }
.sarl-features .bins b { flex: 1 1 0; }
.sarl-features .bins b[title]:hover { background: rgba(128,140,150,0.2); }
.sarl-features .name { font-size: 0.8rem; opacity: 0.75; text-align: center;
  margin: 1.5rem 0.6rem 0 2.9rem; }
</style>""".replace("MARKER", MARKER_COLOUR).replace("ASKED", faded(MARKER_COLOUR, 0.13))


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


def round_ticks(low: float, high: float, most: int) -> list[float]:
    """Round numbers for an axis.

    Args:
        low: Where it begins.
        high: Where it ends, above `low`.
        most: So many, and one more where it begins with a round number.

    Returns:
        Ascending, evenly apart, at least one where there is a round number in between.
    """
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * one for one in _STEPS if power * one >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    digits = max(1 - math.floor(math.log10(step)), 0)  # 0.30000000000000004 is 0.3
    return [round(index * step, digits) for index in range(first, last + 1)]


def _figure(one: FeatureEvidence, feature: Feature, colour: str) -> str:
    low, high = float(one.edges[0]), float(one.edges[-1])
    highest = float(max(one.everywhere.max(), one.at_rule.max()))
    shares, top = round_ticks(0.0, highest, _Y_TICKS), 1.04 * highest

    def across(value: float) -> str:
        return f"{100 * (value - low) / (high - low):.2f}%"

    def up(share: float) -> str:
        return f"{100 * share / top:.2f}%"

    asked = [max(one.bounds.low, low), min(one.bounds.high, high)]
    parts = [
        f'<i class="asked" style="left:{across(asked[0])};'
        f'width:{100 * (asked[1] - asked[0]) / (high - low):.2f}%"></i>'
    ]
    parts += [f'<i class="grid" style="bottom:{up(share)}"></i>' for share in shares]
    parts.append(_bars(one.everywhere, top, _EVERYWHERE))
    if one.at_rule.any():
        parts.append(_bars(one.at_rule, top, faded(colour, 0.75)))
    parts += [
        f'<i class="bound" style="left:{across(bound)}"></i>'
        for bound in (one.bounds.low, one.bounds.high)
        if math.isfinite(bound)
    ]
    ticks = "".join(
        f'<small class="y" style="bottom:{up(share)}">{100 * share:g} %</small>' for share in shares
    ) + "".join(
        f'<small class="x" style="left:{across(tick)}">{number_text(tick)}</small>'
        for tick in round_ticks(low, high, _X_TICKS)
    )
    return (
        f"<figure><figcaption>{escape(short_condition(one.bounds, feature))}</figcaption>"
        f'<div class="plot"><div role="img" aria-label="{escape(_in_words(one, feature))}">'
        f'{"".join(parts)}</div><div class="bins" aria-hidden="true">{_bins(one, feature)}</div>'
        f'<span aria-hidden="true">{ticks}</span></div>'
        f'<div class="name">{escape(feature.unit or feature.name)}</div></figure>'
    )


def _bars(shares: NDArray[np.float64], top: float, colour: str) -> str:
    """All bars of a histogram, as one area within their outline."""
    width, x, corners = 100 / len(shares), 0.0, ["0 100%"]
    for index, share in enumerate(shares.tolist(), start=1):
        y = f"{100 - 100 * share / top:.2f}%"
        corners.append(f"{x:.2f}% {y},{(x := index * width):.2f}% {y}")
    outline = ",".join([*corners, "100% 100%"])
    return f'<i class="bars" style="background:{colour};clip-path:polygon({outline})"></i>'


def _bins(one: FeatureEvidence, feature: Feature) -> str:
    """What is said where the pointer is: over the whole height, since many bars are low."""
    unit = f" {feature.unit}" if feature.unit else ""
    edges = [number_text(edge) for edge in one.edges.tolist()]
    reached = one.at_rule.any()
    parts, empty = [], 0
    for index, (everywhere, at_rule) in enumerate(
        zip(one.everywhere.tolist(), one.at_rule.tolist(), strict=True)
    ):
        if not everywhere and not at_rule:
            empty += 1
            continue
        if empty:
            parts.append(f'<b style="flex-grow:{empty}"></b>')
            empty = 0
        told = f"{edges[index]} to {edges[index + 1]}{unit}: {share_text(everywhere)} of all states"
        if reached:
            told += f", {share_text(at_rule)} of those of the rule"
        parts.append(f'<b title="{escape(told)}"></b>')
    if empty:
        parts.append(f'<b style="flex-grow:{empty}"></b>')
    return "".join(parts)


def _in_words(one: FeatureEvidence, feature: Feature) -> str:
    unit = f" {feature.unit}" if feature.unit else ""
    low, high = (number_text(float(edge)) for edge in one.edges[[0, -1]])
    whose = "all states and those of the rule" if one.at_rule.any() else "all states"
    return (
        f"{feature.name} of {whose}, from {low} to {high}{unit}; the rule asks that "
        f"{condition_text(one.bounds, feature)}"
    )
