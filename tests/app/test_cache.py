"""What pages keep: bounded in bytes, and what a visitor brought goes with the visitor."""

from __future__ import annotations

import pickle
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations, PolicyTree, RuleSet, grow_policy_trees, mine_rules
from sarl_core.mining.editing.edits import Add, Pin, Switch
from sarl_core.mining.rules import FILTERED, UNFILTERED, Thresholds
from sarl_dashboard.cache import cached, key_of
from sarl_dashboard.memory_cache import BoundedCache, size_of
from sarl_dashboard.state.mined import grown_trees
from tests.app.screens import open_page
from tests.app.test_demonstrations_page import upload
from tests.bad_inputs import ROWS, csv_bytes

MEGABYTE = 2**20


def megabytes(count: float) -> np.ndarray:
    return np.zeros(int(count * MEGABYTE), dtype=np.uint8)


@dataclass(frozen=True)
class Pair:
    left: np.ndarray
    right: object


@pytest.mark.parametrize(
    ("value", "size"),
    [
        (megabytes(3), 3),
        (Pair(megabytes(2), {"more": [megabytes(1)]}), 3),
        ([megabytes(0.01) for _ in range(1_000)], 10),
        (pd.DataFrame({"x": np.zeros(MEGABYTE // 8), "y": np.zeros(MEGABYTE // 8)}), 2),
        ("x" * MEGABYTE, 1),
        (tuple(float(i) for i in range(MEGABYTE // 40)), 1),
        (megabytes(5)[:10], 5),  # a part keeps the whole
    ],
)
def test_sizes_are_about_right(value: object, size: float) -> None:
    assert size_of(value) == pytest.approx(size * MEGABYTE, rel=0.1)


def test_what_is_in_a_thing_twice_is_counted_once() -> None:
    whole = megabytes(1)
    assert size_of([whole, whole, (whole,)]) == pytest.approx(MEGABYTE, rel=0.01)


def test_what_another_process_sent_is_counted_once() -> None:
    sent = [megabytes(4), megabytes(4)]
    for protocol in (2, 4, pickle.HIGHEST_PROTOCOL):
        came = pickle.loads(pickle.dumps(sent, protocol=protocol))
        assert size_of(came) == pytest.approx(size_of(sent), rel=0.01)
        assert size_of([came, came[0][1:]]) == pytest.approx(size_of(sent), rel=0.01)


def test_what_many_share_is_counted_about_once() -> None:
    shared = [(float(number),) * 40 for number in range(100)]
    alone = tuple(shared)
    together = [tuple(shared) for _ in range(1_000)]
    lists = sum(sys.getsizeof(one) for one in together)
    assert size_of(alone) * 10 < lists < size_of(together) < 2 * lists


def test_what_was_not_used_for_longest_goes_first() -> None:
    kept = BoundedCache(None, 3 * MEGABYTE)
    for name in "abc":
        kept.put(name, megabytes(0.9))
    kept.get("a")
    kept.put("d", megabytes(0.9))
    assert [name in kept for name in "abcd"] == [True, False, True, True]
    kept.put("e", megabytes(5))  # larger than there is room for: alone
    assert (len(kept), kept.size > kept.most_bytes) == (1, True)
    kept.put("f", megabytes(0.1))
    assert [name in kept for name in "ef"] == [False, True]
    assert kept.size < MEGABYTE


def test_a_function_works_once_for_all_who_ask_at_once() -> None:
    made = []
    begun, go_on = threading.Event(), threading.Event()

    @cached()
    def slow(number: int) -> np.ndarray:
        made.append(number)
        begun.set()
        assert go_on.wait(30)
        return megabytes(0.001)

    found: list[object] = []
    threads = [threading.Thread(target=lambda: found.append(slow(1))) for _ in range(4)]
    for thread in threads:
        thread.start()
    assert begun.wait(30)
    go_on.set()
    for thread in threads:
        thread.join()
    assert made == [1]
    assert all(one is found[0] for one in found)


def test_what_fails_is_not_kept_and_none_is() -> None:
    calls = []

    @cached()
    def odd(number: int) -> None:
        calls.append(number)
        if len(calls) == 1:
            raise ValueError("once")

    with pytest.raises(ValueError, match="once"):
        odd(1)
    assert odd(1) is None
    assert odd(number=1) is None
    assert calls == [1, 1]


# --- by what results are found again -----------------------------------------------------------


@dataclass(frozen=True)
class Settings:
    thresholds: Thresholds
    parts: tuple[Demonstrations, ...]
    content: bytes = b"policy"


def a_recording() -> Demonstrations:
    """The same content at every call, in other objects."""
    rng = np.random.default_rng(3)
    states = rng.normal(size=(60, 2)).astype(np.float32)
    return Demonstrations(states, (states[:, 0] > 0).astype(np.int64), np.arange(60) // 20)


def rules_of(demonstrations: Demonstrations) -> RuleSet:
    return mine_rules(demonstrations, supp_min=0.0, conf_min=0.9)


def switched_off(rules: RuleSet) -> RuleSet:
    return replace(rules, rules=(replace(rules[0], enabled=False), *rules[1:]))


NAMED = replace(a_recording(), feature_units=("m", ""))
OTHER_ACTION = replace(a_recording(), actions=np.ones(60, dtype=np.int64))
CHANGES: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
    "a unit": (a_recording, lambda: NAMED),
    "an action": (a_recording, lambda: OTHER_ACTION),
    "an episode left out": (a_recording, lambda: a_recording().select([0, 1])),
    "a rule switched off": (
        lambda: rules_of(a_recording()),
        lambda: switched_off(rules_of(a_recording())),
    ),
    "a tree under another unit": (
        lambda: grow_policy_trees(a_recording()),
        lambda: grow_policy_trees(NAMED),
    ),
    "a threshold": (
        lambda: Settings(FILTERED, (a_recording(),)),
        lambda: Settings(UNFILTERED, (a_recording(),)),
    ),
    "deep inside": (
        lambda: Settings(FILTERED, (a_recording(), a_recording())),
        lambda: Settings(FILTERED, (a_recording(), OTHER_ACTION)),
    ),
    "bytes": (
        lambda: Settings(FILTERED, (), b"\0" * 9),
        lambda: Settings(FILTERED, (), b"\0" * 8 + b"1"),
    ),
    "an edit": (lambda: (Switch("0.1", True),), lambda: (Switch("0.1", False),)),
    "another kind of edit": (lambda: Pin(rules_of(NAMED)[0]), lambda: Add(rules_of(NAMED)[0])),
    "a number that is no truth": (lambda: True, lambda: 1),
}


@pytest.mark.parametrize("change", CHANGES)
def test_equal_content_is_found_again_and_changed_content_is_not(change: str) -> None:
    before, after = CHANGES[change]

    @cached()
    def work(_: object) -> object:
        return object()

    assert work(before()) is work(before())
    assert work(after()) is work(after())
    assert work(after()) is not work(before())


def test_one_changed_value_among_a_million_is_seen() -> None:
    states = np.zeros((500_000, 2), dtype=np.float32)
    actions = np.arange(500_000) % 2
    one = Demonstrations(states.copy(), actions, np.zeros(500_000, dtype=np.int64))
    states[250_001, 1] = 1
    other = Demonstrations(states, actions, np.zeros(500_000, dtype=np.int64))
    assert key_of(one) != key_of(other)


@pytest.mark.parametrize(
    "value",
    [megabytes(0.001), [1], {"a": 1}, Pair(megabytes(0.001), 1), (1, (2, object())), print],
)
def test_what_has_no_hash_function_is_refused_at_once(value: object) -> None:
    calls = []

    @cached()
    def work(value: object) -> None:
        calls.append(value)

    with pytest.raises(TypeError, match=r"cannot be part of a key; pass what it was made from"):
        work(value)
    assert not calls


def test_a_function_may_have_a_hash_function_of_its_own() -> None:
    @cached(hash_funcs={np.ndarray: np.ndarray.tobytes, Demonstrations: lambda _: ""})
    def shape(values: np.ndarray, _: Demonstrations) -> tuple[int, ...]:
        return values.shape

    assert shape(np.zeros(3), NAMED) is shape(np.zeros(3), OTHER_ACTION)
    assert shape(np.zeros(4), NAMED) == (4,)


def test_other_names_grow_no_other_tree() -> None:
    with_names = replace(a_recording(), feature_names=("speed", "height"))
    (first,), (second,) = grown_trees(a_recording(), 2), grown_trees(with_names, 2)
    assert [feature.name for feature in second.source.features] == ["speed", "height"]
    assert [feature.name for feature in first.source.features] == ["feature 0", "feature 1"]
    assert first.threshold is second.threshold  # grown once
    assert first.source.digest != second.source.digest
    (other,) = grown_trees(OTHER_ACTION, 2)
    assert other.threshold is not first.threshold


def test_nothing_large_is_hashed_again_when_a_page_runs_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hashed: list[str] = []
    for kind in (Demonstrations, PolicyTree, RuleSet):
        for name in ("digest", "pairs_digest"):
            attribute = vars(kind).get(name)
            if attribute is None:
                continue

            def counting(self: object, work: Callable[[Any], str] = attribute.func) -> str:
                hashed.append(type(self).__name__)
                return work(self)

            again = cached_property(counting)
            again.__set_name__(kind, name)
            monkeypatch.setattr(kind, name, again)
    sys.modules["sarl_dashboard.cache"].RESULTS.clear()
    app = open_page("thresholds", data="cartpole", holdout="0.2")
    assert {"Demonstrations", "PolicyTree"} <= set(hashed)
    hashed.clear()
    app.select_slider(key="support").set_value(0.02).run()
    assert not hashed
    for page in ("rules", "edit", "what_if", "evidence", "export", "difference", "shield"):
        app.switch_page(f"{page}.py").run()
        hashed.clear()
        app.run()
        assert not app.exception
        assert not hashed, page


# --- what a visitor brought --------------------------------------------------------------------


def owners() -> set[str]:
    """Whose the entries are that the dashboard keeps."""
    entries = sys.modules["sarl_dashboard.cache"].RESULTS._entries.values()
    return {entry.owner for entry in entries}


def uploaded(content: bytes) -> tuple[AppTest, str]:
    app = upload(open_page("demonstrations"), ("mine.csv", content))
    assert not app.exception
    return app, app.session_state["_upload"].digest


def test_what_a_visitor_uploaded_goes_when_the_last_who_holds_it_has_gone() -> None:
    cache = sys.modules["sarl_dashboard.cache"]
    _app, digest = uploaded(csv_bytes(*ROWS))
    assert digest in owners()
    mine = cache.Visit()
    cache._VISITS.add(mine)
    mine.bring(digest)
    visits = [visit for visit in cache._VISITS if visit.upload == digest and visit is not mine]
    for visit in visits:
        cache._leave(visit)
    assert digest in owners()
    cache._leave(mine)
    assert digest not in owners()
    assert "" in owners() or not owners()
    cache._VISITS.update(visits)  # the test's session goes on


@pytest.mark.parametrize("way", ["the connection was lost", "the page was loaded anew"])
def test_who_comes_back_to_an_upload_holds_what_was_made_of_it(way: str) -> None:
    cache = sys.modules["sarl_dashboard.cache"]
    app, digest = uploaded(csv_bytes(*ROWS))
    for visit in cache._VISITS:  # as that of a new connection, or of a new session
        visit.upload = ""
    if way == "the connection was lost":
        app.run()
    else:
        open_page("rules", data=app.session_state["_upload_id"])
    assert digest in owners()
    (visit,) = (visit for visit in cache._VISITS if visit.upload == digest)
    gone = cache.Visit()
    gone.upload = digest
    cache._leave(gone)
    assert digest in owners()
    visit.bring("")
    assert digest not in owners()


def test_a_second_upload_takes_the_place_of_the_first() -> None:
    app, first = uploaded(csv_bytes("0,0,0.5,1.0,1", "0,1,0.25,1.0,0", "1,0,0.1,0.2,1"))
    assert first in owners()
    app = upload(app, ("other.csv", csv_bytes(*ROWS)))
    second = app.session_state["_upload"].digest
    assert second != first
    assert first not in owners()


def test_what_is_made_after_the_last_has_gone_is_not_kept() -> None:
    cache = sys.modules["sarl_dashboard.cache"]
    visit = cache.Visit()
    cache._VISITS.add(visit)
    visit.bring("a digest")
    cache.keep("early", megabytes(0.1), "a digest")
    assert "a digest" in owners()
    cache._leave(visit)
    cache.keep("late", megabytes(0.1), "a digest")
    assert "a digest" not in owners()
