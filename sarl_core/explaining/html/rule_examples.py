"""Some states of a rule, in HTML."""

from __future__ import annotations

from markupsafe import Markup

from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.html.table import Column, table_html
from sarl_core.explaining.tables.rule_evidence import example_columns
from sarl_core.mining.rules import Rule
from sarl_core.mining.tree import PolicyTree

_DID, _AGREES = "Expert did", "As the rule says"
_WHOLE = ("Episode", "Step")


def examples_html(demonstrations: Demonstrations, tree: PolicyTree, rule: Rule) -> Markup:
    """Example states of a rule, see `example_columns`.

    Args:
        demonstrations: What the tree was grown from.
        tree: Of the rule's action dimension.
        rule: A mined one that some state reaches.

    Returns:
        A table with a state a row, and what the expert did there.
    """
    columns = example_columns(demonstrations, tree, rule)
    headings = [
        Column(name, "m" if name == _DID else "" if name == _AGREES else "n") for name in columns
    ]
    texts = [[_text(name, value) for value in values] for name, values in columns.items()]
    return table_html(headings, list(zip(*texts, strict=True)), "States to which the rule applies")


def _text(name: str, value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and name not in _WHOLE:
        return decimal_text(value)
    return str(value)
