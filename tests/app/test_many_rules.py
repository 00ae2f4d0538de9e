"""Very many rules: only what is looked at is written, and files are made once and held packed."""

from __future__ import annotations

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import RuleSet, load_demonstrations, mine_rules
from sarl_core.explaining.exports.export import export_content
from sarl_core.mining.language import conditions_text
from sarl_dashboard.components.lists import rule_search
from sarl_dashboard.memory_cache import BoundedCache, size_of
from sarl_dashboard.views.edit import table as edit_table
from sarl_dashboard.views.export.files import LINES, LONGEST, MOST_SIGNS, ExportedFile
from tests.app.screens import ROUTER, open_page

DATA = ROUTER.parents[1] / "data"
UNFILTERED = {"data": "lunar_lander", "support": "0", "confidence": "1"}


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    demonstrations = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet")
    return mine_rules(demonstrations, supp_min=0.0, conf_min=1.0)


def rows(app: AppTest) -> list[str]:
    """The names of the rules in the table."""
    tables = [one.value for one in app.dataframe]
    return next(one for one in tables if "Decides" in one)["Rule"].tolist()


def test_edit_writes_a_page_of_rules_and_no_other(
    rules: RuleSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[str] = []

    def write(rule, rule_set):
        written.append(rule.id)
        return conditions_text(rule, rule_set)

    monkeypatch.setattr(edit_table, "PAGE_ROWS", 100)
    monkeypatch.setattr(edit_table, "conditions_text", write)
    app = open_page("edit", **UNFILTERED)
    first = rows(app)
    largest = np.argsort([-rule.samples for rule in rules], kind="stable")
    assert first == [rules.name_of(rules[place]) for place in largest[:100]]
    assert len(written) == len(set(written)) == 100
    app.session_state["edit_page"] = 3
    app.run()
    assert rows(app) == [rules.name_of(rules[place]) for place in largest[200:300]]
    assert len(written) == len(set(written)) == 200
    # An edit writes what has come in anew, and that alone.
    app.session_state["edit_page"] = 1
    app.button(key="edit_switch").click().run()
    assert rows(app) == first
    assert len(written) <= 201


def test_a_search_on_edit_finds_rules_of_every_page(
    rules: RuleSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(edit_table, "PAGE_ROWS", 100)
    longest = [rule for rule in rules if len(rules.name_of(rule)) == 5]
    name = rules.name_of(min(longest, key=lambda rule: rule.samples))
    app = open_page("edit", search=name.lower(), **UNFILTERED)
    assert rows(app) == [name]


def test_a_search_looks_at_words_and_names(rules: RuleSet) -> None:
    texts = [f"{conditions_text(rule, rules)} {rules.name_of(rule)}".lower() for rule in rules]
    for word in ("angle", "≤", "r12", "0.1"):
        have = rule_search.have_word(rules, word) | rule_search.names_have_word(rules, word)
        does = [word in rules.actions[0].label_names[rule.action] for rule in rules]
        assert have.tolist() == [
            word in text or says for text, says in zip(texts, does, strict=True)
        ]


@pytest.mark.parametrize("suffix", [".json", ".csv", ".md", ".py", ".c"])
def test_a_file_is_unpacked_as_it_was_written(rules: RuleSet, suffix: str) -> None:
    content = export_content(rules, suffix)
    file = ExportedFile.of(content, text=True)
    lines = content.decode().split("\n")[:-1]
    assert file.file.content() == content
    assert (file.file.size, file.lines) == (len(content), len(lines))
    assert len(file.file.packed) < len(content) / 2
    shown = file.beginning.split("\n")
    assert len(shown) == LINES
    assert len(file.beginning) <= MOST_SIGNS + 3 * LINES
    assert file.cut == any(len(line) > LONGEST for line in shown)
    for line, whole in zip(shown, lines, strict=False):
        assert whole.startswith(line.removesuffix(" …"))


def test_a_short_file_and_one_that_is_no_text() -> None:
    file = ExportedFile.of(b"one\ntwo", text=True)
    assert (file.lines, file.beginning, file.cut) == (2, "one\ntwo", False)
    file = ExportedFile.of(bytes(range(256)), text=False)
    assert (file.lines, file.file.content()) == (0, bytes(range(256)))


def test_a_rule_set_that_several_results_hold_counts_once(rules: RuleSet) -> None:
    size = size_of(rules)
    assert size > 2**20
    cache: BoundedCache[object] = BoundedCache(None, 2 * size)
    for name in "abcd":
        cache.put(name, (rules, name))
    assert all(name in cache for name in "abcd")
    assert cache.size < 1.1 * size
    for name in "abcd":
        cache.put(name, name)
    assert cache.size < 10_000
