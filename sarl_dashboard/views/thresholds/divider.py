"""What the Thresholds page shows of the divider: what coarse intervals cost, before any rule."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.agents.agent import Agent
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import SarlError
from sarl_core.explaining.figures.divider import error_figure, occupancy_figure, snapped_figure
from sarl_core.mining.quantisation import (
    SNAPPINGS,
    STUDIED_DIVIDERS,
    Quantisation,
    Snapping,
    quantise,
)
from sarl_core.studies.divider import snapped_agents
from sarl_dashboard.cache import cached
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.journey.steps_needed import say_steps_needed
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.run_bar import episodes_bar, watched
from sarl_dashboard.jobs.episodes import EpisodeBatch, Row, known, take_up_work
from sarl_dashboard.jobs.job import Place
from sarl_dashboard.session import is_dark
from sarl_dashboard.state.agents import FRESH_SEED, ChosenAgent, agent_for, has_expert
from sarl_dashboard.state.environments import environment_of
from sarl_dashboard.text import escaped, in_full

PLACE = Place[EpisodeBatch]("divider")
MOST_EPISODES = 200

Divided = tuple[tuple[Quantisation, ...], ...]
Setting = tuple[int, Snapping]


@cached(show_spinner="Dividing the actions …")
def _quantised(demonstrations: Demonstrations) -> Divided:
    return quantise(demonstrations)


def show_divider(demonstrations: Demonstrations, dimension: int | None) -> None:
    """Where the actions lie, how far snapping moves them, and what that does to the expert.

    Args:
        demonstrations: With continuous actions.
        dimension: Which action dimension is looked at; None for all.
    """
    if say_steps_needed("trying other dividers", demonstrations):
        return
    divided = _quantised(demonstrations)
    some = divided if dimension is None else (divided[dimension],)
    dark = is_dark()
    st.caption(
        "A rule for a continuous action names an interval, and no value. Here every action is "
        "replaced by what stands for its own interval, with no rule in between: its centre, or "
        "what the expert typically did in it. What is lost by that is lost to the divider alone."
    )
    left, right = st.columns(2, gap="medium")
    with left:
        st.markdown("**How far an action moves, as a share of its range**")
        chart(
            error_figure(some, dark=dark),
            "divider_errors",
            "Root mean square of what snapping changes, for every action and divider",
        )
    with right:
        st.markdown("**What the expert still achieves**")
        show_returns(demonstrations, divided)
    st.markdown("**Where the demonstrated actions lie**")
    with st.grid(min(len(some), 2), min_column_width=320):
        for index, each in enumerate(some):
            chart(
                occupancy_figure(each, dark=dark),
                f"occupancy_{index}",
                f"Share of the steps in every interval of {each[0].dimension.name}",
            )
    unseen = [
        f"{escaped(part.dimension.name)}: {len(part.never_seen)} of {part.divider}"
        for each in some
        for part in each
        if part.never_seen
    ]
    st.caption(
        "Intervals that were never shown are hatched; no rule can ask for them "
        f"({'; '.join(unseen)})."
        if unseen
        else "Every interval was shown at least once."
    )


def show_returns(demonstrations: Demonstrations, divided: Divided) -> None:
    """The returns of the snapped expert, and the way to run it."""
    try:
        env_id = environment_of(None)
    except SarlError as error:
        st.info(in_full(str(error)), icon=":material/info:")
        return
    if not has_expert(env_id):
        st.info(
            f"No expert is shipped for {escaped(str(env_id))}, so there is nobody whose actions "
            "could be snapped.",
            icon=":material/info:",
        )
        return
    episodes = int(
        st.number_input(
            "Episodes for each setting",
            1,
            MOST_EPISODES,
            20,
            key="divider_episodes",
            bind="query-params",
            help=with_words(f"On the seeds from {FRESH_SEED:,}, the same for all."),
        )
    )
    rows = snapped_rows(demonstrations, env_id, divided)

    def returns(_: bool) -> None:
        episodes_bar(PLACE, list(rows.values()), episodes)
        ready = dict(zip(rows, known(list(rows.values()), episodes), strict=True))
        cells = {
            (divider, snapping): run
            for divider in STUDIED_DIVIDERS
            for snapping in SNAPPINGS
            for run in [ready[unchanged_as(divider, snapping)]]
            if run is not None
        }
        if not cells:
            return
        chart(
            snapped_figure(STUDIED_DIVIDERS, cells, dark=is_dark()),
            "snapped_returns",
            "Typical return of the expert with snapped actions, for every divider",
        )
        st.caption(
            "The typical return, and its 95 % interval. Clip replaces an action by the nearest "
            "value in its interval, which is the action itself: that row is the expert as it is."
        )

    take_up_work(PLACE, list(rows.values()))
    watched(PLACE, returns)


def unchanged_as(divider: int, snapping: Snapping) -> Setting:
    """The setting that is run for this one: all that clip are the same."""
    return (0, snapping) if snapping == "clip" else (divider, snapping)


@dataclass(frozen=True, eq=False)
class SnappedExpert:
    """The expert with every action snapped to its interval, which a call makes.

    Attributes:
        expert: As it is.
        demonstrations: Whose actions say where the intervals and their targets lie.
        divided: Every action dimension at this divider.
        divider: Number of intervals.
        snapping: What an action becomes.
    """

    expert: ChosenAgent
    demonstrations: Demonstrations
    divided: tuple[tuple[Quantisation], ...]
    divider: int
    snapping: Snapping

    @property
    def digest(self) -> str:
        """What tells it from others."""
        known = (self.expert.digest, self.demonstrations.digest, self.divider, self.snapping)
        return repr(known)

    def __call__(self) -> Agent:
        """Make it."""
        expert = self.expert()
        return snapped_agents(self.expert.env_id, expert, self.divided, (self.snapping,))[0]


def snapped_rows(
    demonstrations: Demonstrations, env_id: EnvironmentOrId, divided: Divided
) -> dict[Setting, Row]:
    """What is run, by divider and way to snap; the expert as it is first."""
    expert = agent_for("expert", None, env_id, FRESH_SEED)
    rows = {unchanged_as(0, "clip"): Row("expert as it is", env_id, FRESH_SEED, expert)}
    for column, divider in enumerate(STUDIED_DIVIDERS):
        own = tuple((each[column],) for each in divided)
        for snapping in SNAPPINGS:
            if snapping != "clip":
                snapped = SnappedExpert(expert, demonstrations, own, divider, snapping)
                name = f"{divider} intervals, {snapping}"
                rows[divider, snapping] = Row(name, env_id, FRESH_SEED, snapped)
    return rows
