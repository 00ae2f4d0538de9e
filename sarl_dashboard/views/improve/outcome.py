"""What the Improve page shows: rounds, the report, what can be taken away; what is shipped."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.figures.aggregation import (
    RoundPoint,
    points_of,
    rounds_figure,
)
from sarl_core.explaining.words.comparison import POLICY_TEXT
from sarl_core.improving.aggregation import Aggregation
from sarl_core.improving.aggregation_files import aggregation_card
from sarl_core.mining.language import counted, share_text
from sarl_core.mining.rule_set import rules_to_json
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.downloads import as_file, download
from sarl_dashboard.components.keeping import keep_result_button
from sarl_dashboard.components.safety import Tile, safety_tiles
from sarl_dashboard.components.tables import table_height
from sarl_dashboard.jobs.improving import Outcome, keep_outcome
from sarl_dashboard.state import library
from sarl_dashboard.state.data import (
    is_upload_chosen,
    set_upload,
    uploaded_demonstrations,
)
from sarl_dashboard.text import file_name
from sarl_dashboard.views.improve.gaps import show_gaps


def show_outcome(outcome: Outcome, *, at_work: bool, changed: bool) -> None:
    """Everything that is known of a run.

    Args:
        outcome: Not empty.
        at_work: Whether more is on its way.
        changed: Whether the settings ask for something else by now.
    """
    if changed:
        used = uploaded_demonstrations()
        improved = outcome.improved
        if improved is not None and used is not None and _same(used, improved.demonstrations):
            st.success(
                "These demonstrations are now the ones chosen, on every page. Run asks for more "
                "where their rules lead.",
                icon=":material/check:",
            )
        else:
            st.markdown(":orange[:material/info: The settings have changed since: press Run.]")
    if outcome.gaps is not None:
        show_gaps(outcome, outcome.gaps, at_work=at_work)
        return
    if outcome.improved is not None:
        show_report(outcome, outcome.improved)
        take_away(outcome, outcome.improved)
    show_rounds(
        points_of(outcome.rounds),
        planned=outcome.order.plan.rounds if at_work else None,
        improved=outcome.improved,
    )


# --- what came of it ---------------------------------------------------------------------------


def show_report(outcome: Outcome, improved: Aggregation) -> None:
    """What the best rules achieve, in plain words."""
    rules = improved.rule_set
    size = size_text([len(rules.of_dimension(index)) for index in range(len(rules.actions))])
    steps = counted(improved.plan.turns, "turn")
    refined = f", refined in {steps}" if improved.refined else ""
    if improved.reported is None:
        st.markdown(
            f"The best so far are the {size} of round {improved.chosen}"
            f"{', partly refined' if improved.refined else ''}. {how_chosen(improved)} Nothing was "
            "reported on fresh episodes."
        )
        return
    returns = improved.reported.returns
    spread = improved.reported.statistics
    st.markdown(
        f"A novice that acts at random, kept to the {size} of round "
        f"{improved.chosen}{refined}, reached a mean return of **{spread.mean:,.1f}** over "
        f"{counted(len(returns), 'fresh episode')}, with a standard deviation of "
        f"{spread.std:,.1f} and a least of {float(returns.min()):,.1f}. The rules were chosen on "
        "other episodes"
        + (
            f", where their mean was {improved.validation_mean:,.1f}: the best of several is lucky "
            "too, so that number counts for less."
            if improved.validation_mean is not None
            else "."
        )
        + (
            " The first round was the best, so its rules come from the demonstrations as they "
            "were; more rounds, or more rules, may change that."
            if improved.chosen == 1 and len(improved.rounds) > 1
            else ""
        )
    )
    if improved.reported.summary().get("freedom") == 0.0:
        changed = share_text(improved.reported.summary()["intervention_rate"])
        st.markdown(f"{POLICY_TEXT}: they changed {changed} of the novice's steps.")
    with st.grid(5, min_column_width=140):
        for tile in (
            Tile("Mean return", f"{spread.mean:,.1f}", "Over the fresh episodes"),
            Tile("Deviation", f"{spread.std:,.1f}", "Standard deviation over the fresh episodes"),
            Tile("Least return", f"{float(returns.min()):,.1f}", "Of the fresh episodes"),
            Tile(
                "Typical return",
                f"{spread.iqm:,.1f}",
                "Mean of the middle half of the episodes (IQM), 95 % interval "
                f"{spread.low:,.1f} to {spread.high:,.1f}",
                f"{spread.low:,.1f} to {spread.high:,.1f}",
            ),
            *safety_tiles(improved.reported, shielded=True),
            Tile("Rules", f"{len(rules):,}", "Over all actions"),
            Tile(
                "Demonstrations",
                f"{len(improved.demonstrations):,}",
                "State-action pairs that they were made of, all answered by the expert",
            ),
        ):
            tile.show()


def how_chosen(improved: Aggregation) -> str:
    """By what the rules of a stopped run are the best, in a sentence."""
    if improved.validation_mean is not None:
        return (
            "They were chosen by episodes played for that alone, with a mean return of "
            f"{improved.validation_mean:,.1f}; that number is flattered by being the best."
        )
    if improved.seeds.refinement is not None:
        return (
            "They are judged by the episodes of the refinement alone: that is little, and they "
            "were compared by them more than once."
        )
    best = improved.rounds[improved.chosen - 1]
    return (
        f"They are judged by the {counted(len(best.returns), 'episode')} of their round alone: "
        "that is little, and the number is flattered by being the best."
    )


def size_text(per_action: Sequence[int]) -> str:
    """How many rules there are, for Markdown.

    Args:
        per_action: Rules of each action dimension.
    """
    size = f"**{counted(sum(per_action), 'rule')}**"
    if len(per_action) > 1:
        size += f" (at most {max(per_action)} for each of {len(per_action)} actions)"
    return size


def show_rounds(
    points: Sequence[RoundPoint],
    *,
    planned: int | None = None,
    improved: Aggregation | None = None,
    chosen: int | None = None,
    reported: float | None = None,
    key: str = "rounds",
) -> None:
    """The curve over the rounds, and a table of them."""
    if improved is not None:
        chosen = improved.chosen
        if improved.reported is not None:
            reported = improved.reported.statistics.mean
    chart(
        rounds_figure(points, planned=planned, chosen=chosen, reported=reported),
        f"{key}_figure",
        "Return, coverage, disagreement with the expert and number of rules, round by round",
    )
    marks = []
    if chosen is not None:
        marks.append("The ring is the chosen round.")
    if reported is not None:
        marks.append("The diamond is what its rules achieve on fresh episodes.")
    st.caption(
        "Return: the mean of the round's episodes, shaded one standard deviation to either side. "
        "Coverage: share of the states met in which some rule applied. " + " ".join(marks)
    )
    st.dataframe(
        [
            {
                "Round": point.number,
                "Mean return": point.mean,
                "Deviation": point.std,
                **({} if point.failures is None else {"Failures": point.failures}),
                "Coverage": 100 * point.coverage,
                "Expert disagrees": 100 * point.disagreement,
                "Rules": point.rules,
                "Demonstrations": point.pairs,
                "Chosen": point.number == chosen,
            }
            for point in points
        ],
        hide_index=True,
        height=table_height(len(points), 12),
        key=f"{key}_table",
        column_config={
            "Mean return": st.column_config.NumberColumn(format="%.1f"),
            "Deviation": st.column_config.NumberColumn(
                format="%.1f", help="Standard deviation of the returns of its episodes"
            ),
            "Coverage": st.column_config.NumberColumn(
                format="%.1f %%", help="Share of the states met in which some rule applied"
            ),
            "Expert disagrees": st.column_config.NumberColumn(
                format="%.1f %%",
                help="Share of the rules' decisions in which the expert would do otherwise",
            ),
            "Rules": st.column_config.NumberColumn(format="localized"),
            "Demonstrations": st.column_config.NumberColumn(
                format="localized", help="State-action pairs that its rules were made of"
            ),
        },
    )


def take_away(outcome: Outcome, improved: Aggregation) -> None:
    """The rules, their card and the demonstrations, to keep and to go on with."""
    name = f"{file_name(str(outcome.order.env_id))}-{len(improved.rule_set)}-rules"
    if not improved.is_finished:
        name += ".stopped"
    used = uploaded_demonstrations()
    in_use = used is not None and _same(used, improved.demonstrations)
    with st.container(horizontal=True):
        st.button(
            "Use these demonstrations",
            type="primary",
            icon=":material/dataset:",
            key="use_improved",
            on_click=use,
            args=(improved, name),
            disabled=in_use and is_upload_chosen(),
            help="Every page then works on them, as if you had uploaded them.",
        )
        download(
            "Rules",
            lambda: rules_to_json(improved.rule_set),
            f"{name}.json",
            key="improve_rules",
            meaning="The rule file (JSON), for evaluate and as own file on other pages",
        )
        download(
            "Card",
            lambda: card_text(outcome, improved),
            f"{name}.card.json",
            key="improve_card",
            meaning="How the rules came about and what they achieve (JSON)",
        )
        download(
            "Demonstrations",
            partial(as_file, improved.demonstrations),
            f"{name}.parquet",
            key="improve_demonstrations",
            meaning="All pairs of the chosen round (Parquet)",
        )
        keep_result_button(
            lambda: card_text(outcome, improved),
            f"{name}.card.json",
            key="keep_improvement",
            beside=lambda: keep_all(outcome, improved, name),
        )


def _same(used: Demonstrations, others: Demonstrations) -> bool:
    return used is others or used.digest == others.digest


def use(improved: Aggregation, name: str) -> None:
    """Work on the improved demonstrations from now on; for a callback."""
    set_upload(improved.demonstrations, file_name=f"{name}.parquet")
    st.rerun()  # the sidebar says what is chosen


def keep_all(outcome: Outcome, improved: Aggregation, name: str) -> list[str]:
    """Keep the rules and their demonstrations, and all that the page shows of the run.

    Raises:
        SarlError: If they cannot be kept.
    """
    keep_outcome(outcome)
    library.keep(improved.demonstrations, f"{name}.parquet")
    command = outcome.order.command
    rules = improved.rule_set
    return [library.keep_rules(rules, name, improved.demonstrations, command=command).id]


def card_text(outcome: Outcome, improved: Aggregation) -> str:
    """The card as a file."""
    return json.dumps(aggregation_card(improved, command=outcome.order.command), indent=2) + "\n"
