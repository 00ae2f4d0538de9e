"""The way from the root to a rule as a table, in HTML."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.markup import percent
from sarl_core.explaining.tables.rule_evidence import PathStep
from sarl_core.explaining.templates import render
from sarl_core.mining.action_words import label_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import share_text


def label_key(dimension: LabelledDimension) -> list[tuple[str, str]]:
    """Which colour is which label.

    Args:
        dimension: The labels.

    Returns:
        The name and the colour of each.
    """
    return [
        (label_text(label, dimension), label_colour(label)) for label in range(dimension.n_labels)
    ]


def path_table(
    steps: Sequence[PathStep], dimension: LabelledDimension, *, leaf: bool = False
) -> Markup:
    """The way from the root to a rule, node by node.

    Args:
        steps: The root first.
        dimension: The labels.
        leaf: Whether the path ends because the tree does, and not because it was cut.

    Returns:
        HTML: with each node the shares of the labels as a bar.
    """
    labels = label_key(dimension)
    rows = [
        (
            step,
            f"{step.samples:,}",
            share_text(step.support),
            share_text(step.confidence) if step.samples else "–",
            [
                (f"{name}: {share_text(share)}", f"width:{percent(share)};background:{colour}")
                for (name, colour), share in zip(labels, step.shares, strict=True)
                if share > 0
            ],
        )
        for step in steps
    ]
    return render("rules/path", labels=labels, rows=rows, leaf=leaf)
