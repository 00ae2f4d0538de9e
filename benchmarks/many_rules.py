"""A hundred thousand rules: what a page of them, a search and each file take after the first time.

Beside the browser, so that it is the product's own part; what the first time takes stands behind.
"""

from __future__ import annotations

import logging
import statistics
from collections.abc import Callable, Iterable

import numpy as np

from benchmarks.measure import Row, duration, seconds
from sarl_core import Demonstrations, RuleSet, mine_rules

STEPS, FEATURES = 350_000, 24  # about 101,000 leaves, twenty queries deep
REACH = 1.0  # seconds


def rules() -> RuleSet:
    """Every leaf of a tree over labels that follow from the states and much noise."""
    rng = np.random.default_rng(0)
    states = rng.normal(size=(STEPS, FEATURES)).astype(np.float32)
    score = np.stack(
        [
            states[:, 0] + states[:, 1],
            states[:, 2] - states[:, 3],
            states[:, 4] * states[:, 5],
            states[:, 6] + 0.5 * states[:, 7],
        ],
        axis=1,
    )
    labels = (score + rng.normal(scale=2.2, size=score.shape)).argmax(axis=1)
    episodes = np.arange(STEPS) // 250
    return mine_rules(Demonstrations(states, labels, episodes), supp_min=0.0, conf_min=1.0)


def many_rules(quick: bool) -> Iterable[Row]:
    """A page of the table, a search, and every file that Export offers but ONNX."""
    from streamlit.logger import set_log_level

    from sarl_dashboard.components.lists.rule_search import have_word
    from sarl_dashboard.views.export.files import file_of
    from sarl_dashboard.views.export.settings import FORMATS
    from sarl_dashboard.views.rules.listing import listed_rules, table_of

    set_log_level(logging.ERROR)  # it misses a page to say things on
    rule_set = rules()
    count, words = f"{len(rule_set):,} rules", iter(range(FEATURES))

    def page() -> None:
        places = listed_rules(rule_set).places
        first = int(next(words)) * 2_000
        table_of(rule_set, places[first : first + 2_000].tobytes())

    def search() -> None:
        have_word(rule_set, f"feature {next(words)}")

    def file(suffix: str) -> Callable[[], object]:
        return lambda: file_of(rule_set, suffix, "centre", None).file.content()

    kinds: list[tuple[str, Callable[[], object]]] = [("another page", page), ("a search", search)]
    kinds += [
        (f"the {name} file", file(form.suffix))
        for name, form in FORMATS.items()
        if form.suffix != ".onnx"
    ]
    for what, work in kinds:
        before = seconds(work)
        times = [seconds(work) for _ in range(2 if quick else 5)]
        yield Row(
            f"{count}: {what}",
            "-",
            "seconds",
            statistics.median(times),
            REACH,
            f"the first time {duration(before)}, digest included where it is the first of all",
        )
