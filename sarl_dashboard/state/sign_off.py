"""Who approved the rules on a page, by what is kept."""

from __future__ import annotations

from sarl_core.errors import SarlError
from sarl_core.explaining.words.sign_off import SignOff
from sarl_core.library.contents import rules_sign_off
from sarl_core.mining.rule_set import RuleSet, rules_digest
from sarl_dashboard.cache import cached
from sarl_dashboard.state.library import library


def sign_off_here(rule_set: RuleSet) -> SignOff | None:
    """Who approved rules as they stand; None where the library cannot be read.

    Args:
        rule_set: With every edit.
    """
    try:
        return rules_sign_off(library(), _digest(rule_set))
    except SarlError:
        return None


@cached()
def _digest(rule_set: RuleSet) -> str:
    return rules_digest(rule_set)
