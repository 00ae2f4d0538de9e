"""The way from the root to a rule as a table, in HTML without script; every name escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from sarl_core.explaining.figures.colours import MARKER_COLOUR, label_colour
from sarl_core.explaining.rule_evidence import PathStep
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import label_text, share_text


def label_mix(shares: Sequence[float], dimension: LabelledDimension) -> str:
    """The shares of the labels as a bar.

    Args:
        shares: One a label, summing to 1.
        dimension: The labels.

    Returns:
        HTML without script, styled in place.
    """
    parts = "".join(
        f'<span title="{escape(label_text(label, dimension))}: {share_text(share)}" '
        f'style="width:{100 * share:.2f}%;background:{label_colour(label)}"></span>'
        for label, share in enumerate(shares)
        if share > 0
    )
    return f'<span class="sarl-mix">{parts}</span>'


_STYLE = """<style>
.sarl-path { width: 100%; border-collapse: collapse; font-size: 0.875rem; }
.sarl-path th { text-align: left; font-weight: 400; opacity: 0.7; padding: 0.15rem 0.5rem 0.3rem 0;
  white-space: nowrap; }
.sarl-path td { padding: 0.24rem 0.5rem 0.24rem 0; border-top: 1px solid rgba(128,140,150,0.25);
  vertical-align: middle; }
.sarl-path .n { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
.sarl-path tr.cut td { font-weight: 600; }
.sarl-path tr.cut td:first-child { box-shadow: inset 3px 0 0 MARKER; padding-left: 0.5rem; }
.sarl-path .bar { width: 26%; min-width: 64px; }
@media (max-width: 640px) { .sarl-path .s { display: none; } }
.sarl-mix { display: flex; height: 12px; border-radius: 3px; overflow: hidden; width: 100%; }
.sarl-mix span { display: block; height: 100%; }
.sarl-key { display: flex; flex-wrap: wrap; gap: 0.2rem 0.9rem; font-size: 0.82rem;
  margin-bottom: 0.4rem; }
.sarl-key i { display: inline-block; width: 11px; height: 11px; border-radius: 2px;
  margin-right: 0.35rem; vertical-align: -1px; }
</style>""".replace("MARKER", MARKER_COLOUR)


def label_key(dimension: LabelledDimension) -> str:
    """Which colour is which label.

    Args:
        dimension: The labels.

    Returns:
        HTML without script.
    """
    parts = "".join(
        f'<span><i style="background:{label_colour(label)}"></i>'
        f"{escape(label_text(label, dimension))}</span>"
        for label in range(dimension.n_labels)
    )
    return f'{_STYLE}<div class="sarl-key">{parts}</div>'


def path_table(
    steps: Sequence[PathStep], dimension: LabelledDimension, *, leaf: bool = False
) -> str:
    """The way from the root to a rule, node by node.

    Args:
        steps: The root first.
        dimension: The labels.
        leaf: Whether the path ends because the tree does, and not because it was cut.

    Returns:
        HTML without script; every name escaped.
    """
    rows = []
    for step in steps:
        query = escape(step.query) if step.query else "all states"
        end = "a leaf" if leaf else "cut here"
        note = f" – {end}: this is the rule" if step.is_cut else ""
        rows.append(
            f'<tr class="{"cut" if step.is_cut else ""}"><td>{query}{note}</td>'
            f'<td class="n">{step.samples:,}</td><td class="n s">{share_text(step.support)}</td>'
            f'<td class="n">{share_text(step.confidence) if step.samples else "–"}</td>'
            f'<td class="bar">{label_mix(step.shares, dimension)}</td></tr>'
        )
    head = "".join(
        f"<th{css}>{name}</th>"
        for name, css in (
            ("Condition", ""),
            ("States", ' class="n"'),
            ("Support", ' class="n s"'),
            ("Confidence", ' class="n"'),
            ("What the expert did", ""),
        )
    )
    return (
        f'{label_key(dimension)}<div style="overflow-x:auto"><table class="sarl-path">'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )
