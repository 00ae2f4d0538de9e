"""What the Evidence page shows of the rules: the overview, what is missing, curve, stability."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import streamlit as st

from sarl_core.explaining.figures import evidence as figures
from sarl_core.explaining.html.evidence import enough_plot, overview_plot
from sarl_core.explaining.html.headings import note
from sarl_core.explaining.html.number_cards import Number, number_cards
from sarl_core.explaining.tables.evidence import (
    enough_columns,
    stability_columns,
)
from sarl_core.explaining.words.cross_fit import influence_sentences, judged_sentence
from sarl_core.explaining.words.evidence import (
    VERDICT_COLOURS,
    VERDICTS,
    never_text,
    remedy_text,
    verdict_counts,
)
from sarl_core.mining.language import counted, share_text
from sarl_core.mining.rules import Rule, RuleSet
from sarl_core.mining.validation.cross_fitting import Judged, judge
from sarl_core.mining.validation.episode_counts import Influence, count_rules, most_influential
from sarl_core.mining.validation.evidence import FEWEST_EPISODES
from sarl_core.mining.validation.holding_out import Verdict, more_episodes, shortfall
from sarl_core.mining.validation.learning_curve import LearningCurve, learning_curve
from sarl_core.mining.validation.stability import SAME_RULE, Stability, rule_stability
from sarl_core.progress import Progress
from sarl_dashboard.cache import cached
from sarl_dashboard.components.tables import action_column, table_height
from sarl_dashboard.components.worked_out import worked_out
from sarl_dashboard.state.data import data_parts
from sarl_dashboard.state.hold_out import Parts
from sarl_dashboard.state.mined import mined_rules
from sarl_dashboard.state.thresholds import chosen_divider

MOST_DRAWN = 600
MEANINGS: tuple[tuple[Verdict, str], ...] = (
    ("reached", "The whole 95 % interval lies at or above the minimum confidence"),
    ("open", "The minimum confidence lies within the interval: not enough is known"),
    ("below", "The whole interval lies below the minimum confidence"),
    ("unknown", f"The rule applied in fewer than {FEWEST_EPISODES} of the held-out episodes"),
)
TABLE_ROWS = 12
ORDERS = 6
PLAIN = {"displayModeBar": False}


@dataclass(frozen=True)
class Found:
    """What the page says of a rule set.

    Attributes:
        rules: The most support first.
        missing: Episodes that each still misses.
        threshold: The minimum confidence.
        judged: All of them together on the episodes held out; None where there are none.
        influences: The held-out episode that moves the share of each rule most.
    """

    rules: tuple[Rule, ...]
    missing: tuple[float, ...]
    threshold: float
    judged: Judged | None
    influences: tuple[Influence | None, ...]


@cached(show_spinner="Weighing the evidence …")
def _found(key: tuple[object, ...], _parts: Parts, _rule_set: RuleSet) -> Found:
    rules = tuple(sorted(_rule_set.rules, key=lambda rule: -rule.samples))
    threshold = _rule_set.thresholds.confidence
    missing = more_episodes(rules, _parts.remaining.n_episodes, threshold)
    if _parts.held_out is None:
        return Found(rules, missing, threshold, None, (None,) * len(rules))
    counts = count_rules(replace(_rule_set, rules=rules), _parts.held_out)
    influences = tuple(
        most_influential(*counts.of(place), counts.numbers, counts.lengths)
        for place in range(len(rules))
    )
    return Found(rules, missing, threshold, judge(_rule_set, counts), influences)


@cached()
def _overview(key: tuple[object, ...], _found: Found, _rule_set: RuleSet) -> str:
    return overview_plot(_found.rules[:MOST_DRAWN], _rule_set, _found.threshold)


@cached()
def _enough(key: tuple[object, ...], _found: Found, _rule_set: RuleSet) -> Any:
    import pandas as pd

    columns = enough_columns(
        _found.rules, _rule_set, _found.missing, _found.threshold, _found.influences
    )
    # A list of one, which the table shows in the action's colour.
    columns["Action"] = [[action] for action in columns["Action"]]
    return pd.DataFrame(columns)


class Evidence:
    """The rules at the thresholds with everything that is known about them."""

    def __init__(self) -> None:
        """Take what is chosen."""
        parts = data_parts()
        assert parts is not None
        self.parts = parts
        self.divider = chosen_divider()
        self.rule_set = mined_rules()
        self.thresholds = self.rule_set.thresholds
        held = "" if parts.held_out is None else parts.held_out.digest
        self.key = (parts.mined.digest, held, self.thresholds, self.rule_set.divider)
        self.found = _found(self.key, parts, self.rule_set)


def show_overview(evidence: Evidence) -> None:
    """All rules with what is known of them, and how many reach the minimum confidence."""
    found, judged = evidence.found, evidence.found.judged
    numbers = [Number("Rules", f"{len(found.rules):,}")]
    told = []
    if judged is not None:
        counts = verdict_counts(found.rules, found.threshold)
        share = judged.fidelity.share
        numbers.append(
            Number(
                "Held-out fidelity",
                share_text(math.nan if share is None else share, decimals=1),
                "Share of the states with a rule in which the expert did what it says, on average "
                "over the held-out episodes",
            )
        )
        numbers += [
            Number(VERDICTS[name].capitalize(), f"{counts[name]:,}", meaning)
            for name, meaning in MEANINGS
        ]
        told = [judged_sentence(judged), *influence_sentences(judged)]
        held, there = evidence.parts.held_out, evidence.parts.remaining.n_episodes
        short = shortfall(found.rules, found.threshold, 0 if held is None else held.n_episodes)
        remedy = remedy_text(short, there)
        if remedy:
            told.insert(0, f"No rule reaches the minimum confidence: {remedy}.")
    ink = {name: f"<b style='color:{colour}'>■</b> " for name, colour in VERDICT_COLOURS.items()}
    words = f"dotted: minimum confidence {share_text(found.threshold)}"
    if judged is not None:
        words = (
            f"{ink['reached']}reached &ensp; {ink['open']}open &ensp; {ink['below']}too low &ensp; "
            "a dot alone: too few episodes &ensp; grey: on what it was mined from &ensp; " + words
        )
    if len(found.rules) > MOST_DRAWN:
        told.append(
            f"Drawn: the {MOST_DRAWN} rules with the most support, of {len(found.rules):,}."
        )
    with st.container(key="overview"):  # one piece: each element of its own takes its time
        st.html(
            f"{number_cards(numbers)}<div style='height:1.2rem'></div>"
            + _overview(evidence.key, found, evidence.rule_set)
            + f"<div style='font-size:0.85rem;opacity:0.9;margin:0.6rem 0 0.9rem'>{words}</div>"
            + "".join(map(note, told))
        )


def show_enough(evidence: Evidence) -> None:
    """How many more episodes each rule would take."""
    found = evidence.found
    if found.judged is None:
        st.info(
            "Whether the demonstrations are enough, only episodes can say that the rules were not "
            "mined from. Hold some out above.",
            icon=":material/info:",
        )
        return
    st.html(
        note(
            "How many more episodes until the lower end of a rule's interval would reach the "
            "minimum confidence, if the same share of them was held out, and the rule applied as "
            "often and was right as often, and as unevenly, as so far. Where the confidence itself "
            "does not lie above the minimum, no number is enough."
        )
    )
    none = never_text(found.missing)
    if none:
        st.html(note(none))
        table = st.container()
    else:
        left, table = st.columns([1, 2], gap="medium")
        with left, st.container(key="enough"):
            st.html(enough_plot(found.missing))
    with table:
        column = st.column_config
        st.dataframe(
            _enough(evidence.key, found, evidence.rule_set),
            hide_index=True,
            height=table_height(len(found.rules), 6),
            key="enough_table",
            column_config={
                "Rule": column.TextColumn(width=60),
                "Action": action_column(evidence.rule_set.actions, "What the rule says")[0],
                "Still missing": column.TextColumn(width=155),
                "Held out": column.TextColumn(
                    width=170,
                    help="How often it was right in an episode held out, on average over those",
                ),
                "Interval": column.TextColumn(
                    width=130, help="What so few or so many episodes can tell (95 %)"
                ),
                "Verdict": None,
                "Mined from": column.TextColumn(
                    width=160, help="How often it was right in the states it was mined from"
                ),
                "Moved most by": column.TextColumn(
                    width=195, help="The one episode without which the share would differ most"
                ),
                "When": column.TextColumn(width=420),
            },
            alt="What each rule still misses",
        )


def show_curve(evidence: Evidence) -> None:
    """What rules of fewer episodes would have been."""
    parts = evidence.parts
    if parts.mined.n_episodes < 2:
        st.info(
            "There is one episode only. A learning curve needs several; give demonstrations with "
            "more episodes.",
            icon=":material/info:",
        )
        return
    mined, held_out = parts.mined, parts.held_out
    thresholds, divider = evidence.thresholds, evidence.rule_set.divider
    st.caption(
        "Rules are mined from one episode, from a few more, and so on to all, at the present "
        f"thresholds, in {ORDERS} orders of the episodes. A curve that still climbs at its end "
        "says that more demonstrations would help. "
        + (
            "Tried on the held-out episodes."
            if held_out is not None
            else "Tried on the episodes that come later in the order, so the last point has none; "
            "hold some out above to have it."
        )
    )

    def work(executor: Executor, progress: Progress) -> LearningCurve:
        return learning_curve(
            mined,
            thresholds,
            divider=divider,
            held_out=held_out,
            orders=ORDERS,
            executor=executor,
            progress=progress,
        )

    worked_out(
        "curve",
        ("curve", evidence.key),
        work,
        f"Mines up to {8 * ORDERS} rule sets.",
        _show_curve,
    )


def _show_curve(curve: LearningCurve) -> None:
    with st.grid(4, min_column_width=240, gap="small") as grid:
        for layer, title in figures.CURVE_TITLES.items():
            with grid.cell():
                st.markdown(f"**{title}**")
                st.plotly_chart(
                    figures.curve_figure(curve, layer),
                    config=PLAIN,
                    key=f"curve_{layer}",
                    alt=f"{title} over the number of episodes",
                )
    st.caption(
        f"Line: the mean of {counted(curve.orders, 'order')}. Band: from the least to the most."
    )


def show_stability(evidence: Evidence) -> None:
    """How often each rule comes back."""
    mined = evidence.parts.mined
    if not evidence.rule_set.rules or mined.n_episodes < 2:
        st.info(
            "There is no rule to look for; lower a threshold."
            if mined.n_episodes > 1
            else "There is one episode only, so none can be drawn again.",
            icon=":material/info:",
        )
        return
    with st.container(horizontal=True, vertical_alignment="bottom"):
        rounds = int(
            st.number_input(
                "Rounds",
                5,
                500,
                30,
                key="rounds",
                bind="query-params",
                width=130,
                help="In each, as many episodes as there are are drawn, some of them several "
                "times and others not at all, and the rules are mined again.",
            )
        )
        st.caption(
            "A rule has come back if a new one with the same action covers mostly the same "
            f"states: those that both cover are at least {share_text(SAME_RULE)} of those that "
            "either covers. In brackets: where nine in ten of the new thresholds lay."
        )
    rule_set = evidence.rule_set

    def work(executor: Executor, progress: Progress) -> Stability:
        return rule_stability(rule_set, mined, rounds=rounds, executor=executor, progress=progress)

    worked_out(
        "stability",
        ("stability", evidence.key, rounds),
        work,
        f"Mines {rounds} rule sets.",
        partial(_show_stability, rule_set),
    )


def _show_stability(rule_set: RuleSet, stability: Stability) -> None:
    import pandas as pd

    table = pd.DataFrame(stability_columns(rule_set.rules, rule_set, stability))
    table = table.sort_values(["Comes back", "States"], ascending=False)
    often = sum(one.returns >= 0.5 for one in stability.rules)
    st.markdown(
        f"**{often:,} of {counted(len(stability.rules), 'rule')}** came back in at least half of "
        f"{counted(stability.rounds, 'round')}."
    )
    share: dict[str, Any] = {
        "min_value": 0.0,
        "max_value": 100.0,
        "format": "%.1f %%",
        "color": "gray",
    }
    column = st.column_config
    st.dataframe(
        table,
        hide_index=True,
        height=table_height(len(table), TABLE_ROWS),
        key="stability_table",
        column_config={
            "Action": column.TextColumn(width=150),
            "Comes back": column.ProgressColumn(
                width=120, help="Share of the rounds in which it came back", **share
            ),
            "Overlap": column.ProgressColumn(
                width=120,
                help="With the most similar new rule, in the middle of all rounds: states that "
                "both cover over states that either covers",
                **share,
            ),
            "States": column.NumberColumn(width=75, format="localized"),
            "Thresholds and their bands": column.TextColumn(width=540),
            "Rule": column.TextColumn(width=75),
        },
        alt="How often each rule came back, and how far its thresholds moved",
    )
