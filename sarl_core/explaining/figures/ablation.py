"""What each rule is worth: a table and a figure of an ablation, and how it is to be read."""

from __future__ import annotations

import math
from collections.abc import Sequence

import plotly.graph_objects as go

from sarl_core.explaining.colours import INTERVENTION_COLOUR, MUTED_COLOUR
from sarl_core.explaining.figures.replay import SHIELDED_COLOUR
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.mining.action_words import says_text
from sarl_core.mining.language import conditions_text, counted
from sarl_core.studies.ablation import VERDICTS, Ablation, RuleEffect, Verdict

VERDICT_COLOURS: dict[Verdict, str] = {
    "load-bearing": SHIELDED_COLOUR,
    "no difference seen": MUTED_COLOUR,
    "harmful": INTERVENTION_COLOUR,
}
_SYMBOLS: dict[Verdict, str] = {
    "load-bearing": "diamond",
    "no difference seen": "circle",
    "harmful": "square",
}
FIGURE_ROWS = 30
_ROW_HEIGHT = 24

METHOD = (
    "Each rule is taken out alone, and the same seeds are run again. The interval is Student's "
    "95 % interval of the mean difference in return, of that rule alone. The verdict asks whether "
    "the differences in return or in failures are more than chance: their signs are drawn anew "
    "20,000 times, and since many rules are looked at together, Holm's method keeps the chance of "
    "any wrong verdict below 5 %. Where return and failures point in different directions, "
    "failures decide. Two rules that make up for each other both look idle."
)


def ablation_columns(ablation: Ablation) -> dict[str, list[object]]:
    """The rules that were taken out as columns.

    Args:
        ablation: K rules.

    Returns:
        Column name to one value a rule, in the ablation's order. "Return without it" is the mean
        difference; failures are NaN where they are not known.
    """
    rule_set = ablation.shield.rule_set
    rules = [rule_set.rules[effect.rule] for effect in ablation.effects]
    known = ablation.failures_known
    return {
        "Rule": [rule_set.name_of(rule) for rule in rules],
        "Action": [says_text(rule, rule_set.actions[rule.dimension]) for rule in rules],
        "Verdict": [effect.verdict.capitalize() for effect in ablation.effects],
        "Return without it": [effect.difference.mean for effect in ablation.effects],
        "95 % interval": [difference_interval_text(effect) for effect in ablation.effects],
        "Failures without it": [
            effect.failures if known else math.nan for effect in ablation.effects
        ],
        "Changed": [effect.changed for effect in ablation.effects],
        "In force": [effect.matched for effect in ablation.effects],
        "Episodes": [effect.episodes for effect in ablation.effects],
        "When": [conditions_text(rule, rule_set) for rule in rules],
    }


def difference_interval_text(effect: RuleEffect) -> str:
    """The interval of a rule's difference.

    Args:
        effect: Of the rule.

    Returns:
        As "-50.1 to -18.4".
    """
    return f"{difference_text(effect.difference.low)} to {difference_text(effect.difference.high)}"


def difference_text(value: float) -> str:
    """A difference with its sign.

    Args:
        value: The difference.

    Returns:
        As "+1.2" or "-3.4", the sign that numbers have in tables; "0" for none.
    """
    text = f"{value:+,.1f}"
    return "0" if text in ("+0.0", "-0.0") else text


def ablation_text(ablation: Ablation) -> tuple[str, ...]:
    """What an ablation comes to.

    Args:
        ablation: K rules.

    Returns:
        Sentences: how many rules are what, which were not run and why.
    """
    effects, episodes = ablation.effects, counted(len(ablation.base), "episode")
    sentences = []
    if effects:
        load, idle, harm = (
            sum(effect.verdict == verdict for effect in effects) for verdict in VERDICTS
        )
        sentences.append(
            f"{counted(len(effects), 'rule')} taken out, over {episodes}: {load} load-bearing, "
            f"{harm} harmful, and of {idle} no difference is seen."
        )
        needed = ablation.least_episodes
        if len(ablation.base) < needed:
            sentences.append(
                f"{episodes} are too few for any verdict about so many rules; give at least "
                f"{needed}, and more to see small differences."
            )
    unused = len(ablation.unused)
    if unused:
        others = "Another " if effects else ""
        sentences.append(
            f"{others}{counted(unused, 'rule')} made no difference to any action in these "
            f"episodes: without {'it' if unused == 1 else 'any one of them'} every episode is the "
            "same, step for step, so nothing had to be run."
        )
    return tuple(sentences)


def left_out_text(ablation: Ablation) -> str:
    """Which rules were not taken out although they matter.

    Args:
        ablation: K rules.

    Returns:
        A sentence; "" where there are none.
    """
    count = len(ablation.left_out)
    if not count:
        return ""
    return (
        f"{counted(count, 'rule')} more changed actions and "
        f"{'was' if count == 1 else 'were'} not taken out; run it to the end, or raise the number "
        f"of rules, to see {'it' if count == 1 else 'them'}."
    )


def ablation_figure(ablation: Ablation, effects: Sequence[RuleEffect]) -> go.Figure:
    """The mean difference in return without each rule, with its interval.

    Args:
        ablation: Knows the rules' names.
        effects: Those to show, from top to bottom.

    Returns:
        A row a rule; to the left of the line the return is lower without it.
    """
    rule_set = ablation.shield.rule_set
    figure = go.Figure()
    figure.add_vline(x=0, line={"color": MUTED_COLOUR, "width": 1, "dash": "dot"})
    for verdict in VERDICTS:
        rows = [row for row, effect in enumerate(effects) if effect.verdict == verdict]
        intervals = [effects[row].difference for row in rows]
        if not rows:
            continue
        figure.add_scatter(
            x=[one.mean for one in intervals],
            y=rows,
            mode="markers",
            name=verdict,
            marker={"color": VERDICT_COLOURS[verdict], "size": 9, "symbol": _SYMBOLS[verdict]},
            error_x={
                "type": "data",
                "symmetric": False,
                "array": [one.high - one.mean for one in intervals],
                "arrayminus": [one.mean - one.low for one in intervals],
                "thickness": 2,
                "width": 4,
                "color": VERDICT_COLOURS[verdict],
            },
            text=[_hover(ablation, effects[row]) for row in rows],
            hovertemplate="%{text}<extra></extra>",
        )
    figure.update_layout(
        **figure_layout(
            max(_ROW_HEIGHT * len(effects) + 96, 180),
            margin={"r": 24, "t": 30},
            showlegend=True,
            legend={"orientation": "h", "x": 0, "y": 1, "xanchor": "left", "yanchor": "bottom"},
        )
    )
    figure.update_xaxes(
        title={"text": "change of the return without the rule", "standoff": 2},
        fixedrange=True,
        nticks=6,
        zeroline=False,
    )
    figure.update_yaxes(
        tickvals=list(range(len(effects))),
        ticktext=[rule_set.name_of(rule_set.rules[effect.rule]) for effect in effects],
        range=[len(effects) - 0.4, -0.6],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        ticklabelstandoff=6,
    )
    return figure


def _hover(ablation: Ablation, effect: RuleEffect) -> str:
    rule_set = ablation.shield.rule_set
    rule = rule_set.rules[effect.rule]
    lines = [
        f"<b>{rule_set.name_of(rule)}: "
        f"{plain(says_text(rule, rule_set.actions[rule.dimension]))}</b>",
        f"{difference_text(effect.difference.mean)} without it, 95 % interval "
        f"{difference_interval_text(effect)}",
        effect.verdict,
    ]
    if ablation.failures_known:
        failed = f"{effect.failures} episodes fail without it, {ablation.base_failures} with it"
        lines.insert(2, failed)
    return "<br>".join(lines)
