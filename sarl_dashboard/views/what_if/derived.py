"""What is worked out from the state on the page What if, beside its sliders."""

from __future__ import annotations

from typing import Any

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.demonstrations.derived import extend
from sarl_core.environments.formulas import Formula
from sarl_core.explaining.html.step_card import state_table
from sarl_core.explaining.words.replay import state_values
from sarl_core.explaining.words.what_if import by_use
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.cache import cached
from sarl_dashboard.views.what_if.situation import Situation

_FIRST = 8  # that are not folded away


def derived_values(situation: Situation, state: NDArray[np.float32], action: Any) -> None:
    """The present values of what rules derive from the state; nothing where they derive nothing.

    Args:
        situation: The rules.
        state: What was observed, shape (d,).
        action: What the agent wants.
    """
    rule_set = situation.rules.rule_set
    order = _order(rule_set)
    if not order:
        return
    features = rule_set.source.features
    decision = situation.neighbourhood.shield.decide(state, action)
    asking = [rule_set.rules[place] for place in decision.rules if place is not None]
    values = state_values(extend(state[None], features)[0], features, asking)
    rows = [(features[at].name, values[at], features[at].unit) for at in order]
    st.markdown("**Worked out from it**")
    with st.container(key="derived"):
        st.html(state_table(rows[:_FIRST]))
    if rows[_FIRST:]:
        with st.expander(
            counted(len(rows) - _FIRST, "more feature"), icon=":material/unfold_more:"
        ):
            st.html(state_table(rows[_FIRST:]))


@cached()
def _order(rule_set: RuleSet) -> tuple[int, ...]:
    """Formulas, and combinations that a rule asks about; those first that most ask about."""
    features = rule_set.source.features
    queried = {bounds.feature for rule in rule_set.rules for bounds in rule.bounds}
    return tuple(
        at
        for at in by_use(rule_set)
        if isinstance(features[at].derived, Formula)
        or (features[at].derived is not None and at in queried)
    )
