"""What the page Export shows, worked out once for each choice."""

from __future__ import annotations

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.exports.export import Prepared, export_rules, export_vectors, prepare
from sarl_core.explaining.exports.rule_matrix_png import matrix_png
from sarl_core.explaining.html.rule_matrix import RuleMatrix, rule_matrix
from sarl_core.mining.rules import RuleSet
from sarl_core.shielding.projection import Projection
from sarl_dashboard.cache import cached

MIMES = {
    ".json": "application/json",
    ".csv": "text/csv",
    ".md": "text/markdown",
    ".py": "text/x-python",
    ".c": "text/x-c",
    ".onnx": "application/octet-stream",
}
PREVIEW = {".json": "json", ".csv": None, ".md": "markdown", ".py": "python", ".c": "c"}


def prepared_for(
    key: str, rule_set: RuleSet, demonstrations: Demonstrations | None, *, merged: bool
) -> Prepared:
    """Rules rounded and merged as was asked.

    Args:
        key: Tells the rules, the demonstrations and what is asked from all others.
        rule_set: To carry away.
        demonstrations: On which no decision may change; None for no rounding.
        merged: Whether conditions on one feature become one interval.

    Returns:
        The rules, and what rounding did.

    Raises:
        SarlError: If there is nothing to export, or the demonstrations are for other rules.
    """
    return _prepared(key, rule_set, demonstrations, merged)


@cached(show_spinner="Rounding, and counting what changes …")
def _prepared(
    key: str, _rule_set: RuleSet, _demonstrations: Demonstrations | None, _merged: bool
) -> Prepared:
    return prepare(_rule_set, merged=_merged, demonstrations=_demonstrations)


@cached(show_spinner="Writing …")
def content_of(
    key: tuple[str, ...], _suffix: str, _projection: Projection, _rule_set: RuleSet
) -> bytes:
    """The file."""
    return export_rules(_rule_set, _suffix, _projection)


@cached()
def vectors_of(key: tuple[str, ...], _projection: Projection, _rule_set: RuleSet) -> bytes:
    """Its test vectors, made when asked for."""
    return export_vectors(_rule_set, _projection)


@cached()
def matrix_of(
    key: tuple[str, ...], _rule_set: RuleSet, _demonstrations: Demonstrations
) -> RuleMatrix:
    """The rules by features."""
    return rule_matrix(_rule_set, _demonstrations)


@cached()
def picture_of(key: tuple[object, ...], _matrix: RuleMatrix, _page: int) -> bytes:
    """One page of them as a picture."""
    return matrix_png(_matrix, _matrix.page(_page))
