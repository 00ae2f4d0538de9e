"""Rules that come as files: the compact sets that are shipped, and a visitor's own."""

from __future__ import annotations

from pathlib import Path

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.names import Names
from sarl_core.errors import InputError
from sarl_core.mining.editing.renaming import renamed_rules
from sarl_core.mining.envelope import with_splits
from sarl_core.mining.rule_order import fitting
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

OWN_FILE, IN_LIBRARY = "own file", "kept"
IN_FORCE, EDITED = "in force", "edited"
CHOSEN, UNEDITED = "at the thresholds", "before the edits"
NO_RULES, NO_SHIELD = "none", "no shield"
COMPACT, COMBINED, FEWEST = "compact", "compact, two features", "fewest, two features"
COMPACT_ENDINGS = {COMPACT: "compact", COMBINED: "combined", FEWEST: "few_combined"}
"""The compact sets that there may be for some data: their names, and how their files end."""
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


@cached()
def fitting_demonstrations(
    rule_set: RuleSet, demonstrations: Demonstrations
) -> Demonstrations | None:
    """As `rule_order.fitting`, worked out once: what rules derive is worked out of every step."""
    return fitting(rule_set, demonstrations)


def as_named(rule_set: RuleSet) -> RuleSet:
    """Rules from a file, in the order and under the names of the chosen demonstrations.

    Args:
        rule_set: As it was read.

    Returns:
        The same where they do not fit these.
    """
    raw = raw_demonstrations()
    fitted = None if raw is None else fitting_demonstrations(rule_set, raw)
    if fitted is None:
        return rule_set
    return _renamed(_ordered(rule_set, fitted), given_names.given_names(raw))


@cached()
def _ordered(rule_set: RuleSet, demonstrations: Demonstrations) -> RuleSet:
    return rules_of(rule_set, demonstrations).rule_set


@cached()
def _renamed(rule_set: RuleSet, names: Names | None) -> RuleSet:
    return rule_set if names is None else renamed_rules(rule_set, names)


def compact_file(name: str) -> Path:
    """Where a compact set of the chosen data lies, by its name; there may be none."""
    return RULES_FOLDER / f"{chosen_dataset()}_{COMPACT_ENDINGS[name]}.json"


def compact_sets() -> list[str]:
    """Names of the compact sets of the chosen data."""
    return [name for name in COMPACT_ENDINGS if compact_file(name).is_file()]


@cached()
def _compact_rules(path: Path, stamp: int, dataset: str) -> RuleSet:
    shipped = rules_from_json(path.read_bytes(), name=path.name)
    return with_splits(shipped, shipped_demonstrations(dataset))


def unnamed_compact_rules(name: str) -> RuleSet:
    """A compact set of the chosen data under the names it came with.

    Args:
        name: Of the set.

    Raises:
        InputError: If there is none, or it cannot be read.
    """
    path = compact_file(name)
    try:
        return _compact_rules(path, path.stat().st_mtime_ns, chosen_dataset())
    except OSError as error:
        raise InputError(
            f"there are no rules ({name}) for {dataset_label(chosen_dataset())}; choose other rules"
        ) from error


def compact_rules(name: str) -> RuleSet:
    """A compact set of the chosen data.

    Args:
        name: Of the set.

    Raises:
        InputError: If there is none, or it cannot be read.
    """
    return _renamed(unnamed_compact_rules(name), given_names.given_names(raw_demonstrations()))
