"""The first run: Lunar Lander in five steps, each on its page, with what to do there."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_dashboard.state.data import DEFAULT_DATA
from sarl_dashboard.state.rule_files import FEWEST
from sarl_dashboard.state.thresholds import THRESHOLDS
from sarl_dashboard.state.url import set_url_choice, url_choice

_STEP, _DONE = "first_run", "done"
_TASK = {"data": DEFAULT_DATA}
_SLIDERS = {**_TASK, "set": THRESHOLDS}
_SIX_RULES = {**_TASK, "set": FEWEST}
_USUAL = _SLIDERS
_ON = ":material/east:"


@dataclass(frozen=True)
class FirstStep:
    """One of the five.

    Attributes:
        page: Title of the page.
        file: Of the page.
        what: What one sees there.
        task: What to look at, and to do.
        query: What is chosen.
    """

    page: str
    file: str
    what: str
    task: str
    query: dict[str, str]


STEPS = (
    FirstStep(
        "Demonstrations",
        "demonstrations.py",
        "what an expert did",
        "An expert landed a small spacecraft again and again. At every moment its state was "
        "written down (where it was, how fast, how tilted), and which engine it fired. Look at how "
        "often it used each engine; there is nothing to set.",
        _SLIDERS,
    ),
    FirstStep(
        "Thresholds",
        "thresholds.py",
        "how many rules, and how good",
        "From these moments rules are found. Move **Minimum support** to the right: only rules "
        "that apply often are left, so the number **Rules** falls. **Fidelity** says how often the "
        "expert did what they say.",
        _SLIDERS,
    ),
    FirstStep(
        "Rules",
        "rules.py",
        "six rules in words",
        "These six rules come with the data; they were built to be as few as possible, and may ask "
        "about two numbers together. Choose one in the table and read its sentence.",
        _SIX_RULES,
    ),
    FirstStep(
        "What if",
        "what_if.py",
        "what the rules do in one state",
        "Move one of the sliders, the angle for one, and see which rule decides now, and how "
        "little would have to change for another one to decide.",
        _SIX_RULES,
    ),
    FirstStep(
        "Replay",
        "replay.py",
        "the rules at work",
        "Press **Run**. On the left the six rules correct an agent that acts at random; on the "
        "right nobody does. They were learned from examples and guarantee nothing: try other "
        "seeds, and on the page Measure many episodes at once.",
        {**_SIX_RULES, "rules": FEWEST},
    ),
)


def take_up() -> None:
    """Let the URL say where the first run is, so that it goes on after a reload (URL: first_run).

    Before the URL is written, that every page and link of the run has it at once.
    """
    url_choice(_STEP, ["", *(str(number + 1) for number in range(len(STEPS))), _DONE], "")


def step_at_hand() -> int | None:
    """Which step is next, from 0; None where there is no first run under way."""
    number = st.session_state.get(f"_{_STEP}")
    return int(number) - 1 if number and number != _DONE else None


def first_run_done() -> bool:
    """Whether it was gone through to the end."""
    return bool(st.session_state.get(f"_{_STEP}") == _DONE)


def link_to_step(number: int, label: str, icon: str, *, key: str) -> None:
    """A link to a step: the browser goes there in one step, and back in one.

    An address that says what goes without saying is written anew and is one more to go back to, so
    the link says what is chosen there but for what is chosen anyway.

    Args:
        number: Of the step, from 0.
        label: What stands on it.
        icon: Before that.
        key: Of its place; where it ends in "_on" it looks like the button to press next.
    """
    step = STEPS[number]
    now = {name: st.session_state.get(f"_{name}", usual) for name, usual in _USUAL.items()}
    said = {
        name: value
        for name, value in step.query.items()
        if not value == _USUAL.get(name) == now.get(name)
    }
    with st.container(key=key, width="content"):
        st.page_link(
            step.file, label=label, icon=icon, query_params={**said, _STEP: str(number + 1)}
        )


def _end() -> None:
    set_url_choice(_STEP, "")


def show_first_run(page: str) -> None:
    """What to do on this page, or where the run goes on; nothing where none is under way.

    Args:
        page: Title of the page.
    """
    number = step_at_hand()
    if number is None or page == "Overview":
        return
    step = STEPS[number]
    last = number == len(STEPS) - 1
    with st.container(border=True, key="first_run"):
        here = f"**First run, step {number + 1} of {len(STEPS)}: {step.what}.**"
        st.markdown(f"{here} {step.task}" if page == step.page else here)
        with st.container(horizontal=True, vertical_alignment="center", gap="small"):
            if page != step.page:
                link_to_step(number, f"Go on with {step.page}", _ON, key="first_run_on")
            elif last:
                # A link: had the server changed the page, a part of this one that asks to be drawn
                # again and again could ask for it once more, and the next page would be emptied.
                with st.container(key="first_run_on", width="content"):
                    st.page_link(
                        "overview.py",
                        label="Done",
                        icon=":material/check:",
                        query_params={_STEP: _DONE},
                    )
            else:
                after = STEPS[number + 1].page
                link_to_step(number + 1, f"Next: {after}", _ON, key="first_run_on")
            if page == step.page and number:
                link_to_step(number - 1, "Back", ":material/west:", key="first_run_back")
            st.button("End the first run", key="first_run_end", type="tertiary", on_click=_end)
