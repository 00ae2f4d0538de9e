"""The flight recorder on the page Replay: every step in a table, filtered, and as files.

The row of a step, its picture, its path and its place in the strip are one selection: the step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.decimals import digits_across
from sarl_core.explaining.colours import chip_colour, label_colour
from sarl_core.explaining.exports.steps import RecordedSteps, steps_to_csv, steps_to_parquet
from sarl_core.explaining.html.headings import heading
from sarl_core.explaining.tables.recorder import (
    PAGE,
    filter_text,
    page_count,
    place_of,
    recorder_columns,
)
from sarl_core.mining.action_words import action_text
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.step_filters import StepFilter, used_rules
from sarl_core.rollouts.steps import StepTable
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import switch
from sarl_dashboard.jobs.replays import REPLAY, Played, ReplayPair, compared, comparison_cache
from sarl_dashboard.views.replay.run import jump_to

CHANGED, OUTSIDE = "changed by the rules", "outside the data"
EVERY_RULE, EVERY_EPISODE = "every rule", "every episode"
ONE, ALL = "this episode", "all episodes"


@dataclass(frozen=True, eq=False)
class Recorded:
    """The steps that the table may show.

    Attributes:
        replay: On screen.
        episodes: Whose steps; their steps are kept.
        on_screen: Which of them is on screen.
    """

    replay: ReplayPair
    episodes: Episodes
    on_screen: int

    @property
    def steps(self) -> StepTable:
        """All their steps."""
        assert self.episodes.steps is not None
        return self.episodes.steps

    @property
    def several(self) -> bool:
        """Whether there is more than one episode."""
        return len(self.episodes) > 1

    def row(self, step: int) -> int:
        """The row of a step of the episode on screen."""
        return int(np.searchsorted(self.steps.episode, self.on_screen)) + step


def flight_recorder(played: Played, current: int) -> None:
    """The table of steps, in the fragment of the slider: a chosen row is a moved slider.

    Args:
        played: On screen.
        current: The step that is chosen.
    """
    st.html(heading("Flight recorder"))
    recorded = source(played)
    steps = recorded.steps
    chosen, name = filters(recorded)
    rows = chosen.rows(steps)
    text = filter_text(chosen, len(rows), len(steps), name)
    if not len(rows):
        st.info(
            f"None of the {len(steps):,} steps is as asked; take a filter away.",
            icon=":material/filter_alt_off:",
        )
        return
    place = place_of(rows, recorded.row(current))
    page = page_of(rows, place, (played.order.key, chosen, current))
    on_page = rows[page * PAGE : (page + 1) * PAGE]
    selected = [] if place is None or place // PAGE != page else [place % PAGE]
    wanted: Any = {"selection": {"rows": selected, "columns": [], "cells": []}}
    before = st.session_state.get("recorder_table")
    jumped = st.session_state.pop("_jumped", False)
    moved = before is not None and list(before["selection"]["rows"]) != selected
    # A row of another episode stays chosen until that episode is there.
    if before is not None and not REPLAY.at_work and (jumped or moved):
        st.session_state["recorder_table"] = wanted
    st.dataframe(
        frame(recorded, on_page),
        hide_index=True,
        height="content",
        column_config=column_config(recorded),
        key="recorder_table",
        on_select=lambda: pick(recorded, on_page),
        selection_mode="single-row",
        selection_default=wanted if before is None else None,
        alt="What was recorded of each step",
    )
    with st.container(horizontal=True, vertical_alignment="center"):
        st.pagination(page_count(len(rows)), key="recorder_page", max_visible_pages=5)
        st.caption(
            f"{text[:1].upper()}{text[1:]}."
            + ("" if place is not None else f" Step {current:,} is not among them."),
            width="content",
        )
        downloads(recorded, rows, text)


def source(played: Played) -> Recorded:
    """The episode on screen, or all that it was compared over."""
    replay, comparison = played.replay, compared(played.order)
    runs = None
    if comparison is not None:
        runs = comparison_cache().get((comparison[0].key, comparison[1]))
    if comparison is not None and runs is not None and runs[0][1].steps is not None:
        several = runs[0][1]
        if switch("Steps of", "recorded", [ONE, ALL]) == ALL:
            return Recorded(replay, several, replay.order.seed - comparison[0].seed)
    return Recorded(replay, replay.main_episode, 0)


def filters(recorded: Recorded) -> tuple[StepFilter, str]:
    """The widgets that leave steps out, and what the rule they ask for is called."""
    rule_set = recorded.replay.rule_set
    rule = episode = None
    only: list[str] = []
    if rule_set is None and not recorded.several:
        return StepFilter(), ""
    with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
        name = ""
        if rule_set is not None:
            only = st.pills(
                "Only steps",
                [CHANGED, OUTSIDE],
                selection_mode="multi",
                key="only",
                bind="query-params",
                help=with_words(
                    "Outside the data: the state lies outside what was seen of a rule that the "
                    "agent's action breaks. Only rules that keep their data box can say so."
                ),
            )
            used = {
                rule_set.name_of(rule_set.rules[index]): int(index)
                for index in used_rules(recorded.steps)
            }
            picked = st.selectbox(
                "Rule",
                valid_options([EVERY_RULE, *used], "by_rule"),
                key="by_rule",
                bind="query-params",
                width=180,
                help=with_words("Those in force at some step, the most frequent first."),
            )
            rule, name = used.get(str(picked)), str(picked)
        if recorded.several:
            seeds = recorded.episodes.seeds.tolist()
            seed = st.selectbox(
                "Episode of seed",
                valid_options([EVERY_EPISODE, *map(str, seeds)], "by_episode"),
                key="by_episode",
                bind="query-params",
                width=180,
            )
            episode = seeds.index(int(seed)) if seed and seed != EVERY_EPISODE else None
    return StepFilter(CHANGED in only, OUTSIDE in only, rule, episode), name


def valid_options(options: list[str], key: str) -> list[str]:
    """Options of a select box; a choice that is none of them is let go of."""
    if st.session_state.get(key, options[0]) not in options:
        st.session_state[key] = options[0]
    return options


def page_of(rows: NDArray[np.int64], place: int | None, about: object) -> int:
    """The page to show: that of the step when it, or the filter, has changed; else the chosen one.

    Args:
        rows: That the filter lets through.
        place: Of the step among them, None if it is not.
        about: What the page was chosen for.

    Returns:
        Its number, from 0.
    """
    pages = page_count(len(rows))
    page = int(st.session_state.get("recorder_page") or 1)
    if st.session_state.get("_recorder_about") != about:
        st.session_state["_recorder_about"] = about
        if place is not None:
            page = place // PAGE + 1
    page = min(page, pages)
    if st.session_state.get("recorder_page") != page:
        st.session_state["recorder_page"] = page
    return page - 1


def pick(recorded: Recorded, on_page: NDArray[np.int64]) -> None:
    """Go to the step whose row was selected, and to its episode; the last thing a callback does."""
    places = st.session_state["recorder_table"]["selection"]["rows"]
    if not places or places[0] >= len(on_page):
        return
    row = int(on_page[places[0]])
    episode, step = int(recorded.steps.episode[row]), int(recorded.steps.step[row])
    if episode == recorded.on_screen:
        st.session_state["step"] = step
        return
    jump_to(int(recorded.episodes.seeds[episode]), step)


def coloured(recorded: Recorded) -> bool:
    """Whether actions have a colour each: where they are few, and one at a time."""
    dimensions = recorded.replay.dimensions
    return all(not one.is_interval and one.n_labels <= 24 for one in dimensions)


def frame(recorded: Recorded, rows: NDArray[np.int64]) -> Any:
    """Some rows as an Arrow table, which is what the browser is sent."""
    import pyarrow as pa

    replay = recorded.replay
    columns = recorder_columns(
        recorded.steps,
        rows,
        replay.dimensions,
        replay.features,
        replay.rule_set,
        seeds=recorded.episodes.seeds.tolist() if recorded.several else None,
    )
    if coloured(recorded):
        for name in columns:
            if name.lower().endswith(("wanted", "done")):
                columns[name] = [[action] for action in columns[name]]  # shown in its colour
    return pa.table(columns)


def column_config(recorded: Recorded) -> dict[str, Any]:
    """What the columns look like, and what they mean."""
    column = st.column_config
    replay = recorded.replay
    columns: dict[str, Any] = {
        "Seed": column.NumberColumn(format="%d", pinned=True, width=76),
        "Step": column.NumberColumn(format="%d", pinned=True, width=58),
        "Changed": column.CheckboxColumn(
            width=76, help="Whether the shield changed the agent's action"
        ),
        "Outside": column.CheckboxColumn(
            width=72,
            help="Whether the state lies outside the data of a rule that the agent's action breaks",
        ),
        "Distance": column.NumberColumn(
            format="%.3g",
            width=80,
            help="To the nearest threshold that was asked, in that feature's own unit",
        ),
        "Reward": column.NumberColumn(
            format=f"%.{digits_across(recorded.steps.reward)}g", width=70
        ),
    }
    several = len(replay.dimensions) > 1
    for dimension in replay.dimensions:
        before = f"{dimension.name}: " if several else ""
        for word, meaning in (
            ("wanted", "What the agent chose"),
            ("done", "What was executed"),
        ):
            title = f"{before}{word}"
            title = title[:1].upper() + title[1:]
            if coloured(recorded):
                labels = range(dimension.n_labels)
                names = [action_text(label, dimension) for label in labels]
                widest = 30 + 7 * max(map(len, names))
                columns[title] = column.MultiselectColumn(
                    options=names,
                    color=[chip_colour(label_colour(label)) for label in labels],
                    width=min(max(widest, 90), 190),
                    help=meaning,
                )
            else:
                columns[title] = column.TextColumn(help=meaning)
        title = f"{before}rule"
        columns[title[:1].upper() + title[1:]] = column.TextColumn(
            width=76, help="The rule in force; empty where none applies"
        )
    lived = recorded.steps.observation
    for index, feature in enumerate(replay.features):
        title = f"{feature.name} ({feature.unit})" if feature.unit else feature.name
        digits = digits_across(lived[:, index])
        columns.setdefault(title, column.NumberColumn(format=f"%.{digits}g"))
    return columns


def downloads(recorded: Recorded, rows: NDArray[np.int64], text: str) -> None:
    """What the table shows, on all its pages, as files; made when asked for."""
    replay, episodes = recorded.replay, recorded.episodes

    def record() -> RecordedSteps:
        return RecordedSteps(
            recorded.steps.take(rows),
            episodes.env_id,
            episodes.agent,
            episodes.seeds.tolist(),
            replay.features,
            replay.rule_set,
            text,
        )

    env = episodes.env_id.rsplit("/", 1)[-1].rsplit(":", 1)[-1]
    name = f"steps-{env}-{episodes.agent}-{int(episodes.seeds[recorded.on_screen])}"
    download("CSV", lambda: steps_to_csv(record()), f"{name}.csv", key="steps_csv")
    download("Parquet", lambda: steps_to_parquet(record()), f"{name}.parquet", key="steps_parquet")
