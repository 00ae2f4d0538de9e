"""Figures of how sure rules are: intervals, what is missing, learning curves, contradictions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import plotly.graph_objects as go

from sarl_core.explaining.colours import (
    INTERVENTION_COLOUR,
    LABEL_COLOURS,
    MARKER_COLOUR,
    MUTED_COLOUR,
    faded,
)
from sarl_core.explaining.evidence_words import VERDICT_COLOURS, evidence_text, intervals_text
from sarl_core.explaining.language import action_text, counted
from sarl_core.explaining.markup import plain
from sarl_core.mining.contradictions import EpisodeContradictions
from sarl_core.mining.evidence import Interval
from sarl_core.mining.holding_out import (
    held_out_interval,
    mined_interval,
    verdict,
)
from sarl_core.mining.learning_curve import LearningCurve
from sarl_core.mining.rules import Rule, RuleSet

_Group = Literal["mined", "open", "reached", "below"]
CurveLayer = Literal["rules", "mean_length", "coverage", "fidelity"]
CURVE_TITLES: dict[CurveLayer, str] = {
    "rules": "Number of rules",
    "mean_length": "Mean length of a rule",
    "coverage": "Coverage of what was mined from",
    "fidelity": "Fidelity on other episodes",
}
_LINE = LABEL_COLOURS[0]
_ASIDE = 0.17  # of a rule's place: what it was mined from to the left, held out to the right
_FEW = 60  # rules up to which whiskers are drawn wide
_EPISODES = 60


def overview_figure(rules: Sequence[Rule], rule_set: RuleSet, threshold: float) -> go.Figure:
    """The intervals of many rules side by side.

    Args:
        rules: In the order in which they stand from left to right.
        rule_set: Knows the names.
        threshold: The minimum confidence, drawn as a line.

    Returns:
        Grey: on what each was mined from. In colour: held out, or, where nothing was, the same
        by its verdict.
    """
    figure = go.Figure()
    tried = any(rule.held_out is not None for rule in rules)
    few = len(rules) <= _FEW
    width, size = (3.0, 8) if few else (1.0, 4)
    texts = [_hover(rule, rule_set) for rule in rules]
    groups: dict[_Group, list[tuple[float, Interval, float, str]]] = {}
    for place, rule in enumerate(rules, 1):
        if not rule.samples:
            continue
        said = verdict(rule, threshold)
        own = (mined_interval(rule), rule.confidence, texts[place - 1])
        if not tried:
            groups.setdefault(said, []).append((place, *own))
            continue
        groups.setdefault("mined", []).append((place - _ASIDE * few, *own))
        held = held_out_interval(rule)
        if held is not None and rule.held_out is not None:
            entry = (place + _ASIDE * few, held, rule.held_out.confidence, texts[place - 1])
            groups.setdefault(said, []).append(entry)
    order: tuple[_Group, ...] = ("mined", "open", "reached", "below")
    for name in order:
        if name in groups:
            _whiskers(figure, groups[name], _colour(name), width, size)
    figure.add_hline(y=threshold, line={"color": MARKER_COLOUR, "width": 1.5, "dash": "dot"})
    ends = [interval.low for group in groups.values() for _, interval, _, _ in group]
    floor = max(min([*ends, threshold]) - 0.03, 0.0)
    _plain(figure, 330)
    figure.update_xaxes(
        title={"text": "Rules, the most support first"},
        range=[0.4, len(rules) + 0.6],
        showgrid=False,
        tickformat=",d",
        dtick=1 if len(rules) <= 30 else None,
    )
    figure.update_yaxes(title={"text": "Confidence"}, range=[floor, 1.01], tickformat=".2f")
    return figure


def _colour(group: _Group) -> str:
    return faded(MUTED_COLOUR, 0.7) if group == "mined" else VERDICT_COLOURS[group]


def _whiskers(
    figure: go.Figure,
    group: Sequence[tuple[float, Interval, float, str]],
    colour: str,
    width: float,
    size: int,
) -> None:
    # One line with gaps, since a trace a rule would take the browser seconds.
    across: list[float | None] = []
    upwards: list[float | None] = []
    for place, interval, _, _ in group:
        across += [place, place, None]
        upwards += [round(interval.low, 5), round(interval.high, 5), None]
    figure.add_scatter(
        x=across,
        y=upwards,
        mode="lines",
        line={"color": colour, "width": width},
        hoverinfo="skip",
    )
    figure.add_scatter(
        x=[place for place, _, _, _ in group],
        y=[round(share, 5) for _, _, share, _ in group],
        mode="markers",
        marker={"color": colour, "size": size},
        text=[text for _, _, _, text in group],
        hovertemplate="%{text}<extra></extra>",
    )


def _hover(rule: Rule, rule_set: RuleSet) -> str:
    does = plain(action_text(rule.action, rule_set.actions[rule.dimension]))
    lines = (f"rule {plain(rule.id)}: {does}", evidence_text(rule), intervals_text(rule))
    return "<br>".join(line for line in lines if line)


def enough_figure(missing: Sequence[float]) -> go.Figure:
    """How many rules would reach the minimum confidence after so many more episodes.

    Args:
        missing: What `more_episodes` gives of each rule.

    Returns:
        Episodes to the right, rules upwards, in steps.
    """
    some = np.sort([value for value in missing if np.isfinite(value)])
    across, upwards = [0.0], [int((some <= 0).sum())]
    for value in np.unique(some[some > 0]).tolist():
        across.append(value)
        upwards.append(int((some <= value).sum()))
    far = max(across[-1] * 1.1, 1.0)
    figure = go.Figure()
    figure.add_scatter(
        x=[*across, far],
        y=[*upwards, upwards[-1]],
        mode="lines",
        line={"color": _LINE, "width": 2.5, "shape": "hv"},
        hovertemplate="%{y:,} rules reach it after %{x:,.0f} more episodes<extra></extra>",
    )
    _plain(figure, 260)
    figure.update_xaxes(title={"text": "More episodes"}, range=[0, far], tickformat=",d")
    figure.update_yaxes(
        title={"text": "Rules that reach it"},
        range=[0, max(len(missing), 1) * 1.04],
        tickformat=",d",
    )
    return figure


def curve_figure(curve: LearningCurve, layer: CurveLayer) -> go.Figure:
    """One number of the rule sets of more and more episodes.

    Args:
        curve: Over several orders of the episodes.
        layer: Which number.

    Returns:
        The mean over the orders, and a band from the least to the most.
    """
    values = getattr(curve, layer)
    there = ~np.isnan(values).all(axis=0)
    episodes, values = curve.episodes[there].tolist(), values[:, there]
    low, mean, high = (
        np.nanmin(values, axis=0).tolist(),
        np.nanmean(values, axis=0).tolist(),
        np.nanmax(values, axis=0).tolist(),
    )
    share = layer in ("coverage", "fidelity")
    number = ":.1%" if share else ":,.1f"
    figure = go.Figure()
    figure.add_scatter(
        x=[*episodes, *episodes[::-1]],
        y=[*high, *low[::-1]],
        mode="lines",
        fill="toself",
        fillcolor=faded(_LINE, 0.18),
        line={"width": 0},
        hoverinfo="skip",
    )
    figure.add_scatter(
        x=episodes,
        y=mean,
        mode="lines+markers",
        line={"color": _LINE, "width": 2.5},
        customdata=np.stack([low, high], axis=1) if episodes else [],
        hovertemplate=(
            f"%{{x:,}} episodes: %{{y{number}}}<br>%{{customdata[0]{number}}} to "
            f"%{{customdata[1]{number}}}<extra></extra>"
        ),
    )
    _plain(figure, 230)
    figure.update_xaxes(
        title={"text": "Episodes mined from"},
        range=[0, float(curve.episodes[-1]) * 1.03],
        tickformat=",d",
    )
    figure.update_yaxes(tickformat=".0%" if share else "", rangemode="tozero")
    if layer == "fidelity":
        figure.update_yaxes(rangemode="normal")
    return figure


def contradictions_figure(episodes: Sequence[EpisodeContradictions]) -> go.Figure:
    """The episodes that contradict others most.

    Args:
        episodes: The one with the largest share first; the first sixty are drawn.

    Returns:
        A bar an episode.
    """
    some = episodes[:_EPISODES]
    figure = go.Figure()
    figure.add_bar(
        x=[str(one.episode) for one in some],
        y=[one.share for one in some],
        marker={"color": INTERVENTION_COLOUR, "opacity": 0.85},
        customdata=[[one.contradicting, counted(one.steps, "step"), one.identical] for one in some],
        hovertemplate=(
            "episode %{x}: %{y:.1%}<br>%{customdata[0]:,} of %{customdata[1]}, "
            "%{customdata[2]:,} with an identical state<extra></extra>"
        ),
    )
    _plain(figure, 260)
    figure.update_layout(bargap=0.25)
    figure.update_xaxes(title={"text": "Episode"}, type="category", nticks=20, showgrid=False)
    figure.update_yaxes(title={"text": "Contradicting steps"}, tickformat=".0%", rangemode="tozero")
    return figure


def _plain(figure: go.Figure, height: int) -> None:
    layout: dict[str, Any] = {
        "height": height,
        "margin": {"l": 62, "r": 14, "t": 8, "b": 48},
        "showlegend": False,
        "hovermode": "closest",
        "dragmode": False,
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
    }
    figure.update_layout(**layout)
    figure.update_xaxes(fixedrange=True, zeroline=False)
    figure.update_yaxes(fixedrange=True, zeroline=False)
