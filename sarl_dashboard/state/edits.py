"""The edits of this session: on which rules, their history, and the set they make.

Edits belong to the rules they were made on: those of the trees, whatever the thresholds are, the
compact ones, or those of a file. They stay in the session, and an error loses none. Those that
regrow a part of a tree come first: rules are mined from the trees with them, at any thresholds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError, SarlError
from sarl_core.mining.applications import labels_of
from sarl_core.mining.editing.edits import Edit, History, Regrow, apply, check_edit
from sarl_core.mining.editing.regrowing import regrown_trees
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.validation.holding_out import with_untried_held_out
from sarl_core.shielding.decisions import Ground, ground_of
from sarl_core.shielding.disagreement import sampled_states
from sarl_core.shielding.effects import Verdicts, verdicts
from sarl_dashboard.cache import cached
from sarl_dashboard.state import compact_set
from sarl_dashboard.state.data import (
    chosen_demonstrations,
    data_key,
    data_parts,
    held_out_demonstrations,
)
from sarl_dashboard.state.mined import Trees, grown_trees, mined_rules, rules_at
from sarl_dashboard.state.rule_files import (
    CHOSEN,
    COMPACT_ENDINGS,
    OWN_FILE,
    as_named,
    compact_rules,
    compact_sets,
    fitting_demonstrations,
    rules_in_file,
    unnamed_compact_rules,
)
from sarl_dashboard.state.url import set_url_choice, url_choice
from sarl_dashboard.text import digest_of


@dataclass(frozen=True, eq=False)
class Base:
    """The rules that are edited.

    Attributes:
        kind: One of the words on screen.
        key: To which edits belong, whatever the thresholds and names.
        rule_set: Without edits.
        name: Of the file they are from, "" for none.
    """

    kind: str
    key: str
    rule_set: RuleSet
    name: str = ""

    @cached_property
    def basis(self) -> Basis:
        """The states on which edits are counted; looked up once, since much asks for them."""
        return _basis(self.rule_set, demonstrations_for(self.rule_set))


@dataclass(frozen=True, eq=False)
class Basis:
    """The states on which a rule set and its edits are counted.

    Attributes:
        ground: The states, walked.
        expert: What the expert did there, None where that is not known.
        noun: What one of them is called.
    """

    ground: Ground
    expert: NDArray[np.int64] | None
    noun: str


# --- which rules are edited --------------------------------------------------------------------


def kinds() -> list[str]:
    """What can be edited."""
    return [CHOSEN, *compact_sets(), OWN_FILE]


def chosen_kind() -> str:
    """What is edited: a file, or the rules in force (URL: base, set)."""
    if url_choice("base", ("force", OWN_FILE), "force") == OWN_FILE:
        return OWN_FILE
    return compact_set.in_force() or CHOSEN


def choose_kind(kind: str) -> None:
    """Choose what is edited; for callbacks."""
    set_url_choice("base", OWN_FILE if kind == OWN_FILE else "force", "force")
    if kind != OWN_FILE:
        compact_set.choose(kind if kind in COMPACT_ENDINGS else None)


def take_file(content: bytes, name: str) -> None:
    """Keep an uploaded rule file for this session; what was kept before stays where that fails.

    Raises:
        InputError: If it is no rule file.
    """
    key = f"file {digest_of(content)}"
    st.session_state["_edit_file"] = Base(OWN_FILE, key, rules_in_file(content, name), name)


def base() -> Base:
    """The rules that are edited.

    Raises:
        InputError: If they cannot be had.
    """
    kind = chosen_kind()
    if kind == OWN_FILE:
        uploaded = cast("Base | None", st.session_state.get("_edit_file"))
        if uploaded is None:
            raise InputError("no rule file has been uploaded; upload one, or edit other rules")
        return replace(uploaded, rule_set=as_named(uploaded.rule_set))
    if kind in COMPACT_ENDINGS:
        return Base(kind, f"compact {unnamed_compact_rules(kind).digest}", compact_rules(kind))
    rule_set = rules_at()
    # A rule's number is its node's, the same at all thresholds.
    return Base(kind, repr((data_key(), rule_set.divider)), rule_set)


# --- the edits ---------------------------------------------------------------------------------


def _histories() -> dict[str, History]:
    return cast("dict[str, History]", st.session_state.setdefault("_edits", {}))


def history(of: Base) -> History:
    """The edits of some rules."""
    return _histories().get(of.key, History())


def made() -> int:
    """How many edits there are of the rules that are edited; nothing is mined to say none."""
    if not any(history.edits for history in _histories().values()):
        return 0
    try:
        return len(history(base()).edits)
    except SarlError:  # said on the page Edit
        return 0


def waiting(of: Base) -> int:
    """Of how many other rule sets there are edits in this session."""
    return sum(bool(edits.edits) for key, edits in _histories().items() if key != of.key)


def keep(of: Base, edits: History) -> None:
    """Put edits in force."""
    _histories()[of.key] = edits


def do(of: Base, edit: Edit) -> None:
    """Make one more edit; for callbacks. What cannot be made is said on the page."""
    try:
        check_edit(edited(of), edit)
        grown(of, (*history(of).edits, edit))
    except InputError as error:
        st.session_state["_edit_error"] = str(error)
    else:
        keep(of, history(of).done(edit))


def undo(of: Base) -> None:
    """Take the latest edit back; for callbacks."""
    keep(of, history(of).undo())


def redo(of: Base) -> None:
    """Make the edit again that was taken back last; for callbacks."""
    keep(of, history(of).redo())


def edited(of: Base) -> RuleSet:
    """The rules with the edits."""
    made = history(of).edits
    return _edited(grown(of, made), made, _tried_on(of))


def trees_with(of: Base, edits: tuple[Edit, ...]) -> Trees | None:
    """The trees that some edits make of those that the rules were mined from.

    Args:
        of: The rules that are edited.
        edits: The oldest first.

    Returns:
        One an action dimension; None for rules that were not mined here, which have none.

    Raises:
        InputError: If a part cannot be regrown.
    """
    demonstrations = chosen_demonstrations()
    if of.kind != CHOSEN or demonstrations is None:
        return None
    trees = grown_trees(demonstrations, of.rule_set.divider)
    for edit in edits:
        if isinstance(edit, Regrow):
            trees = _with_part(trees, edit, demonstrations)
    return trees


@cached(show_spinner="Growing a part of the tree …")
def _with_part(trees: Trees, edit: Regrow, demonstrations: Demonstrations) -> Trees:
    return regrown_trees(trees, (edit,), demonstrations)


def grown(of: Base, edits: tuple[Edit, ...]) -> RuleSet:
    """The rules before all other edits: mined from the trees whose parts some edits regrow.

    Raises:
        InputError: If a part cannot be regrown.
    """
    if not any(isinstance(edit, Regrow) for edit in edits):
        return of.rule_set
    trees = trees_with(of, edits)
    if trees is None:
        raise InputError(
            "only rules at the thresholds have a tree of which a part can be regrown; choose "
            "those, or take the edit back"
        )
    return mined_rules(trees, of.rule_set.thresholds, data_parts())


def _tried_on(of: Base) -> Demonstrations | None:
    """What is held out of what the rules were mined from: rules by hand are tried on it too."""
    demonstrations = chosen_demonstrations()
    if demonstrations is None or demonstrations.digest != of.rule_set.source.digest:
        return None
    return held_out_demonstrations()


@cached()
def _edited(rule_set: RuleSet, edits: tuple[Edit, ...], held_out: Demonstrations | None) -> RuleSet:
    edited_set = apply(rule_set, edits)
    return edited_set if held_out is None else with_untried_held_out(edited_set, held_out)


# --- for other pages ---------------------------------------------------------------------------


def offered() -> bool:
    """Whether there is an edited set to choose."""
    if not _histories():
        return False
    try:
        return bool(history(base()).edits)
    except SarlError:
        return False


def edited_rules() -> RuleSet:
    """The edited set.

    Raises:
        InputError: If there is none.
    """
    of = base()
    if not history(of).edits:
        raise InputError("there are no edits of the rules in force; make some on the Edit page")
    return edited(of)


def edited_trees() -> Trees | None:
    """The trees of the edited set; None where its rules were not mined here."""
    of = base()
    return trees_with(of, history(of).edits)


# --- what they change --------------------------------------------------------------------------


def demonstrations_for(rule_set: RuleSet) -> Demonstrations | None:
    """The chosen demonstrations with what the rules derive, where they are of their features."""
    demonstrations = chosen_demonstrations()
    return fitting_demonstrations(rule_set, demonstrations) if demonstrations else None


@cached(show_spinner="Looking which rule decides which state …")
def _basis(rule_set: RuleSet, demonstrations: Demonstrations | None) -> Basis:
    """The states on which rules are counted: demonstrated ones, where they are their own kind."""
    if demonstrations is None:
        ground = ground_of(rule_set, sampled_states([rule_set]))
        return Basis(ground, None, "random state")
    ground = ground_of(rule_set, demonstrations.observations)
    return Basis(ground, labels_of(rule_set, demonstrations), "demonstrated state")


def verdicts_of(of: Base, edits: tuple[Edit, ...]) -> Verdicts:
    """What the rules with some edits say of the states."""
    rule_set = grown(of, edits)
    return _verdicts(rule_set, edits, _tried_on(of), demonstrations_for(rule_set))


@cached()
def _verdicts(
    rule_set: RuleSet,
    edits: tuple[Edit, ...],
    held_out: Demonstrations | None,
    demonstrations: Demonstrations | None,
) -> Verdicts:
    basis = _basis(rule_set, demonstrations)
    return verdicts(basis.ground, _edited(rule_set, edits, held_out), basis.expert)
