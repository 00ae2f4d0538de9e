"""The settings that several pages ask for in the same words, each kept in the URL."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, get_args

import streamlit as st

from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Outside
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.state import in_force, rule_base
from sarl_dashboard.state.agents import FRESH_SEED, PROJECTIONS, PolicyFile, policy_upload
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.environments import AS_DEMONSTRATED, continuous, usual_environments
from sarl_dashboard.state.rule_files import (
    CHOSEN,
    COMBINED,
    COMPACT,
    COMPACT_ENDINGS,
    EDITED,
    FEWEST,
    IN_FORCE,
    NO_RULES,
    NO_SHIELD,
    OWN_FILE,
    PAPERS,
    UNEDITED,
    compact_sets,
    fitting_demonstrations,
)
from sarl_dashboard.state.url import with_own
from sarl_dashboard.text import escaped, in_full

OUTSIDE: tuple[Outside, ...] = get_args(Outside)
RULE_SETS = (IN_FORCE, CHOSEN, *PAPERS, *COMPACT_ENDINGS, EDITED, UNEDITED)
"""The rules that a page may work on, the default first."""
_RULE_SETS = {
    IN_FORCE: "those in the sidebar",
    CHOSEN: "those at the thresholds, without edits",
    "filtered": "support 0.005, confidence 0.95",
    "unfiltered": "support 0, confidence 1",
    COMPACT: "a small set that is shipped, every condition about one feature",
    COMBINED: "a set that is shipped and asks about two features at once",
    FEWEST: "one of that kind with as few rules as do it",
    UNEDITED: "what was edited, as it was",
    EDITED: "what you made of them on the page Edit",
    **dict.fromkeys((NO_RULES, NO_SHIELD), "the agent alone"),
}
Width = Literal["stretch"] | int


def shield_choice(env: str | None) -> tuple[Projection, Outside]:
    """What a shield does with an action that breaks a rule, as far as there is a choice.

    Args:
        env: As `environment_choice` gives it.
    """
    projection = projection_choice() if continuous(env) else PROJECTIONS[0]
    return projection, outside_choice()


def own_policy(agent: str, env: str | None) -> PolicyFile | None:
    """Ask for the policy, where one's own was chosen.

    Args:
        agent: What was chosen.
        env: As `environment_choice` gives it.
    """
    return policy_upload("Policy", "policy_file", env) if agent == OWN_FILE else None


def environment_choice() -> str | None:
    """The environment: a usual one, or any id that was typed (URL: env)."""
    return st.selectbox(
        "Environment",
        with_own((AS_DEMONSTRATED, *usual_environments()), "env"),
        key="env",
        bind="query-params",
        accept_new_options=True,
        help=with_words(
            "That of the demonstrations, or type any id that Gymnasium knows, such as CartPole-v1."
        ),
    )


def offered_rule_sets(names: Sequence[str]) -> list[str]:
    """Those of some rule sets that can be had now."""
    missing = COMPACT_ENDINGS.keys() - compact_sets()
    edited = in_force.edits_made(rule_base.base_name()) > 0
    return [
        name for name in names if name not in missing and (name not in (EDITED, UNEDITED) or edited)
    ]


def rule_sets_help(offered: Sequence[str]) -> str:
    """What the offered rule sets are."""
    return " ".join(f"{name[0].upper()}{name[1:]}: {_RULE_SETS[name]}." for name in offered)


def rule_set_choice(
    key: str,
    *,
    without: Sequence[str] = (),
    more: Sequence[str] = (),
    about: str = "",
    width: Width = "stretch",
    persist_state: Literal["session"] | None = None,
) -> str:
    """The rules that a page works on: those in force where nothing else is chosen (URL: the key).

    Args:
        key: Of the widget.
        without: What is not offered here.
        more: What is offered besides.
        about: A sentence before what is said of the sets.
        width: Of the widget.
        persist_state: As Streamlit has it.

    Returns:
        What it is called: of those in force, what they are.
    """
    offered = offered_rule_sets([name for name in (*RULE_SETS, *more) if name not in without])
    named = st.query_params.get(key)
    if key not in st.session_state and named is not None and named not in offered:
        st.session_state[f"_{key}_unknown"] = named
    if unknown := st.session_state.get(f"_{key}_unknown"):
        st.warning(
            f"There are no rules called “{escaped(unknown[:60])}” here, which the address names: "
            "choose others below.",
            icon=":material/link_off:",
        )
    choice = st.selectbox(
        "Rules",
        offered,
        on_change=lambda: st.session_state.pop(f"_{key}_unknown", None),
        key=key,
        bind="query-params",
        width=width,
        persist_state=persist_state,
        help=with_words(f"{about} {rule_sets_help(offered)}".strip()),
    )
    return in_force.kind() if choice in (None, IN_FORCE) else choice


def projection_choice(width: Width = "stretch") -> Projection:
    """What a continuous action becomes (URL: projection)."""
    return st.selectbox(
        "Replace by",
        PROJECTIONS,
        key="projection",
        bind="query-params",
        width=width,
        help=with_words(
            "What a continuous action that breaks a rule becomes. Centre: the middle of the "
            "rule's interval. Clip: the nearest value in it. Expert: what the expert typically "
            "did there."
        ),
    )


def outside_choice(width: Width = "stretch") -> Outside:
    """What a rule does outside the data it was mined from (URL: outside)."""
    return st.selectbox(
        "Outside the data",
        OUTSIDE,
        key="outside",
        bind="query-params",
        width=width,
        help=with_words(
            "What a rule does in a state beyond the least and largest values seen where it "
            "applies. Act: it changes the action all the same, and the step is marked. Abstain: "
            "it leaves the action to the agent."
        ),
    )


def switch(label: str, key: str, options: Sequence[str], hint: str | None = None) -> str:
    """A choice between a few ways to look; the first where nothing was chosen.

    Args:
        label: What it is called, for who cannot see it.
        key: Of the widget, and in the URL.
        options: The ways.
        hint: Said when the pointer rests on it.
    """
    return (
        st.segmented_control(
            label,
            options,
            default=options[0],
            key=key,
            bind="query-params",
            required=True,
            label_visibility="collapsed",
            help=hint,
        )
        or options[0]
    )


def search_box() -> tuple[str, ...]:
    """The words that rules are searched for, in small letters (URL: search)."""
    text = st.text_input(
        "Search",
        key="search",
        bind="query-params",
        icon=":material/search:",
        width=300,
        placeholder="a feature, an action, a number",
        label_visibility="collapsed",
    )
    return tuple((text or "").lower().split())


def notes_notice(notes: Iterable[str]) -> None:
    """Say how it was found out which feature is which, and what else a visitor should know."""
    for note in dict.fromkeys(notes):
        st.info(in_full(note), icon=":material/info:")


def no_boxes_notice(rule_sets: list[RuleSet], outside: Outside) -> None:
    """Say where abstaining does nothing, because a rule file does not say where its data lay."""
    if outside == "abstain" and any(
        rule_set.rules and all(rule.box is None for rule in rule_set.rules)
        for rule_set in rule_sets
    ):
        st.info(
            "This rule file keeps no data boxes: its rules act everywhere, also with “abstain”. "
            "Mine them again to have the boxes.",
            icon=":material/frame_inspect:",
        )


def other_data_notice() -> bool:
    """Say that the rules in force are of other data than the chosen ones.

    Returns:
        Whether they are.
    """
    demonstrations = chosen_demonstrations()
    if rule_base.at_thresholds() or demonstrations is None:
        return False
    if fitting_demonstrations(rule_base.base().rule_set, demonstrations) is not None:
        return False
    st.info(
        "The rules in force speak of other features or actions than the chosen demonstrations; "
        "choose the demonstrations of their environment, or other rules, in the sidebar.",
        icon=":material/swap_horiz:",
    )
    return True


def known_seeds_notice() -> None:
    """Say that rules are tried on seeds that they were mined from."""
    st.warning(
        "Some of these seeds are those of the demonstrations, where the rules know the way. A "
        f"first seed such as {FRESH_SEED:,} shows what they bring elsewhere.",
        icon=":material/casino:",
    )
