"""The rules that a search, an action and a lower bound let through, and all of them as files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.explaining.exports.export import rules_to_csv
from sarl_core.explaining.words.evidence import remedy_text, shortfall_text
from sarl_core.mining.action_words import action_text, says_text
from sarl_core.mining.rule_set import RuleSet, rules_to_json
from sarl_core.mining.validation.holding_out import lower_bound, shortfall, with_lower_bound
from sarl_dashboard.cache import cached
from sarl_dashboard.components.downloads import PackedFile, download
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.lists.rule_search import have_word, names_have_word
from sarl_dashboard.components.settings import search_box
from sarl_dashboard.components.tables import frame
from sarl_dashboard.state.mined import episodes_tried_on
from sarl_dashboard.text import in_full
from sarl_dashboard.views.rules.in_force import InForce

if TYPE_CHECKING:
    import pyarrow as pa

EVERY = "every action"


Places = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Listed:
    """The R rules of a set, by their places in it, ready to be filtered and ordered.

    Attributes:
        places: The most support first, (R,).
        place: By id.
        does: What each says, as a place among `names`, (R,).
        names: What rules may say.
        lower: The lower bound of each, (R,).
        measures: What the table may be ordered by, (R,) each.
    """

    places: Places
    place: Mapping[str, int]
    does: Places
    names: tuple[str, ...]
    lower: NDArray[np.float64]
    measures: Mapping[str, NDArray[np.float64]]


@cached(show_spinner="Listing the rules …")
def listed_rules(rule_set: RuleSet) -> Listed:
    """What rules are found by; none of them is written in words for it."""
    rules = rule_set.rules
    names: dict[str, int] = {}
    if not all(rule.forbids for rule in rules):  # else no rule says to do any of them
        for dimension in rule_set.actions:
            for label in range(dimension.n_labels):
                names.setdefault(action_text(label, dimension), len(names))
    does = [
        names.setdefault(says_text(rule, rule_set.actions[rule.dimension]), len(names))
        for rule in rules
    ]
    samples = np.array([rule.samples for rule in rules], dtype=np.int64)
    return Listed(
        places=np.argsort(-samples, kind="stable"),
        place={rule.id: place for place, rule in enumerate(rules)},
        does=np.array(does, dtype=np.int64),
        names=tuple(names),
        lower=np.array(list(map(lower_bound, rules)), dtype=np.float64),
        measures={
            name: np.array([getattr(rule, name) for rule in rules], dtype=np.float64)
            for name in ("confidence", "lift", "length")
        },
    )


@cached()
def table_of(rule_set: RuleSet, places: bytes) -> pa.Table:
    """Some rules as an Arrow table, which takes no time to send.

    Args:
        rule_set: Of which they are.
        places: The bytes of their places in it.
    """
    import pyarrow as pa

    rules = [rule_set[place] for place in np.frombuffer(places, dtype=np.int64).tolist()]
    names = [f"{rule_set.name_of(rule)}{'' if rule.enabled else ', off'}" for rule in rules]
    table = frame(rules, rule_set, names)
    return pa.Table.from_pandas(table, preserve_index=False)


def matching(listed: Listed, in_force: InForce) -> Places:
    """Places of the rules that the search and the choice of action let through."""
    rule_set, compact = in_force.rule_set, in_force.compact
    with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
        words = search_box()
        action = st.selectbox(
            "Action",
            [EVERY, *listed.names],
            key="action",
            bind="query-params",
            width=220,
            label_visibility="collapsed",
        )
        tried = compact is None and any(rule.held_out is not None for rule in rule_set)
        least = lower_bound_choice() if tried else 0.0
        matches = listed.lower >= least
        sure = int(np.count_nonzero(matches))
        stem = f"rules-{in_force.demonstrations.env_id.replace('/', '-') or 'unnamed'}"
        if compact is not None and not in_force.edits:
            downloads(stem, len(compact.shipped), lambda: compact.shipped)
        else:
            downloads(stem, sure, lambda: with_lower_bound(rule_set, least) if least else rule_set)
    if sure < len(rule_set):
        why_left_out(rule_set, least)
    if action in listed.names:
        matches &= listed.does == listed.names.index(action)
    if words and matches.any():
        matches &= have_words(rule_set, words)
    return listed.places[matches[listed.places]]


def have_words(rule_set: RuleSet, words: tuple[str, ...]) -> NDArray[np.bool_]:
    """Whether each rule has all words of a search, (R,)."""
    have = np.ones(len(rule_set), dtype=np.bool_)
    for word in words:
        have &= have_word(rule_set, word) | names_have_word(rule_set, word)
    return have


_LARGE_SET = 10_000  # rules, of which a file may be as large as `downloads.LARGE`
_WRITERS: dict[str, tuple[str, Callable[[RuleSet], str]]] = {
    "json": ("JSON", rules_to_json),
    "csv": ("CSV", rules_to_csv),
    "txt": ("Text", RuleSet.to_text),
}


@cached()
def _file_of(rule_set: RuleSet, ending: str) -> PackedFile:
    return PackedFile.of(_WRITERS[ending][1](rule_set))


def downloads(stem: str, count: int, make_set: Callable[[], RuleSet]) -> None:
    """The whole rule set as files, made when asked for."""
    for ending, (kind, _) in _WRITERS.items():
        download(
            kind,
            partial(lambda ending: _file_of(make_set(), ending).content(), ending),
            f"{stem}.{ending}",
            key=f"download_{ending}",
            meaning=f"All {count:,} rules" if count != 1 else "The one rule",
            large=count > _LARGE_SET,
        )


def lower_bound_choice() -> float:
    """The least lower bound of a rule; 0 for any."""
    least = st.number_input(
        "Lower bound at least",
        0.0,
        1.0,
        0.0,
        0.05,
        key="lower",
        bind="query-params",
        width=150,
        help=with_words(
            "Only rules whose 95 % interval of confidence, over the held-out episodes, lies at or "
            "above this. The downloads hold these rules. 0: all."
        ),
    )
    return float(least or 0.0)


def why_left_out(rule_set: RuleSet, least: float) -> None:
    """Why rules do not reach the lower bound, and where none does, what to do."""
    held_out, all_of_them = episodes_tried_on()
    missing = shortfall(rule_set.rules, least, held_out)
    remedy = remedy_text(missing, all_of_them)
    st.caption(f"{shortfall_text(missing)}." + (f" {in_full(remedy)}" if remedy else ""))
