"""Which rule set was chosen, and where it comes from."""

from __future__ import annotations

from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_core.errors import InputError
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.state.edits import edited_rules
from sarl_dashboard.state.mined import rules_at
from sarl_dashboard.state.rule_files import (
    COMPACT_ENDINGS,
    NO_RULES,
    OWN_FILE,
    PAPERS,
    as_named,
    compact_rules,
    rules_in_file,
)

EDITED = "edited"


def rules_for(choice: str, uploaded: UploadedFile | None) -> RuleSet | None:
    """The rule set that was chosen, None for none.

    Raises:
        InputError: If it cannot be had.
    """
    if choice == NO_RULES:
        return None
    if choice == OWN_FILE:
        if uploaded is None:
            raise InputError("no rule file has been uploaded; upload one, or choose other rules")
        return as_named(rules_in_file(uploaded.getvalue(), uploaded.name))
    if choice in COMPACT_ENDINGS:
        return compact_rules(choice)
    if choice == EDITED:
        return edited_rules()
    return rules_at(PAPERS.get(choice))
