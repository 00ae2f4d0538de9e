"""What the page Measure shows of a comparison: what it comes to, two figures, and a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import streamlit as st

from sarl_core.explaining.figures.comparison import returns_figure, typical_figure
from sarl_core.explaining.words.comparison import POLICY_TEXT, verdict_on_all
from sarl_core.mining.language import share_text
from sarl_core.rollouts.episodes import Episodes
from sarl_core.studies.comparison import Comparison
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.flips import flips_rate, flips_title, pace_of_played
from sarl_dashboard.components.keeping import keep_result_button
from sarl_dashboard.components.run_bar import episodes_bar, watched
from sarl_dashboard.components.safety import freedom_cell, safety_column_config, safety_columns
from sarl_dashboard.jobs.episodes import COMPARISON, known, take_up_work
from sarl_dashboard.state.agents import AGENTS
from sarl_dashboard.text import escaped
from sarl_dashboard.views.shield.freedom import show_freedom
from sarl_dashboard.views.shield.lines import ShieldLine

HEIGHT = 400
ROW = 46  # pixels a row of the first figure

Finished = Sequence[tuple[ShieldLine, Episodes]]


def comparison_of(lines: Sequence[ShieldLine], episodes: int) -> None:
    """The button or the progress, and all that is known so far.

    Args:
        lines: What is compared; at least one.
        episodes: How many of each.
    """
    rows = [line.row for line in lines]
    take_up_work(COMPARISON, rows)

    def outcome(at_work: bool) -> None:
        episodes_bar(COMPARISON, rows, episodes)
        of_each = zip(lines, known(rows, episodes), strict=True)
        show([(line, some) for line, some in of_each if some is not None], at_work=at_work)

    watched(COMPARISON, outcome)


def show(finished: Finished, *, at_work: bool) -> None:
    """The comparison, or what to do where there is none.

    Args:
        finished: What has been run of the present choices.
        at_work: Whether more is on its way.
    """
    if not finished:
        if not at_work:
            st.info(
                "Choose agents and shields, then press Run. The work goes on while you look at "
                "other pages, and what is finished stays when you cancel.",
                icon=":material/play_circle:",
            )
        return
    lines = [line for line, _ in finished]
    env_id, seed = str(lines[0].row.env_id), lines[0].row.seed
    comparison = Comparison(
        env_id, seed, tuple(line.arm for line in lines), tuple(episodes for _, episodes in finished)
    )
    styles = [line.style for line in lines]
    height = max(HEIGHT, 60 + ROW * len(lines))
    if not at_work:
        sentences = [*verdicts(finished), *policies(finished), *remarks(finished)]
        st.markdown("\n".join(f"- {escaped(sentence)}" for sentence in sentences))
    left, right = st.columns([2, 3], gap="medium")
    with left:
        st.markdown("**Typical return**")
        chart(
            typical_figure(comparison, styles=styles, height=height),
            "typical",
            "Interquartile mean of the returns with its 95 % interval, for every agent and shield",
        )
    with right:
        st.markdown("**Every episode**")
        chart(
            returns_figure(comparison, styles=styles, height=height),
            "returns",
            "Return of every episode, for every agent and shield",
        )
    st.caption(
        "The typical return is the mean of the middle half of the episodes, with its 95 % "
        "interval. It leaves out the worst quarter of the episodes, and so hides failures: read "
        "the mean return and the failures beside it. Click a name to hide its line, twice to see "
        "it alone."
    )
    st.dataframe(
        [
            table_row(line, episodes, safety)
            for (line, episodes), safety in zip(
                finished, safety_columns([episodes for _, episodes in finished]), strict=True
            )
        ],
        hide_index=True,
        height="content",
        column_config=column_config(env_id),
        key="comparison_table",
    )
    show_freedom(finished)
    if not at_work:
        name = env_id.rsplit("/", 1)[-1].rsplit(":", 1)[-1]
        with st.container(horizontal=True):
            file = f"comparison-{name}-{seed}.csv"
            download("Download CSV", lambda: csv(comparison), file, key="comparison_csv")
            keep_result_button(lambda: csv(comparison), file, key="keep_comparison")


def verdicts(finished: Finished) -> list[str]:
    """For each agent, what every shield did to it."""
    sentences = []
    for agent in dict.fromkeys(line.agent for line, _ in finished):
        own = [(line, episodes) for line, episodes in finished if line.agent == agent]
        alone = next((episodes for line, episodes in own if line.arm.rules is None), None)
        if alone is None:
            continue
        shielded = [
            (f"the {rules_name(line.shield)}", episodes)
            for line, episodes in own
            if line.arm.rules is not None and len(episodes) == len(alone)
        ]
        if shielded:
            sentences.append(verdict_on_all(agent_name(agent), alone, shielded))
    return sentences


def policies(finished: Finished) -> list[str]:
    """Which of the rules leave an agent nothing to choose from."""
    names = dict.fromkeys(
        line.shield
        for line, episodes in finished
        if line.arm.rules is not None and episodes.summary().get("freedom") == 0.0
    )
    return [f"The {rules_name(name)}: {POLICY_TEXT[0].lower()}{POLICY_TEXT[1:]}." for name in names]


def remarks(finished: Finished) -> list[str]:
    """What is to be said of how the episodes came about, each once."""
    notes = dict.fromkeys(
        (line.shield if line.arm.rules is not None else "", note)
        for line, episodes in finished
        for note in episodes.remarks
    )
    return [
        f"{f'With the {rules_name(shield)}, ' if shield else 'Without a shield, '}{note}."
        for shield, note in notes
    ]


def agent_name(agent: str) -> str:
    """An agent in the middle of a sentence, after "the"."""
    if agent == "untrained":
        return "untrained agent"
    return agent if agent in AGENTS else f"agent {agent}"


def rules_name(shield: str) -> str:
    """A shield in the middle of a sentence."""
    return f"rules {shield}" if shield.startswith("at ") else f"{shield} rules"


def column_config(env_id: str) -> dict[str, Any]:
    """What the columns look like, and what they mean."""
    column = st.column_config
    return {
        "Agent": column.TextColumn(pinned=True),
        "Shield": column.TextColumn(pinned=True),
        "Rules": column.TextColumn(alignment="right", help="Rules in the set"),
        "Episodes": column.NumberColumn(format="localized"),
        "Typical return": column.NumberColumn(
            format="%.1f", help="Mean of the middle half of the episodes (IQM)"
        ),
        "95 % interval": column.TextColumn(alignment="right", help="Of the typical return"),
        "Mean return": column.NumberColumn(format="%.1f", help="Of all episodes"),
        "Changed": column.TextColumn(
            alignment="right", help="Share of the steps at which the shield changed the action"
        ),
        "Outside": column.TextColumn(
            alignment="right",
            help="Share of the interventions in states outside the data of the rule, those that "
            "it left out with them; a dash where the rules keep no data boxes",
        ),
        "Covered": column.TextColumn(
            alignment="right", help="Share of the steps at which some rule applied"
        ),
        flips_title(env_id): column.TextColumn(
            alignment="right", help="How often the shield switches on or off"
        ),
        **safety_column_config(),
    }


def table_row(line: ShieldLine, episodes: Episodes, safety: Mapping[str, str]) -> dict[str, Any]:
    """What the table says of a line."""
    numbers, summary = episodes.statistics, episodes.summary()
    rules = line.arm.rules
    return {
        "Agent": line.agent,
        "Shield": line.shield,
        "Rules": f"{len(rules):,}" if rules is not None else "–",
        "Episodes": len(episodes),
        "Typical return": numbers.iqm,
        "95 % interval": f"{numbers.low:,.1f} to {numbers.high:,.1f}",
        "Mean return": numbers.mean,
        **safety,
        "Changed": share_text(summary["intervention_rate"]) if rules is not None else "–",
        "Outside": share_text(summary["outside_rate"])
        if rules is not None and any(rule.box is not None for rule in rules.rules)
        else "–",
        "Covered": share_text(summary["coverage"]) if rules is not None else "–",
        "Freedom": freedom_cell(episodes) if rules is not None else "–",
        flips_title(episodes.env_id): f"{flips_rate(episodes):.2f}"
        if rules is not None and episodes.flips is not None
        else "–",
    }


def csv(comparison: Comparison) -> bytes:
    """The table as a file, every number in full."""
    frame = comparison.to_frame()
    projections = [arm.projection if arm.rules is not None else "" for arm in comparison.arms]
    frame.insert(2, "projection", projections)
    ways = [arm.outside if arm.rules is not None else "" for arm in comparison.arms]
    frame.insert(3, "outside", ways)
    unit = pace_of_played(comparison.env_id).unit.replace(" ", "_")
    frame[f"flips_per_{unit}"] = [
        flips_rate(episodes) if arm.rules is not None and episodes.flips is not None else None
        for arm, episodes in zip(comparison.arms, comparison.episodes, strict=True)
    ]
    frame.insert(0, "seed", comparison.seed)
    frame.insert(0, "environment", comparison.env_id)
    return str(frame.to_csv(index=False)).encode()
