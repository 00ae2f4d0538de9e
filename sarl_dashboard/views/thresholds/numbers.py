"""The numbers of the rule set in force."""

from __future__ import annotations

from typing import Any

import streamlit as st

from sarl_core.explaining.words.cross_fit import elsewhere_text
from sarl_core.explaining.words.growth import LEARNERS, learner_text
from sarl_core.mining.evidence import HeldOut
from sarl_core.mining.language import share_text, threshold_text
from sarl_core.mining.never.landscape import NeverLandscape
from sarl_core.mining.thresholds.landscape import Landscape
from sarl_core.mining.tree import PolicyTree
from sarl_core.mining.validation.cross_fitting import Judged
from sarl_dashboard.components.journey.words import with_words, word_help
from sarl_dashboard.state.thresholds import least_support

_UNBROKEN = "Here: in which it kept to all that apply."
_ELSEWHERE = "Elsewhere: in an episode that the rules were not mined from, on average."


def show_numbers(
    point: Landscape | NeverLandscape, judged: Judged | None, tree: PolicyTree | None
) -> None:
    """The four numbers of the rule set in force, and what two of them are in other episodes.

    Args:
        point: A landscape of one point.
        judged: The same rules in episodes that they were not mined from; None where not known.
        tree: One of those that are cut, to say what grew it; None for other rules.
    """
    forbids = isinstance(point, NeverLandscape)
    rules = int(point.rule_count[0, 0])
    with st.container(horizontal=True, key="metrics"):
        st.metric("Rules", f"{rules:,}", help=word_help("rule"))
        st.metric(
            "Mean length",
            f"{point.mean_length[0, 0]:.1f}" if rules else "–",
            help=word_help("length of a rule", "Here: on average."),
        )
        st.metric(
            "Coverage",
            share_text(float(point.coverage[0, 0]), decimals=1),
            help=word_help("coverage", "" if forbids else _ELSEWHERE),
            **elsewhere(None if judged is None else judged.coverage),
        )
        st.metric(
            "Fidelity",
            share_text(float(point.fidelity[0, 0]), decimals=1),
            help=word_help("fidelity", _UNBROKEN if forbids else _ELSEWHERE),
            **elsewhere(None if judged is None else judged.fidelity),
        )
        if isinstance(point, NeverLandscape):
            st.metric(
                "Freedom",
                share_text(float(point.freedom[0, 0]), decimals=1),
                help=word_help("freedom", "Here: over the demonstrated states."),
            )
        elif point.held_out_fidelity is not None:
            st.metric(
                "Held-out fidelity",
                share_text(float(point.held_out_fidelity[0, 0]), decimals=1),
                help=with_words(
                    "The same on the episodes held out, which no rule was mined from; on average, "
                    "so that each episode counts once"
                ),
            )
        if tree is not None:
            st.caption(
                f"Learner: {LEARNERS[tree.learner].lower()}",
                width="content",
                help=with_words(f"{learner_text(tree.learner).capitalize()}."),
            )
    if least_support():
        st.caption(
            f":material/info: The trees of this file reach down to a support of "
            f"{threshold_text(least_support())}; rules of fewer states are not among them."
        )


def elsewhere(share: HeldOut | None) -> dict[str, Any]:
    """A number in episodes that the rules were not mined from, to stand under the other."""
    if share is None:
        return {}
    return {
        "delta": f"elsewhere {elsewhere_text(share)}",
        "delta_color": "off",
        "delta_arrow": "off",
    }
