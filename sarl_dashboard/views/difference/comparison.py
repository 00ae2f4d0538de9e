"""What differs between rule sets: two closely, rules and decisions in the same states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import SarlError
from sarl_core.explaining.html.confusion import confusion_html
from sarl_core.explaining.tables.difference import KINDS, example_rows, rule_rows
from sarl_core.explaining.words.difference import decided_text, rows_text
from sarl_core.mining.editing.difference import comparable
from sarl_core.mining.editing.shared_words import in_shared_words
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.decisions import ground_of
from sarl_core.shielding.disagreement import Disagreement, disagreement, sampled_states
from sarl_dashboard.cache import cached
from sarl_dashboard.components.journey.steps_needed import say_of_sample
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import notes_notice, switch
from sarl_dashboard.components.tables import action_column, row_height, table_height
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.rule_files import fitting_demonstrations
from sarl_dashboard.text import escaped, labelled, refuse, together
from sarl_dashboard.views.difference.overview import show_overview
from sarl_dashboard.views.difference.sides import Side, chosen_sides

EVERY = "all"


@dataclass(frozen=True)
class RuleSetComparison:
    """Two rule sets, held against each other.

    Attributes:
        first: One of them.
        second: The other.
        demonstrations: On whose states they are compared; None for random ones.
        names: Of both.
    """

    first: RuleSet
    second: RuleSet
    demonstrations: Demonstrations | None
    names: tuple[str, str]

    @property
    def disagreement(self) -> Disagreement:
        """What differs."""
        return _disagreement(self.first, self.second, self.demonstrations)[0]

    @property
    def states(self) -> NDArray[np.float32]:
        """On which they are compared, shape (n, d)."""
        return _disagreement(self.first, self.second, self.demonstrations)[1]

    @property
    def noun(self) -> str:
        """What one of the states is called."""
        of = self.demonstrations
        if of is not None and len(of) < of.whole.steps:
            return "sampled state"
        return "random state" if of is None else "demonstrated state"


@st.fragment
def comparison() -> None:
    """The choices and what differs; nothing else on the page does."""
    sides = chosen_sides()
    if len(sides) < 2:
        st.info("Choose at least two rule sets to compare.", icon=":material/compare_arrows:")
        return
    try:
        show_overview(sides, _different)
        compared = _compare(*_pair(sides))
        if compared.demonstrations is not None:
            say_of_sample("The states of this page", compared.demonstrations)
        _show_states(compared)
        _show_rules(compared)
    except SarlError as error:
        refuse(error)


def _pair(sides: list[Side]) -> tuple[Side, Side]:
    """The two that are looked at closely: the first one and another."""
    others = {side.name: side for side in sides[1:]}
    name = next(iter(others))
    if len(others) > 1:
        st.header("Closely")
        label = f"{sides[0].name} against"
        with labelled(label, width=340) as label_visibility:
            name = st.selectbox(
                label,
                list(others),
                key="against",
                bind="query-params",
                width=340,
                label_visibility=label_visibility,
            )
    return sides[0], others.get(name, sides[1])


def _different(first: Side, second: Side) -> float:
    """Share of the states that two sets decide differently, in some action dimension."""
    differs = _compare(first, second, quietly=True).disagreement.differs
    return float(differs.any(axis=1).mean()) if len(differs) else 0.0


def _compare(first: Side, second: Side, *, quietly: bool = False) -> RuleSetComparison:
    names = (first.name, second.name)
    one, other, notes = in_shared_words(first.rule_set, second.rule_set)
    if not quietly:
        notes_notice(notes)
    demonstrations = chosen_demonstrations()
    if demonstrations is not None:
        demonstrations = fitting_demonstrations(one, demonstrations)
        if demonstrations is not None and fitting_demonstrations(other, demonstrations) is None:
            demonstrations = None
    return RuleSetComparison(one, other, demonstrations, names)


@cached(show_spinner="Comparing …")
def _disagreement(
    first: RuleSet, second: RuleSet, demonstrations: Demonstrations | None
) -> tuple[Disagreement, NDArray[np.float32]]:
    """The comparison, and the states."""
    second = comparable(first, second).rule_set
    states = (
        sampled_states([first, second]) if demonstrations is None else demonstrations.observations
    )
    return disagreement(ground_of(first, states), ground_of(second, states)), states


@cached(show_spinner="Writing the rules in plain language …")
def _rules_frame(compared: RuleSetComparison, kinds: tuple[str, ...]) -> Any:
    """The rules that differ, as a data frame."""
    import pandas as pd

    rows = rule_rows(compared.disagreement, kinds)
    rows["Action"] = [[action] for action in rows["Action"]]
    if "changed" not in rows["What"]:
        del rows["Change"]
    return pd.DataFrame(rows)


@cached()
def _decisions(compared: RuleSetComparison, dimension: int) -> tuple[str, Any]:
    """What the two say of the states, as a table in HTML, and some states as a data frame."""
    import pandas as pd

    names, disagreements = compared.names, compared.disagreement
    table = confusion_html(disagreements, dimension, names=names, noun=compared.noun)
    rows = example_rows(
        disagreements,
        dimension,
        compared.states,
        names=names,
        demonstrations=compared.demonstrations,
    )
    return table, pd.DataFrame(rows)


def _small(text: str) -> str:
    """Markdown as a caption has it."""
    return f":small[:gray[{text}]]"


def _headed(title: str, *paragraphs: str) -> str:
    """A heading and what stands below it, in one piece of Markdown."""
    return "\n\n".join([f"## {title}", *filter(None, paragraphs)])


def _show_rules(compared: RuleSetComparison) -> None:
    """Rules added, removed, changed."""
    disagreements = compared.disagreement
    st.markdown(
        _headed("Rules", _small(rows_text(disagreements))),
        help=with_words(
            "Rules are the same rule where they ask the same, or where they share more than "
            "half of the states that either of them applies to. A changed one has other "
            "conditions, says something else, was switched on or off, or has another place."
        ),
    )
    counts = (
        len(disagreements.difference.added),
        len(disagreements.difference.removed),
        len(disagreements.difference.changed),
    )
    if not any(counts):
        return
    view = switch(
        "Show", "kind", [EVERY, *(kind for kind, count in zip(KINDS, counts, strict=True) if count)]
    )
    kinds = KINDS if view == EVERY else (view,)
    frame = _rules_frame(compared, kinds)
    column = st.column_config
    forbidding = [rule for side in _both(disagreements) for rule in side.rules if rule.forbids]
    action, action_width = action_column(
        disagreements.first.actions, "What the rule says", forbidding
    )
    high = row_height(*_both(disagreements))
    st.dataframe(
        frame,
        hide_index=True,
        height=table_height(len(frame), 9, high),
        row_height=high,
        key="rule_changes",
        alt="Rules that differ",
        column_config={
            "What": column.TextColumn(width=75),
            "Rule": column.TextColumn(width=80),
            "Action": action,
            "When": column.TextColumn(width=(470 if "Change" in frame else 650) - action_width),
            "Change": column.TextColumn(width=240),
            "States": column.NumberColumn(
                format="localized",
                width=75,
                help="Demonstrated states to which the rule applies, of those it was mined from",
            ),
        },
    )


def _both(disagreements: Disagreement) -> tuple[RuleSet, RuleSet]:
    return disagreements.first, disagreements.second


def _show_states(compared: RuleSetComparison) -> None:
    """The states that are decided differently."""
    disagreements = compared.disagreement
    random = (
        f"The states are {counted(disagreements.states, 'random one')} over the range of the "
        "rules' thresholds, because the chosen demonstrations are of something else. They say "
        "where the two differ, not how often an agent comes there."
    )
    st.markdown(
        _headed(
            "Decisions",
            f"**{escaped(together(decided_text(disagreements, states=compared.noun)))}**",
            _small(random) if compared.demonstrations is None else "",
        )
    )
    actions = disagreements.first.actions
    dimension = 0
    if len(actions) > 1:
        labels = [action.name for action in actions]
        most = labels[int(disagreements.differs.sum(axis=0).argmax())]
        name = st.selectbox(
            "Action", labels, labels.index(most), key="decided", bind="query-params", width=340
        )
        dimension = labels.index(name)
    table, examples = _decisions(compared, dimension)
    with st.container(key="confusion"):
        st.html(table)
    count = len(examples)
    if not count:
        return
    several = int(disagreements.differs[:, dimension].sum())
    st.markdown(
        _headed(
            "Example states",
            _small(f"{count} of {several:,}, evenly spread.") if several > count else "",
        )
    )
    st.dataframe(
        examples,
        hide_index=True,
        height=table_height(count, 9),
        key="examples",
        alt="States that the two decide differently",
    )
