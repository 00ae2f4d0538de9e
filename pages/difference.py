"""Difference: two rule sets side by side, their rules and the states they decide differently."""

from __future__ import annotations

from typing import Any

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.explaining.html.confusion import confusion_html
from sarl_core.explaining.tables.difference import KINDS, example_rows, rule_rows
from sarl_core.explaining.words.difference import decided_text, rows_text
from sarl_core.mining.editing.difference import comparable
from sarl_core.mining.language import counted
from sarl_core.mining.rule_order import fits
from sarl_core.mining.rules import RuleSet
from sarl_core.shielding.deciding import ground_of
from sarl_core.shielding.disagreement import Disagreement, disagreement, sampled_states
from sarl_dashboard.cache import cached
from sarl_dashboard.components.settings import offered_rule_sets
from sarl_dashboard.components.tables import action_column, table_height
from sarl_dashboard.state import edits
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.rule_choice import EDITED, rules_for
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT, OWN_FILE, PAPERS
from sarl_dashboard.text import escaped, in_full, together

UNEDITED = "before the edits"
EVERY = "all"
SIDES = (("first", "First set", CHOSEN), ("second", "Second set", "unfiltered"))


def options() -> list[str]:
    """The rule sets that can be had."""
    offered = offered_rule_sets([CHOSEN, *PAPERS, COMPACT, EDITED, OWN_FILE])
    if EDITED in offered:
        offered.insert(offered.index(EDITED), UNEDITED)
    return offered


def side(key: str, label: str, default: str) -> tuple[RuleSet, str, str]:
    """One of the two sets, what tells it from others, and its name.

    Raises:
        InputError: If it cannot be had.
    """
    offered = options()
    choice = st.selectbox(label, offered, offered.index(default), key=key, bind="query-params")
    file = None
    if choice == OWN_FILE:
        file = st.file_uploader("Rule file (.json)", key=f"{key}_file")
    if choice == UNEDITED:
        of = edits.base()
        return of.rule_set, of.digest, choice
    rule_set, digest = rules_for(choice, file)
    assert rule_set is not None
    return rule_set, digest, file.name if file is not None else choice


@cached(show_spinner="Comparing …")
def compared(
    digests: tuple[str, str, str], _first: RuleSet, _second: RuleSet, _demonstrations: Any
) -> tuple[Disagreement, Any]:
    """The comparison, and the states."""
    _second = comparable(_first, _second).rule_set
    states = (
        sampled_states([_first, _second])
        if _demonstrations is None
        else _demonstrations.observations
    )
    return disagreement(ground_of(_first, states), ground_of(_second, states)), states


@cached(show_spinner="Writing the rules in plain language …")
def rules_frame(digests: tuple[str, str, str], kinds: tuple[str, ...], _found: Disagreement) -> Any:
    """The rules that differ, as a data frame."""
    import pandas as pd

    rows = rule_rows(_found, kinds)
    rows["Action"] = [[action] for action in rows["Action"]]
    if "changed" not in rows["What"]:
        del rows["Change"]
    return pd.DataFrame(rows)


@cached()
def decisions(
    digests: tuple[str, str, str],
    names: tuple[str, str],
    dimension: int,
    _found: Disagreement,
    _states: Any,
    _shown: Any,
) -> tuple[str, Any]:
    """What the two say of the states, as a table in HTML, and some states as a data frame."""
    import pandas as pd

    table = confusion_html(_found, dimension, names=names, noun=noun_of(_shown))
    rows = example_rows(_found, dimension, _states, names=names, demonstrations=_shown)
    return table, pd.DataFrame(rows)


def noun_of(shown: Any) -> str:
    """What one of the states is called."""
    return "random state" if shown is None else "demonstrated state"


def small(text: str) -> str:
    """Markdown as a caption has it."""
    return f":small[:gray[{text}]]"


def headed(title: str, *paragraphs: str) -> str:
    """A heading and what stands below it, in one piece of Markdown."""
    return "\n\n".join([f"### {title}", *filter(None, paragraphs)])


def show_rules(found: Disagreement, digests: tuple[str, str, str]) -> None:
    """Rules added, removed, changed."""
    st.markdown(
        headed("Rules", small(rows_text(found))),
        help="Rules are the same rule where they ask the same, or where they share more than "
        "half of the states that either of them applies to. A changed one has other conditions, "
        "says something else, was switched on or off, or has another place.",
    )
    counts = (
        len(found.difference.added),
        len(found.difference.removed),
        len(found.difference.changed),
    )
    if not any(counts):
        return
    view = st.segmented_control(
        "Show",
        [EVERY, *(kind for kind, count in zip(KINDS, counts, strict=True) if count)],
        default=EVERY,
        key="kind",
        bind="query-params",
        required=True,
        label_visibility="collapsed",
    )
    frame = rules_frame(digests, KINDS if view in (None, EVERY) else (str(view),), found)
    column = st.column_config
    action, action_width = action_column(found.first.actions, "What the rule says")
    st.dataframe(
        frame,
        hide_index=True,
        height=table_height(len(frame), 9),
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


def show_states(
    found: Disagreement,
    digests: tuple[str, str, str],
    states: Any,
    names: tuple[str, str],
    shown: Any,
) -> None:
    """The states that are decided differently."""
    random = (
        f"The states are {counted(found.states, 'random one')} over the range of the rules' "
        "thresholds, because the chosen demonstrations are of something else. They say where "
        "the two differ, not how often an agent comes there."
    )
    st.markdown(
        headed(
            "Decisions",
            f"**{escaped(together(decided_text(found, states=noun_of(shown))))}**",
            small(random) if shown is None else "",
        )
    )
    actions = found.first.actions
    at = 0
    if len(actions) > 1:
        labels = [action.name for action in actions]
        most = labels[int(found.differs.sum(axis=0).argmax())]
        name = st.segmented_control(
            "Action", labels, default=most, key="decided", bind="query-params", required=True
        )
        at = labels.index(name) if name in labels else 0
    table, examples = decisions(digests, names, at, found, states, shown)
    with st.container(key="confusion"):
        st.html(table)
    count = len(examples)
    if not count:
        return
    several = int(found.differs[:, at].sum())
    st.markdown(
        headed(
            "Example states",
            small(f"{count} of {several:,}, evenly spread.") if several > count else "",
        )
    )
    st.dataframe(
        examples,
        hide_index=True,
        height=table_height(count, 9),
        key="examples",
        alt="States that the two decide differently",
    )


@st.fragment
def comparison() -> None:
    """Both choices and what differs; nothing else on the page does."""
    sides, problems = [], []
    for place, (key, label, default) in zip(st.columns(2), SIDES, strict=True):
        with place:
            try:
                sides.append(side(key, label, default))
            except SarlError as error:
                problems.append(in_full(str(error)))
    for problem in problems:
        st.info(problem, icon=":material/upload_file:")
    if problems:
        return
    (one, one_digest, one_name), (other, other_digest, other_name) = sides
    if one_name == other_name:
        one_name, other_name = f"{one_name} (first)", f"{other_name} (second)"
    chosen = chosen_demonstrations()
    if chosen is not None and not (fits(one, chosen) and fits(other, chosen)):
        chosen = None
    told_by = (one_digest, other_digest, chosen.digest if chosen is not None else "")
    try:
        result, compared_on = compared(told_by, one, other, chosen)
    except SarlError as error:
        st.error(in_full(str(error)), icon=":material/error:")
        return
    show_states(result, told_by, compared_on, (one_name, other_name), chosen)
    show_rules(result, told_by)


st.title("Difference")
st.caption(
    "Two rule sets side by side: which rules differ, and on how many of the same states the two "
    "decide differently."
)
comparison()
