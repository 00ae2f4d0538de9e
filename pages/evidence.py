"""Evidence: how sure each rule is, and whether the demonstrations are enough and agree."""

from __future__ import annotations

import _compact
import _elsewhere
import _hold_out
import _state as state
import streamlit as st
from _contradictions_view import show_contradictions
from _evidence_view import (
    Evidence,
    show_curve,
    show_enough,
    show_overview,
    show_stability,
)
from _words import in_full

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.cross_fit_words import influence_sentences
from sarl_core.explaining.language import counted
from sarl_core.explaining.prose import note

ENOUGH, CURVE, STABILITY = "Enough demonstrations?", "Learning curve", "Stability"
CONTRADICTIONS, LEFT_OUT = "Contradictions", "Leave episodes out"


def share_text(share: str) -> str:
    """A share on the slider."""
    return "nothing" if share == _hold_out.NOTHING else f"{100 * float(share):.0f} %"


def hold_out_choice(whole: Demonstrations) -> None:
    """How many episodes are held out, and which."""
    choice, parts = _hold_out.chosen(), _hold_out.parted(whole)
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
            _hold_out.SHARES,
            format_func=share_text,
            key="_holdout_choice",
            on_change=lambda: _hold_out.choose_share(st.session_state["_holdout_choice"]),
            width=380,
            help="Rules are mined from the other episodes and tried on these. Whole episodes, "
            "because the steps within one are alike.",
        )
        st.number_input(
            "Seed",
            0,
            _hold_out.MOST_SEED,
            key="_holdout_seed_choice",
            on_change=lambda: _hold_out.choose_seed(
                int(st.session_state["_holdout_seed_choice"] or 0)
            ),
            width=120,
            help="Another one draws other episodes.",
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


st.title("Evidence")
st.caption(
    "How sure each rule is: how often it was right, and in how many episodes that it was not mined "
    "from. Each episode counts once, because its steps are alike."
)
state.require_demonstrations()
demonstrations = state.all_demonstrations()
assert demonstrations is not None
hold_out_choice(demonstrations)
if _compact.in_force():
    st.info(
        "The compact rules were built from other states, the held-out ones perhaps among them, so "
        "they cannot be tried here. This page is about the rules at the thresholds.",
        icon=":material/info:",
    )
evidence = Evidence()
if not evidence.rule_set.rules:
    st.info(
        "There is no rule at the present thresholds. Lower one of them on the Thresholds page, "
        "whose maps show where there are rules.",
        icon=":material/filter_alt_off:",
    )
    st.page_link("thresholds.py", label="Go to Thresholds", icon=":material/arrow_forward:")
else:
    show_overview(evidence)
    _elsewhere.told(
        evidence.thresholds,
        evidence.rule_set.fidelity,
        lambda judged: "".join(map(note, influence_sentences(judged))),
    )
enough, curve, stability, contradictions, left_out = st.tabs(
    [ENOUGH, CURVE, STABILITY, CONTRADICTIONS, LEFT_OUT],
    key="about",
    on_change="rerun",
    bind="query-params",
)
if curve.open:
    with curve:
        show_curve(evidence)
elif stability.open:
    with stability:
        show_stability(evidence)
elif contradictions.open:
    with contradictions:
        show_contradictions(evidence.parts.remaining, evidence.rule_set)
elif left_out.open:
    with left_out:
        st.caption(
            "Episodes that are left out are there for nothing: rules are neither mined from them "
            "nor tried on them, on any page. The file stays as it is."
        )
        _hold_out.leave_out_choice(demonstrations)
elif evidence.rule_set.rules:
    with enough:
        show_enough(evidence)
_elsewhere.make_ready()
