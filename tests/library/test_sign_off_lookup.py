"""Who approved rules is known of the rules as they stand, and looking it up makes no library."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from sarl_core import RuleSet
from sarl_core.errors import SarlError
from sarl_core.explaining.words.sign_off import SignOff
from sarl_core.library import Library
from sarl_core.library.contents import add_rules, rules_sign_off, sign_off_at_hand
from sarl_core.library.database import is_there
from sarl_core.library.place import LibraryPlace
from sarl_core.mining.rule_set import rules_digest

RULES = Path(__file__).parents[2] / "data" / "rules"


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    return RuleSet.load(RULES / "cartpole_combined.json")


def test_an_approval_is_of_the_rules_as_they_stand(library: Library, rules: RuleSet) -> None:
    assert rules_sign_off(library, rules_digest(rules)) == SignOff()
    item = add_rules(library, rules, "two rules", author="Ada")
    assert rules_sign_off(library, rules_digest(rules)) == SignOff(is_known=True)
    approved = library.approve(item.id, author="Eve", note="seen")
    assert rules_sign_off(library, rules_digest(rules)) == SignOff(
        approved.approvals, is_known=True
    )
    first, *others = rules.rules
    changed = replace(rules, rules=(replace(first, enabled=False), *others))
    assert rules_sign_off(library, rules_digest(changed)) == SignOff()
    version = add_rules(library, changed, "one rule", author="Ada", parent=item.id)
    assert rules_sign_off(library, rules_digest(changed)).approvals == version.approvals == ()
    library.remove(item.id, author="Ada")
    assert rules_sign_off(library, rules_digest(rules)) == SignOff()


def test_rules_that_several_keep_are_approved_once_for_all(
    library: Library, rules: RuleSet
) -> None:
    for author in ("Ada", "Bob"):
        item = add_rules(library, rules, "rules", author=author)
        library.approve(item.id, author="Eve", note=f"of {author}")
    library.approve(item.id, author="Ada")
    said = [
        (one.author, one.note) for one in rules_sign_off(library, rules_digest(rules)).approvals
    ]
    assert said == [("Eve", "of Bob"), ("Ada", "")]


def test_all_who_approve_at_once_stand(place: LibraryPlace, rules: RuleSet) -> None:
    names = [f"person {number}" for number in range(12)]
    with Library(place) as library:
        item = add_rules(library, rules, "rules", author="Ada")

        def approve(name: str) -> None:
            with Library(place) as own:
                own.approve(item.id, author=name, note=f"seen by {name}")

        with ThreadPoolExecutor(6) as people:
            list(people.map(approve, names))
        approvals = rules_sign_off(library, rules_digest(rules)).approvals
    assert sorted(one.author for one in approvals) == sorted(names)
    assert all(one.note == f"seen by {one.author}" for one in approvals)


def test_looking_makes_no_library(place: LibraryPlace, opened: Callable[..., Library]) -> None:
    assert not is_there(place)
    assert not is_there(place)
    assert not place.database_file.exists()
    opened()
    assert is_there(place)


def test_where_there_is_no_library_nobody_has_approved(
    rules: RuleSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path / "library"))
    assert sign_off_at_hand(rules) == SignOff()
    assert not (tmp_path / "library").exists()
    with Library() as library:
        item = add_rules(library, rules, "rules", author="Ada")
        library.approve(item.id, author="Eve")
    assert [one.author for one in sign_off_at_hand(rules).approvals] == ["Eve"]


@pytest.mark.parametrize(
    "address",
    ["postgresql://127.0.0.1:1/none", "mysql://host/database", "postgresql://host:port/x"],
)
def test_a_library_that_cannot_be_reached_is_an_error_of_ours(
    rules: RuleSet, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SARL_LIBRARY", address)
    with pytest.raises(SarlError):
        sign_off_at_hand(rules)
