"""Rules that come as files: the compact ones that are shipped, and a visitor's own."""

from __future__ import annotations

from pathlib import Path

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
from sarl_dashboard.text import digest_of

OWN_FILE = "own file"
CHOSEN, NO_RULES, COMPACT = "at the thresholds", "none", "compact"
PAPERS = {"filtered": FILTERED, "unfiltered": UNFILTERED}
RULES_FOLDER = DATA / "rules"


def as_named(rule_set: RuleSet, digest: str) -> tuple[RuleSet, str]:
    """Rules from a file, in the order and under the names of the chosen demonstrations.

    Args:
        rule_set: As it was read.
        digest: Tells it from others.

    Returns:
        The rules, as they were read where they do not fit these; and what tells them from
        others and from themselves under other names or in another order.
    """
    raw = raw_demonstrations()
    if raw is None or not fits(rule_set, raw):
        return rule_set, digest
    ordered = rules_of(rule_set, raw).rule_set
    if ordered is not rule_set:
        digest = f"{digest} {raw.digest}"
    names = given_names.given_names(raw)
    if names is None:
        return ordered, digest
    return renamed_rules(ordered, names), f"{digest} {given_names.digest_of_names(names)}"


def compact_file() -> Path:
    """Where the compact rules of the chosen data lie; there may be none."""
    return RULES_FOLDER / f"{chosen_dataset()}_compact.json"


@cached()
def _rule_file(path: Path, stamp: int, dataset: str) -> tuple[RuleSet, str]:
    content = path.read_bytes()
    shipped = rules_from_json(content, name=path.name)
    return with_splits(shipped, shipped_demonstrations(dataset)), digest_of(content)


def compact_rules() -> tuple[RuleSet, str]:
    """The compact rules of the chosen data, and what tells them from others.

    Raises:
        InputError: If there are none, or they cannot be read.
    """
    path = compact_file()
    try:
        rule_set, digest = _rule_file(path, path.stat().st_mtime_ns, chosen_dataset())
    except OSError as error:
        raise InputError(
            f"there are no compact rules for {dataset_label(chosen_dataset())}; choose other rules"
        ) from error
    names = given_names.given_names(raw_demonstrations())
    if names is None:
        return rule_set, digest
    return renamed_rules(rule_set, names), f"{digest} {given_names.digest_of_names(names)}"
