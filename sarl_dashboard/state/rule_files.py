"""Rules that come as files: the compact ones that are shipped, and a visitor's own."""

from __future__ import annotations

from pathlib import Path

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.names import Names
from sarl_core.errors import InputError
from sarl_core.mining.editing.renaming import renamed_rules
from sarl_core.mining.envelope import with_splits
from sarl_core.mining.rule_order import fits
from sarl_core.mining.rule_order import rules_for as rules_of
from sarl_core.mining.rule_set import RuleSet, rules_from_json
from sarl_core.mining.rules import FILTERED, UNFILTERED
from sarl_core.shipped import DATA
from sarl_dashboard.cache import cached
from sarl_dashboard.state import given_names
from sarl_dashboard.state.data import (
    chosen_dataset,
    dataset_label,
    raw_demonstrations,
    shipped_demonstrations,
)

OWN_FILE = "own file"
CHOSEN, NO_RULES, COMPACT = "at the thresholds", "none", "compact"
PAPERS = {"filtered": FILTERED, "unfiltered": UNFILTERED}
RULES_FOLDER = DATA / "rules"


@cached()
def rules_in_file(content: bytes, name: str) -> RuleSet:
    """The rules of an uploaded file.

    Args:
        content: Of the file.
        name: Of the file, for errors.

    Raises:
        InputError: If it is no rule file.
    """
    return rules_from_json(content, name=name)


def as_named(rule_set: RuleSet) -> RuleSet:
    """Rules from a file, in the order and under the names of the chosen demonstrations.

    Args:
        rule_set: As it was read.

    Returns:
        The same where they do not fit these.
    """
    raw = raw_demonstrations()
    if raw is None or not fits(rule_set, raw):
        return rule_set
    return _renamed(_ordered(rule_set, raw), given_names.given_names(raw))


@cached()
def _ordered(rule_set: RuleSet, demonstrations: Demonstrations) -> RuleSet:
    return rules_of(rule_set, demonstrations).rule_set


@cached()
def _renamed(rule_set: RuleSet, names: Names | None) -> RuleSet:
    return rule_set if names is None else renamed_rules(rule_set, names)


def compact_file() -> Path:
    """Where the compact rules of the chosen data lie; there may be none."""
    return RULES_FOLDER / f"{chosen_dataset()}_compact.json"


@cached()
def _compact_rules(path: Path, stamp: int, dataset: str) -> RuleSet:
    shipped = rules_from_json(path.read_bytes(), name=path.name)
    return with_splits(shipped, shipped_demonstrations(dataset))


def unnamed_compact_rules() -> RuleSet:
    """The compact rules of the chosen data under the names they came with.

    Raises:
        InputError: If there are none, or they cannot be read.
    """
    path = compact_file()
    try:
        return _compact_rules(path, path.stat().st_mtime_ns, chosen_dataset())
    except OSError as error:
        raise InputError(
            f"there are no compact rules for {dataset_label(chosen_dataset())}; choose other rules"
        ) from error


def compact_rules() -> RuleSet:
    """The compact rules of the chosen data.

    Raises:
        InputError: If there are none, or they cannot be read.
    """
    return _renamed(unnamed_compact_rules(), given_names.given_names(raw_demonstrations()))
