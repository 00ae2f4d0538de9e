"""The edits of this session: on which rules, their history, and the set they make.

Edits belong to the rules they were made on: those of the trees, whatever the thresholds are, the
compact ones, or those of a file. They stay in the session, and an error loses none.
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
from sarl_core.mining.applying import labels_of
from sarl_core.mining.editing.edits import Edit, History, apply, check_edit
from sarl_core.mining.rule_order import fits
from sarl_core.mining.rule_set import RuleSet, rules_from_json
from sarl_core.mining.validation.holding_out import with_untried_held_out
from sarl_core.shielding.deciding import Ground, ground_of
from sarl_core.shielding.disagreement import sampled_states
from sarl_core.shielding.effects import Verdicts, verdicts
from sarl_dashboard.cache import cached
from sarl_dashboard.state import compact_set
from sarl_dashboard.state.data import (
    chosen_demonstrations,
    data_key,
    held_out_demonstrations,
    held_out_digest,
)
from sarl_dashboard.state.mined import rules_at
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT, OWN_FILE, as_named, compact_rules
from sarl_dashboard.state.url import set_url_choice, url_choice
from sarl_dashboard.text import digest_of


@dataclass(frozen=True, eq=False)
class Base:
    """The rules that are edited.

    Attributes:
        kind: One of the words on screen.
        key: To which edits belong.
        digest: Tells these rules from all others.
        rule_set: Without edits.
        name: Of the file they are from, "" for none.
    """

    kind: str
    key: str
    digest: str
    rule_set: RuleSet
    name: str = ""

    @cached_property
    def basis(self) -> Basis:
        """The states on which edits are counted; looked up once, since much asks for them."""
        return basis_of(self.rule_set, self.digest)


@dataclass(frozen=True, eq=False)
class Basis:
    """The states on which a rule set and its edits are counted.

    Attributes:
        ground: The states, walked.
        expert: What the expert did there, None where that is not known.
        noun: What one of them is called.
        digest: Tells these states from others.
    """

    ground: Ground
    expert: NDArray[np.int64] | None
    noun: str
    digest: str


# --- which rules are edited --------------------------------------------------------------------


def kinds() -> list[str]:
    """What can be edited."""
    return [CHOSEN, *([COMPACT] if compact_set.offered() else []), OWN_FILE]


def chosen_kind() -> str:
    """What is edited: a file, or the rules in force (URL: base, set)."""
    if url_choice("base", ("force", OWN_FILE), "force") == OWN_FILE:
        return OWN_FILE
    return COMPACT if compact_set.in_force() else CHOSEN


def choose_kind(kind: str) -> None:
    """Choose what is edited; for callbacks."""
    set_url_choice("base", OWN_FILE if kind == OWN_FILE else "force", "force")
    if kind != OWN_FILE:
        compact_set.choose(kind == COMPACT)


def take_file(content: bytes, name: str) -> None:
    """Keep an uploaded rule file for this session; what was kept before stays where that fails.

    Raises:
        InputError: If it is no rule file.
    """
    rule_set = rules_from_json(content, name=name)
    digest = digest_of(content)
    st.session_state["_edit_file"] = Base(OWN_FILE, f"file {digest}", digest, rule_set, name)


def base() -> Base:
    """The rules that are edited.

    Raises:
        InputError: If they cannot be had.
    """
    kind = chosen_kind()
    if kind == OWN_FILE:
        kept = cast("Base | None", st.session_state.get("_edit_file"))
        if kept is None:
            raise InputError("no rule file has been uploaded; upload one, or edit other rules")
        rule_set, digest = as_named(kept.rule_set, kept.digest)
        return replace(kept, rule_set=rule_set, digest=digest)
    if kind == COMPACT:
        rule_set, digest = compact_rules()
        return Base(kind, f"compact {digest.split()[0]}", digest, rule_set)  # whatever the names
    rule_set, digest = rules_at(None)
    # A rule's number is its node's, the same at all thresholds.
    return Base(kind, repr((data_key(), rule_set.divider)), digest, rule_set)


# --- the edits ---------------------------------------------------------------------------------


def _histories() -> dict[str, History]:
    return cast("dict[str, History]", st.session_state.setdefault("_edits", {}))


def history(of: Base) -> History:
    """The edits of some rules."""
    return _histories().get(of.key, History())


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
    return _with(of, history(of).edits)


def _with(of: Base, edits: tuple[Edit, ...]) -> RuleSet:
    """The rules with some edits; those by hand are tried on what is held out, as mined ones are."""
    found, held_out = chosen_demonstrations(), None
    if found is not None and found.digest == of.rule_set.source.digest:
        held_out = held_out_demonstrations()
    tried = held_out.digest if held_out is not None else ""
    return _edited(of.digest, _told(edits), tried, edits, of.rule_set, held_out)


def _told(edits: tuple[Edit, ...]) -> str:
    return digest_of(repr(edits).encode())


@cached()
def _edited(
    digest: str,
    told: str,
    tried: str,
    _edits: tuple[Edit, ...],
    _rule_set: RuleSet,
    _held_out: Demonstrations | None,
) -> RuleSet:
    found = apply(_rule_set, _edits)
    return found if _held_out is None else with_untried_held_out(found, _held_out)


# --- for other pages ---------------------------------------------------------------------------


def offered() -> bool:
    """Whether there is an edited set to choose."""
    if not _histories():
        return False
    try:
        return bool(history(base()).edits)
    except SarlError:
        return False


def edited_rules() -> tuple[RuleSet, str]:
    """The edited set, and what tells it from others.

    Raises:
        InputError: If there is none.
    """
    of = base()
    edits = history(of).edits
    if not edits:
        raise InputError("there are no edits of the rules in force; make some on the Edit page")
    return edited(of), f"{of.digest} {_told(edits)}"


# --- what they change --------------------------------------------------------------------------


def demonstrations_for(rule_set: RuleSet) -> Demonstrations | None:
    """The chosen demonstrations, where the rules ask about their features."""
    demonstrations = chosen_demonstrations()
    return demonstrations if demonstrations and fits(rule_set, demonstrations) else None


def basis_of(rule_set: RuleSet, digest: str) -> Basis:
    """The states on which a rule set is counted: demonstrated ones, where they are its own kind."""
    demonstrations = demonstrations_for(rule_set)
    told = demonstrations.digest if demonstrations is not None else ""
    return _basis(digest, told, rule_set, demonstrations)


@cached(show_spinner="Looking which rule decides which state …")
def _basis(
    digest: str, told: str, _rule_set: RuleSet, _demonstrations: Demonstrations | None
) -> Basis:
    if _demonstrations is None:
        ground = ground_of(_rule_set, sampled_states([_rule_set]))
        return Basis(ground, None, "random state", f"{len(ground.states)} random")
    ground = ground_of(_rule_set, _demonstrations.observations)
    return Basis(ground, labels_of(_rule_set, _demonstrations), "demonstrated state", told)


def verdicts_of(of: Base, edits: tuple[Edit, ...]) -> Verdicts:
    """What the rules with some edits say of the states."""
    told = f"{of.basis.digest} {_told(edits)} {held_out_digest()}"
    return _verdicts(of.digest, told, _with(of, edits), of.basis)


@cached()
def _verdicts(digest: str, told: str, _edited_set: RuleSet, _basis: Basis) -> Verdicts:
    return verdicts(_basis.ground, _edited_set, _basis.expert)
