"""The steps of a replay, one by one."""

from __future__ import annotations

import contextlib

import numpy as np
import streamlit as st
from markupsafe import Markup
from streamlit.errors import StreamlitAPIException

from sarl_core.explaining.figures.replay import (
    SHIELDED_COLOUR,
    UNSHIELDED_COLOUR,
    ReturnLine,
    Timeline,
    intervention_strip,
    return_figure,
    tracks,
)
from sarl_core.explaining.html.headings import aside
from sarl_core.explaining.html.lit_path import lit_paths_html
from sarl_core.explaining.html.step_card import picture, step_card
from sarl_core.explaining.words.leeway import left_text
from sarl_core.explaining.words.replay import StepView, step_texts, step_view
from sarl_core.mining.language import counted, number_text
from sarl_core.rollouts.episodes import Episodes
from sarl_core.shielding.leeway import labels_left
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.flips import pace_of_played
from sarl_dashboard.components.timeline import clicked_step, mark_at, mark_room, show_legend
from sarl_dashboard.jobs.replays import ALONE, WITH, WITHOUT, Played, ReplayPair
from sarl_dashboard.state import in_force
from sarl_dashboard.views.replay.fork import fork_section
from sarl_dashboard.views.replay.player import film_at
from sarl_dashboard.views.replay.recorder import flight_recorder


def pick_step() -> None:
    """Go to the step that was clicked in the strip; for a callback, and the last thing it does."""
    look_at(clicked_step("strip"))


def look_at(step: int | None) -> None:
    """Go to a step that was chosen outside the fragment of the slider.

    That fragment finds the step as it begins: what a callback writes to a slider does not reach
    the browser when it asks for another run.

    Args:
        step: None where there is none to go to.
    """
    if step is not None:
        st.session_state["_step"] = step
        # A click in a picture that is about to go finds no fragment: then the page runs as a whole.
        with contextlib.suppress(StreamlitAPIException):
            st.rerun("at_step")


def go_to(step: int) -> None:
    """Go to a step; for buttons beside the slider."""
    st.session_state["step"] = step


def step_by_step(played: Played) -> None:
    """The strip and the return so far, and everything about the step that is looked at.

    The figures hold all steps already, so that only the mark over them moves with the slider.
    """
    replay = played.replay
    steps, shielded = replay.steps, replay.shielded is not None
    st.header("Step by step")
    show_legend(replay.dimensions, marks="changed by the rules" if shielded else "")
    plain = replay.plain.steps
    assert plain is not None  # a replay records them
    rows = tracks(steps, replay.dimensions, shielded=shielded)
    lines = [
        ReturnLine(
            WITHOUT if shielded else ALONE,
            np.cumsum(plain.reward),
            UNSHIELDED_COLOUR,
        )
    ]
    if shielded:
        lines.insert(0, ReturnLine(WITH, np.cumsum(steps.reward), SHIELDED_COLOUR))
    timeline = Timeline.of(rows, max(len(line.returns) for line in lines))
    st.html(mark_room(timeline))
    with st.container(key="timeline", gap="xxsmall"):
        st.plotly_chart(
            intervention_strip(
                rows, step_texts(steps, replay.dimensions, replay.rule_set), timeline
            ),
            key="strip",
            on_select=pick_step,
            selection_mode="points",
            config={"displayModeBar": False},
            alt="What the agent wanted, what was done, and where the two differ, step by step",
        )
        chart(return_figure(lines, timeline), "return", "Return so far, step by step")
    at_step(played, timeline)


@st.fragment(key="at_step")
def at_step(played: Played, timeline: Timeline) -> None:
    """The slider, and the step it stands at.

    Args:
        played: To show.
        timeline: Of the figures above.
    """
    replay = played.replay
    steps, shielded = replay.steps, replay.shielded is not None
    # Under which set the Rules page has these rules.
    linked = in_force.address_of(replay.order.rules)
    last = len(steps) - 1
    if "_step" in st.session_state:
        st.session_state["step"] = st.session_state.pop("_step")
    step_before = st.session_state.get("step")
    if step_before is not None and not 0 <= step_before <= last:
        st.session_state["step"] = min(max(step_before, 0), last)
    current = 0
    if last > 0:
        current = int(st.slider("Step", 0, last, key="step", bind="query-params"))
    mark = mark_at(timeline, current)
    if shielded:
        changes(replay, current, mark)
    else:
        st.html(mark)
        film_at(replay.name, current)
    view = step_view(steps, current, replay.dimensions, replay.features, replay.rule_set)
    pictures, words = st.columns([3, 2], gap="medium")
    with pictures:
        ways: list[tuple[str, Markup]] = []
        if replay.finder is not None:
            tables = lit_paths_html(replay.finder, steps.observation[current], steps.rules[current])
            many = len(tables) > 1
            names = [action.dimension if many else "" for action in view.actions]
            ways = list(zip(names, tables, strict=True))
        st.html(picture(replay.png(current), f"The environment at step {current}", ways))
    with words:
        st.html(step_card(view, shielded=shielded, left=left_texts(replay, current)))
        if linked is not None:
            link_rules(view, linked)
    if shielded:
        fork_section(played, current)
    flight_recorder(played, current)
    # The pictures beside it are made while nobody waits for them.
    for step in (current + 1, current - 1):
        if 0 <= step <= last:
            replay.png(step)


def left_texts(replay: ReplayPair, step: int) -> list[str]:
    """Of each action dimension what never-rules forbid at a step, and leave; "" for nothing."""
    shield, steps = replay.shield, replay.steps
    if shield is None or not shield.rule_set.forbids or steps.invalid[step] is not None:
        return []
    state = steps.observation[step]
    each = [labels_left(shield, state, place) for place in range(len(replay.dimensions))]
    return [
        "" if left is None else left_text(left, shield.rule_set, place)
        for place, left in enumerate(each)
    ]


def changes(replay: ReplayPair, current: int, mark: Markup) -> None:
    """Ways to the changes before and after a step, and how many there are.

    Args:
        replay: To show.
        current: The step.
        mark: Style that puts the mark over the figures; in one piece with the text.
    """
    changed = np.flatnonzero(replay.steps.intervened)
    before, after = changed[changed < current], changed[changed > current]
    with st.container(horizontal=True, vertical_alignment="center"):
        st.button(
            "Previous change",
            icon=":material/skip_previous:",
            on_click=go_to,
            args=(int(before[-1]) if len(before) else current,),
            disabled=not len(before),
            key="previous",
        )
        st.button(
            "Next change",
            icon=":material/skip_next:",
            on_click=go_to,
            args=(int(after[0]) if len(after) else current,),
            disabled=not len(after),
            key="next",
        )
        count = f"{len(changed):,} of {len(replay.steps):,} steps were changed."
        st.html(mark + aside(f"{count} {flips_text(replay.main_episode)}"))
        film_at(replay.name, current)


def flips_text(episodes: Episodes) -> str:
    """How often the shield switched on and off in some episodes, as a sentence."""
    flips = int(episodes.flips.sum()) if episodes.flips is not None else 0
    pace = pace_of_played(episodes.env_id)
    rate = pace.rate(flips, int(episodes.lengths.sum()))
    return (
        f"The shield switched on or off {counted(flips, 'time')}: {number_text(rate)} {pace.each}."
        if flips
        else "The shield never switched on or off."
    )


def link_rules(view: StepView, linked: dict[str, str]) -> None:
    """A way to each rule in force, on the Rules page under the set that is shown there."""
    names = {action.rule_id: action.rule_name for action in view.actions if action.rule}
    for rule_id, name in names.items():
        st.page_link(
            "rules.py",
            label="Open this rule" if len(names) == 1 else f"Open {name}",
            icon=":material/rule:",
            query_params={**st.query_params.to_dict(), **linked, "rule": rule_id},
        )
