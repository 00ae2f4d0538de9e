"""How many episodes are held out, and which: the widgets on the page Evidence."""

from __future__ import annotations

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.samples import needs_steps_text
from sarl_core.mining.language import counted
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.state import hold_out
from sarl_dashboard.state.mined import episodes_tried_on
from sarl_dashboard.text import in_full


def _share_text(share: str) -> str:
    """A share on the slider."""
    return "nothing" if share == hold_out.NOTHING else f"{100 * float(share):.0f} %"


def hold_out_choice(whole: Demonstrations) -> None:
    """How many episodes are held out, and which."""
    if whole.sample_of is not None:
        _say_settled(whole)
        return
    choice, parts = hold_out.chosen(), hold_out.parted(whole)
    # The widgets follow the URL, so a link and the browser's "back" both reach them. Only where
    # they differ: a value that is set takes back what a hand is moving just then.
    for key, value in (
        ("_holdout_choice", f"{choice.share:g}"),
        ("_holdout_seed_choice", choice.seed),
    ):
        if st.session_state.get(key) != value:
            st.session_state[key] = value
    with st.container(horizontal=True, vertical_alignment="bottom", gap="medium"):
        st.select_slider(
            "Share of the episodes held out",
            hold_out.SHARES,
            format_func=_share_text,
            key="_holdout_choice",
            on_change=lambda: hold_out.choose_share(st.session_state["_holdout_choice"]),
            width=380,
            help=with_words(
                "Rules are mined from the other episodes and tried on these. Whole episodes, "
                "because the steps within one are alike."
            ),
        )
        st.number_input(
            "Seed",
            0,
            hold_out.MOST_SEED,
            key="_holdout_seed_choice",
            on_change=lambda: hold_out.choose_seed(
                int(st.session_state["_holdout_seed_choice"] or 0)
            ),
            width=120,
            help=with_words("Another one draws other episodes."),
        )
    if parts.problem:
        st.warning(in_full(parts.problem), icon=":material/warning:")
    if parts.held_out is None:
        st.caption(
            "Nothing is held out, so the dots below are of what the rules were mined from. They "
            "flatter: each rule was chosen for being right there."
        )
        return
    numbers = parts.held_out.episodes[parts.held_out.episode_starts].tolist()
    named = ", ".join(map(str, numbers[:20])) + (" …" if len(numbers) > 20 else "")
    st.caption(
        f"{counted(len(numbers), 'episode')} of {parts.remaining.n_episodes:,} held out, with "
        f"{counted(len(parts.held_out), 'step')}: {named}. Every page mines from the others."
    )


def _say_settled(sample: Demonstrations) -> None:
    """What was held out when a mined file was made; that is not chosen here."""
    held_out, episodes = episodes_tried_on()
    if not held_out:
        st.caption(
            "Nothing was held out when these steps were mined, so the dots below are of what the "
            "rules were mined from. They flatter: each rule was chosen for being right there. "
            + in_full(needs_steps_text("holding episodes out", sample))
        )
        return
    st.caption(
        f"{counted(held_out, 'episode')} of {episodes:,} were held out when these steps were "
        "mined, and counted at every rule. Holding out others needs the demonstrations themselves."
    )
