"""Which episodes are held out: parting_lines, and chosen."""

from __future__ import annotations

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.language import counted
from sarl_dashboard.state.data import mined_data
from sarl_dashboard.state.hold_out import chosen, leave_out, parted
from sarl_dashboard.text import in_full


def parting_lines(demonstrations: Demonstrations) -> list[str]:
    """What is in force, for the sidebar.

    Args:
        demonstrations: All there are.

    Returns:
        Lines; none where nothing is left out or held out.
    """
    mined = mined_data()
    if mined is not None:
        episodes = mined.held_out_episodes
        return [f"**{counted(episodes, 'episode')}** held out"] if episodes else []
    parts = parted(demonstrations)
    lines = []
    held = parts.held_out.n_episodes if parts.held_out is not None else 0
    left_out = demonstrations.n_episodes - parts.mined.n_episodes - held
    if left_out:
        lines.append(f"**{counted(left_out, 'episode')}** left out")
    if held:
        lines.append(f"**{counted(held, 'episode')}** held out")
    return lines


def leave_out_choice(demonstrations: Demonstrations) -> None:
    """The widget that leaves episodes out.

    Args:
        demonstrations: All there are.
    """
    episodes = demonstrations.episodes[demonstrations.episode_starts].tolist()
    excluded = set(chosen().left_out)
    # The widget follows the URL, so a link and the browser's "back" both reach it.
    st.session_state["_left_out_choice"] = [episode for episode in episodes if episode in excluded]
    st.multiselect(
        "Episodes left out",
        episodes,
        key="_left_out_choice",
        format_func=lambda episode: f"episode {episode}",
        placeholder="none: choose one, and every page follows",
        on_change=lambda: leave_out(tuple(st.session_state["_left_out_choice"])),
    )
    problem = parted(demonstrations).problem
    if problem:
        st.warning(in_full(problem), icon=":material/warning:")
