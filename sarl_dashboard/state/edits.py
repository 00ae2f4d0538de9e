"""The edits of a visit: their history, and the set they make.

Edits belong to the rules they were made on (`rule_base.Base`): those of the trees, whatever the
thresholds are, a compact set, or those of a file. An error loses none. Those that regrow a part of
a tree come first: rules are mined from the trees with them, at any thresholds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import Extension
from sarl_core.errors import InputError
from sarl_core.mining.applications import labels_of
from sarl_core.mining.editing.edits import Edit, History, Regrow, apply
from sarl_core.mining.editing.regrowing import regrown_trees
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.validation.holding_out import with_untried_held_out
from sarl_core.shielding.decisions import Ground, ground_of
from sarl_core.shielding.disagreement import sampled_states
from sarl_core.shielding.effects import Verdicts, verdicts
from sarl_core.shielding.leeway import Leeway, leeway_in, leeway_of
from sarl_dashboard.cache import cached
from sarl_dashboard.state.data import (
    chosen_demonstrations,
    data_parts,
    held_out_demonstrations,
)
from sarl_dashboard.state.mined import Trees, grown_trees, mined_rules
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.state.rule_files import CHOSEN, fitting_demonstrations


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


# --- the edits ---------------------------------------------------------------------------------


def _histories() -> dict[str, History]:
    return cast("dict[str, History]", st.session_state.setdefault("_edits_made", {}))


def history_of(key: str) -> History:
    """The edits of the rules that a key tells."""
    return _histories().get(key, History())


def history(of: Base) -> History:
    """The edits of some rules."""
    return history_of(of.key)


def any_made() -> bool:
    """Whether there are edits of any rules in this visit."""
    return any(history.edits for history in _histories().values())


def waiting(of: Base) -> int:
    """Of how many other rule sets there are edits in this session."""
    return sum(bool(edits.edits) for key, edits in _histories().items() if key != of.key)


def put(key: str, edits: History) -> None:
    """Take edits for those of the rules that a key tells."""
    _histories()[key] = edits


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
    trees = grown_trees(demonstrations, of.rule_set.divider, of.rule_set.learner)
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


# --- what they change --------------------------------------------------------------------------


def demonstrations_for(rule_set: RuleSet) -> Demonstrations | None:
    """The chosen demonstrations with what the rules derive, where they are of their features."""
    demonstrations = chosen_demonstrations()
    return fitting_demonstrations(rule_set, demonstrations) if demonstrations else None


def basis_of(of: Base) -> Basis:
    """The states on which edits of some rules are counted."""
    return _basis(of.rule_set, demonstrations_for(of.rule_set))


@cached(show_spinner="Looking which rule decides which state …")
def _basis(rule_set: RuleSet, demonstrations: Demonstrations | None) -> Basis:
    """The states on which rules are counted: demonstrated ones, where they are their own kind."""
    if demonstrations is None:
        ground = ground_of(rule_set, sampled_states([rule_set]))
        return Basis(ground, None, "random state")
    ground = ground_of(rule_set, demonstrations.observations)
    is_part = len(demonstrations) < demonstrations.whole.steps
    noun = "sampled state" if is_part else "demonstrated state"
    return Basis(ground, labels_of(rule_set, demonstrations), noun)


def leeway_of_set(rule_set: RuleSet) -> Leeway:
    """What rules, of either kind, say of the states on which they are counted."""
    return _leeway(rule_set, demonstrations_for(rule_set))


@cached()
def _leeway(rule_set: RuleSet, demonstrations: Demonstrations | None) -> Leeway:
    if demonstrations is None:
        width = Extension.of(rule_set.source.features).width
        return leeway_in(rule_set, sampled_states([rule_set])[:, :width])
    return leeway_of(rule_set, demonstrations)


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
