"""Where a page plays episodes and there is nothing to play them in: what to do, before any form."""

from __future__ import annotations

from typing import Any

import streamlit as st

from sarl_core.environments.description import describe_environment
from sarl_core.errors import SarlError
from sarl_dashboard.components.run_bar import bars_at_work
from sarl_dashboard.components.settings import environment_choice
from sarl_dashboard.jobs.job import Place
from sarl_dashboard.session import end_page
from sarl_dashboard.state.data import require_demonstrations, uncombined_demonstrations
from sarl_dashboard.state.environments import AS_DEMONSTRATED, environment_of
from sarl_dashboard.text import escaped, in_full, refuse


def require_environment(*places: Place[Any]) -> None:
    """Go on where there is an environment to play in; else ask for one, and end the page.

    What was typed, or came with a link, is refused as an error. Demonstrations without an
    environment are none: most tasks have no simulator.

    Args:
        *places: Of the page's work. What goes on can be called off, whatever was chosen since.
    """
    choice = st.session_state.get("env") or st.query_params.get("env") or AS_DEMONSTRATED
    problem = _problem(choice)
    if problem is None:
        return
    bars_at_work(*places)
    if choice == AS_DEMONSTRATED:
        _say_missing(
            problem,
            "nothing can be played: choose one below, or hold the rules against a log on the page "
            "Audit, which needs none",
        )
    else:
        refuse(problem)
    with st.container(border=True):
        environment_choice()
    st.page_link("audit.py", label="Go to Audit", icon=":material/arrow_forward:")
    end_page()


def require_own_environment() -> None:
    """The same on a page that takes that of the demonstrations and no other."""
    problem = _problem(AS_DEMONSTRATED)
    if problem is None:
        return
    _say_missing(
        problem,
        "no agent can learn: give one where the file is uploaded, on the page Demonstrations, or "
        "choose other demonstrations in the sidebar",
    )
    st.page_link("demonstrations.py", label="Go to Demonstrations", icon=":material/arrow_forward:")
    end_page()


def _problem(choice: str) -> SarlError | None:
    """Why an environment cannot be played; None where it can."""
    try:
        describe_environment(environment_of(choice))
    except SarlError as error:
        return error
    return None


def _say_missing(problem: SarlError, consequence: str) -> None:
    """What the demonstrations lack, and what can be done; where they lack nothing, the reason."""
    demonstrations = uncombined_demonstrations()
    if demonstrations is None:
        require_demonstrations()  # says what to do, and ends the page
        return
    env_id = demonstrations.env_id
    lacking = (
        f"The environment of these demonstrations, {escaped(env_id)}, is not to be had here"
        if env_id
        else "These demonstrations name no environment"
    )
    st.info(f"{lacking}, so {consequence}.", icon=":material/travel_explore:")
    if env_id:
        st.caption(in_full(str(problem)))
