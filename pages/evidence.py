"""Evidence: how sure each rule is, and whether the demonstrations are enough and agree."""

from __future__ import annotations

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.html.headings import note
from sarl_core.explaining.words.cross_fit import influence_sentences
from sarl_core.mining.language import counted
from sarl_dashboard.components.hold_out import leave_out_choice
from sarl_dashboard.jobs import cross_fitting
from sarl_dashboard.state import compact_set, hold_out
from sarl_dashboard.state.data import all_demonstrations, require_demonstrations
from sarl_dashboard.text import in_full
from sarl_dashboard.views.evidence.contradictions import show_contradictions
from sarl_dashboard.views.evidence.sections import (
    Evidence,
    show_curve,
    show_enough,
    show_overview,
    show_stability,
)

ENOUGH, CURVE, STABILITY = "Enough demonstrations?", "Learning curve", "Stability"
CONTRADICTIONS, LEFT_OUT = "Contradictions", "Leave episodes out"


def share_text(share: str) -> str:
    """A share on the slider."""
    return "nothing" if share == hold_out.NOTHING else f"{100 * float(share):.0f} %"


def hold_out_choice(whole: Demonstrations) -> None:
    """How many episodes are held out, and which."""
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
            format_func=share_text,
            key="_holdout_choice",
            on_change=lambda: hold_out.choose_share(st.session_state["_holdout_choice"]),
            width=380,
            help="Rules are mined from the other episodes and tried on these. Whole episodes, "
            "because the steps within one are alike.",
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
require_demonstrations()
demonstrations = all_demonstrations()
assert demonstrations is not None
hold_out_choice(demonstrations)
if compact_set.in_force():
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
    cross_fitting.told(
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
        leave_out_choice(demonstrations)
elif evidence.rule_set.rules:
    with enough:
        show_enough(evidence)
cross_fitting.make_ready()
