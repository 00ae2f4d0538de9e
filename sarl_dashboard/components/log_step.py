"""One step of a log under the rules: what was done, which rule applied, its path, and What if."""

from __future__ import annotations

import streamlit as st

from sarl_core.auditing.audit import Audit
from sarl_core.demonstrations.dataset import observed_features
from sarl_core.explaining.figures.audit import step_texts
from sarl_core.explaining.html.lit_path import lit_paths_html
from sarl_core.explaining.state_path import PathFinder
from sarl_core.mining.language import sentence
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.sampling import feature_spans, within
from sarl_dashboard.cache import cached
from sarl_dashboard.state import in_force
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.rule_files import fitting_demonstrations
from sarl_dashboard.text import escaped


def show_step(held: Audit, row: int, choice: str) -> None:
    """One step, its rules, and ways to the pages Rules and What if.

    Args:
        held: The rules against the log.
        row: Of the log.
        choice: Where the rules were chosen from.
    """
    assert held.log.steps is not None
    state = held.observations[row]
    with st.container(border=True):
        st.markdown(
            f"**Step {held.log.steps[row]} of episode {held.log.episodes[row]}.** "
            + escaped(step_texts(held, slice(row, row + 1))[0].split(": ", 1)[1])
            + (" – **broken**" if held.is_broken[row] else "")
            + (", outside the data of the rule" if held.outside[row] else "")
        )
        for place in dict.fromkeys(held.rules[row].tolist()):
            if place < 0:
                continue
            rule = held.rule_set[place]
            st.markdown(
                f"**{held.rule_set.name_of(rule)}.** {escaped(sentence(rule, held.rule_set))}"
            )
            address = in_force.address_of(choice)
            if address is not None:
                st.page_link(
                    "rules.py",
                    label=f"Open {held.rule_set.name_of(rule)}",
                    icon=":material/rule:",
                    query_params={**address, "rule": rule.id},
                )
        for table in lit_paths_html(_finder(held.rule_set), state, held.rules[row]):
            st.html(table)
        _link_what_if(held, row, choice)


def _link_what_if(held: Audit, row: int, choice: str) -> None:
    """A way to this state on the page What if, where that page asks about the same features."""
    demonstrations = chosen_demonstrations()
    if demonstrations is None or fitting_demonstrations(held.rule_set, demonstrations) is None:
        return
    names = [feature.name for feature in observed_features(held.rule_set.source.features)]
    if names != [feature.name for feature in demonstrations.observed]:
        return
    # Its sliders reach as far as what was demonstrated, and derive the rest.
    state = held.observations[row, : len(names)]
    state = within(state, feature_spans(demonstrations.raw_observations))
    values = {f"x{index}": repr(float(value)) for index, value in enumerate(state.tolist())}
    chosen = in_force.address_of(choice) or {}
    st.page_link(
        "what_if.py",
        label="What if, with this state",
        icon=":material/help_center:",
        query_params={**st.query_params.to_dict(), **chosen, **values},
    )


@cached()
def _finder(rule_set: RuleSet) -> PathFinder:
    return PathFinder(rule_set)
